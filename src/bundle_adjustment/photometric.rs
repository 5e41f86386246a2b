//! L_ph (Eq. 3), on the graph.

use burn::tensor::{DType, Tensor, TensorData, s};
use rayon::prelude::*;

use super::{
    correspondences::Correspondences,
    exposure::Exposure,
    objective::{Objective, Reduction, Scene},
};
use crate::loss::charbonnier;

impl Objective<'_> {
    /// L_ph (Eq. 3), over the points that the reference frame sees, and each target's exposure.
    pub(super) fn photometric(
        &self,
        matches: &Correspondences,
        scene: &Scene,
        level: usize,
    ) -> (Tensor<1>, Vec<Exposure>) {
        let points = &scene.points;
        let [_, n, _] = points.dims();
        let (n_targets, seen) = (matches.frames.len() - 1, &matches.visible[0]);
        let mut exposures = vec![Exposure::NEUTRAL; n_targets];
        if n_targets == 0 {
            return (Tensor::zeros([1], &points.device()), exposures);
        }
        if seen.is_empty() {
            // Nothing to compare is the worst that can be, not the best: all three channels of
            // every point are as wrong as colours can be.
            let worst = match self.config.reduction {
                Reduction::Sum => 3.0 * (n_targets * n) as f32,
                Reduction::Mean => 3.0,
            };
            return (Tensor::from_floats([worst], &points.device()), exposures);
        }
        let point_idx = seen.iter().map(|&i| i64::from(i)).collect();
        let pixels = self.pixels(scene, point_idx, &scene.poses);
        let images = &self.observations.images[level];
        let colors = images.sample_bilinear(&matches.frames, pixels);
        let (reference, mut targets) = (colors.clone().slice(s![0..1]), colors.slice(s![1..]));
        if self.config.solve_exposure {
            // By the envelope theorem, what minimises the loss is constant as far as gradients go.
            exposures = self.exposures(&reference, &targets, matches);
            targets = exposed(targets, &exposures);
        }
        let residuals = reference - targets; // [t, m, 3]
        let mut squared = residuals.square().sum_dim(2).squeeze_dim::<2>(2);
        if self.config.robust_scale > 0.0 {
            squared = charbonnier(squared, self.config.robust_scale);
        }
        let weights = TensorData::new(matches.comparable.concat(), [n_targets, seen.len()]);
        let sum = (squared * Tensor::from_data(weights, &self.device.clone().inner())).sum();
        let loss = match self.config.reduction {
            Reduction::Sum => sum,
            Reduction::Mean => sum / matches.n_compared(),
        };
        (loss, exposures)
    }

    /// The exposure of each target, from the colours `[1, m, 3]` and `[t, m, 3]` that are compared.
    fn exposures(
        &self,
        reference: &Tensor<3>,
        targets: &Tensor<3>,
        matches: &Correspondences,
    ) -> Vec<Exposure> {
        let (reference, targets) = (host_colors(reference), host_colors(targets));
        let of_target = |(target, comparable): (&[[f64; 3]], &Vec<f32>)| {
            let pairs =
                reference.iter().zip(target).map(|(&reference, &target)| [reference, target]);
            let compared = pairs.zip(comparable).filter(|(_, weight)| **weight > 0.0);
            let compared: Vec<_> = compared.map(|(pair, _)| pair).collect();
            Exposure::between(&compared, f64::from(self.config.robust_scale))
        };
        targets.par_chunks(reference.len()).zip(&matches.comparable).map(of_target).collect()
    }
}

/// gain · I_l + bias, of colours `[t, m, 3]`.
fn exposed(colors: Tensor<3>, exposures: &[Exposure]) -> Tensor<3> {
    let device = colors.device().inner();
    let column = |value: fn(&Exposure) -> f64| {
        let values: Vec<f64> = exposures.iter().map(value).collect();
        Tensor::<3>::from_data(TensorData::new(values, [exposures.len(), 1, 1]), &device)
    };
    colors * column(|exposure| exposure.gain) + column(|exposure| exposure.bias)
}

/// Colours on the host, in double precision: one list over all frames.
fn host_colors(colors: &Tensor<3>) -> Vec<[f64; 3]> {
    let values = colors.clone().inner().into_data().convert_dtype(DType::F64);
    values.try_into_vec::<f64>().expect("f64").as_chunks::<3>().0.to_vec()
}
