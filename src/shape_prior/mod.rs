//! The shape prior: an autoencoder whose generator turns a style into a cloud (Sec. 2.2).
//!
//! The paper's appendix, where its layers are, is not public. Like its source (Fan et al. 2017),
//! ours has a fully connected branch for what is particular and a deconvolution branch for what is
//! smooth; both move the points of a learned template.

mod encoder;
mod fit;
mod generator;
mod whitening;

pub use encoder::PointEncoder;
pub use generator::Generator;
pub use whitening::Whitening;

use burn::{
    module::Module,
    tensor::{Device, Tensor},
};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Side of the coarsest grid of the deconvolution branch.
pub(crate) const COARSEST_SIDE: usize = 4;

/// The sizes of the autoencoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapePriorConfig {
    /// Numbers in a latent; the style keeps those directions along which shapes differ.
    pub n_latent: usize,
    /// Points that the encoder is trained on; it sees other numbers less well.
    pub n_encoder_points: usize,
    /// Widths of the layers that see a point alone.
    pub encoder_widths: [usize; 3],
    /// Points of the fully connected branch, and the width of its last hidden layer.
    pub n_fc_points: usize,
    pub fc_width: usize,
    /// Side of the deconvolution branch's grid of points, 4 · 2ⁱ.
    pub grid_side: usize,
    /// Channels of its 4 × 4 grid; every doubling of the side halves them, down to 16.
    pub grid_channels: usize,
    /// Whether shapes look the same in the mirror, x ↦ −x. Either branch then has half of its points
    /// to decode, and half of the grid's columns.
    pub symmetric: bool,
}

impl Default for ShapePriorConfig {
    fn default() -> Self {
        Self {
            n_latent: 64,
            n_encoder_points: 1024,
            encoder_widths: [64, 128, 256],
            n_fc_points: 2048,
            fc_width: 512,
            grid_side: 64,
            grid_channels: 128,
            symmetric: false,
        }
    }
}

impl ShapePriorConfig {
    /// N, the points of a generated cloud.
    pub fn n_points(&self) -> usize {
        self.n_fc_points + self.grid_side * self.grid_side
    }

    /// How often each decoded point appears in a cloud.
    fn copies(&self) -> usize {
        if self.symmetric { 2 } else { 1 }
    }

    /// Why no network has these sizes, if none has.
    pub fn check(&self) -> Result<(), String> {
        let (n_latent, n_encoder_points) = (self.n_latent, self.n_encoder_points);
        let sizes =
            [n_latent, n_encoder_points, self.n_fc_points, self.fc_width, self.grid_channels];
        if sizes.iter().chain(&self.encoder_widths).any(|&size| size == 0) {
            return Err("the sizes of the shape prior must be positive".into());
        }
        if n_encoder_points > self.n_points() {
            return Err(format!("n_encoder_points must be at most {}", self.n_points()));
        }
        if self.symmetric && !self.n_fc_points.is_multiple_of(2) {
            return Err("n_fc_points must be even where shapes are symmetric".into());
        }
        let doublings = self.grid_side / COARSEST_SIDE;
        if !self.grid_side.is_multiple_of(COARSEST_SIDE) || !doublings.is_power_of_two() {
            return Err(format!("grid_side is {}, not 4, 8, 16, 32, …", self.grid_side));
        }
        Ok(())
    }

    /// A prior to train: its style is its latent, and every shape is the template.
    ///
    /// The template, of [`n_points`](Self::n_points), are points of real shapes.
    pub fn init(&self, template: &[[f32; 3]], device: &Device) -> ShapePrior {
        ShapePrior {
            encoder: PointEncoder::new(self, device),
            generator: Generator::new(self, template, self.n_latent, device),
        }
    }

    /// A prior of `n_style` whitened directions whose weights are to be loaded over.
    pub fn init_empty(&self, n_style: usize, device: &Device) -> ShapePrior {
        let template = vec![[0.0; 3]; self.n_points()];
        ShapePrior {
            encoder: PointEncoder::new(self, device),
            generator: Generator::new(self, &template, n_style, device),
        }
    }
}

/// The autoencoder of shapes in their canonical pose.
#[derive(Module, Debug)]
pub struct ShapePrior {
    pub encoder: PointEncoder,
    /// G, with the whitening of its argument.
    pub generator: Generator,
}

impl ShapePrior {
    /// Numbers in a style.
    pub fn n_style(&self) -> usize {
        self.generator.n_style()
    }

    /// Styles `[b, k]` of clouds `[b, n, 3]`, in world units; any number of surface points will do.
    pub fn encode(&self, points: Tensor<3>) -> Tensor<2> {
        self.generator.whitening.style_from_latent(self.encoder.forward(points))
    }

    /// The same prior, with styles that are white over these `latents`, one row a training shape.
    pub fn whiten(mut self, latents: &DMatrix<f64>, device: &Device) -> Self {
        self.generator.whitening = Whitening::fit(latents, device);
        self
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use burn::tensor::Distribution;

    pub fn tiny() -> ShapePriorConfig {
        ShapePriorConfig {
            n_latent: 6,
            n_encoder_points: 50,
            encoder_widths: [8, 8, 16],
            n_fc_points: 64,
            fc_width: 32,
            grid_side: 8,
            grid_channels: 16,
            symmetric: false,
        }
    }

    #[test]
    fn the_presets_of_the_paper_have_its_numbers_of_points() {
        for (n_fc_points, grid_side, n) in [(8192, 128, 24_576), (512, 32, 1536)] {
            let config = ShapePriorConfig { n_fc_points, grid_side, ..Default::default() };
            assert_eq!(config.n_points(), n);
            assert!(config.check().is_ok());
        }
    }

    #[test]
    fn sizes_without_a_network_are_refused() {
        for grid_side in [0, 2, 12, 100] {
            assert!(ShapePriorConfig { grid_side, ..Default::default() }.check().is_err());
        }
        assert!(ShapePriorConfig { n_latent: 0, ..Default::default() }.check().is_err());
    }

    #[test]
    fn the_order_of_the_points_does_not_change_their_style() {
        let device = Device::flex();
        let prior = tiny().init(&vec![[0.0; 3]; 128], &device);
        let points = Tensor::<3>::random([2, 50, 3], Distribution::Default, &device);
        let style = prior.encode(points.clone()).into_data();
        prior.encode(points.flip([1])).into_data().assert_eq(&style, true);
    }

    #[test]
    fn a_frozen_prior_passes_gradients_to_the_style_only() {
        let device = Device::flex().autodiff();
        let prior = tiny().init(&vec![[0.1; 3]; 128], &device).freeze();
        let style = Tensor::<2>::ones([1, 6], &device).require_grad();
        let points = prior.generator.forward(style.clone());
        let gradients = points.square().sum().backward();

        let gradient = style.grad(&gradients).expect("points depend on the style");
        assert!(gradient.abs().sum().into_scalar::<f32>() > 0.0);
        let parameters = burn::optim::GradientsParams::from_grads(gradients, &prior);
        assert!(parameters.is_empty());
    }
}
