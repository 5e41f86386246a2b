//! A triangle as one camera sees it, in homogeneous coordinates (Olano and Greer, 1997).
//!
//! The ray of pixel (x, y) meets the triangle at depth z where z (x, y, 1) = Σ λ_i K p_i. Each λ_i / z
//! is then linear in the pixel, and so is 1/z: nothing is divided by depth before the sample is
//! taken, so nothing needs clipping, not even a triangle that reaches behind the camera.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Vector2, Vector3};

use super::z_buffer::{N, OFFSETS};
use crate::camera::Intrinsics;

/// Nearest depth that is drawn, in world units.
pub const NEAR: f32 = 1e-3;

/// p ↦ K (R p + t), and the pixels around where that lies.
pub struct Projector {
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
    size: [usize; 2],
}

/// A vertex as one camera sees it.
pub struct Vertex {
    /// K p = z (x, y, 1), where (x, y) is its pixel.
    homogeneous: Vector3<f32>,
    /// How many columns and rows of samples lie before it. Only means something before the camera.
    samples_before: [u32; 2],
}

/// The pixels in which a triangle may be seen.
pub struct Bounds {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

impl Projector {
    pub fn new(
        camera_from_world: &Isometry3<f32>,
        Intrinsics { focal, center }: &Intrinsics,
        size: [usize; 2],
    ) -> Self {
        let pixel_from_camera =
            Matrix3::new(focal[0], 0.0, center[0], 0.0, focal[1], center[1], 0.0, 0.0, 1.0);
        Self {
            rotation: pixel_from_camera * camera_from_world.rotation.to_rotation_matrix().matrix(),
            translation: pixel_from_camera * camera_from_world.translation.vector,
            size,
        }
    }

    #[inline]
    pub fn project(&self, point_in_world: &Point3<f32>) -> Vertex {
        let homogeneous = self.rotation * point_in_world.coords + self.translation;
        let scale = 2.0 / homogeneous.z;
        // Sample i lies at pixel (i + ½) / 2. Float-to-integer casts saturate.
        let samples_before = |axis: usize| {
            let index = homogeneous[axis] * scale + 0.5;
            (index as u32).min(2 * self.size[axis] as u32)
        };
        let samples_before = [samples_before(0), samples_before(1)];
        Vertex { homogeneous, samples_before }
    }

    /// None if no sample lies in the box of a triangle's corners. One that reaches behind the
    /// camera has no such box, and may be anywhere.
    pub fn bounds(&self, corners: [&Vertex; 3]) -> Option<Bounds> {
        let in_front = |corner: &&Vertex| corner.homogeneous.z > NEAR;
        if !corners.iter().all(in_front) {
            let [columns, rows] = self.size.map(|side| 0..side);
            return corners.iter().any(in_front).then_some(Bounds { columns, rows });
        }
        let [a, b, c] = corners;
        let samples = |axis: usize| {
            let [a, b, c] = [a, b, c].map(|corner| corner.samples_before[axis]);
            a.min(b).min(c)..a.max(b).max(c)
        };
        let [across, down] = [samples(0), samples(1)];
        if across.is_empty() || down.is_empty() {
            return None;
        }
        let pixels =
            |samples: Range<u32>| samples.start as usize / 2..(samples.end as usize).div_ceil(2);
        Some(Bounds { columns: pixels(across), rows: pixels(down) })
    }
}

/// A triangle's edges and plane, as functions of the pixel (x, y, 1).
pub struct Face {
    /// Which of the renderer's surfaces it is.
    pub surface_idx: u32,
    /// The λ_i / z up to one positive factor, so that neighbours agree exactly on their common edge.
    weights: [Vector3<f32>; 3],
    inverse_depth: Vector3<f32>,
}

/// Weights and 1/z along a row of pixels. At x, they are `slopes[i] * x + starts[i][sample]`.
pub struct Row {
    pub slopes: [f32; 4],
    pub starts: [[f32; N]; 4],
}

impl Face {
    /// None if the face is seen edge-on, or is not finite.
    pub fn new(corners: [&Vertex; 3], surface_idx: u32) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| corner.homogeneous);
        let plane = (b - a).cross(&(c - a));
        let determinant = plane.dot(&a);
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let sign = determinant.signum();
        Some(Self {
            surface_idx,
            weights: [b.cross(&c) * sign, c.cross(&a) * sign, a.cross(&b) * sign],
            inverse_depth: plane * determinant.recip(),
        })
    }

    /// The row of pixels whose upper side is at `y`.
    #[inline(always)]
    pub fn row(&self, y: f32) -> Row {
        let [a, b, c] = &self.weights;
        let mut row = Row { slopes: [0.0; 4], starts: [[0.0; N]; 4] };
        for (i, function) in [a, b, c, &self.inverse_depth].into_iter().enumerate() {
            row.slopes[i] = function.x;
            for (start, offset) in row.starts[i].iter_mut().zip(OFFSETS[1]) {
                *start = function.y * (y + offset) + function.z;
            }
        }
        row
    }

    pub fn depth_at(&self, pixel: &Vector3<f32>) -> f32 {
        1.0 / self.inverse_depth.dot(pixel)
    }

    /// Perspective-correct texture coordinates at a pixel (x, y, 1), from those of the corners, and
    /// their derivatives along the image's x and y as columns.
    pub fn uv_at(
        &self,
        pixel: &Vector3<f32>,
        corner_uvs: &[[f32; 2]; 3],
    ) -> (Vector2<f32>, Matrix2<f32>) {
        let [a, b, c] = &self.weights;
        let weights = [a.dot(pixel), b.dot(pixel), c.dot(pixel)];
        let scale = 1.0 / (weights[0] + weights[1] + weights[2]);
        let [uv_a, uv_b, uv_c] = corner_uvs.map(Vector2::from);
        let uv = (uv_a * weights[0] + uv_b * weights[1] + uv_c * weights[2]) * scale;
        // uv Σ w = Σ w_i uv_i. Both sides by the product rule: uv' Σ w = Σ w_i' (uv_i − uv).
        let [uv_a, uv_b, uv_c] = [uv_a - uv, uv_b - uv, uv_c - uv];
        let along_x = (uv_a * a.x + uv_b * b.x + uv_c * c.x) * scale;
        let along_y = (uv_a * a.y + uv_b * b.y + uv_c * c.y) * scale;
        (uv, Matrix2::from_columns(&[along_x, along_y]))
    }
}
