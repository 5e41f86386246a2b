//! The objective's residuals to first order, as the normal equations that Levenberg–Marquardt solves.
//!
//! The unknowns are small steps [δω_0, δt_0 | δs | δω_1, δt_1 | …]: rotations step on the left,
//! R_0 ← exp(δω_0) R_0 and ΔR_l ← exp(δω_l) ΔR_l, and Δp_l acts about the object. Frames meet only
//! through p_0 and s, so each contributes one dense block and the matrix is an arrow.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix2x3, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::{
    correspondences::Correspondences,
    objective::{ObjectiveConfig, Reduction},
    observations::Observations,
};
use crate::data::ColorImage;

/// H step = −g: a quadratic model of the objective around the current unknowns.
pub struct NormalEquations {
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

/// Where the objective is linearised.
pub struct Linearisation<'a> {
    pub observations: &'a Observations,
    pub config: &'a ObjectiveConfig,
    /// Level of blur.
    pub level: usize,
    pub matches: &'a Correspondences,
    /// `camera_from_world` of every frame.
    pub poses: &'a [Isometry3<f64>],
    pub points: &'a [[f32; 3]],
    /// ∂X/∂s: for each style direction, the derivative of every point.
    pub style_derivatives: &'a [Vec<[f32; 3]>],
    /// Points and pairs of one frame that are used at most, evenly spread.
    pub max_residuals: usize,
}

/// Rows of a weighted Jacobian and their residuals; columns are [p_0 | s | Δp_l].
#[derive(Default)]
struct Rows {
    jacobian: Vec<f64>,
    residuals: Vec<f64>,
}

impl Linearisation<'_> {
    /// Adds up all frames. The style prior is the caller's.
    pub fn normal_equations(&self) -> NormalEquations {
        let k = self.style_derivatives.len();
        let size = 6 + k + 6 * (self.poses.len() - 1);
        let blocks: Vec<_> = (0..self.poses.len())
            .into_par_iter()
            .map(|frame| {
                let rows = self.rows(frame);
                let residuals = DVector::from_vec(rows.residuals);
                // Rows of J one after the other are the columns of Jᵀ.
                let transposed = DMatrix::from_vec(12 + k, residuals.len(), rows.jacobian);
                (&transposed * transposed.transpose(), transposed * residuals)
            })
            .collect();

        let mut hessian = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        for (frame, (block, right)) in blocks.iter().enumerate() {
            // The reference frame has no Δp: its last six columns are empty.
            let used = if frame == 0 { 6 + k } else { 12 + k };
            let place =
                |column: usize| if column < 6 + k { column } else { column + 6 * (frame - 1) };
            for row in 0..used {
                gradient[place(row)] += right[row];
                for column in 0..used {
                    hessian[(place(row), place(column))] += block[(row, column)];
                }
            }
        }
        NormalEquations { hessian, gradient }
    }

    fn rows(&self, frame: usize) -> Rows {
        let mut rows = Rows::default();
        if frame > 0 {
            self.photometric_rows(frame, &mut rows);
        }
        self.silhouette_rows(frame, &mut rows);
        rows
    }

    /// I_0(u_0) − I_l(u_l) of every point that may be compared, reweighted by Charbonnier's loss.
    fn photometric_rows(&self, frame: usize, rows: &mut Rows) {
        let comparable = &self.matches.comparable[frame - 1];
        let seen = &self.matches.visible[0];
        let used: Vec<usize> = (0..seen.len()).filter(|&j| comparable[j] > 0.0).collect();
        let stride = used.len().div_ceil(self.max_residuals).max(1);
        let count = match self.config.reduction {
            Reduction::Sum => 1.0,
            Reduction::Mean => f64::from(self.matches.n_compared()),
        };
        let share = stride as f64 * f64::from(self.config.photometric_weight) / count;
        let images = &self.observations.host_images[self.level];
        for &j in used.iter().step_by(stride) {
            let point = seen[j] as usize;
            let [at, there] = [0, frame].map(|f| self.matches.pixels[f][point]);
            let (color, slope) = color_and_slope(&images[0], at);
            let (target, target_slope) = color_and_slope(&images[frame], there);
            let residual: [f64; 3] = std::array::from_fn(|c| color[c] - target[c]);
            let squared: f64 = residual.iter().map(|r| r * r).sum();
            let robust = match f64::from(self.config.robust_scale) {
                scale if scale > 0.0 => (1.0 + squared / (scale * scale)).sqrt().recip(),
                _ => 1.0,
            };
            let weight = (share * robust).sqrt();
            let reference = self.pixel_jacobian(0, point);
            let moved = self.pixel_jacobian(frame, point);
            for c in 0..3 {
                let columns = (0..reference[0].len()).map(|i| {
                    slope[c][0] * reference[0][i] + slope[c][1] * reference[1][i]
                        - target_slope[c][0] * moved[0][i]
                        - target_slope[c][1] * moved[1][i]
                });
                rows.push(columns, residual[c], weight);
            }
        }
    }

    /// What each pair's distance exceeds its tolerance by.
    fn silhouette_rows(&self, frame: usize, rows: &mut Rows) {
        let Some((_, pairs)) = self.matches.pairs.iter().find(|(f, _)| *f == frame) else { return };
        let stride = pairs.len().div_ceil(2 * self.max_residuals).max(1);
        let share = stride as f64 * f64::from(self.config.silhouette_weight)
            / self.matches.pairs.len() as f64;
        for idx in (0..pairs.len()).step_by(stride) {
            let pair = pairs[idx];
            let at = self.matches.pixels[frame][pair.point_idx as usize];
            let offset = [0, 1].map(|axis| f64::from(at[axis] - pair.target[axis]));
            let distance = offset[0].hypot(offset[1]);
            let excess = distance - f64::from(pair.tolerance);
            let weight = (share * f64::from(pair.weight)).sqrt();
            let [u, v] = self.pixel_jacobian(frame, pair.point_idx as usize);
            let columns =
                (0..u.len()).map(|i| (offset[0] * u[i] + offset[1] * v[i]) / distance.max(1e-9));
            rows.push(columns, excess, weight);
        }
    }

    /// ∂u/∂[p_0 | s | Δp_l] of one point in one frame: the rows of u and of v.
    fn pixel_jacobian(&self, frame: usize, point: usize) -> [Vec<f64>; 2] {
        let pose = &self.poses[frame];
        let world = Point3::from(self.points[point].map(f64::from));
        let turned = pose.rotation * world.coords;
        let in_camera = turned + pose.translation.vector;
        let projection = self.projection_jacobian(in_camera);
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        // ΔR_l exp(δω) R_0 X moves by −ΔR_l [R_0 X]× δω.
        let relative = rotation * self.poses[0].rotation.inverse().to_rotation_matrix().matrix();
        let of_reference_turn = relative * cross(&(self.poses[0].rotation * world.coords)) * -1.0;
        let of_turn = cross(&turned) * -1.0;

        let k = self.style_derivatives.len();
        let mut jacobian = [vec![0.0; 12 + k], vec![0.0; 12 + k]];
        let turn = projection * of_reference_turn;
        let own_turn = projection * of_turn;
        let onto_pixels = projection * rotation;
        for (axis, row) in jacobian.iter_mut().enumerate() {
            for i in 0..3 {
                row[i] = turn[(axis, i)];
                row[3 + i] = projection[(axis, i)];
                if frame > 0 {
                    row[6 + k + i] = own_turn[(axis, i)];
                    row[9 + k + i] = projection[(axis, i)];
                }
            }
            for (direction, derivatives) in self.style_derivatives.iter().enumerate() {
                let moved = derivatives[point];
                row[6 + direction] =
                    (0..3).map(|i| onto_pixels[(axis, i)] * f64::from(moved[i])).sum();
            }
        }
        jacobian
    }

    /// ∂π/∂x (Eq. 1).
    fn projection_jacobian(&self, in_camera: Vector3<f64>) -> Matrix2x3<f64> {
        let [fx, fy] = self.observations.intrinsics.focal.map(f64::from);
        let depth = in_camera.z.max(f64::from(crate::camera::NEAR));
        let (x, y) = (in_camera.x / depth, in_camera.y / depth);
        Matrix2x3::new(fx, 0.0, -fx * x, 0.0, fy, -fy * y) / depth
    }
}

