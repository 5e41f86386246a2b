//! The objective's residuals to first order, as the normal equations that Levenberg–Marquardt solves.
//!
//! The unknowns are small steps [δω_0, δt_0 | δs | δf | δω_1, δt_1 | …]: rotations step on the left,
//! R_0 ← exp(δω_0) R_0 and ΔR_l ← exp(δω_l) ΔR_l, and Δp_l acts about the object. Frames meet only
//! through p_0, s and f, the log of the focal length where that is refined, so each contributes one dense block and the matrix is an arrow.

use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use super::{
    color_slope::color_and_slope,
    correspondences::Correspondences,
    normal_equations::NormalEquations,
    objective::{ObjectiveConfig, Reduction},
    observations::Observations,
    rows::Rows,
    shape_jacobian::ShapeJacobian,
};
use crate::camera::{Intrinsics, NEAR};

/// Where the objective is linearised.
pub struct Linearisation<'a> {
    pub observations: &'a Observations,
    pub config: &'a ObjectiveConfig,
    pub intrinsics: Intrinsics,
    /// Whether the focal length is an unknown.
    pub refines_focal: bool,
    /// Level of blur.
    pub level: usize,
    pub matches: &'a Correspondences,
    /// `camera_from_world` of every frame.
    pub poses: &'a [Isometry3<f64>],
    pub shape: &'a ShapeJacobian,
    /// Points and pairs of one frame that are used at most, evenly spread.
    pub max_residuals: usize,
}

impl Linearisation<'_> {
    /// Adds up all frames. The style prior is the caller's.
    pub fn normal_equations(&self) -> NormalEquations {
        let blocks: Vec<_> =
            (0..self.poses.len()).into_par_iter().map(|frame| self.rows(frame).squared()).collect();
        let n_shared = 6 + self.shape.n_directions() + usize::from(self.refines_focal);
        NormalEquations::from_frames(n_shared, &blocks)
    }

    fn rows(&self, frame: usize) -> Rows<'_> {
        let mut rows = Rows::new(self, frame);
        if frame > 0 {
            self.photometric_rows(frame, &mut rows);
        }
        self.silhouette_rows(frame, &mut rows);
        rows
    }

    /// I_0(u_0) − I_l(u_l), exposed alike, of every point that may be compared, reweighted by
    /// Charbonnier's loss.
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
        let exposure = self.matches.exposures[frame - 1];
        let mut by_exposure = Vec::new();
        for &j in used.iter().step_by(stride) {
            let point = seen[j] as usize;
            let [at, there] = [0, frame].map(|f| self.matches.pixels[f][point]);
            let (color, slope) = color_and_slope(&images[0], at);
            let (target, target_slope) = color_and_slope(&images[frame], there);
            let residual = exposure.residual(&[color, target]);
            let squared: f64 = residual.iter().map(|r| r * r).sum();
            let robust = match f64::from(self.config.robust_scale) {
                scale if scale > 0.0 => (1.0 + squared / (scale * scale)).sqrt().recip(),
                _ => 1.0,
            };
            let weight = (share * robust).sqrt();
            let placed = rows.place(point);
            for c in 0..3 {
                let in_reference = self.by_camera_point(&placed.in_reference, slope[c]);
                let in_frame = self.by_camera_point(&placed.in_frame, target_slope[c]);
                let by_points = [in_reference, -in_frame * exposure.gain];
                rows.push(&placed, by_points, residual[c], weight);
                by_exposure.push([-target[c] * weight, -weight]);
            }
        }
        if self.config.solve_exposure {
            let by_gain = by_exposure.iter().map(|[by_gain, _]| *by_gain);
            let by_bias = by_exposure.iter().map(|[_, by_bias]| *by_bias);
            if exposure.gain_is_free() {
                rows.eliminate(&[by_bias.collect(), by_gain.collect()]);
            } else {
                rows.eliminate(&[by_bias.collect()]);
            }
        }
    }

    /// What each pair's distance exceeds its tolerance by.
    fn silhouette_rows(&self, frame: usize, rows: &mut Rows) {
        let Some((_, pairs)) = self.matches.pairs.iter().find(|(f, _)| *f == frame) else { return };
        let stride = pairs.len().div_ceil(2 * self.max_residuals).max(1);
        let share = stride as f64 * f64::from(self.config.silhouette_weight)
            / self.matches.pairs.len() as f64;
        let loss = self.config.silhouette_loss();
        for pair in pairs.iter().step_by(stride) {
            let at = self.matches.pixels[frame][pair.point_idx as usize];
            let offset = pair.target.offset(at).map(f64::from);
            let distance = offset[0].hypot(offset[1]);
            let excess = distance - f64::from(pair.tolerance);
            let robust = loss.weight(excess * excess);
            let weight = (share * f64::from(pair.weight) * robust).sqrt();
            let placed = rows.place(pair.point_idx as usize);
            let direction = offset.map(|offset| offset / distance.max(1e-9));
            let slope = self.by_camera_point(&placed.in_frame, direction);
            let by_points = match frame {
                0 => [slope, Vector3::zeros()],
                _ => [Vector3::zeros(), slope],
            };
            rows.push(&placed, by_points, excess, weight);
        }
    }

    /// Of a derivative by the pixel, the one by the point in the camera: ∂π/∂x (Eq. 1), transposed.
    fn by_camera_point(&self, in_camera: &Vector3<f64>, by_pixel: [f64; 2]) -> Vector3<f64> {
        let focal = self.intrinsics.focal;
        let inverse_depth = in_camera.z.max(f64::from(NEAR)).recip();
        let [u, v] = [0, 1].map(|axis| by_pixel[axis] * f64::from(focal[axis]) * inverse_depth);
        Vector3::new(u, v, -(u * in_camera.x + v * in_camera.y) * inverse_depth)
    }
}
