//! Algorithm 1: L-BFGS on each Δp_l in parallel, then on p_0, then on s, and around again.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    evaluation::Evaluation,
    lbfgs::{LbfgsConfig, Minimum, minimise},
    objective::Objective,
    progress::{Ending, Progress, Status},
    shape_model::KnownPoints,
    unknowns::Unknowns,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlternatingConfig {
    /// Most rounds over the three blocks.
    pub max_rounds: usize,
    /// δ_L: stops when the photometric loss is no greater.
    pub loss_tolerance: f64,
    /// One block's L-BFGS.
    pub lbfgs: LbfgsConfig,
}

impl Default for AlternatingConfig {
    fn default() -> Self {
        Self { max_rounds: 5, loss_tolerance: 0.0, lbfgs: LbfgsConfig::default() }
    }
}

/// Runs Algorithm 1 at one level of blur.
///
/// It loops "while L_ph > δ_L or step < maximum" in print, which would not end; "and" is meant.
pub fn run(
    objective: &Objective,
    unknowns: &mut Unknowns,
    level: usize,
    config: &AlternatingConfig,
    progress: &mut Progress,
) -> Ending {
    let mut previous = objective.evaluate(unknowns, level);
    progress.report("initial", &previous, unknowns);
    for round in 0..config.max_rounds {
        if !previous.objective.is_finite() {
            return ended(&previous, Status::NotFinite);
        }
        if previous.photometric <= config.loss_tolerance {
            return ended(&previous, Status::Converged);
        }
        let start = unknowns.clone();
        update_relative_poses(objective, unknowns, level, &config.lbfgs);
        progress.report("relative poses", &objective.evaluate(unknowns, level), unknowns);
        update_block(objective, unknowns, Unknowns::REFERENCE, level, &config.lbfgs);
        if !unknowns.focal().is_empty() {
            update_block(objective, unknowns, unknowns.focal(), level, &config.lbfgs);
        }
        progress.report("reference pose", &objective.evaluate(unknowns, level), unknowns);
        update_block(objective, unknowns, unknowns.style(), level, &config.lbfgs);
        let current = objective.evaluate(unknowns, level);
        progress.report("style", &current, unknowns);
        if let Some(fault) = current.fault().filter(|_| previous.fault().is_none()) {
            *unknowns = start;
            return ended(&previous, fault);
        }
        progress.end_stage(&format!("round {}", round + 1), unknowns);
        let gain = previous.objective - current.objective;
        previous = current;
        if gain <= 1e-4 * previous.objective.abs() {
            return ended(&previous, Status::Converged);
        }
    }
    ended(&previous, Status::BudgetSpent)
}

fn ended(last: &Evaluation, status: Status) -> Ending {
    Ending { status: last.fault().unwrap_or(status), objective: last.objective }
}

/// Line 5 and 6: the frames do not meet while the shape and p_0 stand still.
fn update_relative_poses(
    objective: &Objective,
    unknowns: &mut Unknowns,
    level: usize,
    config: &LbfgsConfig,
) {
    let style = unknowns.leaves(&objective.device.clone().inner()).style;
    let points = objective.shape.points(style).inner();
    let updated: Vec<Minimum> = (1..unknowns.n_frames())
        .into_par_iter()
        .map(|l| {
            let shape = KnownPoints(points.clone());
            let objective =
                Objective { shape: &shape, device: objective.device.clone(), ..*objective };
            let range = Unknowns::relative(l);
            let cost = block_cost(unknowns, range.clone(), |unknowns| {
                objective.evaluate_targets(unknowns, &[l], level)
            });
            minimise(cost, &unknowns.values[range], config)
        })
        .collect();
    for (l, minimum) in (1..).zip(updated) {
        unknowns.values[Unknowns::relative(l)].copy_from_slice(&minimum.x);
    }
}

/// Lines 7 and 8: one block over all frames.
fn update_block(
    objective: &Objective,
    unknowns: &mut Unknowns,
    range: Range<usize>,
    level: usize,
    config: &LbfgsConfig,
) {
    let cost = block_cost(unknowns, range.clone(), |x| objective.evaluate(x, level));
    let updated = minimise(cost, &unknowns.values[range.clone()], config);
    unknowns.values[range].copy_from_slice(&updated.x);
}

/// The objective as a function of the unknowns in `range` alone.
fn block_cost(
    unknowns: &Unknowns,
    range: Range<usize>,
    evaluate: impl Fn(&Unknowns) -> Evaluation,
) -> impl FnMut(&[f64]) -> (f64, Vec<f64>) {
    let mut unknowns = unknowns.clone();
    move |x| {
        unknowns.values[range.clone()].copy_from_slice(x);
        let Evaluation { objective, gradient, .. } = evaluate(&unknowns);
        let zeros = || vec![0.0; range.len()];
        (objective, gradient.get(range.clone()).map_or_else(zeros, <[f64]>::to_vec))
    }
}
