//! L-BFGS with a strong-Wolfe line search (Nocedal and Wright, Algorithms 7.4, 7.5, 3.5 and 3.6),
//! in double precision on the host: unknowns are few, and evaluating the objective is what costs.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

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
    /// Longest first step, in the units of the unknowns.
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

/// A point, with the objective's value and gradient there.
#[derive(Clone, Debug)]
pub struct Sample {
    pub x: Vec<f64>,
    pub value: f64,
    pub gradient: Vec<f64>,
}

/// Armijo's and Wolfe's constants.
const SUFFICIENT_DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Steps that one line search may try.
const MAX_TRIALS: usize = 20;

/// Lowers `objective`, which gives a value and a gradient, from `x`. Never returns a worse point.
///
/// Points where the objective is not finite count as infinitely bad, and the line search backs off.
pub fn minimise(
    mut objective: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    x: &[f64],
    config: &LbfgsConfig,
) -> Sample {
    let mut n_evaluations = 0;
    let mut evaluate = |x: Vec<f64>| {
        n_evaluations += 1;
        let (value, gradient) = objective(&x);
        let finite = value.is_finite() && gradient.iter().all(|g| g.is_finite());
        let value = if finite { value } else { f64::INFINITY };
        (Sample { x, value, gradient }, n_evaluations >= config.max_evaluations)
    };

    let (mut current, mut exhausted) = evaluate(x.to_vec());
    let mut pairs = VecDeque::new();
    for _ in 0..config.max_iterations {
        let steepest = max_abs(&current.gradient);
        if exhausted || !current.value.is_finite() || steepest <= config.gradient_tolerance {
            break;
        }
        let mut direction = descent_direction(&current.gradient, &pairs);
        if dot(&direction, &current.gradient) >= 0.0 {
            pairs.clear();
            direction = descent_direction(&current.gradient, &pairs);
        }
        let first = if pairs.is_empty() { config.first_step / norm(&direction) } else { 1.0 };
        let (next, done) = line_search(&current, &direction, first, &mut evaluate);
        exhausted = done;
        let Some(next) = next else { break };

        let step = difference(&next.x, &current.x);
        let change = difference(&next.gradient, &current.gradient);
        let curvature = dot(&step, &change);
        if curvature > 1e-12 * norm(&step) * norm(&change) {
            pairs.push_back((step, change, curvature));
            if pairs.len() > config.history {
                pairs.pop_front();
            }
        }
        let gain = current.value - next.value;
        current = next;
        if gain <= config.relative_tolerance * current.value.abs() {
            break;
        }
    }
    current
}

type Pairs = VecDeque<(Vec<f64>, Vec<f64>, f64)>;

/// −H g by the two-loop recursion, H scaled as the latest pair suggests.
fn descent_direction(gradient: &[f64], pairs: &Pairs) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut alphas = Vec::with_capacity(pairs.len());
    for (step, change, curvature) in pairs.iter().rev() {
        let alpha = dot(step, &direction) / curvature;
        add_scaled(&mut direction, -alpha, change);
        alphas.push(alpha);
    }
    if let Some((_, change, curvature)) = pairs.back() {
        let scale = curvature / dot(change, change);
        direction.iter_mut().for_each(|d| *d *= scale);
    }
    for ((step, change, curvature), alpha) in pairs.iter().zip(alphas.iter().rev()) {
        let beta = dot(change, &direction) / curvature;
        add_scaled(&mut direction, alpha - beta, step);
    }
    direction
}

