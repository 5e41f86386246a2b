//! Levenberg–Marquardt over all poses and the leading style directions.
//!
//! The paper sets Gauss–Newton aside because ∂X/∂s hides in the network. A batch of decoded
//! neighbours gives it by differences: one row of the batch for each direction.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::{
    correspondences::Correspondences,
    linearisation::Linearisation,
    normal_equations::NormalEquations,
    objective::Objective,
    progress::{Ending, Progress, Status},
    shape_jacobian::ShapeJacobian,
    unknowns::Unknowns,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LevenbergMarquardtConfig {
    /// Iterations at each level of blur.
    pub iterations: usize,
    /// Leading directions of the whitened style that are solved for.
    pub n_directions: usize,
    /// Points of one frame that enter the Jacobian at most.
    pub max_residuals: usize,
    /// Iterations at the first level during which p_0 and the style wait for the Δp_l.
    pub relative_first: usize,
    /// Stops at a level when an iteration lowers the objective by less than this share of it.
    pub relative_tolerance: f64,
}

impl Default for LevenbergMarquardtConfig {
    fn default() -> Self {
        Self {
            iterations: 15,
            n_directions: 16,
            max_residuals: 4000,
            relative_first: 3,
            relative_tolerance: 1e-4,
        }
    }
}

/// Damping at the start, its limits, and how it changes after a failure and a success.
const DAMPING: f64 = 1e-2;
const DAMPING_LIMITS: [f64; 2] = [1e-6, 1e4];
const DAMPING_FACTORS: [f64; 2] = [6.0, 0.3];
/// Longest step of a rotation (radians), and of a style direction (standard deviations).
const MAX_TURN: f64 = 0.2;
const MAX_STYLE_STEP: f64 = 0.7;
/// Longest step of the log of the focal length.
const MAX_FOCAL_STEP: f64 = 0.1;

/// Runs at one level of blur. A step that does not lower the objective, or leads into a fault, is never
/// taken.
pub fn run(
    objective: &Objective,
    unknowns: &mut Unknowns,
    level: usize,
    config: &LevenbergMarquardtConfig,
    progress: &mut Progress,
) -> Ending {
    let mut damping = DAMPING;
    let (mut current, mut matches) = objective.value(unknowns, level);
    let mut shape = ShapeJacobian::default();
    let mut status = Status::BudgetSpent;
    for iteration in 0..config.iterations {
        progress.report("joint", &current, unknowns);
        if !current.objective.is_finite() {
            return Ending { status: Status::NotFinite, objective: current.objective };
        }
        let relative_only = level == 0 && iteration < config.relative_first;
        let n_directions = config.n_directions.min(unknowns.style().len());
        shape.refresh(objective, unknowns, n_directions);
        let model = normal_equations(objective, unknowns, level, &shape, &matches, config);
        let step = |damping| match relative_only {
            true => model.relative_step(damping),
            false => model.step(damping),
        };
        let mut refused = None;
        let better = |damping| {
            let step = limited(step(damping)?, n_directions, unknowns.focal().len());
            let next = unknowns.stepped(step.as_slice(), n_directions);
            let (value, matches) = objective.value(&next, level);
            if value.objective >= current.objective || value.objective.is_nan() {
                return None;
            }
            refused = current.refuses(&value).or(refused);
            current.refuses(&value).is_none().then_some((next, value, matches))
        };
        let Some((next, value, next_matches)) = damped_step(better, &mut damping) else {
            status = refused.unwrap_or(Status::Converged);
            break;
        };
        let gain = current.objective - value.objective;
        (*unknowns, current, matches) = (next, value, next_matches);
        if !relative_only && gain <= config.relative_tolerance * current.objective {
            status = Status::Converged;
            break;
        }
    }
    progress.report("joint", &current, unknowns);
    Ending { status: current.fault().unwrap_or(status), objective: current.objective }
}

/// Raises the damping until a step is `better`; `None` when none is.
fn damped_step<T>(mut better: impl FnMut(f64) -> Option<T>, damping: &mut f64) -> Option<T> {
    while *damping <= DAMPING_LIMITS[1] {
        if let Some(found) = better(*damping) {
            *damping = (*damping * DAMPING_FACTORS[1]).max(DAMPING_LIMITS[0]);
            return Some(found);
        }
        *damping *= DAMPING_FACTORS[0];
    }
    *damping = DAMPING;
    None
}

/// Shortens a step whose linear model can no longer be trusted.
fn limited(step: DVector<f64>, n_directions: usize, n_focal: usize) -> DVector<f64> {
    let style = 6..6 + n_directions;
    let focal = style.end..style.end + n_focal;
    let excess = step.iter().enumerate().map(|(i, value)| {
        if style.contains(&i) {
            return value.abs() / MAX_STYLE_STEP;
        }
        if focal.contains(&i) {
            return value.abs() / MAX_FOCAL_STEP;
        }
        let of_translation = (i - if i < 6 { 0 } else { focal.end }) % 6 >= 3;
        if of_translation { 0.0 } else { value.abs() / MAX_TURN }
    });
    let excess = excess.fold(1.0, f64::max);
    step / excess
}

