//! What two samplings of one surface score: errors below it say nothing.

use rand::seq::SliceRandom;

use super::CloudErrors;
use crate::data::keyed_rng;

/// Errors between two halves of a true cloud, from which those between samplings of any size follow.
///
/// Where the mesh is not at hand, there is but one sampling of it. Its halves are two, of half as many
/// points each; and near a point, those of a sampling are a Poisson process on the surface. With
/// k times as many of them, squared distances to the nearest shrink by k, distances by √k, and a
/// point without one that near has that by itself with a probability to the power of k.
#[derive(Clone, Debug)]
pub struct SamplingNoise {
    n_half: usize,
    halves: CloudErrors,
}

impl SamplingNoise {
    /// `None` where the cloud cannot be halved.
    pub fn of(truth: &[[f32; 3]]) -> Option<Self> {
        let n_half = truth.len() / 2;
        if n_half == 0 {
            return None;
        }
        // Points may come in an order that follows the surface.
        let mut points = truth.to_vec();
        points.shuffle(&mut keyed_rng(0, [0, 0]));
        let (a, b) = points.split_at(n_half);
        Some(Self { n_half, halves: CloudErrors::new(a, &b[..n_half]) })
    }

    /// The expected errors of a sampling of `n_estimate` points against one of `n_truth`.
    pub fn at(&self, n_estimate: usize, n_truth: usize) -> CloudErrors {
        let [to_truth, from_truth] = [n_truth, n_estimate].map(|n| n as f64 / self.n_half as f64);
        let halves = &self.halves;
        let within = |share: f64, denser: f64| 1.0 - (1.0 - share).powf(denser);
        CloudErrors {
            squared_to_truth: halves.squared_to_truth / to_truth,
            squared_from_truth: halves.squared_from_truth / from_truth,
            distance_to_truth: halves.distance_to_truth / to_truth.sqrt(),
            distance_from_truth: halves.distance_from_truth / from_truth.sqrt(),
            precision: within(halves.precision, to_truth),
            recall: within(halves.recall, from_truth),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{procedural::car, surface::sample_surface};

    fn sampling(n: usize, key: u64) -> Vec<[f32; 3]> {
        let points = sample_surface(&car(3), n, &mut keyed_rng(key, [0, 0]));
        points.iter().map(|point| point.coords.into()).collect()
    }

    #[test]
    fn halves_tell_what_two_samplings_of_a_car_score() {
        let truth = sampling(12_000, 1);
        let noise = SamplingNoise::of(&truth).expect("it has halves");
        for n_estimate in [12_000, 4_000] {
            let expected = CloudErrors::new(&sampling(n_estimate, 2), &truth);
            let told = noise.at(n_estimate, truth.len());
            for (told, expected) in [
                (told.squared_to_truth, expected.squared_to_truth),
                (told.squared_from_truth, expected.squared_from_truth),
                (told.distance(), expected.distance()),
                (told.f_score(), expected.f_score()),
            ] {
                assert!((told / expected - 1.0).abs() < 0.08, "{told} is not {expected}");
            }
        }
    }

    #[test]
    fn a_single_point_has_no_halves() {
        assert!(SamplingNoise::of(&[[0.0; 3]]).is_none());
    }
}
