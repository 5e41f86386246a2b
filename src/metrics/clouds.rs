//! Errors of point clouds (Eq. 7).

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::mean;
use crate::nearest_neighbours::mutual_neighbours;

/// Distance up to which the F-score counts a point as right: 1 % of the diagonal.
pub const F_SCORE_DISTANCE: f64 = 0.01;

/// Eq. 7: mean squared distance from each point to the other cloud's nearest, both ways added up.
///
/// In squared world units (diagonal 1). Two samplings of one mesh at N = 24,576 score about 4.7e-5.
pub fn style_error(estimate: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    CloudErrors::new(estimate, truth).style_error()
}

/// What lies between two clouds, each way. Lengths are in world units (diagonal 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CloudErrors {
    /// Mean squared distance from an estimated point to the nearest true one: what is too much.
    pub squared_to_truth: f64,
    /// From a true point to the nearest estimated one: what is missing.
    pub squared_from_truth: f64,
    /// The same distances, not squared.
    pub distance_to_truth: f64,
    pub distance_from_truth: f64,
    /// Shares of estimated and of true points that the other cloud is within 1 % of the diagonal of.
    pub precision: f64,
    pub recall: f64,
}

impl CloudErrors {
    /// Panics where a cloud has no points.
    pub fn new(estimate: &[[f32; 3]], truth: &[[f32; 3]]) -> Self {
        let [of_estimate, of_truth] = mutual_neighbours(estimate, truth);
        let to_truth = squared_distances(estimate, truth, &of_estimate);
        let from_truth = squared_distances(truth, estimate, &of_truth);
        let near = |squared: &[f64]| {
            let most = F_SCORE_DISTANCE.powi(2);
            mean(squared.iter().map(|&squared| f64::from(u8::from(squared <= most))))
        };
        Self {
            squared_to_truth: mean(to_truth.iter().copied()),
            squared_from_truth: mean(from_truth.iter().copied()),
            distance_to_truth: mean(to_truth.iter().map(|squared| squared.sqrt())),
            distance_from_truth: mean(from_truth.iter().map(|squared| squared.sqrt())),
            precision: near(&to_truth),
            recall: near(&from_truth),
        }
    }

    /// Eq. 7, in squared world units.
    pub fn style_error(&self) -> f64 {
        self.squared_to_truth + self.squared_from_truth
    }

    /// Eq. 7 without its squares, in world units: outliers weigh less.
    pub fn distance(&self) -> f64 {
        self.distance_to_truth + self.distance_from_truth
    }

    /// The harmonic mean of precision and recall at 1 % of the diagonal.
    pub fn f_score(&self) -> f64 {
        let sum = self.precision + self.recall;
        if sum > 0.0 { 2.0 * self.precision * self.recall / sum } else { 0.0 }
    }
}

fn squared_distances(from: &[[f32; 3]], to: &[[f32; 3]], nearest: &[u32]) -> Vec<f64> {
    let squared = |(&from, &nearest): (&[f32; 3], &u32)| {
        let offset = Point3::from(from) - Point3::from(to[nearest as usize]);
        f64::from(offset.norm_squared())
    };
    from.iter().zip(nearest).map(squared).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    /// Distances from each point to the other cloud, by a plain loop over all pairs.
    fn by_brute_force(from: &[[f32; 3]], to: &[[f32; 3]]) -> Vec<f64> {
        let nearest = |p: &[f32; 3]| {
            let distances = to
                .iter()
                .map(|q| (0..3).map(|i| f64::from(p[i] - q[i]).powi(2)).sum::<f64>().sqrt());
            distances.fold(f64::INFINITY, f64::min)
        };
        from.iter().map(nearest).collect()
    }

    #[test]
    fn the_errors_are_the_brute_force_ones() {
        let mut rng = keyed_rng(1, [0, 0]);
        // Crowded, so that some distances are below the F-score's and some are not.
        let mut cloud = |n: usize| -> Vec<[f32; 3]> {
            (0..n).map(|_| rng.random::<[f32; 3]>().map(|x| 0.1 * x)).collect()
        };
        let (a, b) = (cloud(300), cloud(220));
        let errors = CloudErrors::new(&a, &b);
        let [to_truth, from_truth] = [by_brute_force(&a, &b), by_brute_force(&b, &a)];
        let mean_of = |distances: &[f64], value: fn(f64) -> f64| {
            distances.iter().map(|&d| value(d)).sum::<f64>() / distances.len() as f64
        };
        let within = |distances: &[f64]| mean_of(distances, |d| if d <= 0.01 { 1.0 } else { 0.0 });
        let expected = [
            (errors.squared_to_truth, mean_of(&to_truth, |d| d * d)),
            (errors.squared_from_truth, mean_of(&from_truth, |d| d * d)),
            (errors.distance_to_truth, mean_of(&to_truth, |d| d)),
            (errors.distance_from_truth, mean_of(&from_truth, |d| d)),
            (errors.precision, within(&to_truth)),
            (errors.recall, within(&from_truth)),
            (errors.style_error(), mean_of(&to_truth, |d| d * d) + mean_of(&from_truth, |d| d * d)),
        ];
        for (actual, expected) in expected {
            assert!((actual - expected).abs() < 1e-8, "{actual} is not {expected}");
        }
        assert!((0.2..0.95).contains(&errors.precision), "{errors:?}");
    }

    #[test]
    fn clouds_far_apart_have_no_f_score() {
        let errors = CloudErrors::new(&[[0.0; 3]], &[[1.0, 0.0, 0.0]]);
        assert_eq!((errors.f_score(), errors.distance()), (0.0, 2.0));
    }
}
