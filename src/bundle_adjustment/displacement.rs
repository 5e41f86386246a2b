//! Beyond the prior's manifold: X = G(s) + Σ c_j φ_j, small and smooth displacements of what is seen.
//!
//! What the prior cannot represent, poses make up for. So once the style has converged, points may move
//! along the surface's normal, by a smooth field whose modes φ_j are as likely at
//! unit c_j as the whitened style's directions are: one weight holds both.

use std::ops::Range;

use burn::tensor::{Device, Tensor, TensorData};
use serde::{Deserialize, Serialize};

use super::{
    levenberg_marquardt::{self, LevenbergMarquardtConfig},
    objective::{Objective, ObjectiveConfig},
    progress::{Ending, Progress},
    shape_model::ShapeModel,
    smooth_field::SmoothField,
    unknowns::Unknowns,
};

/// Levels of blur, the sharpest, at which a displacement is solved for: sharp pictures alone tell it only
/// within a pixel.
const N_LEVELS: usize = 2;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DisplacementConfig {
    /// Modes that are solved for; 0 keeps to the prior's manifold. Levenberg–Marquardt alone has them.
    pub n_modes: usize,
    /// σ, the field's standard deviation, in world units.
    pub deviation: f32,
    /// ℓ, the distance over which it is correlated, in world units.
    pub length: f32,
}

impl Default for DisplacementConfig {
    fn default() -> Self {
        Self { n_modes: 0, deviation: 0.01, length: 0.12 }
    }
}

/// The modes of a displacement, which the style's leading directions make room for.
#[derive(Clone, Debug)]
pub struct Displacement {
    /// φ, a row for each mode: `[m, 3n]`, in world units a standard deviation.
    modes: Tensor<2>,
    /// Directions of the style before the coefficients, and all of them.
    n_leading: usize,
    n_style: usize,
}

impl Displacement {
    /// Around a cloud of n points, of which those `seen` may move, and others near them follow.
    fn around(
        points: &[[f32; 3]],
        seen: &[u32],
        config: &DisplacementConfig,
        [n_leading, n_style]: [usize; 2],
        device: &Device,
    ) -> Self {
        let field = SmoothField::new(points, seen, config.deviation, config.length);
        let modes = field.modes(config.n_modes);
        let data = TensorData::new(modes.concat(), [modes.len(), 3 * points.len()]);
        Self { modes: Tensor::from_data(data, device), n_leading, n_style }
    }

    fn n_modes(&self) -> usize {
        self.modes.dims()[0]
    }

    /// The objective of the longer vector: the style's weight is of a mean, and each direction keeps its own.
    pub(super) fn objective(&self, config: &ObjectiveConfig) -> ObjectiveConfig {
        let longer = (self.n_style + self.n_modes()) as f32 / self.n_style.max(1) as f32;
        ObjectiveConfig { style_weight: longer * config.style_weight, ..config.clone() }
    }

    /// Leading entries of the vector that are solved for.
    pub(super) fn n_solved(&self) -> usize {
        self.n_leading + self.n_modes()
    }
}

/// G(s), or G(s) + Σ c_j φ_j where there is a displacement and the vector is as long as
/// [leading directions of s | c | the other directions].
pub struct Displaced<'a> {
    pub prior: &'a dyn ShapeModel,
    pub displacement: Option<&'a Displacement>,
}

impl<'a> Displaced<'a> {
    /// The displacement, if such a vector holds its coefficients.
    fn of(&self, vector: &Tensor<2>) -> Option<&'a Displacement> {
        let [_, length] = vector.dims();
        self.displacement.filter(|moved| length == moved.n_style + moved.n_modes())
    }
}

/// s of a vector that holds c, too.
fn style_of(vector: &Tensor<2>, moved: &Displacement) -> Tensor<2> {
    let others = moved.n_solved()..moved.n_solved() + moved.n_style - moved.n_leading;
    let parts = [0..moved.n_leading, others].into_iter().filter(|part| !part.is_empty());
    let part = |part: Range<usize>| vector.clone().narrow(1, part.start, part.len());
    Tensor::cat(parts.map(part).collect(), 1)
}

impl ShapeModel for Displaced<'_> {
    fn points(&self, style: Tensor<2>) -> Tensor<3> {
        let Some(moved) = self.of(&style) else { return self.prior.points(style) };
        let points = self.prior.points(style_of(&style, moved));
        let coefficients = style.narrow(1, moved.n_leading, moved.n_modes());
        points.clone() + coefficients.matmul(moved.modes.clone()).reshape(points.dims())
    }

    fn derivatives(&self, style: Tensor<2>, n_directions: usize) -> Tensor<3> {
        match self.of(&style) {
            Some(moved) if n_directions == moved.n_solved() => {
                let of_style = self.prior.derivatives(style_of(&style, moved), moved.n_leading);
                let modes = moved.modes.clone().reshape([moved.n_modes() as i64, -1, 3]);
                Tensor::cat(vec![of_style, modes], 0)
            }
            Some(_) => panic!("all leading directions are solved for, or none"),
            None => self.prior.derivatives(style, n_directions),
        }
    }
}

