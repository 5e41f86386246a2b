//! A triangle as one camera sees it, in homogeneous coordinates (Olano and Greer, 1997).
//!
//! A pixel's ray d = K⁻¹ (x, y, 1) meets the triangle at z d = Σ λ_i p_i. Each λ_i / z is then linear
//! in the pixel, and so is 1/z: no division by depth before the sample is taken, and therefore no
//! clipping. A triangle that reaches behind the camera needs no special case.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use crate::{camera::Intrinsics, data::mesh::Triangle};

use super::SAMPLES;

/// Nearest depth that is drawn, in world units.
const NEAR: f32 = 1e-3;

pub struct Face<'a> {
    pub triangle: &'a Triangle,
    /// Unit normal in the camera frame, turned towards the camera: files wind as they like.
    pub normal: Vector3<f32>,
    /// The columns and rows of samples that it may cover.
    pub bounds: [Range<usize>; 2],
    /// λ_i / z up to one positive factor, so that neighbours agree exactly on their common edge.
    weights: [Linear; 3],
    inverse_depth: Linear,
}

impl<'a> Face<'a> {
    /// None where it covers no sample: out of view, edge-on, or with vertices that do not exist.
    pub fn new(
        triangle: &'a Triangle,
        vertices_in_camera: &[Point3<f32>],
        intrinsics: &Intrinsics,
        n_samples: [usize; 2],
    ) -> Option<Self> {
        let [a, b, c] = triangle.vertices.map(|idx| vertices_in_camera.get(idx as usize));
        let [a, b, c] = [a?.coords, b?.coords, c?.coords];
        let bounds = sample_bounds([a, b, c], intrinsics, n_samples)?;

        let across = (b - a).cross(&(c - a));
        let volume = across.dot(&a); // det [a b c], the signed distance of the plane times |across|
        if volume == 0.0 || !volume.is_finite() {
            return None;
        }
        let edges = [b.cross(&c), c.cross(&a), a.cross(&b)];
        Some(Self {
            triangle,
            normal: -volume.signum() * across.normalize(),
            bounds,
            weights: edges.map(|edge| Linear::of_ray(edge * volume.signum(), intrinsics)),
            inverse_depth: Linear::of_ray(across / volume, intrinsics),
        })
    }

    /// 1/z where the pixel's ray meets the face in front of the camera.
    pub fn inverse_depth_at(&self, pixel: [f32; 2]) -> Option<f32> {
        let inside = self.weights.iter().all(|weight| weight.at(pixel) >= 0.0);
        let inverse_depth = self.inverse_depth.at(pixel);
        (inside && inverse_depth > 0.0 && inverse_depth < 1.0 / NEAR).then_some(inverse_depth)
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
        let total: f32 = weights.iter().sum();
        let uv = weighted(weights).map(|sum| sum / total);

        // The quotient rule: (Σ w u / Σ w)' = (Σ w' u − uv Σ w') / Σ w.
        let uv_per_pixel = [0, 1].map(|axis| {
            let slopes = self.weights.map(|weight| weight.slope[axis]);
            let sum = weighted(slopes);
            [0, 1].map(|k| (sum[k] - uv[k] * slopes.iter().sum::<f32>()) / total)
        });
        (uv, uv_per_pixel)
    }
}

/// A function that is linear in the pixel's coordinates.
#[derive(Clone, Copy)]
struct Linear {
    slope: [f32; 2],
    offset: f32,
}

impl Linear {
    /// Pixel ↦ `normal · d`, where d is the pixel's ray with z = 1.
    fn of_ray(normal: Vector3<f32>, Intrinsics { focal, center }: &Intrinsics) -> Self {
        let slope = [normal.x / focal[0], normal.y / focal[1]];
        Self { slope, offset: normal.z - slope[0] * center[0] - slope[1] * center[1] }
    }

    fn at(self, [x, y]: [f32; 2]) -> f32 {
        self.slope[0] * x + (self.slope[1] * y + self.offset)
    }
}

/// The samples within the projected bounding box: none if it is empty, and all of them if the
/// triangle reaches behind the camera, where its projection has no bounds.
fn sample_bounds(
    corners: [Vector3<f32>; 3],
    Intrinsics { focal, center }: &Intrinsics,
    n_samples: [usize; 2],
) -> Option<[Range<usize>; 2]> {
    let n_behind = corners.iter().filter(|corner| corner.z <= NEAR).count();
    let bounds = match n_behind {
        3 => return None,
        0 => [0, 1].map(|axis| {
            let pixels = corners.map(|corner| corner[axis] / corner.z * focal[axis] + center[axis]);
            // Sample i lies at pixel (i + ½) / SAMPLES; float-to-integer casts saturate.
            let index = pixels.map(|pixel| pixel * SAMPLES as f32 - 0.5);
            let first = index.into_iter().fold(f32::INFINITY, f32::min).ceil() as usize;
            let last = index.into_iter().fold(f32::NEG_INFINITY, f32::max).floor();
            first..((last + 1.0) as usize).min(n_samples[axis])
        }),
        _ => n_samples.map(|n| 0..n),
    };
    bounds.iter().all(|range| !range.is_empty()).then_some(bounds)
}
