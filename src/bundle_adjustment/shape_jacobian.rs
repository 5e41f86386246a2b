//! ∂X/∂s, which hides in the network, by differences of decoded neighbours.

use burn::tensor::{Tensor, TensorData};

use super::{objective::Objective, unknowns::Unknowns};
use crate::host::host_points;

/// Step of the style for the differences, in standard deviations.
const STEP: f32 = 0.05;
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
        // The style itself, then a row for each direction.
        let mut rows = style.repeat(1 + n_directions);
        (0..n_directions).for_each(|i| rows[(1 + i) * style.len() + i] += STEP);
        let rows = TensorData::new(rows, [1 + n_directions, style.len()]);
        let device = objective.device.clone().inner();
        let clouds = host_points(&objective.shape.points(Tensor::from_data(rows, &device)));
        let (points, moved) = clouds.split_at(clouds.len() / (1 + n_directions));
        let slope = |point: usize, direction: usize| {
            let there = moved[direction * points.len() + point];
            std::array::from_fn(|i| (there[i] - points[point][i]) / STEP)
        };
        let of_point = |point| (0..n_directions).map(move |direction| slope(point, direction));
        self.derivatives = (0..points.len()).flat_map(of_point).collect();
        (self.style, self.n_directions) = (style, n_directions);
    }
}
