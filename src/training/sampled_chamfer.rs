//! The Chamfer distance (Eq. 7) at a fraction of its cost, for the steps of training.

use burn::tensor::Tensor;
use rand::Rng;
use rayon::prelude::*;

use super::batches::cloud_tensor;
use crate::{chamfer::select_points, host::host_points, nearest_neighbours::NearestNeighbours};

/// Eq. 7 on `n_queries` points of each cloud, which look among all points of the other: `[1]`.
///
/// An unbiased estimate of the whole for a fraction of its cost.
pub(super) fn sampled_chamfer(
    clouds: Tensor<3>,
    targets: &[Vec<[f32; 3]>],
    n_queries: usize,
    rng: &mut impl Rng,
) -> Tensor<1> {
    let [_, n, _] = clouds.dims();
    let generated = host_points(&clouds);
    let queries: Vec<_> = targets
        .iter()
        .map(|target| {
            [n, target.len()].map(|n_points| -> Vec<u32> {
                (0..n_queries).map(|_| rng.random_range(0..n_points) as u32).collect()
            })
        })
        .collect();
    // Pairs of a generated point, by index, and a target point.
    let pairs: Vec<(Vec<u32>, Vec<[f32; 3]>)> = generated
        .par_chunks(n)
        .zip(targets)
        .zip(queries)
        .map(|((generated, target), [mut of_generated, of_target])| {
            let nearest_target = NearestNeighbours::new(target);
            let nearest_generated = NearestNeighbours::new(generated);
            let mut partners: Vec<[f32; 3]> = of_generated
                .iter()
                .map(|&i| target[nearest_target.nearest(generated[i as usize]) as usize])
                .collect();
            for i in of_target {
                of_generated.push(nearest_generated.nearest(target[i as usize]));
                partners.push(target[i as usize]);
            }
            (of_generated, partners)
        })
        .collect();
    let (point_idx, partners): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let partners = cloud_tensor(&partners, &clouds.device());
    // Half of the pairs are of either direction, and directions add up.
    (select_points(clouds, &point_idx) - partners).square().sum_dim(2).mean() * 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{chamfer::chamfer_distance, data::keyed_rng, host::host_values};
    use burn::tensor::Device;

    fn scattered(seed: u64, n: usize) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(seed, [0, 0]);
        (0..n).map(|_| rng.random()).collect()
    }

    #[test]
    fn the_sampled_chamfer_distance_estimates_the_whole() {
        let device = Device::flex();
        let (one, other) = ([scattered(0, 500)], [scattered(1, 400)]);
        let clouds = [&one, &other].map(|cloud| cloud_tensor(cloud, &device));
        let mut rng = keyed_rng(2, [0, 0]);
        let sampled = sampled_chamfer(clouds[0].clone(), &other, 20_000, &mut rng);
        let [whole] = [chamfer_distance(clouds[0].clone(), clouds[1].clone())];
        let ratio = host_values(&sampled)[0] / host_values(&whole)[0];
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
}
