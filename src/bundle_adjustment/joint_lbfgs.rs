//! Joint quasi-Newton descent: every unknown at once, with L-BFGS.

use serde::{Deserialize, Serialize};

use super::{
    evaluation::Evaluation,
    lbfgs::{LbfgsConfig, Problem, Sample, minimise},
    objective::Objective,
    progress::{Ending, Progress, Status},
    unknowns::Unknowns,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointLbfgsConfig {
    /// Iterations at each level of blur.
    pub iterations: usize,
    /// Evaluations of the objective at each level of blur.
    pub evaluations: usize,
    /// Pairs of steps and gradient changes that approximate the Hessian; each level starts with none.
    pub history: usize,
    /// Unit of p_0 and each Δp_l, in radians and world units.
    ///
    /// L-BFGS starts from a Hessian that is a multiple of the identity, so unknowns should be measured
    /// in units that matter alike.
    pub pose_scale: f64,
    /// Unit of the style, in standard deviations; of free points, in world units.
    pub style_scale: f64,
    /// Length of the first step of each level, over all unknowns in these units.
    pub first_step: f64,
    /// Iterations at the first level during which p_0 and the style wait for the Δp_l.
    pub relative_first: usize,
    /// Stops at a level when an iteration lowers the objective by less than this share of it.
    pub relative_tolerance: f64,
}

impl Default for JointLbfgsConfig {
    fn default() -> Self {
        Self {
            iterations: 60,
            evaluations: 60,
            history: 10,
            pose_scale: 0.01,
            style_scale: 0.1,
            first_step: 1.0,
            relative_first: 10,
            relative_tolerance: 1e-5,
        }
    }
}

/// Runs at one level of blur, and forgets the curvature of the last. A step that does not lower the
/// objective, or leads into a fault, is never taken.
pub fn run(
    objective: &Objective,
    unknowns: &mut Unknowns,
    level: usize,
    config: &JointLbfgsConfig,
    progress: &mut Progress,
) -> Ending {
    let relative_first = if level == 0 { config.relative_first.min(config.iterations) } else { 0 };
    let mut scales = vec![config.pose_scale; unknowns.values.len()];
    scales[unknowns.style()].fill(config.style_scale);
    let mut relative_scales = vec![0.0; scales.len()];
    relative_scales[unknowns.relatives()].fill(config.pose_scale);

    let mut descent = Descent::new(objective, unknowns, level, progress);
    if relative_first > 0 {
        descent.run(relative_scales, relative_first, config);
    }
    let converged = descent.run(scales, config.iterations - relative_first, config);
    let status = match converged {
        true => descent.refused.unwrap_or(Status::Converged),
        false => Status::BudgetSpent,
    };
    let last = descent.current.expect("the start was evaluated");
    Ending { status: last.fault().unwrap_or(status), objective: last.objective }
}

/// The unknowns on their way down one level, as a function of `x`: values = origin + scales · x.
struct Descent<'a, 'b> {
    objective: &'a Objective<'a>,
    level: usize,
    progress: &'a mut Progress<'b>,
    /// Where the last iteration ended, and the objective there.
    unknowns: &'a mut Unknowns,
    current: Option<Evaluation>,
    origin: Vec<f64>,
    /// The unit of each unknown; those that wait have none.
    scales: Vec<f64>,
    /// What was evaluated since the last iteration, and why something lower was not taken.
    tried: Vec<(Vec<f64>, Evaluation)>,
    refused: Option<Status>,
    n_evaluations: usize,
}

impl<'a, 'b> Descent<'a, 'b> {
    fn new(
        objective: &'a Objective<'a>,
        unknowns: &'a mut Unknowns,
        level: usize,
        progress: &'a mut Progress<'b>,
    ) -> Self {
        Self {
            objective,
            level,
            progress,
            unknowns,
            current: None,
            origin: Vec::new(),
            scales: Vec::new(),
            tried: Vec::new(),
            refused: None,
            n_evaluations: 0,
        }
    }

    /// Goes on from the unknowns as they are; tells whether that converged.
    fn run(&mut self, scales: Vec<f64>, max_iterations: usize, config: &JointLbfgsConfig) -> bool {
        self.origin.clone_from(&self.unknowns.values);
        self.scales = scales;
        self.refused = None;
        let start = vec![0.0; self.origin.len()];
        let budget = LbfgsConfig {
            max_iterations,
            max_evaluations: config.evaluations.saturating_sub(self.n_evaluations),
            history: config.history,
            gradient_tolerance: 0.0,
            relative_tolerance: config.relative_tolerance,
            first_step: config.first_step,
        };
        minimise(self, &start, &budget).converged
    }

    fn values(&self, x: &[f64]) -> Vec<f64> {
        let steps = self.scales.iter().zip(x).map(|(scale, x)| scale * x);
        self.origin.iter().zip(steps).map(|(origin, step)| origin + step).collect()
    }

    /// Why a lower point must not be gone to.
    fn fault_ahead(&self, next: &Evaluation) -> Option<Status> {
        let current = self.current.as_ref()?;
        if next.objective < current.objective { current.refuses(next) } else { None }
    }
}

impl Problem for &mut Descent<'_, '_> {
    fn evaluate(&mut self, x: &[f64]) -> (f64, Vec<f64>) {
        let mut unknowns = self.unknowns.clone();
        unknowns.values = self.values(x);
        // A second run starts from what the first one knows.
        let known = self.current.clone().filter(|_| unknowns.values == self.unknowns.values);
        let evaluation = known.unwrap_or_else(|| {
            self.n_evaluations += 1;
            let evaluation = self.objective.evaluate(&unknowns, self.level);
            self.tried.push((x.to_vec(), evaluation.clone()));
            evaluation
        });
        let fault = self.fault_ahead(&evaluation);
        self.refused = fault.or(self.refused);
        let value = if fault.is_some() { f64::INFINITY } else { evaluation.objective };
        let gradient = match evaluation.gradient.as_slice() {
            [] => vec![0.0; x.len()],
            gradient => gradient.iter().zip(&self.scales).map(|(g, scale)| g * scale).collect(),
        };
        (value, gradient)
    }

    fn accepted(&mut self, sample: &Sample) {
        let Some(idx) = self.tried.iter().position(|(x, _)| *x == sample.x) else { return };
        let (x, evaluation) = self.tried.swap_remove(idx);
        self.unknowns.values = self.values(&x);
        self.progress.report("joint", &evaluation, self.unknowns);
        self.current = Some(evaluation);
        self.refused = None;
        self.tried.clear();
    }
}
