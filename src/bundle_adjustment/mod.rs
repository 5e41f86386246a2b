//! Sec. 2.3: poses and style, adjusted together until the frames agree.

pub mod adam;
pub mod alternating;
mod color_slope;
pub mod correspondences;
pub mod displacement;
mod evaluation;
mod exposure;
mod hypotheses;
pub mod joint_lbfgs;
pub mod lbfgs;
pub mod levenberg_marquardt;
mod linearisation;
mod normal_equations;
pub mod objective;
mod objective_config;
pub mod observations;
mod photometric;
pub mod point_subset;
mod progress;
mod rows;
mod shape_jacobian;
pub mod shape_model;
mod smooth_field;
#[cfg(test)]
mod tests;
mod uncertainty;
pub mod unknowns;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use self::{
    adam::AdamConfig,
    alternating::AlternatingConfig,
    displacement::{Displaced, Displacement, DisplacementConfig, leave_manifold},
    hypotheses::{Run, drop_those_behind},
    joint_lbfgs::JointLbfgsConfig,
    levenberg_marquardt::LevenbergMarquardtConfig,
    objective::{Objective, ObjectiveConfig},
    observations::Observations,
    progress::Progress,
    shape_model::ShapeModel,
    uncertainty::uncertainty,
    unknowns::Unknowns,
};
pub use self::{
    evaluation::Evaluation,
    exposure::Exposure,
    hypotheses::{Hypothesis, HypothesisReport},
    progress::{Status, Step},
    uncertainty::{Uncertainty, WithinTwoSigma},
};
use crate::{
    data::sequence::Sequence,
    initial_guess::{InitialMotion, InitialStyle, LikelyStyle, Start},
};

/// Levels of blur after which hypotheses are not compared yet: coarsely, a car turned round fits as well.
const COARSE_LEVELS: usize = 1;

/// How the objective is minimised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// All unknowns together, by Levenberg–Marquardt.
    #[default]
    Lm,
    /// All unknowns together, by Adam.
    Adam,
    /// All unknowns together, by L-BFGS.
    Lbfgs,
    /// Algorithm 1 as printed: L-BFGS on each Δp_l in parallel, then p_0, then s.
    AlternatingLbfgs,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BundleAdjustmentConfig {
    pub solver: Solver,
    /// Blur of the frames at each level, coarse to fine: a Gaussian's standard deviation in pixels.
    pub blurs: Vec<f32>,
    /// Initial poses that are tried. Front and back look alike until the frames are sharp.
    pub n_hypotheses: usize,
    /// n, the independent observations that an objective L is worth: −log likelihood is ½ n log L. The
    /// hypothesis is kept for which that, less the log of the regressor's confidence, is least; and the
    /// covariance of what it found is L / n H⁻¹.
    ///
    /// Points, pixels and frames are many more. But what L ends with is what the shape cannot explain: the
    /// same in frames 2° apart, and alike over a whole bumper. A view shows some 0.2 squared diagonals of a
    /// car, and a patch that errs together is about a tenth of a diagonal wide: 20.
    pub independent_observations: f64,
    /// The power that the regressor's confidences are raised to: below one, it is believed less than it
    /// believes itself, as it has to be on shapes unlike those that it has seen.
    pub confidence_exponent: f32,
    /// How far a hypothesis may be behind the best one after the coarse levels, in nats of the same
    /// measure; it is dropped beyond.
    pub drop_margin: f64,
    pub start: Start,
    pub initial_style: InitialStyle,
    /// s̄, around which the prior holds the style.
    pub likely_style: LikelyStyle,
    pub initial_motion: InitialMotion,
    pub objective: ObjectiveConfig,
    pub displacement: DisplacementConfig,
    pub adam: AdamConfig,
    pub lm: LevenbergMarquardtConfig,
    pub lbfgs: JointLbfgsConfig,
    pub alternating: AlternatingConfig,
}

impl Default for BundleAdjustmentConfig {
    fn default() -> Self {
        Self {
            solver: Solver::Lm,
            blurs: vec![3.0, 1.5, 0.7, 0.0],
            n_hypotheses: 2,
            independent_observations: 20.0,
            confidence_exponent: 0.5,
            drop_margin: 5.0,
            start: Start::default(),
            initial_style: InitialStyle::default(),
            likely_style: LikelyStyle::default(),
            initial_motion: InitialMotion::default(),
            objective: ObjectiveConfig::default(),
            displacement: DisplacementConfig::default(),
            adam: AdamConfig::default(),
            lm: LevenbergMarquardtConfig::default(),
            lbfgs: JointLbfgsConfig::default(),
            alternating: AlternatingConfig::default(),
        }
    }
}

impl BundleAdjustmentConfig {
    /// What suits a solver: ours, or the paper's.
    pub fn preset(solver: Solver) -> Self {
        match solver {
            Solver::Lm | Solver::Adam | Solver::Lbfgs => Self { solver, ..Self::default() },
            Solver::AlternatingLbfgs => Self::paper(),
        }
    }

    /// Steps that a whole run reports at most, for progress bars.
    pub fn n_reports(&self) -> usize {
        let per_level = match self.solver {
            Solver::Adam => self.adam.iterations + 1,
            Solver::Lm => self.lm.iterations + 1,
            Solver::Lbfgs => self.lbfgs.iterations + 1,
            Solver::AlternatingLbfgs => 3 * self.alternating.max_rounds + 1,
        };
        let beyond = if self.leaves_manifold() { per_level } else { 0 };
        per_level * self.n_hypotheses.max(1) * self.blurs.len() + beyond
    }

    fn leaves_manifold(&self) -> bool {
        self.solver == Solver::Lm && self.displacement.n_modes > 0
    }

