//! A triangle as one camera sees it, in homogeneous coordinates (Olano and Greer, 1997).
//!
//! The ray of pixel (x, y) meets the triangle at depth z where z (x, y, 1) = Σ λ_i K p_i. Each λ_i / z
//! is then linear in the pixel, and so is 1/z: nothing is divided by depth before the sample is
//! taken, so nothing needs clipping, not even a triangle that reaches behind the camera.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, Vector3};

use super::SAMPLES;
use crate::{camera::Intrinsics, data::mesh::Triangle};

/// Nearest depth that is drawn, in world units.
const NEAR: f32 = 1e-3;

/// A vertex as one camera sees it.
pub struct Vertex {
    /// K p = z (x, y, 1), where (x, y) is its pixel.
    homogeneous: Vector3<f32>,
    pixel: [f32; 2],
}

impl Vertex {
    pub fn new(
        point_in_world: &Point3<f32>,
        camera_from_world: &Isometry3<f32>,
        Intrinsics { focal, center }: &Intrinsics,
    ) -> Self {
        let point = camera_from_world * point_in_world;
        let homogeneous = Vector3::new(
            point.x * focal[0] + point.z * center[0],
            point.y * focal[1] + point.z * center[1],
            point.z,
        );
        Self { homogeneous, pixel: [homogeneous.x / point.z, homogeneous.y / point.z] }
    }
}

pub struct Face<'a> {
    pub triangle: &'a Triangle,
    /// λ_i / z up to one positive factor, so that neighbours agree exactly on their common edge.
    weights: [Linear; 3],
    inverse_depth: Linear,
}

impl<'a> Face<'a> {
    /// With the columns and rows of samples that it may cover. None if there are none, if the face
    /// is seen edge-on, or if its vertices do not exist.
    pub fn new(
        triangle: &'a Triangle,
        vertices: &[Vertex],
        n_samples: [u32; 2],
    ) -> Option<(Self, [Range<u32>; 2])> {
        let [a, b, c] = triangle.vertices.map(|idx| vertices.get(idx as usize));
        let corners = [a?, b?, c?];
        let bounds = sample_bounds(corners, n_samples)?;

        let [a, b, c] = corners.map(|corner| corner.homogeneous);
        let plane = (b - a).cross(&(c - a));
        let determinant = plane.dot(&a);
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let edges = [b.cross(&c), c.cross(&a), a.cross(&b)];
        let face = Self {
            triangle,
            weights: edges.map(|edge| Linear(edge * determinant.signum())),
            inverse_depth: Linear(plane * determinant.recip()),
        };
        Some((face, bounds))
    }

    /// 1/z where the pixel's ray meets the face in front of the camera.
    pub fn inverse_depth_at(&self, pixel: [f32; 2]) -> Option<f32> {
        let [a, b, c] = self.weights.map(|weight| weight.at(pixel));
        let inverse_depth = self.inverse_depth.at(pixel);
        // Without branches: they would be taken at random along every edge.
        let inside = (a >= 0.0) & (b >= 0.0) & (c >= 0.0);
        (inside & (inverse_depth > 0.0) & (inverse_depth < 1.0 / NEAR)).then_some(inverse_depth)
    }

    pub fn depth_at(&self, pixel: [f32; 2]) -> f32 {
        1.0 / self.inverse_depth.at(pixel)
    }

    /// Perspective-correct texture coordinates, and their derivatives along the image's x and y.
    pub fn uv_at(&self, pixel: [f32; 2]) -> ([f32; 2], [[f32; 2]; 2]) {
        let uvs = self.triangle.uvs;
        let weighted =
            |factors: [f32; 3]| [0, 1].map(|k| (0..3).map(|i| factors[i] * uvs[i][k]).sum::<f32>());
        let weights = self.weights.map(|weight| weight.at(pixel));
        let scale = 1.0 / weights.iter().sum::<f32>();
        let uv = weighted(weights).map(|sum| sum * scale);

        // The quotient rule: (Σ w u / Σ w)' = (Σ w' u − uv Σ w') / Σ w.
        let uv_per_pixel = [0, 1].map(|axis| {
            let slopes = self.weights.map(|Linear(coefficients)| coefficients[axis]);
            let [sum, total] = [weighted(slopes), [slopes.iter().sum(); 2]];
            [0, 1].map(|k| (sum[k] - uv[k] * total[k]) * scale)
        });
        (uv, uv_per_pixel)
    }
}

/// A function of the pixel: these coefficients times (x, y, 1).
#[derive(Clone, Copy)]
struct Linear(Vector3<f32>);

impl Linear {
    fn at(self, [x, y]: [f32; 2]) -> f32 {
        self.0.x * x + (self.0.y * y + self.0.z)
    }
}

/// The samples within the projected bounding box; all of them if the triangle reaches behind the
/// camera, where its projection has no bounds.
fn sample_bounds(corners: [&Vertex; 3], n_samples: [u32; 2]) -> Option<[Range<u32>; 2]> {
    let depths = corners.map(|corner| corner.homogeneous.z);
    if depths.iter().all(|depth| *depth > NEAR) {
        let [a, b, c] = corners.map(|corner| corner.pixel);
        let bounds = [0, 1].map(|axis| {
            // Sample i lies at pixel (i + ½) / SAMPLES. Float-to-integer casts saturate.
            let index = |pixel: f32| (pixel * SAMPLES as f32 + 0.5) as u32;
            let first = index(a[axis].min(b[axis]).min(c[axis]));
            let end = index(a[axis].max(b[axis]).max(c[axis]));
            first..end.min(n_samples[axis])
        });
        bounds.iter().all(|range| !range.is_empty()).then_some(bounds)
    } else if depths.iter().any(|depth| *depth > NEAR) {
        Some(n_samples.map(|n| 0..n))
    } else {
        None
    }
}
