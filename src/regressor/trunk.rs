//! The convolutions that both regressors share.

use burn::{
    module::Module,
    nn::{BatchNorm, BatchNormConfig, Linear},
    tensor::{Device, Tensor, activation::relu},
};

use super::RegressorConfig;
use crate::{
    data::{ColorImage, ScalarImage},
    layers::{Conv, ConvConfig, rectified_linear},
};

/// From a crop to the feature that the heads read.
#[derive(Module, Debug)]
pub struct Trunk {
    blocks: Vec<Block>,
    output: Linear,
}

/// A convolution, normalised and rectified.
#[derive(Module, Debug)]
struct Block {
    conv: Conv,
    norm: BatchNorm,
}

impl Trunk {
    pub(crate) fn new(config: &RegressorConfig, device: &Device) -> Self {
        let mut blocks = Vec::new();
        let mut previous = 4;
        for (i, &channels) in config.channels.iter().enumerate() {
            blocks.push(Block::new(ConvConfig::halving([previous, channels]), device));
            // At the finest size, a second convolution would cost as much as all others.
            if i > 0 {
                blocks.push(Block::new(ConvConfig::same([channels, channels]), device));
            }
            previous = channels;
        }
        let side = config.crop_size >> config.channels.len();
        let n_features = side * side * previous + 1;
        Self { blocks, output: rectified_linear(n_features, config.feature_width, device) }
    }

    /// Features `[b, width]` of crops `[b, size, size, 4]`, see [`crop_values`].
    ///
    /// `focal_ratios`, `[b, 1]`, are focal lengths in units of the crop's side: perspective tells
    /// how far an object of this size is, and how its near side is magnified.
    pub fn forward(&self, crops: Tensor<4>, focal_ratios: Tensor<2>) -> Tensor<2> {
        let grid = self.blocks.iter().fold(crops, |grid, block| block.forward(grid));
        let features = Tensor::cat(vec![grid.flatten::<2>(1, 3), focal_ratios.log()], 1);
        relu(self.output.forward(features))
    }
}

impl Block {
    fn new(conv: ConvConfig, device: &Device) -> Self {
        Self { conv: conv.init(device), norm: BatchNormConfig::new(conv.channels[1]).init(device) }
    }

    fn forward(&self, picture: Tensor<4>) -> Tensor<4> {
        let picture = self.conv.forward(picture);
        let [b, h, w, c] = picture.dims();
        relu(self.norm.forward::<2>(picture.reshape([b * h * w, c]))).reshape([b, h, w, c])
    }
}

/// What the trunk sees of a crop, pixel by pixel: RGB on black outside the mask, and the mask.
pub fn crop_values(color: &ColorImage, mask: &ScalarImage) -> Vec<f32> {
    let pixels = color.pixels().zip(mask.pixels());
    pixels
        .flat_map(|(rgb, m)| {
            let [red, green, blue] = rgb.0.map(|value| (value * m.0[0]).clamp(0.0, 1.0));
            [red, green, blue, m.0[0]]
        })
        .collect()
}
