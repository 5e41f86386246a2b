//! What a solver reports while it runs, and why it stopped.

use serde::{Deserialize, Serialize};

use super::{evaluation::Evaluation, unknowns::Unknowns};

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The loss is small enough, or no longer falls.
    Converged,
    /// All iterations are used.
    BudgetSpent,
    /// Clearly behind another hypothesis after the coarse levels.
    Dropped,
    /// The objective is not finite.
    NotFinite,
    /// Points lie behind a camera.
    BehindCamera,
    /// The cloud lies out of a frame.
    OutOfFrame,
    /// The reference frame sees hardly a point, or would see less than half of what it sees after every
    /// step that lowers the objective.
    VisibleSetShrank,
}

impl Status {
    /// Whether what was found is not to be used.
    pub fn is_fault(self) -> bool {
        !matches!(self, Self::Converged | Self::BudgetSpent | Self::Dropped)
    }
}

/// How a solver ended: why, and at which value of its objective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ending {
    pub status: Status,
    pub objective: f64,
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
    pub(super) observe: &'a mut dyn FnMut(&Step, &Unknowns),
    /// The unknowns after each stage of the current hypothesis.
    pub(super) stages: Vec<(String, Unknowns)>,
    pub(super) iteration: usize,
    pub(super) hypothesis: usize,
    pub(super) blur: f32,
}

impl Progress<'_> {
    pub(super) fn report(&mut self, block: &str, evaluation: &Evaluation, unknowns: &Unknowns) {
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

    pub(super) fn end_stage(&mut self, name: &str, unknowns: &Unknowns) {
        self.stages.push((name.into(), unknowns.clone()));
    }
}
