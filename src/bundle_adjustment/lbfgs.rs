//! L-BFGS with a strong-Wolfe line search (Nocedal and Wright, Algorithms 7.4, 7.5, 3.5 and 3.6),
//! in double precision on the host: unknowns are few, and evaluating the objective is what costs.

mod line_search;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use self::line_search::line_search;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LbfgsConfig {
    pub max_iterations: usize,
    /// Evaluations of the objective, over all iterations.
    pub max_evaluations: usize,
    /// Pairs of steps and gradient changes that approximate the Hessian.
    pub history: usize,
    /// Stops when no component of the gradient exceeds this.
    pub gradient_tolerance: f64,
    /// Stops when an iteration lowers the objective by less than this share of it.
    pub relative_tolerance: f64,
    /// Length of the first step that is tried, in the units of the unknowns.
    pub first_step: f64,
}

impl Default for LbfgsConfig {
    fn default() -> Self {
        Self {
            max_iterations: 8,
            max_evaluations: 24,
            history: 8,
            gradient_tolerance: 1e-9,
            relative_tolerance: 1e-9,
            first_step: 0.02,
        }
    }
}

/// What is minimised. A closure will do where nobody needs to follow.
pub trait Problem {
    /// The value and the gradient at `x`.
    fn evaluate(&mut self, x: &[f64]) -> (f64, Vec<f64>);

    /// Hears of the start, and of the end of every iteration: points that were evaluated before.
    fn accepted(&mut self, _: &Sample) {}
}

impl<F: FnMut(&[f64]) -> (f64, Vec<f64>)> Problem for F {
    fn evaluate(&mut self, x: &[f64]) -> (f64, Vec<f64>) {
        self(x)
    }
}

/// A point, with the objective's value and gradient there.
#[derive(Clone, Debug)]
pub struct Sample {
    pub x: Vec<f64>,
    pub value: f64,
    pub gradient: Vec<f64>,
}

/// The lowest point that was found.
#[derive(Clone, Debug)]
pub struct Minimum {
    pub x: Vec<f64>,
    pub value: f64,
    /// Whether it ended because nothing more was to be gained, and not because a budget was spent.
    pub converged: bool,
}

/// Lowers `problem` from `x`. Never returns a worse point.
///
/// Points where the objective is not finite count as infinitely bad, and the line search backs off.
pub fn minimise(problem: impl Problem, x: &[f64], config: &LbfgsConfig) -> Minimum {
    let pairs = VecDeque::with_capacity(config.history);
    let mut descent = Descent { problem, config, n_left: config.max_evaluations.max(1), pairs };
    let mut current = descent.evaluate(x.to_vec()).expect("the start is within any budget");
    descent.problem.accepted(&current);
    let mut converged = false;
    for _ in 0..config.max_iterations {
        if !current.value.is_finite() {
            break;
        }
        converged = max_abs(&current.gradient) <= config.gradient_tolerance;
        if converged {
            break;
        }
        let Some(next) = descent.step(&current) else {
            converged = descent.n_left > 0;
            break;
        };
        let gain = current.value - next.value;
        current = next;
        descent.problem.accepted(&current);
        converged = gain <= config.relative_tolerance * current.value.abs();
        if converged {
            break;
        }
    }
    Minimum { x: current.x, value: current.value, converged }
}

/// What is kept between iterations.
struct Descent<'a, P> {
    problem: P,
    config: &'a LbfgsConfig,
    /// Evaluations left in the budget.
    n_left: usize,
    pairs: VecDeque<Pair>,
}

/// A step, the gradient's change over it, and their product.
struct Pair {
    step: Vec<f64>,
    change: Vec<f64>,
    curvature: f64,
}

impl<P: Problem> Descent<'_, P> {
    /// `None` when the budget is spent.
    fn evaluate(&mut self, x: Vec<f64>) -> Option<Sample> {
        self.n_left = self.n_left.checked_sub(1)?;
        let (value, gradient) = self.problem.evaluate(&x);
        let finite = value.is_finite() && gradient.iter().all(|g| g.is_finite());
        Some(Sample { x, value: if finite { value } else { f64::INFINITY }, gradient })
    }

    /// One iteration: a lower point, unless there is none within the budget.
    fn step(&mut self, current: &Sample) -> Option<Sample> {
        let mut direction = self.direction(&current.gradient);
        if dot(&direction, &current.gradient) >= 0.0 {
            self.pairs.clear();
            direction = self.direction(&current.gradient);
        }
        let is_steepest = self.pairs.is_empty();
        let first = if is_steepest { self.config.first_step / norm(&direction) } else { 1.0 };
        match line_search(current, &direction, first, |x| self.evaluate(x)) {
            Some(next) => {
                self.remember(current, &next);
                Some(next)
            }
            None if is_steepest => None,
            // Where the remembered curvature leads nowhere, steepest descent may still.
            None => {
                self.pairs.clear();
                self.step(current)
            }
        }
    }

    /// −H g by the two-loop recursion, H scaled as the latest pair suggests.
    fn direction(&self, gradient: &[f64]) -> Vec<f64> {
        let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
        let mut alphas = Vec::with_capacity(self.pairs.len());
        for Pair { step, change, curvature } in self.pairs.iter().rev() {
            let alpha = dot(step, &direction) / curvature;
            add_scaled(&mut direction, -alpha, change);
            alphas.push(alpha);
        }
        if let Some(Pair { change, curvature, .. }) = self.pairs.back() {
            let scale = curvature / dot(change, change);
            direction.iter_mut().for_each(|d| *d *= scale);
        }
        for (Pair { step, change, curvature }, alpha) in self.pairs.iter().zip(alphas.iter().rev())
        {
            let beta = dot(change, &direction) / curvature;
            add_scaled(&mut direction, alpha - beta, step);
        }
        direction
    }

    /// Keeps a pair whose curvature is positive, and forgets the oldest.
    fn remember(&mut self, current: &Sample, next: &Sample) {
        let step = difference(&next.x, &current.x);
        let change = difference(&next.gradient, &current.gradient);
        let curvature = dot(&step, &change);
        if curvature > 1e-12 * norm(&step) * norm(&change) {
            self.pairs.push_back(Pair { step, change, curvature });
        }
        if self.pairs.len() > self.config.history {
            self.pairs.pop_front();
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn max_abs(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |max, a| a.abs().max(max))
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn add_scaled(a: &mut [f64], scale: f64, b: &[f64]) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += scale * b);
}