/// Finds a step along `direction` that meets the strong Wolfe conditions; when the budget ends
/// first, the best that decreases enough. Also tells whether evaluations are exhausted.
fn line_search(
    start: &Sample,
    direction: &[f64],
    first: f64,
    evaluate: &mut impl FnMut(Vec<f64>) -> (Sample, bool),
) -> (Option<Sample>, bool) {
    let slope = dot(direction, &start.gradient);
    let decreases = |at: f64, value: f64| value <= start.value + SUFFICIENT_DECREASE * at * slope;
    let mut best: Option<Sample> = None;
    // The bracket [low, high], as (step, value, slope); `high` is unknown until one is found.
    let (mut low, mut high) = ((0.0, start.value, slope), None::<(f64, f64, f64)>);
    let mut at = first;
    for _ in 0..MAX_TRIALS {
        let mut x = start.x.clone();
        add_scaled(&mut x, at, direction);
        let (sample, exhausted) = evaluate(x);
        let slope_here = dot(direction, &sample.gradient);
        let here = (at, sample.value, slope_here);
        let accepted = decreases(at, sample.value);
        let wolfe = accepted && slope_here.abs() <= -CURVATURE * slope;
        let lowest = best.as_ref().map_or(start.value, |best| best.value);
        if accepted && sample.value < lowest {
            best = Some(sample);
        }
        if wolfe || exhausted {
            return (best, exhausted);
        }
        if !accepted || here.1 >= low.1 {
            high = Some(here);
        } else {
            let beyond = high.map_or(1.0, |high| high.0 - low.0);
            if slope_here * beyond >= 0.0 {
                high = Some(low);
            }
            low = here;
        }
        at = match high {
            None => 2.5 * at,
            Some(high) => interpolate(low, high),
        };
    }
    (best, false)
}

/// The minimiser of the cubic through both ends, kept inside the bracket.
fn interpolate((a, fa, ga): (f64, f64, f64), (b, fb, gb): (f64, f64, f64)) -> f64 {
    let d1 = ga + gb - 3.0 * (fa - fb) / (a - b);
    let d2 = (d1 * d1 - ga * gb).max(0.0).sqrt() * (b - a).signum();
    let cubic = b - (b - a) * (gb + d2 - d1) / (gb - ga + 2.0 * d2);
    let (near, far) = (a + 0.1 * (b - a), a + 0.9 * (b - a));
    if cubic.is_finite() { cubic.clamp(near.min(far), near.max(far)) } else { 0.5 * (a + b) }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn patient() -> LbfgsConfig {
        LbfgsConfig {
            max_iterations: 200,
            max_evaluations: 400,
            first_step: 1.0,
            relative_tolerance: 0.0,
            ..Default::default()
        }
    }

    fn rosenbrock(x: &[f64]) -> (f64, Vec<f64>) {
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        (a * a + 100.0 * b * b, vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b])
    }

    #[test]
    fn rosenbrocks_valley_is_followed_to_its_end() {
        let found = minimise(rosenbrock, &[-1.2, 1.0], &patient());
        assert!((found.x[0] - 1.0).abs() < 1e-6 && (found.x[1] - 1.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn an_ill_conditioned_quadratic_is_solved() {
        let quadratic = |x: &[f64]| {
            let scales = [1.0, 30.0, 1000.0];
            let value = x.iter().zip(scales).map(|(x, s)| 0.5 * s * x * x).sum();
            (value, x.iter().zip(scales).map(|(x, s)| s * x).collect())
        };
        let found = minimise(quadratic, &[3.0, -2.0, 1.0], &patient());
        assert!(max_abs(&found.x) < 1e-6, "{found:?}");
    }

    #[test]
    fn a_region_without_values_is_backed_out_of() {
        let barrier = |x: &[f64]| match x[0] > 0.0 {
            true => (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]]),
            false => (f64::NAN, vec![f64::NAN]),
        };
        let config = LbfgsConfig { first_step: 10.0, ..patient() };
        let found = minimise(barrier, &[3.0], &config);
        assert!((found.x[0] - 1.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn no_step_is_taken_from_where_there_is_no_value() {
        let found = minimise(|_| (f64::NAN, vec![0.0]), &[2.0], &patient());
        assert_eq!((found.x, found.value), (vec![2.0], f64::INFINITY));
    }

    #[test]
    fn the_budget_of_evaluations_is_kept() {
        let mut count = 0;
        let counted = |x: &[f64]| {
            count += 1;
            rosenbrock(x)
        };
        minimise(counted, &[-1.2, 1.0], &LbfgsConfig { max_evaluations: 7, ..patient() });
        assert_eq!(count, 7);
    }
}
