//! Point clouds from meshes: the ground truth that a prior learns from (Sec. 3.1).

use nalgebra::Point3;
use rand::{Rng, distr::weighted::WeightedIndex};

use super::mesh::Mesh;

/// Points a cloud: the paper's N.
pub const N_POINTS: usize = 24_576;

/// Draws `n_points` uniformly by area from the surface, in the mesh's frame.
///
/// A mesh without area has no surface to draw from, and gives no points.
pub fn sample_surface(mesh: &Mesh, n_points: usize, rng: &mut impl Rng) -> Vec<Point3<f32>> {
    // In f64: the cumulative sum must still tell small triangles from rounding.
    let areas = mesh.triangles.iter().map(|triangle| f64::from(mesh.area_vector(triangle).norm()));
    let Ok(by_area) = WeightedIndex::new(areas) else { return Vec::new() };
    (0..n_points)
        .map(|_| {
            let corners = mesh.corners(&mesh.triangles[rng.sample(&by_area)]);
            point_in_triangle(corners, rng.random(), rng.random())
        })
        .collect()
}

/// Maps the unit square onto a triangle, uniformly: the square's far half is folded back.
fn point_in_triangle([a, b, c]: [Point3<f32>; 3], u: f32, v: f32) -> Point3<f32> {
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    a + (b - a) * u + (c - a) * v
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{keyed_rng, mesh::Triangle};

    /// Triangles side by side in the plane z = 0, each 1 high and `widths[i]` wide.
    fn strip(widths: &[f32]) -> Mesh {
        let mut mesh = Mesh::default();
        let mut x = 0.0;
        for &width in widths {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend([[x, 0., 0.], [x + width, 0., 0.], [x, 1., 0.]].map(Point3::from));
            mesh.triangles.push(Triangle {
                vertices: [first, first + 1, first + 2],
                uvs: [[0.0; 2]; 3],
                color: [0.5; 3],
                texture: None,
            });
            x += width;
        }
        mesh
    }

    /// χ² of the counts against the expected ones.
    fn chi_squared(counts: &[f32], expected: &[f32]) -> f32 {
        counts.iter().zip(expected).map(|(n, e)| (n - e).powi(2) / e).sum()
    }

    #[test]
    fn triangles_receive_points_by_their_area() {
        let widths = [1.0, 2.0, 3.0, 4.0];
        let points = sample_surface(&strip(&widths), 10_000, &mut keyed_rng(1, [0, 0]));
        let mut counts = [0.0; 4];
        for point in &points {
            counts[[1.0, 3.0, 6.0].iter().filter(|&&end| point.x >= end).count()] += 1.0;
        }
        // The 99.9 % quantile of χ² with 3 degrees of freedom.
        assert!(chi_squared(&counts, &widths.map(|w| w * 1000.0)) < 16.27, "{counts:?}");
    }

    #[test]
    fn points_fill_a_triangle_evenly() {
        let points = sample_surface(&strip(&[1.0]), 8_000, &mut keyed_rng(2, [0, 0]));
        // Halving every edge cuts a triangle into four equal ones.
        let mut counts = [0.0; 4];
        for point in &points {
            assert!(point.x >= 0.0 && point.y >= 0.0 && point.x + point.y <= 1.0 + 1e-6);
            let quarter = match (point.x > 0.5, point.y > 0.5, point.x + point.y < 0.5) {
                (true, ..) => 0,
                (_, true, _) => 1,
                (.., true) => 2,
                _ => 3,
            };
            counts[quarter] += 1.0;
        }
        assert!(chi_squared(&counts, &[2000.0; 4]) < 16.27, "{counts:?}");
    }

    #[test]
    fn a_triangle_without_area_receives_nothing() {
        let points = sample_surface(&strip(&[1.0, 0.0, 1.0]), 5_000, &mut keyed_rng(3, [0, 0]));
        assert_eq!(points.len(), 5_000);
        // Triangle 1 is the segment x = 1; triangle 0 meets that line in one point only.
        assert!(points.iter().all(|point| point.x != 1.0 || point.y < 1e-3));
    }

    #[test]
    fn a_mesh_without_area_gives_no_points() {
        let mut rng = keyed_rng(4, [0, 0]);
        assert!(sample_surface(&Mesh::default(), 10, &mut rng).is_empty());
        assert!(sample_surface(&strip(&[0.0]), 10, &mut rng).is_empty());
    }

    #[test]
    fn the_same_stream_draws_the_same_points() {
        let draw = || sample_surface(&strip(&[1.0, 2.0]), 100, &mut keyed_rng(5, [1, 2]));
        assert_eq!(draw(), draw());
    }
}