impl Rows {
    fn push(&mut self, columns: impl Iterator<Item = f64>, residual: f64, weight: f64) {
        self.jacobian.extend(columns.map(|value| weight * value));
        self.residuals.push(weight * residual);
    }
}

/// [v]×, with [v]× w = v × w.
fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// The bilinear colour at a location and its derivative by [u, v], a row for each channel.
fn color_and_slope(image: &ColorImage, [u, v]: [f32; 2]) -> ([f64; 3], [[f64; 2]; 3]) {
    let axis = |location: f32, side: u32| {
        let last = side.saturating_sub(1) as f32;
        let at = (location - 0.5).clamp(0.0, last);
        let first = at.floor().min((last - 1.0).max(0.0));
        let inside = location - 0.5 > 0.0 && location - 0.5 < last;
        (first as u32, f64::from(at - first), if inside { 1.0 } else { 0.0 })
    };
    let (x, fx, inside_x) = axis(u, image.width());
    let (y, fy, inside_y) = axis(v, image.height());
    let (right, below) = ((x + 1).min(image.width() - 1), (y + 1).min(image.height() - 1));
    let [a, b, c, d] = [(x, y), (right, y), (x, below), (right, below)]
        .map(|(x, y)| image.get_pixel(x, y).0.map(f64::from));
    let color = std::array::from_fn(|i| {
        (1.0 - fy) * ((1.0 - fx) * a[i] + fx * b[i]) + fy * ((1.0 - fx) * c[i] + fx * d[i])
    });
    let slope = std::array::from_fn(|i| {
        let along_u = (1.0 - fy) * (b[i] - a[i]) + fy * (d[i] - c[i]);
        let along_v = (1.0 - fx) * (c[i] - a[i]) + fx * (d[i] - b[i]);
        [along_u * inside_x, along_v * inside_y]
    });
    (color, slope)
}
