//! The Chamfer distance between point clouds (Eq. 7).
//!
//! Neighbours are found on the host, outside the graph; the distances to them are on it. The
//! minimum is differentiated through its winner, which is its derivative wherever it has one.

use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::{
    host::{host_points, index_tensor},
    nearest_neighbours::mutual_neighbours,
};

/// Eq. 7 for each pair of a batch: the mean of squared distances, both ways added up, `[b]`.
///
/// Clouds are `[b, n, 3]` and `[b, m, 3]`; the unit is that of the points, squared.
pub fn chamfer_distance(predicted: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    NearestDistances::new(predicted, target).mean_squared()
}

/// From each point to the nearest of the other cloud, squared: what clouds are compared by.
#[derive(Clone, Debug)]
pub struct NearestDistances {
    of_predicted: Tensor<2>, // [b, n]
    of_target: Tensor<2>,    // [b, m]
}

impl NearestDistances {
    /// Clouds are `[b, n, 3]` and `[b, m, 3]`.
    pub fn new(predicted: Tensor<3>, target: Tensor<3>) -> Self {
        let ([_, n, _], [_, m, _]) = (predicted.dims(), target.dims());
        let (predicted_host, target_host) = (host_points(&predicted), host_points(&target));
        let (of_predicted, of_target): (Vec<_>, Vec<_>) = predicted_host
            .par_chunks(n)
            .zip(target_host.par_chunks(m))
            .map(|(predicted, target)| mutual_neighbours(predicted, target).into())
            .unzip();

        let nearest_target = select_points(target.clone(), &of_predicted);
        let nearest_predicted = select_points(predicted.clone(), &of_target);
        let squared = |offsets: Tensor<3>| offsets.square().sum_dim(2).squeeze_dim(2);
        Self {
            of_predicted: squared(predicted - nearest_target),
            of_target: squared(target - nearest_predicted),
        }
    }

    /// Eq. 7: the means of squared distances, both ways added up, `[b]`, in squared units.
    pub fn mean_squared(&self) -> Tensor<1> {
        self.both_ways(|squared| squared)
    }

    /// Eq. 7 without its squares, `[b]`, in the unit of the points: outliers weigh less.
    pub fn mean(&self) -> Tensor<1> {
        self.both_ways(|squared| {
            // Points that coincide have no gradient. The offset gives them a zero one.
            let coincide = squared.clone().equal_elem(0.0).float();
            (squared + coincide.clone()).sqrt() - coincide
        })
    }

    /// F-score at a distance: the harmonic mean of precision and recall, the shares of predicted and
    /// of target points with a neighbour up to that far, `[b]`. It has no gradient.
    pub fn f_score(&self, distance: f32) -> Tensor<1> {
        let squared = f64::from(distance * distance);
        let [precision, recall] = [&self.of_predicted, &self.of_target].map(|distances| {
            distances.clone().inner().lower_equal_elem(squared).float().mean_dim(1)
        });
        let sum = (precision.clone() + recall.clone()).clamp_min(f32::MIN_POSITIVE);
        (precision * recall * 2.0 / sum).squeeze_dim(1)
    }

    fn both_ways(&self, cost: impl Fn(Tensor<2>) -> Tensor<2>) -> Tensor<1> {
        let means = |squared: &Tensor<2>| cost(squared.clone()).mean_dim(1);
        (means(&self.of_predicted) + means(&self.of_target)).squeeze_dim(1)
    }
}

