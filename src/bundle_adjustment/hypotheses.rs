//! Several initial guesses, of which one is kept.

use serde::Serialize;

use super::{
    BundleAdjustmentConfig, Solver,
    adam::Adam,
    alternating, joint_lbfgs, levenberg_marquardt,
    objective::Objective,
    progress::{Ending, Progress, Status},
    unknowns::Unknowns,
};

/// Where bundle adjustment may start, and how likely that is, up to a factor that all have.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    pub unknowns: Unknowns,
    pub confidence: f32,
}

impl From<Unknowns> for Hypothesis {
    /// Without a rival, any confidence will do.
    fn from(unknowns: Unknowns) -> Self {
        Self { unknowns, confidence: 1.0 }
    }
}

/// What became of a hypothesis.
#[derive(Clone, Debug, Serialize)]
pub struct HypothesisReport {
    pub status: Status,
    pub confidence: f32,
    /// The solver's objective at the end of each level of blur that it ran through.
    pub objectives: Vec<f64>,
    /// −log of its posterior probability, in nats and up to a constant: the least one is kept.
    pub cost: f64,
}

/// One hypothesis on its way.
pub(super) struct Run {
    pub unknowns: Unknowns,
    pub stages: Vec<(String, Unknowns)>,
    pub report: HypothesisReport,
    adam: Adam,
}

impl Run {
    pub fn new(hypothesis: &Hypothesis, initial: &Unknowns) -> Self {
        let Hypothesis { unknowns, confidence } = hypothesis.clone();
        Self {
            stages: vec![("initial".into(), initial.clone())],
            report: HypothesisReport {
                status: Status::BudgetSpent,
                confidence,
                objectives: Vec::new(),
                cost: f64::NAN,
            },
            adam: Adam::new(&unknowns),
            unknowns,
        }
    }

    /// Whether it may still become the best.
    pub fn goes_on(&self) -> bool {
        !matches!(self.report.status, Status::NotFinite | Status::Dropped)
    }

    /// Runs the solver at one level of blur.
    pub fn advance(
        &mut self,
        objective: &Objective,
        level: usize,
        config: &BundleAdjustmentConfig,
        progress: &mut Progress,
    ) {
        progress.blur = config.blurs[level];
        std::mem::swap(&mut progress.stages, &mut self.stages);
        let unknowns = &mut self.unknowns;
        let levels = [level, config.blurs.len()];
        let Ending { status, objective } = match config.solver {
            Solver::Adam => self.adam.run(objective, unknowns, levels, &config.adam, progress),
            Solver::Lm => {
                levenberg_marquardt::run(objective, unknowns, level, &config.lm, progress)
            }
            Solver::Lbfgs => joint_lbfgs::run(objective, unknowns, level, &config.lbfgs, progress),
            Solver::AlternatingLbfgs => {
                alternating::run(objective, unknowns, level, &config.alternating, progress)
            }
        };
        if config.solver != Solver::AlternatingLbfgs {
            progress.end_stage(&format!("blur {}", progress.blur), unknowns);
        }
        std::mem::swap(&mut progress.stages, &mut self.stages);
        self.report.status = status;
        self.report.objectives.push(objective);
        self.report.cost = cost(objective, self.report.confidence, config.independent_observations);
    }

    /// Sorts before another that is worse: one that is at fault, or costs more. NaN costs most.
    pub fn rank(&self) -> (bool, f64) {
        (self.report.status.is_fault(), self.report.cost)
    }
}

/// −log p(pictures | hypothesis) p(hypothesis), in nats.
///
/// Residuals are normal with a variance that nobody knows: of n observations whose squares add up to
/// L, the likelihood at the best variance is L^(−n/2).
fn cost(objective: f64, confidence: f32, n_observations: f64) -> f64 {
    0.5 * n_observations * objective.ln() - f64::from(confidence).ln()
}

/// Gives up on runs that the best one has left behind by more than `margin`, in nats.
pub(super) fn drop_those_behind(runs: &mut [Run], margin: f64) {
    let going = runs.iter().filter(|run| run.goes_on() && !run.report.status.is_fault());
    let least = going.map(|run| run.report.cost).fold(f64::INFINITY, f64::min);
    for run in runs.iter_mut().filter(|run| run.goes_on()) {
        if run.report.cost > least + margin {
            run.report.status = Status::Dropped;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    const N: f64 = 20.0;

    fn run(objective: f64, confidence: f32, status: Status) -> Run {
        let unknowns = Unknowns::new(Isometry3::identity(), 2, &[], Default::default());
        let mut run = Run::new(&Hypothesis { unknowns: unknowns.clone(), confidence }, &unknowns);
        run.report.status = status;
        run.report.cost = cost(objective, confidence, N);
        run
    }

    #[test]
    fn the_cost_is_the_log_of_a_normal_posterior() {
        // n residuals of variance v: their densities' product, at the best v = L / n.
        let density = |objective: f64| {
            let variance = objective / N;
            (std::f64::consts::TAU * variance).powf(-0.5 * N) * (-0.5 * N).exp()
        };
        let odds = (0.7 * density(6.6)) / (0.3 * density(7.2));
        let nats = cost(7.2, 0.3, N) - cost(6.6, 0.7, N);
        assert!((nats - odds.ln()).abs() < 1e-6, "{nats} is not {}", odds.ln());
    }

    #[test]
    fn confidence_decides_between_objectives_that_are_close() {
        let costs = |a: [f64; 2], b: [f64; 2]| [a, b].map(|[l, c]| cost(l, c as f32, N));
        let [sure, unsure] = costs([7.0, 0.8], [6.8, 0.2]);
        assert!(sure < unsure);
        let [sure, unsure] = costs([7.0, 0.8], [4.0, 0.2]);
        assert!(sure > unsure);
    }

    #[test]
    fn only_what_is_clearly_behind_is_dropped() {
        let converged = Status::Converged;
        let mut runs =
            [run(7.0, 0.5, converged), run(7.5, 0.5, converged), run(30.0, 0.5, converged)];
        drop_those_behind(&mut runs, 5.0);
        assert_eq!(runs.map(|run| run.report.status), [converged, converged, Status::Dropped]);
    }

    #[test]
    fn a_run_at_fault_neither_wins_nor_drops_others() {
        let mut runs = [run(1.0, 0.5, Status::OutOfFrame), run(30.0, 0.5, Status::Converged)];
        drop_those_behind(&mut runs, 5.0);
        assert!(runs[1].goes_on() && runs[1].rank() < runs[0].rank());
    }
}
