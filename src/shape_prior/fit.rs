//! The style that suits a cloud best, found on the generator itself.

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};

use super::ShapePrior;
use crate::{
    bundle_adjustment::lbfgs::{LbfgsConfig, minimise},
    chamfer::chamfer_distance,
    host::host_values,
};

impl ShapePrior {
    /// Lowers the Chamfer distance (Eq. 7) between a cloud `[1, n, 3]`, in world units, and what its
    /// style decodes to, by L-BFGS from a style `[1, k]`, such as the encoder's.
    ///
    /// What error remains is what the generator cannot express; the encoder adds its own, above all
    /// for shapes unlike those that it has seen.
    pub fn fit(&self, cloud: Tensor<3>, style: Tensor<2>, iterations: usize) -> Tensor<2> {
        let device = style.device().autodiff();
        let generator = self.generator.clone().fork(&device).freeze();
        let cloud = Tensor::<3>::from_data(cloud.into_data(), &device);
        let objective = |x: &[f64]| {
            let style = row(x, &device).require_grad();
            let distance = chamfer_distance(generator.forward(style.clone()), cloud.clone());
            let value = f64::from(host_values(&distance)[0]);
            let gradient = style.grad(&distance.backward()).expect("the distance depends on it");
            (value, host_values(&gradient).into_iter().map(f64::from).collect())
        };
        let config = LbfgsConfig {
            max_iterations: iterations,
            max_evaluations: 2 * iterations,
            gradient_tolerance: 0.0,
            relative_tolerance: 1e-4,
            first_step: 0.1,
            ..LbfgsConfig::default()
        };
        let start: Vec<f64> = host_values(&style).into_iter().map(f64::from).collect();
        row(&minimise(objective, &start, &config).x, &style.device())
    }
}

/// `[1, k]`
fn row(values: &[f64], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = values.iter().map(|&value| value as f32).collect();
    let shape = [1, values.len()];
    Tensor::from_data(TensorData::new(values, shape), device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        data::keyed_rng,
        shape_prior::{ShapePrior, tests::tiny},
    };
    use burn::tensor::Distribution;
    use rand::Rng;

    fn prior(device: &Device) -> ShapePrior {
        let mut rng = keyed_rng(3, [0, 0]);
        let template: Vec<[f32; 3]> = (0..tiny().n_points()).map(|_| rng.random()).collect();
        tiny().init(&template, device)
    }

    #[test]
    fn a_decoded_style_is_fitted_by_a_style_that_decodes_to_the_same() {
        let device = Device::flex();
        let prior = prior(&device);
        let decode = |style: Tensor<2>| prior.generator.forward(style);
        let style = || Tensor::random([1, prior.n_style()], Distribution::Default, &device);
        let (cloud, start) = (decode(style()), style());

        let error =
            |style: Tensor<2>| host_values(&chamfer_distance(decode(style), cloud.clone()))[0];
        let fitted = prior.fit(cloud.clone(), start.clone(), 60);
        let (before, after) = (error(start), error(fitted));
        assert!(after < 0.05 * before, "{before} to {after}");
    }
}
