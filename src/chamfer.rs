//! The Chamfer distance between point clouds (Eq. 7).
//!
//! Neighbours are found on the host, outside the graph; the distances to them are on it. The
//! minimum is differentiated through its winner, which is its derivative wherever it has one.

use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::{
    host::{host_points, index_tensor},
    nearest_neighbours::nearest_neighbours,
};

/// Eq. 7 for each pair of a batch: the mean of squared distances, both ways added up, `[b]`.
///
/// Clouds are `[b, n, 3]` and `[b, m, 3]`; the unit is that of the points, squared.
pub fn chamfer_distance(predicted: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    let [b, n, _] = predicted.dims();
    let [_, m, _] = target.dims();
    let (predicted_host, target_host) = (host_points(&predicted), host_points(&target));
    let pairs: Vec<_> = predicted_host.chunks(n).zip(target_host.chunks(m)).collect();
    let (of_predicted, of_target): (Vec<_>, Vec<_>) = pairs
        .into_par_iter()
        .map(|(x, y)| rayon::join(|| nearest_neighbours(x, y), || nearest_neighbours(y, x)))
        .unzip();

    let nearest_target = select_points(target.clone(), &of_predicted);
    let nearest_predicted = select_points(predicted.clone(), &of_target);
    let forward = (predicted - nearest_target).square().sum_dim(2).mean_dim(1);
    let backward = (target - nearest_predicted).square().sum_dim(2).mean_dim(1);
    (forward + backward).reshape([b])
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
    use burn::tensor::{Distribution, Tolerance};

    /// Every pair, without any search.
    fn by_brute_force(x: Tensor<3>, y: Tensor<3>) -> Tensor<1> {
        let pairs = x.unsqueeze_dim::<4>(2) - y.unsqueeze_dim(1); // [b, n, m, 3]
        let squared = pairs.square().sum_dim(3).squeeze_dim::<3>(3);
        let forward = squared.clone().min_dim(2).mean_dim(1);
        let backward = squared.min_dim(1).mean_dim(2);
        (forward + backward).flatten(0, 2)
    }

    fn clouds() -> (Tensor<3>, Tensor<3>) {
        let device = Backend::Flex.device().autodiff();
        device.seed(7);
        let x = Tensor::random([3, 150, 3], Distribution::Uniform(-0.5, 0.5), &device);
        let y = Tensor::random([3, 90, 3], Distribution::Uniform(-0.4, 0.6), &device);
        (x.require_grad(), y.require_grad())
    }

    #[test]
    fn distances_match_brute_force() {
        let (x, y) = clouds();
        let expected = by_brute_force(x.clone(), y.clone()).into_data();
        let tolerance = Tolerance::<f32>::relative(1e-5);
        chamfer_distance(x, y).into_data().assert_approx_eq(&expected, tolerance);
    }

    #[test]
    fn gradients_match_brute_force() {
        let (x, y) = clouds();
        let gradients = |distance: Tensor<1>| {
            let gradients = distance.sum().backward();
            (x.grad(&gradients).expect("depends on x"), y.grad(&gradients).expect("depends on y"))
        };
        let (dx, dy) = gradients(chamfer_distance(x.clone(), y.clone()));
        let (expected_dx, expected_dy) = gradients(by_brute_force(x.clone(), y.clone()));
        let tolerance = Tolerance::<f32>::absolute(1e-7);
        dx.into_data().assert_approx_eq(&expected_dx.into_data(), tolerance);
        dy.into_data().assert_approx_eq(&expected_dy.into_data(), tolerance);
    }

    #[test]
    fn a_cloud_is_at_no_distance_from_itself() {
        let (x, _) = clouds();
        assert_eq!(host_values(&chamfer_distance(x.clone(), x)), [0.0; 3]);
    }
}
