//! Sec. 2.3: poses and style, adjusted together until the frames agree.

pub mod adam;
pub mod alternating;
mod color_slope;
pub mod correspondences;
pub mod lbfgs;
pub mod levenberg_marquardt;
mod linearisation;
mod normal_equations;
pub mod objective;
pub mod observations;
mod rows;
mod shape_jacobian;
pub mod shape_model;
pub mod unknowns;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use self::{
    adam::{Adam, AdamConfig},
    alternating::AlternatingConfig,
    levenberg_marquardt::LevenbergMarquardtConfig,
    objective::{Evaluation, Objective, ObjectiveConfig},
    observations::Observations,
    shape_model::ShapeModel,
    unknowns::Unknowns,
};
use crate::{data::sequence::Sequence, initial_guess::InitialStyle};

/// How the objective is minimised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// All unknowns together, by Levenberg–Marquardt.
    #[default]
    Lm,
    /// All unknowns together, by Adam.
    Adam,
    /// Algorithm 1 as printed: L-BFGS on each Δp_l in parallel, then p_0, then s.
    AlternatingLbfgs,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BundleAdjustmentConfig {
    pub solver: Solver,
    /// Blur of the frames at each level, coarse to fine: a Gaussian's standard deviation in pixels.
    pub blurs: Vec<f32>,
    /// Initial poses that are tried; the one that ends with the least objective is kept. Front and back
    /// look alike until the frames are sharp.
    pub n_hypotheses: usize,
    pub initial_style: InitialStyle,
    pub objective: ObjectiveConfig,
    pub adam: AdamConfig,
    pub lm: LevenbergMarquardtConfig,
    pub alternating: AlternatingConfig,
}

impl Default for BundleAdjustmentConfig {
    fn default() -> Self {
        Self {
            solver: Solver::Lm,
            blurs: vec![3.0, 1.5, 0.7, 0.0],
            n_hypotheses: 2,
            initial_style: InitialStyle::default(),
            objective: ObjectiveConfig::default(),
            adam: AdamConfig::default(),
            lm: LevenbergMarquardtConfig::default(),
            alternating: AlternatingConfig::default(),
        }
    }
}

impl BundleAdjustmentConfig {
    /// What suits a solver: ours, or the paper's.
    pub fn preset(solver: Solver) -> Self {
        match solver {
            Solver::Lm | Solver::Adam => Self { solver, ..Self::default() },
            Solver::AlternatingLbfgs => Self::paper(),
        }
    }

    /// Steps that a whole run reports at most, for progress bars.
    pub fn n_reports(&self) -> usize {
        let per_level = match self.solver {
            Solver::Adam => self.adam.iterations + 1,
            Solver::Lm => self.lm.iterations + 1,
            Solver::AlternatingLbfgs => 3 * self.alternating.max_rounds + 1,
        };
        per_level * self.n_hypotheses.max(1) * self.blurs.len()
    }

    /// Algorithm 1 on Eq. 6, as the paper prints them.
    pub fn paper() -> Self {
        Self {
            solver: Solver::AlternatingLbfgs,
            blurs: vec![0.0],
            n_hypotheses: 1,
            objective: ObjectiveConfig::paper(),
            ..Self::default()
        }
    }
}

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The loss is small enough, or no longer falls.
    Converged,
    /// All iterations are used.
    BudgetSpent,
    /// The objective ceased to be finite; the last good unknowns are returned.
    NotFinite,
}

/// One line of the history: the solver's own terms, on blurred images where it blurs them.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    pub iteration: usize,
    pub hypothesis: usize,
    /// Blur of the frames in pixels.
    pub blur: f32,
    pub block: String,
    pub objective: f64,
    pub photometric: f64,
    pub silhouette: f64,
    pub n_visible: usize,
}

/// Collects what a solver reports, and passes it on.
pub struct Progress<'a> {
    observe: &'a mut dyn FnMut(&Step, &Unknowns),
    stages: Vec<(String, Unknowns)>,
    iteration: usize,
    hypothesis: usize,
    blur: f32,
}

impl Progress<'_> {
    fn report(&mut self, block: &str, evaluation: &Evaluation, unknowns: &Unknowns) {
        let step = Step {
            iteration: self.iteration,
            hypothesis: self.hypothesis,
            blur: self.blur,
            block: block.into(),
            objective: evaluation.objective,
            photometric: evaluation.photometric,
            silhouette: evaluation.silhouette,
            n_visible: evaluation.n_visible,
        };
        self.iteration += 1;
        (self.observe)(&step, unknowns);
    }

    fn end_stage(&mut self, name: &str, unknowns: &Unknowns) {
        self.stages.push((name.into(), unknowns.clone()));
    }
}

/// What bundle adjustment found.
pub struct Outcome {
    pub unknowns: Unknowns,
    pub status: Status,
    /// The unknowns after each stage, the initial ones first (Fig. 5).
    pub stages: Vec<(String, Unknowns)>,
    /// Evaluations that were reported, over all hypotheses.
    pub iterations: usize,
}

/// Adjusts poses and shape to a sequence, from one or several initial guesses, likeliest first.
///
/// `device` carries the graph and differentiates. Panics without a hypothesis or a blur level.
pub fn bundle_adjust(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    hypotheses: &[Unknowns],
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
    let hypotheses = &hypotheses[..hypotheses.len().min(config.n_hypotheses.max(1))];
    let finished = hypotheses.iter().enumerate().map(|(idx, hypothesis)| {
        progress.hypothesis = idx;
        progress.end_stage("initial", &hypotheses[0]);
        let run = Run::new(hypothesis).through_all_levels(&objective, config, &mut progress);
        let cost = objective.value(&run.unknowns, config.blurs.len() - 1).0.objective;
        (cost, run, std::mem::take(&mut progress.stages))
    });
    // NaN is the greatest.
    let best = finished.min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, run, stages) = best.expect("there is a hypothesis");
    Outcome { unknowns: run.unknowns, status: run.status, iterations: progress.iteration, stages }
}

/// One hypothesis on its way.
struct Run {
    unknowns: Unknowns,
    adam: Adam,
    status: Status,
}

impl Run {
    fn new(initial: &Unknowns) -> Self {
        let (unknowns, adam) = (initial.clone(), Adam::new(initial));
        Self { unknowns, adam, status: Status::BudgetSpent }
    }

    fn through_all_levels(
        mut self,
        objective: &Objective,
        config: &BundleAdjustmentConfig,
        progress: &mut Progress,
    ) -> Self {
        for level in 0..config.blurs.len() {
            self.advance(objective, level, config, progress);
            if self.status == Status::NotFinite {
                break;
            }
        }
        self
    }

    fn advance(
        &mut self,
        objective: &Objective,
        level: usize,
        config: &BundleAdjustmentConfig,
        progress: &mut Progress,
    ) {
        progress.blur = config.blurs[level];
        let levels = [level, config.blurs.len()];
        self.status = match config.solver {
            Solver::Adam => {
                self.adam.run(objective, &mut self.unknowns, levels, &config.adam, progress)
            }
            Solver::Lm => {
                let config = &config.lm;
                levenberg_marquardt::run(objective, &mut self.unknowns, level, config, progress)
            }
            Solver::AlternatingLbfgs => {
                let config = &config.alternating;
                alternating::run(objective, &mut self.unknowns, level, config, progress)
            }
        };
        if config.solver != Solver::AlternatingLbfgs {
            progress.end_stage(&format!("blur {}", progress.blur), &self.unknowns);
        }
    }
}
