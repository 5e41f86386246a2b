//! A step along a direction that meets the strong Wolfe conditions.

use super::{Sample, add_scaled, dot};

/// Armijo's and Wolfe's constants.
const SUFFICIENT_DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Steps that one search may try.
pub(super) const MAX_TRIALS: usize = 20;
/// How much longer the next step is than the last, while the slope still points down.
const EXTRAPOLATION: f64 = 2.5;

/// One step that was tried.
#[derive(Clone, Copy)]
struct Trial {
    at: f64,
    value: f64,
    slope: f64,
}

/// Searches from `start` along `direction`, beginning with `first` times its length; when
/// `evaluate` or the trials end, the lowest that decreases enough, if any.
pub(super) fn line_search(
    start: &Sample,
    direction: &[f64],
    first: f64,
    mut evaluate: impl FnMut(Vec<f64>) -> Option<Sample>,
) -> Option<Sample> {
    let slope = dot(direction, &start.gradient);
    let mut best: Option<Sample> = None;
    // The bracket; `high` is unknown until one is found.
    let (mut low, mut high) = (Trial { at: 0.0, value: start.value, slope }, None::<Trial>);
    let mut at = first;
    for _ in 0..MAX_TRIALS {
        let mut x = start.x.clone();
        add_scaled(&mut x, at, direction);
        let Some(sample) = evaluate(x) else { return best };
        let here = Trial { at, value: sample.value, slope: dot(direction, &sample.gradient) };
        let decreases = here.value <= start.value + SUFFICIENT_DECREASE * at * slope;
        if decreases && best.as_ref().is_none_or(|best| here.value < best.value) {
            best = Some(sample);
        }
        if decreases && here.slope.abs() <= -CURVATURE * slope {
            return best;
        }
        if !decreases || here.value >= low.value {
            high = Some(here);
        } else {
            let beyond = high.map_or(1.0, |high| high.at - low.at);
            if here.slope * beyond >= 0.0 {
                high = Some(low);
            }
            low = here;
        }
        at = match high {
            None => EXTRAPOLATION * at,
            Some(high) => interpolate(low, high),
        };
    }
    best
}

/// The minimiser of the cubic through both ends, kept inside the bracket.
fn interpolate(a: Trial, b: Trial) -> f64 {
    let width = b.at - a.at;
    let d1 = a.slope + b.slope - 3.0 * (a.value - b.value) / (a.at - b.at);
    let d2 = (d1 * d1 - a.slope * b.slope).max(0.0).sqrt() * width.signum();
    let cubic = b.at - width * (b.slope + d2 - d1) / (b.slope - a.slope + 2.0 * d2);
    let (near, far) = (a.at + 0.1 * width, a.at + 0.9 * width);
    if cubic.is_finite() { cubic.clamp(near.min(far), near.max(far)) } else { 0.5 * (a.at + b.at) }
}
