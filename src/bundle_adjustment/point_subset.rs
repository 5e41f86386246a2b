//! Some of a generator's points: what another N does, without another prior.

use burn::tensor::Tensor;

use super::shape_model::ShapeModel;
use crate::{
    host::{host_points, index_tensor},
    shape_prior::Generator,
};

/// n of the generator's points, the same ones for every style.
pub struct PointSubset<'a> {
    generator: &'a Generator,
    /// In ascending order.
    point_idx: Vec<i64>,
}

impl<'a> PointSubset<'a> {
    /// Points that lie evenly on the mean shape, and so nearly evenly on every other one.
    ///
    /// Every k-th of them would leave wider gaps: neighbours in their order are neighbours on the grid
    /// that they come from. So would any at random: 1,536 points of the bundled prior, at the styles of
    /// four true cars, are 0.23e-3 from these by Eq. 7, at random 0.33e-3, every 16th 0.36e-3.
    ///
    /// Panics without a point, or with more than there are.
    pub fn new(generator: &'a Generator, n_points: usize) -> Self {
        let mean_style = Tensor::zeros([1, generator.n_style()], &generator.deviations().device());
        let mean_shape = host_points(&generator.forward(mean_style));
        assert!((1..=mean_shape.len()).contains(&n_points), "{n_points} points");
        Self { generator, point_idx: farthest_points(&mean_shape, n_points) }
    }

    /// How many there are.
    pub fn n_points(&self) -> usize {
        self.point_idx.len()
    }
}

/// Gradients, and differences of neighbouring styles, pass through the choice, which is fixed.
impl ShapeModel for PointSubset<'_> {
    fn points(&self, style: Tensor<2>) -> Tensor<3> {
        let points = self.generator.forward(style);
        let point_idx = index_tensor(self.point_idx.clone(), &points);
        points.select(1, point_idx)
    }
}

/// The first point, then time and again the one that is farthest from all before it; in ascending order.
pub(super) fn farthest_points(points: &[[f32; 3]], n: usize) -> Vec<i64> {
    let squared = |a: [f32; 3], b: [f32; 3]| -> f32 { (0..3).map(|i| (a[i] - b[i]).powi(2)).sum() };
    // To the nearest of those chosen, which themselves are out of the running.
    let mut distances = vec![f32::INFINITY; points.len()];
    let mut chosen = Vec::with_capacity(n);
    let mut next = 0;
    while chosen.len() < n {
        chosen.push(next as i64);
        distances[next] = f32::NEG_INFINITY;
        let (latest, mut farthest) = (points[next], f32::NEG_INFINITY);
        for (idx, (distance, &point)) in distances.iter_mut().zip(points).enumerate() {
            *distance = distance.min(squared(point, latest));
            if *distance > farthest {
                (next, farthest) = (idx, *distance);
            }
        }
    }
    chosen.sort();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        data::keyed_rng,
        nearest_neighbours::NearestNeighbours,
        shape_prior::{ShapePrior, ShapePriorConfig},
    };
    use burn::tensor::{Device, Distribution, TensorData, Tolerance, s};
    use rand::Rng;

    fn prior(device: &Device) -> ShapePrior {
        let config = ShapePriorConfig {
            n_latent: 6,
            n_fc_points: 64,
            grid_side: 16,
            grid_channels: 16,
            ..Default::default()
        };
        let mut rng = keyed_rng(1, [0, 0]);
        let template: Vec<_> = (0..config.n_points()).map(|_| rng.random()).collect();
        device.seed(1);
        config.init(&template, device)
    }

    #[test]
    fn a_subset_is_some_of_the_points_of_every_style_each_once() {
        let device = Device::flex();
        let prior = prior(&device);
        let subset = PointSubset::new(&prior.generator, 100);
        let styles = Tensor::random([2, 6], Distribution::Default, &device);
        let [all, some] = [&prior.generator as &dyn ShapeModel, &subset]
            .map(|shape| shape.points(styles.clone()));
        assert_eq!((some.dims(), subset.n_points()), ([2, 100, 3], 100));
        let cloud = |clouds: &Tensor<3>, i: i32| host_points(&clouds.clone().slice(s![i..i + 1]));
        let places = |i| -> Vec<_> {
            let (all, some) = (cloud(&all, i), cloud(&some, i));
            some.iter().map(|point| all.iter().position(|other| other == point)).collect()
        };
        assert!(places(0).iter().all(Option::is_some) && places(0) == places(1));
        assert!(places(0).windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn gradients_are_those_of_the_chosen_points_alone() {
        let device = Device::flex().autodiff();
        let prior = prior(&device.clone().inner());
        let subset = PointSubset::new(&prior.generator, 30);
        let mut weights = vec![[0.0f32; 3]; prior.generator.n_points()];
        subset.point_idx.iter().for_each(|&i| weights[i as usize] = [1.0; 3]);
        let weights = TensorData::new(weights.concat(), [1, weights.len(), 3]);
        let weights = Tensor::<3>::from_data(weights, &device.clone().inner());

        let gradient = |loss: &dyn Fn(Tensor<2>) -> Tensor<1>| {
            let style = Tensor::<2>::from_floats([[0.3, -0.5, 0.1, 1.0, -1.0, 0.2]], &device);
            let style = style.require_grad();
            let gradients = loss(style.clone()).backward();
            style.grad(&gradients).expect("points depend on the style").into_data()
        };
        let of_subset = gradient(&|style| subset.points(style).sin().sum());
        let of_weighted =
            gradient(&|style| (prior.generator.forward(style).sin() * weights.clone()).sum());
        assert!(of_subset.iter::<f32>().all(|slope| slope != 0.0));
        of_subset.assert_approx_eq::<f32>(&of_weighted, Tolerance::default());
    }

    #[test]
    fn chosen_points_leave_smaller_gaps_than_every_fourth() {
        let mut rng = keyed_rng(2, [0, 0]);
        let points: Vec<[f32; 3]> = (0..400).map(|_| rng.random()).collect();
        let widest_gap = |idx: Vec<i64>| {
            let chosen: Vec<_> = idx.iter().map(|&i| points[i as usize]).collect();
            let neighbours = NearestNeighbours::new(&chosen);
            let gap = |point: &[f32; 3]| {
                let nearest = chosen[neighbours.nearest(*point) as usize];
                (0..3).map(|i| (point[i] - nearest[i]).powi(2)).sum::<f32>().sqrt()
            };
            points.iter().map(gap).fold(0.0, f32::max)
        };
        let every_fourth = (0..100).map(|i| 4 * i).collect();
        assert!(widest_gap(farthest_points(&points, 100)) < 0.8 * widest_gap(every_fourth));
    }

    #[test]
    fn points_that_coincide_are_chosen_once_each() {
        assert_eq!(farthest_points(&[[0.5; 3]; 4], 4), [0, 1, 2, 3]);
    }
}
