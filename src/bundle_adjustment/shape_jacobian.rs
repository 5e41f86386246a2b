//! ∂X/∂s on the host, taken again only where the style has moved on.

use burn::tensor::{Tensor, TensorData};

use super::{objective::Objective, unknowns::Unknowns};
use crate::host::host_points;

/// How far any direction may be from where the derivatives were taken, in standard deviations.
const TOLERANCE: f32 = 0.2;

/// The derivatives of every point by the leading style directions, at a style nearby.
#[derive(Default)]
pub struct ShapeJacobian {
    /// Where they were taken.
    style: Vec<f32>,
    n_directions: usize,
    /// The directions of one point, then those of the next.
    derivatives: Vec<[f32; 3]>,
}

impl ShapeJacobian {
    pub fn n_directions(&self) -> usize {
        self.n_directions
    }

    /// ∂X_i/∂s, in world units a standard deviation: one vector a direction.
    pub fn of_point(&self, point_idx: usize) -> &[[f32; 3]] {
        &self.derivatives[point_idx * self.n_directions..][..self.n_directions]
    }

    /// Takes the derivatives again where the style has moved on.
    pub fn refresh(&mut self, objective: &Objective, unknowns: &Unknowns, n_directions: usize) {
        let style: Vec<f32> = unknowns.values[unknowns.style()].iter().map(|&s| s as f32).collect();
        let moved = style.iter().zip(&self.style).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        if n_directions == self.n_directions && moved <= TOLERANCE {
            return;
        }
        let row = TensorData::new(style.clone(), [1, style.len()]);
        let row = Tensor::from_data(row, &objective.device.clone().inner());
        let slopes = host_points(&objective.shape.derivatives(row, n_directions));
        let n_points = slopes.len() / n_directions;
        let of_point = |point| (0..n_directions).map(move |i| i * n_points + point);
        self.derivatives = (0..n_points).flat_map(of_point).map(|i| slopes[i]).collect();
        (self.style, self.n_directions) = (style, n_directions);
    }
}
