//! R_s: the style of the object in a crop.

use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor},
};

/// R_s, a linear head: whitened styles need no other scale or offset.
#[derive(Module, Debug)]
pub struct StyleRegressor {
    output: Linear,
}

impl StyleRegressor {
    pub(super) fn new(feature_width: usize, n_style: usize, device: &Device) -> Self {
        Self { output: LinearConfig::new(feature_width, n_style).init(device) }
    }

    pub(super) fn device(&self) -> Device {
        self.output.weight.device()
    }

    /// Styles `[b, k]` from the trunk's features `[b, width]`.
    pub fn forward(&self, features: Tensor<2>) -> Tensor<2> {
        self.output.forward(features)
    }

    /// The squared error of the latent, as a share of its variance: 1 for the mean shape.
    ///
    /// `deviations`, `[k]`, are those of the latent along each style direction. Without them, the
    /// many directions along which shapes hardly differ would have the say.
    pub fn loss(&self, styles: Tensor<2>, targets: Tensor<2>, deviations: Tensor<1>) -> Tensor<1> {
        let variance = deviations.clone().square().sum();
        let error = (styles - targets) * deviations.unsqueeze();
        error.square().sum_dim(1).mean() / variance
    }
}
