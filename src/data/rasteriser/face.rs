//! A triangle as one camera sees it, in homogeneous coordinates (Olano and Greer, 1997).
//!
//! The ray of pixel (x, y) meets the triangle at depth z where z (x, y, 1) = Σ λ_i K p_i. Each λ_i / z
//! is then linear in the pixel, and so is 1/z: nothing is divided by depth before the sample is
//! taken, so nothing needs clipping, not even a triangle that reaches behind the camera.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix2, Matrix2x3, Matrix3, Point3, RowVector3, Vector2, Vector3};

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

    pub fn project(&self, point_in_world: &Point3<f32>) -> Vertex {
        let homogeneous = self.rotation * point_in_world.coords + self.translation;
        let scale = 2.0 / homogeneous.z;
        // Sample i lies at pixel (i + ½) / 2. Float-to-integer casts saturate.
        let samples_before = |pixel: f32, side: usize| ((pixel + 0.5) as u32).min(2 * side as u32);
        let [width, height] = self.size;
        Vertex {
            homogeneous,
            samples_before: [
                samples_before(homogeneous.x * scale, width),
                samples_before(homogeneous.y * scale, height),
            ],
        }
    }

    /// The columns and rows of pixels in which a triangle may cover samples, if any: those in the
    /// box of its corners, or all if it reaches behind the camera, where the box means nothing.
    pub fn pixel_bounds(&self, corners: [&Vertex; 3]) -> Option<[Range<usize>; 2]> {
        let in_front = |corner: &&Vertex| corner.homogeneous.z > NEAR;
        if !corners.iter().all(in_front) {
            return corners.iter().any(in_front).then(|| self.size.map(|side| 0..side));
        }
        let [a, b, c] = corners.map(|corner| corner.samples_before);
        let samples = |axis: usize| {
            let (a, b, c) = (a[axis], b[axis], c[axis]);
            a.min(b).min(c)..a.max(b).max(c)
        };
        let [across, down] = [samples(0), samples(1)];
        let pixels =
            |samples: Range<u32>| samples.start as usize / 2..(samples.end as usize).div_ceil(2);
        (!across.is_empty() && !down.is_empty()).then(|| [pixels(across), pixels(down)])
    }
}

/// A triangle's plane and edges, as functions of the pixel (x, y, 1).
pub struct Face {
    /// Which of the renderer's surfaces it is.
    pub surface_idx: u32,
    /// λ_i / z up to one positive factor, so that neighbours agree exactly on their common edge.
    weights: [Vector3<f32>; 3],
    inverse_depth: Vector3<f32>,
}

/// A face's weights and 1/z along a row of pixels, at x: `slopes[i] * x + starts[i][sample]`.
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
    pub fn row(&self, y: usize) -> Row {
        let [a, b, c] = self.weights;
        let functions = [a, b, c, self.inverse_depth];
        let start = |f: Vector3<f32>| OFFSETS[1].map(|offset| f.y * (y as f32 + offset) + f.z);
        Row { slopes: functions.map(|f| f.x), starts: functions.map(start) }
    }

    pub fn depth_at(&self, pixel: &Vector3<f32>) -> f32 {
        1.0 / self.inverse_depth.dot(pixel)
    }

    /// Perspective-correct texture coordinates at a pixel (x, y, 1), from those of the corners in
    /// columns, and their derivatives along the image's x and y.
    pub fn uv_at(
        &self,
        pixel: &Vector3<f32>,
        corner_uvs: &Matrix2x3<f32>,
    ) -> (Vector2<f32>, Matrix2<f32>) {
        // (u, v) = Σ w uv / Σ w. Numerator and denominator are linear in the pixel.
        let weights = Matrix3::from_rows(&self.weights.map(|weight| weight.transpose()));
        let numerator = corner_uvs * weights;
        let denominator: RowVector3<f32> = weights.row_sum();
        let scale = 1.0 / (denominator * pixel).x;
        let uv = numerator * pixel * scale;
        // The quotient rule: (n / d)' = (n' − uv d') / d.
        let slopes = numerator.fixed_columns::<2>(0) - uv * denominator.fixed_columns::<2>(0);
        (uv, slopes * scale)
    }
}
