//! Closed surfaces from rings of points.

use std::f32::consts::TAU;

use nalgebra::{Point3, Vector3};

/// A closed, outward-facing surface.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    pub vertices: Vec<Point3<f32>>,
    pub faces: Vec<Face>,
}

/// A triangle of a [`Solid`], and where on the loft it lies.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    pub vertices: [u32; 3],
    /// The gap between points of a ring that it fills.
    pub column: usize,
}

impl Solid {
    pub fn corners(&self, face: &Face) -> [Point3<f32>; 3] {
        face.vertices.map(|vertex| self.vertices[vertex as usize])
    }
}

/// Joins equally long closed rings into a tube and closes both ends with a fan.
///
/// Seen from the first ring towards the last, each ring runs clockwise.
pub fn loft(rings: &[Vec<Point3<f32>>]) -> Solid {
    let (Some(first), Some(last)) = (rings.first(), rings.last()) else { return Solid::default() };
    let n_columns = first.len();
    let mut solid = Solid { vertices: rings.concat(), faces: Vec::new() };

    let vertex = |ring: usize, column: usize| (ring * n_columns + column % n_columns) as u32;
    for ring in 0..rings.len() - 1 {
        for column in 0..n_columns {
            let [a, b] = [vertex(ring, column), vertex(ring, column + 1)];
            let [c, d] = [vertex(ring + 1, column + 1), vertex(ring + 1, column)];
            solid.faces.push(Face { vertices: [a, b, c], column });
            solid.faces.push(Face { vertices: [a, c, d], column });
        }
    }

    let n_rings = rings.len();
    let first_center = solid.vertices.len() as u32;
    solid.vertices.extend([centroid(first), centroid(last)]);
    for column in 0..n_columns {
        let [a, b] = [vertex(0, column), vertex(0, column + 1)];
        solid.faces.push(Face { vertices: [b, a, first_center], column });
        let [a, b] = [vertex(n_rings - 1, column), vertex(n_rings - 1, column + 1)];
        solid.faces.push(Face { vertices: [a, b, first_center + 1], column });
    }
    solid
}

/// A box with rounded edges, or an ellipsoid: `|x|ᵏ + |y|ᵏ + |z|ᵏ = 1` with k = 2/`squareness`,
/// stretched to `half_size`. Squareness 1 is an ellipsoid, towards 0 a box.
pub fn superellipsoid(center: Point3<f32>, half_size: Vector3<f32>, squareness: f32) -> Solid {
    const N_RINGS: usize = 8;
    const N_COLUMNS: usize = 16;
    let power = |x: f32| x.signum() * x.abs().powf(squareness);
    let rings: Vec<_> = (0..N_RINGS)
        .map(|ring| {
            // Half a step off the poles, which the fans close.
            let latitude = (ring as f32 + 0.5) / N_RINGS as f32 * TAU / 2.0;
            let circle = (0..N_COLUMNS).map(|column| column as f32 / N_COLUMNS as f32 * TAU);
            circle
                .map(|longitude| {
                    let radius = power(latitude.sin());
                    let direction = Vector3::new(
                        -radius * power(longitude.sin()),
                        radius * power(longitude.cos()),
                        -power(latitude.cos()),
                    );
                    center + half_size.component_mul(&direction)
                })
                .collect()
        })
        .collect();
    loft(&rings)
}

/// Turns a profile of `[radius, x]` about the x axis; it runs from the −x side to the +x side.
pub fn lathe(profile: &[[f32; 2]], n_columns: usize) -> Solid {
    let circle = |[radius, x]: [f32; 2]| -> Vec<_> {
        (0..n_columns)
            .map(|column| {
                let (sine, cosine) = (column as f32 / n_columns as f32 * TAU).sin_cos();
                Point3::new(x, radius * cosine, radius * sine)
            })
            .collect()
    };
    loft(&profile.iter().map(|&point| circle(point)).collect::<Vec<_>>())
}

fn centroid(points: &[Point3<f32>]) -> Point3<f32> {
    let sum: Vector3<f32> = points.iter().map(|point| point.coords).sum();
    Point3::from(sum / points.len() as f32)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Every edge has one triangle on either side, which run along it in opposite directions.
    #[track_caller]
    pub fn check_closed(solid: &Solid) {
        let mut balance = HashMap::new();
        for face in &solid.faces {
            let [a, b, c] = face.vertices;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *balance.entry((from, to)).or_insert(0) += 1;
            }
        }
        for (&(from, to), &n) in &balance {
            assert_eq!((n, balance.get(&(to, from))), (1, Some(&1)), "edge {from}–{to}");
        }
    }

    /// By the divergence theorem: positive where the faces look outwards.
    pub fn signed_volume(solid: &Solid) -> f32 {
        let faces = solid.faces.iter().map(|face| solid.corners(face));
        faces.map(|[a, b, c]| a.coords.cross(&b.coords).dot(&c.coords) / 6.0).sum()
    }

    #[test]
    fn a_superellipsoid_is_closed_and_has_its_volume() {
        let half_size = Vector3::new(1.0, 2.0, 3.0);
        let ball = superellipsoid(Point3::new(4.0, 5.0, 6.0), half_size, 1.0);
        check_closed(&ball);
        let exact = 4.0 / 3.0 * std::f32::consts::PI * 6.0;
        let volume = signed_volume(&ball);
        assert!(volume > 0.85 * exact && volume < exact, "{volume} of {exact}");
    }

    #[test]
    fn a_lathe_is_closed_and_has_its_volume() {
        let cylinder = lathe(&[[2.0, -0.5], [2.0, 0.5]], 64);
        check_closed(&cylinder);
        assert!((signed_volume(&cylinder) / (4.0 * std::f32::consts::PI) - 1.0).abs() < 0.01);
    }
}
