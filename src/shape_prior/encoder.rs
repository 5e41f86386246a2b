//! From a cloud to its latent.

use burn::{
    module::{Module, Param},
    nn::{BatchNorm, BatchNormConfig, Linear},
    tensor::{Device, Tensor, activation::relu},
};

use super::ShapePriorConfig;
use crate::layers::{each_row, rectified_linear};

/// Layers that see one point each, the maximum over points, then layers that see them all.
///
/// Normalising the pooled feature and the latent keeps the autoencoder from collapsing: without,
/// its cheapest way down from the template is to decode the mean shape whatever the input.
#[derive(Module, Debug)]
pub struct PointEncoder {
    point_layers: [Linear; 3],
    pooled_norm: BatchNorm,
    hidden: Linear,
    hidden_norm: BatchNorm,
    output: Linear,
    latent_norm: BatchNorm,
}

impl PointEncoder {
    pub(super) fn new(config: &ShapePriorConfig, device: &Device) -> Self {
        let [a, b, c] = config.encoder_widths;
        let k = config.n_latent;
        Self {
            point_layers: [(3, a), (a, b), (b, c)].map(|(i, o)| rectified_linear(i, o, device)),
            pooled_norm: BatchNormConfig::new(c).init(device),
            hidden: rectified_linear(c, c, device),
            hidden_norm: BatchNormConfig::new(c).init(device),
            output: rectified_linear(c, k, device),
            // Without weights, so that no direction of the latent can fade away.
            latent_norm: BatchNormConfig::new(k).init(device).no_grad(),
        }
    }

    /// The same encoder, also on a device that trains, with the statistics that it has gathered.
    ///
    /// Those of a batch make a shape's latent depend on the shapes beside it: a noise that keeps
    /// the generator from becoming exact.
    pub fn with_running_statistics(&self) -> Self {
        let settled =
            |norm: &BatchNorm| BatchNorm { training: Param::from_bool(false), ..norm.clone() };
        Self {
            pooled_norm: settled(&self.pooled_norm),
            hidden_norm: settled(&self.hidden_norm),
            latent_norm: settled(&self.latent_norm),
            ..self.clone()
        }
    }

    /// Latents `[b, k]` of clouds `[b, n, 3]`, in world units.
    pub fn forward(&self, points: Tensor<3>) -> Tensor<2> {
        let [first, second, third] = &self.point_layers;
        let features = relu(each_row(second, relu(each_row(first, points))));
        let pooled = each_row(third, features).max_dim(1).squeeze_dim(1); // [b, c]

        let pooled = relu(self.pooled_norm.forward::<2>(pooled));
        let hidden = relu(self.hidden_norm.forward(self.hidden.forward(pooled)));
        self.latent_norm.forward(self.output.forward(hidden))
    }
}