/// Each cloud's points at its own indices: `[b, n, 3]` and b lists of k become `[b, k, 3]`.
pub fn select_points(points: Tensor<3>, point_idx: &[Vec<u32>]) -> Tensor<3> {
    let [b, n, _] = points.dims();
    let k = point_idx[0].len();
    let rows = point_idx.iter().enumerate().flat_map(|(cloud, idx)| {
        idx.iter().map(move |&point_idx| (cloud * n + point_idx as usize) as i64)
    });
    let rows = index_tensor(rows.collect(), &points);
    points.reshape([b * n, 3]).select(0, rows).reshape([b, k, 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{device::Backend, host::host_values};
    use burn::tensor::{Distribution, TensorData, Tolerance};

    /// Squared distances of every pair, `[b, n, m]`, without any search.
    fn of_all_pairs(x: Tensor<3>, y: Tensor<3>) -> Tensor<3> {
        (x.unsqueeze_dim::<4>(2) - y.unsqueeze_dim(1)).square().sum_dim(3).squeeze_dim(3)
    }

    fn by_brute_force(x: Tensor<3>, y: Tensor<3>) -> Tensor<1> {
        both_ways(of_all_pairs(x, y))
    }

    fn unsquared_by_brute_force(x: Tensor<3>, y: Tensor<3>) -> Tensor<1> {
        both_ways(of_all_pairs(x, y).sqrt())
    }

    fn both_ways(pairs: Tensor<3>) -> Tensor<1> {
        let forward = pairs.clone().min_dim(2).mean_dim(1);
        let backward = pairs.min_dim(1).mean_dim(2);
        (forward + backward).flatten(0, 2)
    }

    fn unsquared(x: Tensor<3>, y: Tensor<3>) -> Tensor<1> {
        NearestDistances::new(x, y).mean()
    }

    fn clouds() -> (Tensor<3>, Tensor<3>) {
        let device = Backend::Flex.device().autodiff();
        device.seed(7);
        let x = Tensor::random([3, 150, 3], Distribution::Uniform(-0.5, 0.5), &device);
        let y = Tensor::random([3, 90, 3], Distribution::Uniform(-0.4, 0.6), &device);
        (x.require_grad(), y.require_grad())
    }

    type Distance = fn(Tensor<3>, Tensor<3>) -> Tensor<1>;

    const WITH_ORACLES: [[Distance; 2]; 2] =
        [[chamfer_distance, by_brute_force], [unsquared, unsquared_by_brute_force]];

    /// A distance's gradients by both clouds.
    fn gradients(distance: Distance, (x, y): (Tensor<3>, Tensor<3>)) -> [TensorData; 2] {
        let gradients = distance(x.clone(), y.clone()).sum().backward();
        [x, y].map(|cloud| cloud.grad(&gradients).expect("depends on both").into_data())
    }

    #[test]
    fn distances_match_brute_force() {
        let (x, y) = clouds();
        for [distance, oracle] in WITH_ORACLES {
            let expected = oracle(x.clone(), y.clone()).into_data();
            let tolerance = Tolerance::<f32>::relative(1e-5);
            distance(x.clone(), y.clone()).into_data().assert_approx_eq(&expected, tolerance);
        }
    }

    #[test]
    fn gradients_match_brute_force() {
        for [distance, oracle] in WITH_ORACLES {
            let [actual, expected] = [distance, oracle].map(|d| gradients(d, clouds()));
            for (actual, expected) in actual.iter().zip(&expected) {
                actual.assert_approx_eq(expected, Tolerance::<f32>::absolute(1e-6));
            }
        }
    }

    #[test]
    fn clouds_that_coincide_have_no_gradient() {
        for distance in [chamfer_distance, unsquared] {
            let (x, _) = clouds();
            let twin = Tensor::from_data(x.to_data(), &x.device()).require_grad();
            for gradient in gradients(distance, (x, twin)) {
                gradient.assert_eq(&TensorData::zeros::<f32, _>([3, 150, 3]), true);
            }
        }
    }

    #[test]
    fn the_f_score_is_the_harmonic_mean_of_precision_and_recall() {
        let device = Backend::Flex.device();
        // Two of three predicted points are within 0.1 of the target, and one of four of its.
        let predicted = [[0.0, 0., 0.], [0.05, 0., 0.], [1.0, 0., 0.]];
        let target = [[0.0, 0., 0.], [0., 2., 0.], [0., 0., 3.], [1.2, 0., 0.]];
        let [predicted, target] = [
            Tensor::<2>::from_floats(predicted, &device).unsqueeze::<3>(),
            Tensor::<2>::from_floats(target, &device).unsqueeze::<3>(),
        ];
        let distances = NearestDistances::new(predicted, target);
        let scores = [0.1, 0.25, 5.0].map(|distance| host_values(&distances.f_score(distance))[0]);
        // Precision and recall are 2/3 and 1/4, 1 and 1/2, 1 and 1.
        for (score, expected) in scores.into_iter().zip([4.0 / 11.0, 2.0 / 3.0, 1.0]) {
            assert!((score - expected).abs() < 1e-6, "{score} is not {expected}");
        }
    }

    #[test]
    fn clouds_that_are_apart_score_zero() {
        let (x, y) = clouds();
        assert_eq!(host_values(&NearestDistances::new(x, y + 9.0).f_score(0.1)), [0.0; 3]);
    }

    #[test]
    fn a_cloud_is_at_no_distance_from_itself() {
        let (x, _) = clouds();
        assert_eq!(host_values(&chamfer_distance(x.clone(), x)), [0.0; 3]);
    }
}
