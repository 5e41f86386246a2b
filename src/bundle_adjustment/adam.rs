//! Joint first-order descent: every unknown at once, with Adam (Kingma and Ba 2015).

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::{
    objective::Objective,
    progress::{Ending, Progress, Status},
    unknowns::Unknowns,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamConfig {
    /// Iterations at each level of blur.
    pub iterations: usize,
    /// Step sizes of p_0 and each Δp_l, in radians and world units.
    pub pose_rate: f64,
    /// Step size of the style, in standard deviations; of free points, in world units.
    pub style_rate: f64,
    /// Decay rates of the two moments.
    pub beta: [f64; 2],
    /// Share of the first level during which p_0 and the style wait for the Δp_l: from Δp = 0,
    /// a reference pose that moves at once settles between the frames.
    pub relative_first: f64,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self {
            iterations: 60,
            pose_rate: 0.01,
            style_rate: 0.04,
            beta: [0.9, 0.99],
            relative_first: 0.5,
        }
    }
}

/// Adam's moments, which go on through all levels of blur.
pub struct Adam {
    first: Vec<f64>,
    second: Vec<f64>,
    step: i32,
}

impl Adam {
    pub fn new(unknowns: &Unknowns) -> Self {
        let zeros = vec![0.0; unknowns.values.len()];
        Self { first: zeros.clone(), second: zeros, step: 0 }
    }

    /// Descends at level `level` of `n_levels`; ends at the best point that this level saw.
    ///
    /// The step sizes warm up at the start and fall along half a cosine over all levels.
    pub fn run(
        &mut self,
        objective: &Objective,
        unknowns: &mut Unknowns,
        [level, n_levels]: [usize; 2],
        config: &AdamConfig,
        progress: &mut Progress,
    ) -> Ending {
        let mut best = (f64::INFINITY, unknowns.values.clone());
        for iteration in 0..config.iterations {
            let evaluation = objective.evaluate(unknowns, level);
            progress.report("joint", &evaluation, unknowns);
            match evaluation.fault() {
                // The best so far is sound: back to it.
                Some(status) if status == Status::NotFinite || best.0.is_finite() => {
                    unknowns.values = best.1;
                    return Ending { status, objective: best.0 };
                }
                None if evaluation.objective < best.0 => {
                    best = (evaluation.objective, unknowns.values.clone());
                }
                _ => (),
            }
            let total = (n_levels * config.iterations) as f64;
            let done = (level * config.iterations + iteration) as f64 / total;
            let warm_up = (f64::from(self.step + 1) / 5.0).min(1.0);
            let decay = warm_up * (0.05 + 0.95 * 0.5 * (1.0 + (PI * done).cos()));
            let relative_only =
                level == 0 && (iteration as f64) < config.relative_first * config.iterations as f64;
            if evaluation.gradient.is_empty() {
                break;
            }
            self.step(unknowns, &evaluation.gradient, config, decay, relative_only);
        }
        let last = objective.evaluate(unknowns, level);
        progress.report("joint", &last, unknowns);
        match last.fault() {
            Some(status) if best.0.is_infinite() => Ending { status, objective: last.objective },
            None if last.objective <= best.0 => {
                Ending { status: Status::BudgetSpent, objective: last.objective }
            }
            _ => {
                unknowns.values = best.1;
                Ending { status: Status::BudgetSpent, objective: best.0 }
            }
        }
    }

    fn step(
        &mut self,
        unknowns: &mut Unknowns,
        gradient: &[f64],
        config: &AdamConfig,
        decay: f64,
        relative_only: bool,
    ) {
        self.step += 1;
        let [beta1, beta2] = config.beta;
        let unbias = [beta1, beta2].map(|beta| 1.0 - beta.powi(self.step));
        let (relatives, style) = (unknowns.relatives(), unknowns.style());
        for (i, value) in unknowns.values.iter_mut().enumerate() {
            if relative_only && !relatives.contains(&i) {
                continue;
            }
            let rate = if style.contains(&i) { config.style_rate } else { config.pose_rate };
            self.first[i] = beta1 * self.first[i] + (1.0 - beta1) * gradient[i];
            self.second[i] = beta2 * self.second[i] + (1.0 - beta2) * gradient[i] * gradient[i];
            let (mean, variance) = (self.first[i] / unbias[0], self.second[i] / unbias[1]);
            *value -= decay * rate * mean / (variance.sqrt() + 1e-12);
        }
    }
}
