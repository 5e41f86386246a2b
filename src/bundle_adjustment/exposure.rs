//! A gain and a bias for each frame: cameras that expose every picture anew.
//!
//! Both are shared by the channels. An automatic exposure scales all of them alike, and haze or black
//! level lifts all of them; three gains would have colours agree that only lie on one another by mistake.

use serde::{Deserialize, Serialize};

/// How a frame's colours become the reference's: I_0 ≈ gain · I_l + bias, RGB in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exposure {
    pub gain: f64,
    pub bias: f64,
}

/// The colours of one point in the reference frame and in another.
pub type ColorPair = [[f64; 3]; 2];

/// Fewest pairs of colours that tell an exposure.
const LEAST_PAIRS: usize = 8;
/// Variance of a frame's colours below which its gain is not told, and taken for 1.
const LEAST_VARIANCE: f64 = 1e-6;
/// A gain near 0 would make any frame agree with a flat reference. These are some 1.6 stops.
const GAIN_LIMITS: [f64; 2] = [1.0 / 3.0, 3.0];
/// Rounds of reweighting, and the change of gain and bias that ends them.
const MOST_ROUNDS: usize = 200;
const TOLERANCE: f64 = 1e-10;

impl Exposure {
    /// A frame exposed like the reference.
    pub const NEUTRAL: Self = Self { gain: 1.0, bias: 0.0 };

    /// What minimises Charbonnier's loss of the colours' differences at `robust_scale` (0: their
    /// squares), by reweighted least squares. The loss is convex, so there is one minimum.
    ///
    /// [`NEUTRAL`](Self::NEUTRAL) where there are too few pairs.
    pub fn between(pairs: &[ColorPair], robust_scale: f64) -> Self {
        if pairs.len() < LEAST_PAIRS {
            return Self::NEUTRAL;
        }
        let mut found = Self::NEUTRAL;
        for _ in 0..MOST_ROUNDS {
            let last = found;
            found = Self::weighted(pairs, |pair| last.weight(pair, robust_scale));
            if (found.gain - last.gain).abs().max((found.bias - last.bias).abs()) < TOLERANCE {
                break;
            }
        }
        found
    }

    /// Weighted least squares: the regression of one frame's colours on another's.
    fn weighted(pairs: &[ColorPair], weight: impl Fn(&ColorPair) -> f64) -> Self {
        let [mut total, mut x, mut y, mut xx, mut xy] = [0.0; 5];
        for pair in pairs {
            let w = weight(pair);
            for (&reference, &target) in pair[0].iter().zip(&pair[1]) {
                total += w;
                x += w * target;
                y += w * reference;
                xx += w * target * target;
                xy += w * target * reference;
            }
        }
        let [x, y, xx, xy] = [x, y, xx, xy].map(|sum| sum / total);
        let variance = xx - x * x;
        let gain = match variance < LEAST_VARIANCE {
            true => 1.0,
            false => ((xy - x * y) / variance).clamp(GAIN_LIMITS[0], GAIN_LIMITS[1]),
        };
        Self { gain, bias: y - gain * x }
    }

    /// I_0 − gain · I_l − bias.
    pub fn residual(&self, [reference, target]: &ColorPair) -> [f64; 3] {
        std::array::from_fn(|c| reference[c] - (self.gain * target[c] + self.bias))
    }

    /// Of Charbonnier's loss, as reweighted squares have it.
    fn weight(&self, pair: &ColorPair, scale: f64) -> f64 {
        let squared: f64 = self.residual(pair).iter().map(|r| r * r).sum();
        if scale > 0.0 { (1.0 + squared / (scale * scale)).sqrt().recip() } else { 1.0 }
    }

    /// Whether the gain is its own choice, and not a limit's.
    pub fn gain_is_free(&self) -> bool {
        GAIN_LIMITS[0] < self.gain && self.gain < GAIN_LIMITS[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    fn pairs(n: usize, exposure: Exposure, noise: f64) -> Vec<ColorPair> {
        let mut rng = keyed_rng(1, [0, 0]);
        let mut pair = || {
            let target: [f64; 3] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
            let reference = target.map(|color| {
                exposure.gain * color + exposure.bias + noise * rng.random_range(-1.0..1.0)
            });
            [reference, target]
        };
        (0..n).map(|_| pair()).collect()
    }

    const BRIGHTER: Exposure = Exposure { gain: 1.3, bias: -0.05 };

    #[track_caller]
    fn check_near(found: Exposure, expected: Exposure, tolerance: f64) {
        let error = (found.gain - expected.gain).abs().max((found.bias - expected.bias).abs());
        assert!(error < tolerance, "{found:?} is not {expected:?}");
    }

    #[test]
    fn an_exposure_is_found_in_spite_of_outliers() {
        let mut pairs = pairs(300, BRIGHTER, 0.0);
        check_near(Exposure::between(&pairs, 0.0), BRIGHTER, 1e-9);
        pairs[..40].iter_mut().for_each(|pair| pair[0] = [0.0; 3]);
        check_near(Exposure::between(&pairs, 0.02), BRIGHTER, 0.02);
        let plain = Exposure::between(&pairs, 0.0);
        assert!((plain.gain - BRIGHTER.gain).abs() > 0.05, "{plain:?}");
    }

    /// The envelope theorem asks for a minimum: a grid of neighbours costs more.
    #[test]
    fn no_neighbour_of_an_exposure_costs_less() {
        let pairs = pairs(100, BRIGHTER, 0.3);
        let scale = 0.05;
        let cost = |exposure: Exposure| -> f64 {
            let squared = |pair| exposure.residual(pair).iter().map(|r| r * r).sum::<f64>();
            pairs.iter().map(|pair| (1.0 + squared(pair) / (scale * scale)).sqrt()).sum()
        };
        let found = Exposure::between(&pairs, scale);
        for (gain, bias) in [(1e-4, 0.0), (-1e-4, 0.0), (0.0, 1e-4), (0.0, -1e-4), (1e-4, -1e-4)] {
            let beside = Exposure { gain: found.gain + gain, bias: found.bias + bias };
            assert!(cost(beside) > cost(found), "{beside:?} costs less than {found:?}");
        }
    }

    #[test]
    fn what_tells_too_little_leaves_a_frame_as_it_is() {
        assert_eq!(Exposure::between(&pairs(7, BRIGHTER, 0.0), 0.05), Exposure::NEUTRAL);
        let flat = vec![[[0.6; 3], [0.4; 3]]; 50];
        check_near(Exposure::between(&flat, 0.05), Exposure { gain: 1.0, bias: 0.2 }, 1e-9);
    }

    #[test]
    fn a_gain_has_limits_at_which_the_bias_is_still_the_best() {
        let black = Exposure { gain: 0.0, bias: 0.7 };
        let found = Exposure::between(&pairs(200, black, 0.0), 0.0);
        assert!(!found.gain_is_free() && found.gain > 0.3);
        // The means agree.
        let mean: f64 =
            pairs(200, black, 0.0).iter().flat_map(|pair| found.residual(pair)).sum::<f64>();
        assert!(mean.abs() < 1e-9, "{mean}");
    }
}