/// Solves for a displacement, too, from unknowns that have converged: they then hold its coefficients.
pub(super) fn leave_manifold(
    objective: &Objective,
    unknowns: &mut Unknowns,
    level: usize,
    (config, lm): (&DisplacementConfig, &LevenbergMarquardtConfig),
    progress: &mut Progress,
) -> (Displacement, Ending) {
    let (_, matches) = objective.value(unknowns, level);
    let mut seen = matches.visible.concat();
    seen.sort_unstable();
    seen.dedup();
    let style: Vec<f32> = unknowns.values[unknowns.style()].iter().map(|&s| s as f32).collect();
    let directions = [lm.n_directions.min(style.len()), style.len()];
    let device = objective.device.clone().inner();
    let moved = Displacement::around(&matches.points, &seen, config, directions, &device);

    let (leading, others) = style.split_at(moved.n_leading);
    let vector = [leading, &vec![0.0; moved.n_modes()], others].concat();
    let (leading, others) = unknowns.likely_style().split_at(moved.n_leading);
    let likely = [leading, &vec![0.0; moved.n_modes()], others].concat();
    *unknowns = unknowns.with_style(&vector).expecting(likely);
    let config = moved.objective(objective.config);
    let shape = Displaced { prior: objective.shape, displacement: Some(&moved) };
    let objective = Objective {
        shape: &shape,
        config: &config,
        device: objective.device.clone(),
        observations: objective.observations,
    };
    let lm = LevenbergMarquardtConfig { n_directions: moved.n_solved(), ..lm.clone() };
    let mut ending = None;
    for level in level.saturating_sub(N_LEVELS - 1)..=level {
        progress.blur = objective.observations.blurs[level];
        ending = Some(levenberg_marquardt::run(&objective, unknowns, level, &lm, progress));
    }
    progress.end_stage("beyond the manifold", unknowns);
    (moved, ending.expect("there is a level"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        data::{keyed_rng, procedural, surface::sample_surface},
        device::Backend,
        host::host_points,
        shape_prior,
    };

    const N_MODES: usize = 4;

    /// Two directions of six and four modes: what Levenberg–Marquardt takes for derivatives is how far
    /// points move.
    #[test]
    fn derivatives_are_of_the_style_and_of_the_coefficients() {
        let device = Backend::Flex.device();
        let tiny = shape_prior::tests::tiny();
        let cloud = sample_surface(&procedural::car(5), tiny.n_points(), &mut keyed_rng(5, [0, 0]));
        let cloud: Vec<[f32; 3]> = cloud.iter().map(|point| point.coords.into()).collect();
        device.seed(4);
        let generator = tiny.init(&cloud, &device).generator;
        let seen: Vec<u32> = (0..cloud.len() as u32).collect();
        let config = DisplacementConfig { n_modes: N_MODES, deviation: 0.05, length: 0.3 };
        let moved = Displacement::around(&cloud, &seen, &config, [2, generator.n_style()], &device);
        let shape = Displaced { prior: &generator, displacement: Some(&moved) };

        let vector = [0.3, -0.2, 0.5, 0.1, 0.0, -0.4, 0.7, 0.2, -0.6, 0.9];
        let points = |vector: &[f32]| {
            let row = TensorData::new(vector.to_vec(), [1, vector.len()]);
            host_points(&shape.points(Tensor::from_data(row, &device)))
        };
        let row = Tensor::from_data(TensorData::new(vector.to_vec(), [1, vector.len()]), &device);
        let derivatives = host_points(&shape.derivatives(row, 2 + N_MODES));
        for direction in 0..2 + N_MODES {
            let beside = |step: f32| {
                let mut vector = vector;
                vector[direction] += step;
                points(&vector)
            };
            let (ahead, behind) = (beside(0.05), beside(-0.05));
            let of_direction = &derivatives[direction * cloud.len()..][..cloud.len()];
            let scale = of_direction.iter().flatten().fold(0.0, |a: f32, b| a.max(b.abs()));
            assert!(scale > 1e-4, "direction {direction} moves nothing");
            for ((ahead, behind), slope) in ahead.iter().zip(&behind).zip(of_direction) {
                for axis in 0..3 {
                    let expected = (ahead[axis] - behind[axis]) / 0.1;
                    let error = (slope[axis] - expected).abs();
                    // Modes are linear; the network bends within a step.
                    let tolerance = if direction < 2 { 0.2 } else { 1e-3 };
                    assert!(error < tolerance * scale, "{direction}: {slope:?}, {expected}");
                }
            }
        }
        // Without coefficients, it is the prior.
        let style = [vector[0], vector[1], vector[6], vector[7], vector[8], vector[9]];
        let mut still = vector;
        still[2..6].fill(0.0);
        assert_eq!(points(&style), points(&still));
    }
}