    /// Algorithm 1 on Eq. 6, as the paper prints them.
    pub fn paper() -> Self {
        Self {
            solver: Solver::AlternatingLbfgs,
            blurs: vec![0.0],
            n_hypotheses: 1,
            initial_motion: InitialMotion::Still,
            objective: ObjectiveConfig::paper(),
            ..Self::default()
        }
    }
}

/// What bundle adjustment found.
pub struct Outcome {
    pub unknowns: Unknowns,
    /// How points may leave the prior's manifold, where that is solved for: see [`shape`](Self::shape).
    pub displacement: Option<Displacement>,
    pub status: Status,
    /// The unknowns after each stage, the initial ones first (Fig. 5).
    pub stages: Vec<(String, Unknowns)>,
    /// Evaluations that were reported, over all hypotheses.
    pub iterations: usize,
    /// What became of each initial guess that was tried, in their order.
    pub hypotheses: Vec<HypothesisReport>,
    /// How each target frame is exposed, at the last level of blur, where that is solved for.
    pub exposures: Option<Vec<Exposure>>,
    /// Of what was found; Levenberg–Marquardt alone knows it.
    pub uncertainty: Option<Uncertainty>,
}

impl Outcome {
    /// The shape model of its unknowns and of those of all its stages, which `prior` began with.
    pub fn shape<'a>(&'a self, prior: &'a dyn ShapeModel) -> Displaced<'a> {
        Displaced { prior, displacement: self.displacement.as_ref() }
    }
}

/// Adjusts poses and shape to a sequence, from one or several initial guesses, likeliest first.
///
/// `device` carries the graph and differentiates. Panics without a hypothesis or a blur level.
pub fn bundle_adjust(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    hypotheses: &[Hypothesis],
    config: &BundleAdjustmentConfig,
    device: &Device,
    observe: &mut dyn FnMut(&Step, &Unknowns),
) -> Outcome {
    let observations = Observations::new(sequence, &config.blurs, device);
    let objective = Objective {
        observations: &observations,
        shape,
        config: &config.objective,
        device: device.clone(),
    };
    let mut progress =
        Progress { observe, stages: Vec::new(), iteration: 0, hypothesis: 0, blur: 0.0 };
    let runs = explored(&objective, hypotheses, config, &mut progress);
    let hypotheses = runs.iter().map(|run| run.report.clone()).collect();
    let (idx, best) = best_of(runs);
    let Run { mut unknowns, mut stages, report, .. } = best;
    let (last_level, mut status) = (config.blurs.len() - 1, report.status);
    let mut displacement = None;
    if config.leaves_manifold() && !status.is_fault() {
        progress.hypothesis = idx;
        std::mem::swap(&mut progress.stages, &mut stages);
        let configs = (&config.displacement, &config.lm);
        let (moved, ending) =
            leave_manifold(&objective, &mut unknowns, last_level, configs, &mut progress);
        std::mem::swap(&mut progress.stages, &mut stages);
        status = ending.status;
        displacement = Some(moved);
    }
    let shape = Displaced { prior: shape, displacement: displacement.as_ref() };
    let longer = displacement.as_ref().map(|moved| moved.objective(&config.objective));
    let objective = Objective {
        shape: &shape,
        config: longer.as_ref().unwrap_or(&config.objective),
        device: device.clone(),
        ..objective
    };
    let certain = || {
        let n_directions =
            displacement.as_ref().map_or(config.lm.n_directions, Displacement::n_solved);
        let lm = LevenbergMarquardtConfig { n_directions, ..config.lm.clone() };
        uncertainty(&objective, &unknowns, last_level, &lm, config.independent_observations)
    };
    let known = config.solver == Solver::Lm && !status.is_fault();
    let exposures = || objective.value(&unknowns, last_level).1.exposures;
    Outcome {
        exposures: config.objective.solve_exposure.then(exposures),
        uncertainty: known.then(certain).flatten(),
        unknowns,
        displacement,
        status,
        iterations: progress.iteration,
        stages,
        hypotheses,
    }
}

/// Runs the solver from every initial guess, level by level, and gives up on those that fall behind.
fn explored(
    objective: &Objective,
    hypotheses: &[Hypothesis],
    config: &BundleAdjustmentConfig,
    progress: &mut Progress,
) -> Vec<Run> {
    let mut hypotheses = hypotheses[..hypotheses.len().min(config.n_hypotheses.max(1))].to_vec();
    if config.objective.refine_focal {
        hypotheses
            .iter_mut()
            .for_each(|start| start.unknowns = start.unknowns.clone().with_focal());
    }
    let initial = &hypotheses[0].unknowns;
    let mut runs: Vec<Run> = hypotheses.iter().map(|start| Run::new(start, initial)).collect();
    let last_level = config.blurs.len() - 1;
    for level in 0..=last_level {
        for (idx, run) in runs.iter_mut().enumerate().filter(|(_, run)| run.goes_on()) {
            progress.hypothesis = idx;
            run.advance(objective, level, config, progress);
        }
        if COARSE_LEVELS <= level && level < last_level {
            drop_those_behind(&mut runs, config.drop_margin);
        }
    }
    runs
}

/// The run to keep, and its place. One that was dropped has seen coarser frames only: what it ended with
/// does not compare.
fn best_of(runs: Vec<Run>) -> (usize, Run) {
    let finished =
        runs.into_iter().enumerate().filter(|(_, run)| run.report.status != Status::Dropped);
    let best = finished.min_by(|(_, a), (_, b)| {
        let ([a_faulty, b_faulty], [a, b]) = ([a.rank().0, b.rank().0], [a.rank().1, b.rank().1]);
        a_faulty.cmp(&b_faulty).then(a.total_cmp(&b))
    });
    best.expect("the best is never dropped")
}
