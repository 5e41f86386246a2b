use super::*;
use crate::data::keyed_rng;
use nalgebra::Rotation3;
use rand::Rng;

/// A tall L; its first corner does not see all of it.
pub const L_SHAPE: [[f32; 2]; 6] = [[2., 0.], [2., 1.], [1., 1.], [1., 3.], [0., 3.], [0., 0.]];

/// Five tips at distance 2, and as many notches at 0.7.
pub fn star() -> Vec<[f32; 2]> {
    let corner = |idx: usize| {
        let (sine, cosine) = (idx as f32 * std::f32::consts::PI / 5.0).sin_cos();
        let radius = if idx.is_multiple_of(2) { 2.0 } else { 0.7 };
        [radius * cosine, radius * sine]
    };
    (0..10).map(corner).collect()
}

/// A polygon of the plane, somewhere in space.
fn placed(polygon: &[[f32; 2]], axis: Vector3<f32>) -> Vec<Point3<f32>> {
    let turn = Rotation3::from_scaled_axis(axis);
    let place = |&[x, y]: &[f32; 2]| turn * Point3::new(x, y, 0.0) + Vector3::new(30., -20., 10.);
    polygon.iter().map(place).collect()
}

fn cut(corners: &[Point3<f32>]) -> Vec<[usize; 3]> {
    let indices: Vec<usize> = (0..corners.len()).collect();
    triangles(&indices, |idx| corners[idx]).collect()
}

pub fn shoelace(polygon: &[[f32; 2]]) -> f32 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f32>() / 2.0
}

/// Whether a ray from the point crosses the outline an odd number of times.
pub fn is_inside(polygon: &[[f32; 2]], [x, y]: [f32; 2]) -> bool {
    let next = polygon.iter().cycle().skip(1);
    let crosses = |(a, b): &(&[f32; 2], &[f32; 2])| {
        (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    };
    polygon.iter().zip(next).filter(crosses).count() % 2 == 1
}

/// The triangles lie inside the polygon, fill it and look the same way.
#[track_caller]
fn check_filled(polygon: &[[f32; 2]]) {
    for axis in [[0., 0., 0.], [3.1, 0., 0.], [0.4, 0.9, -0.2], [0., 1.6, 0.], [1.5, 0., 0.]] {
        let triangles = cut(&placed(polygon, axis.into()));
        assert_eq!(triangles.len(), polygon.len() - 2);
        let mut area = 0.0;
        for triangle in triangles {
            let corners = triangle.map(|corner| polygon[corner]);
            let signed = shoelace(&corners);
            assert!(signed * shoelace(polygon) >= 0.0, "{triangle:?} looks the other way");
            let centroid = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).sum::<f32>() / 3.0);
            assert!(is_inside(polygon, centroid), "{triangle:?} lies outside");
            area += signed;
        }
        assert!((area - shoelace(polygon)).abs() < 1e-5, "{area}");
    }
}

#[test]
fn concave_polygons_are_filled_from_whichever_corner() {
    for mut polygon in [L_SHAPE.to_vec(), star()] {
        for _ in 0..polygon.len() {
            check_filled(&polygon);
            polygon.rotate_left(1);
        }
        polygon.reverse();
        check_filled(&polygon);
    }
}

#[test]
fn what_the_first_corner_sees_becomes_a_fan() {
    let hexagon: Vec<_> = (0..6).map(|k| (k as f32).sin_cos()).map(|(y, x)| [x, y]).collect();
    let mut arrow = vec![[1., 1.], [3., 0.], [1., 3.], [0., 1.], [1., 1.2]];
    arrow.rotate_left(4); // Its notch sees everything.
    let collinear = vec![[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.]];
    for polygon in [hexagon, arrow, collinear] {
        let corners = placed(&polygon, Vector3::new(0.3, -0.8, 0.1));
        let indices: Vec<usize> = (0..polygon.len()).collect();
        assert_eq!(cut(&corners), fan(&indices).collect::<Vec<_>>());
    }
    // Of four corners that are in no plane as well.
    let bent = [[0., 0., 0.], [1., 0., 0.3], [1., 1., 0.], [0., 1., 0.3]].map(Point3::from);
    assert_eq!(cut(&bent), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn fewer_corners_than_three_are_no_triangle() {
    let corners = placed(&L_SHAPE, Vector3::zeros());
    assert!((0..3).all(|n| cut(&corners[..n]).is_empty()));
    assert_eq!(cut(&corners[..3]), [[0, 1, 2]]);
}

#[test]
fn a_bow_tie_keeps_some_surface() {
    for right in [1.0, 0.4] {
        let bow_tie = [[0., 0.], [1., 1.], [1., 1. - right], [0., 1.]];
        let corners = placed(&bow_tie, Vector3::new(0.2, 0.1, 0.));
        let area = |[a, b, c]: [usize; 3]| {
            (corners[b] - corners[a]).cross(&(corners[c] - corners[a])).norm() / 2.0
        };
        assert!(cut(&corners).into_iter().map(area).sum::<f32>() > 0.3);
    }
}

#[test]
fn no_polygon_is_lost_or_panics() {
    for seed in 0..2000 {
        let mut rng = keyed_rng(seed, [0, 0]);
        let n = rng.random_range(4..12);
        // On a coarse grid corners coincide and edges overlap.
        let mut coordinate = || rng.random_range(0..4) as f32;
        let corners: Vec<_> =
            (0..n).map(|_| Point3::new(coordinate(), coordinate(), coordinate())).collect();
        let area =
            |[a, b, c]: [usize; 3]| (corners[b] - corners[a]).cross(&(corners[c] - corners[a]));
        let normal: Vector3<f32> = (2..n).map(|idx| area([0, idx - 1, idx])).sum();
        let covered: Vector3<f32> = cut(&corners).into_iter().map(area).sum();
        assert!(covered.dot(&normal) >= 0.99 * normal.norm_squared(), "{corners:?}");
    }
    let huge: Vec<_> =
        (0..5).map(|k| Point3::from([[1e6, -1e6, 1e6], [1e-30; 3]][k % 2]) * (k as f32)).collect();
    cut(&huge);
}