/// The objective to second order around some unknowns, the style prior included.
pub(super) fn normal_equations(
    objective: &Objective,
    unknowns: &Unknowns,
    level: usize,
    shape: &ShapeJacobian,
    matches: &Correspondences,
    config: &LevenbergMarquardtConfig,
) -> NormalEquations {
    let linearisation = Linearisation {
        observations: objective.observations,
        config: objective.config,
        intrinsics: unknowns.intrinsics(&objective.observations.intrinsics),
        refines_focal: !unknowns.focal().is_empty(),
        level,
        matches,
        poses: &unknowns.host_poses(&objective.device),
        shape,
        max_residuals: config.max_residuals,
    };
    let mut model = linearisation.normal_equations();
    let style = unknowns.unlikely_style();
    model.add_style_prior(objective.config.style_weight, &style, shape.n_directions());
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bundle_adjustment::{
            objective::ObjectiveConfig, observations::Observations, unknowns::Parameterisation,
        },
        data::{
            keyed_rng, procedural,
            sequence::{Sequence, SequenceOptions},
            surface::sample_surface,
        },
        device::Backend,
        loss::SilhouetteNorm,
        shape_prior,
    };
    use burn::module::Module;

    /// Both see the same residuals; squares have twice the gradient that the equations hold.
    #[track_caller]
    fn check_normal_equations(config: ObjectiveConfig) {
        // As strong as all the rest, or nobody would see it.
        let config = ObjectiveConfig { style_weight: 600.0, ..config };
        let device = Backend::Flex.device().autodiff();
        device.seed(3);
        let mesh = procedural::car(5);
        let options = SequenceOptions { n_frames: 3, size: [64, 64], ..Default::default() };
        let sequence = Sequence::render(&mesh, &options, 5);
        let tiny = shape_prior::tests::tiny();
        let template = sample_surface(&mesh, tiny.n_points(), &mut keyed_rng(5, [0, 0]));
        let template: Vec<[f32; 3]> = template.iter().map(|point| point.coords.into()).collect();
        let generator = tiny.init(&template, &device).generator.no_grad();

        let observations = Observations::new(&sequence, &[1.0], &device);
        let objective = Objective {
            observations: &observations,
            shape: &generator,
            config: &config,
            device: device.clone(),
        };
        let start = sequence.truth.expect("rendered").camera_from_world[0];
        let style = [0.3, -0.2, 0.5, 0.1, 0.0, -0.4];
        let mut unknowns = Unknowns::new(start, 3, &style, Parameterisation::ObjectCentred)
            .expecting(vec![0.4, 0.1, -0.2, 0.0, 0.3, 0.1]);
        if config.refine_focal {
            unknowns = unknowns.with_focal();
            let focal = unknowns.focal();
            unknowns.values[focal].fill(0.03);
        }
        let mut shape = ShapeJacobian::default();
        shape.refresh(&objective, &unknowns, style.len());
        let focal = unknowns.focal();
        let config =
            LevenbergMarquardtConfig { max_residuals: usize::MAX / 4, ..Default::default() };
        let (_, matches) = objective.value(&unknowns, 0);
        let model = normal_equations(&objective, &unknowns, 0, &shape, &matches, &config);
        let gradient = model.gradient();

        let of_graph = objective.evaluate(&unknowns, 0).gradient;
        // [p_0 | Δp_1, Δp_2 | focal | s] there, [p_0 | s | focal | Δp_1, Δp_2] here.
        let (style, focal) = (&of_graph[focal.end..], &of_graph[focal]);
        let in_order = [&of_graph[..6], style, focal, &of_graph[6..18]].concat();
        let scale = in_order.iter().fold(0.0, |max: f64, g| max.max(g.abs()));
        for (i, (expected, found)) in in_order.iter().zip(gradient.iter()).enumerate() {
            // The style's derivatives are differences over a step that rounding can stand.
            let tolerance = if (6..12).contains(&i) { 2e-2 } else { 1e-4 };
            let error = (expected - 2.0 * found).abs();
            assert!(error < tolerance * scale, "{in_order:?} is not twice {gradient}");
        }
    }

    #[test]
    fn the_normal_equations_hold_the_gradient_of_the_graph() {
        check_normal_equations(ObjectiveConfig::default());
    }

    #[test]
    fn they_hold_it_when_exposures_are_solved_for() {
        check_normal_equations(ObjectiveConfig { solve_exposure: true, ..Default::default() });
    }

    #[test]
    fn they_hold_it_when_the_focal_length_is_refined() {
        check_normal_equations(ObjectiveConfig { refine_focal: true, ..Default::default() });
    }

    #[test]
    fn they_hold_it_when_silhouettes_are_robust() {
        for silhouette_norm in [SilhouetteNorm::Unsquared, SilhouetteNorm::Saturating] {
            check_normal_equations(ObjectiveConfig {
                silhouette_norm,
                silhouette_trim: 0.05,
                ..Default::default()
            });
        }
    }

    #[test]
    fn a_long_step_is_shortened_as_a_whole() {
        let step = limited(DVector::from_vec(vec![0.4, 0.0, 0.1, 5.0, 0.0, 0.0, 0.7]), 1, 0);
        assert_eq!(step.as_slice(), [0.2, 0.0, 0.05, 2.5, 0.0, 0.0, 0.35]);
        let step = vec![0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.4, 0.0, 0.0, 9.0, 0.0, 0.0];
        let halved: Vec<f64> = step.iter().map(|value| 0.5 * value).collect();
        assert_eq!(limited(DVector::from_vec(step), 0, 1).as_slice(), halved);
    }
}
