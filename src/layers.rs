//! Convolutions as matrix products, over pictures `[b, h, w, c]`.
//!
//! Patches are reshapes and windows are slices, so that every backend spends its time in the one
//! operation that all of them do fast: burn-ndarray's own convolutions are scalar loops.

use burn::{
    module::Module,
    nn::{Initializer, Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData, ops::PadMode},
};

/// A convolution with kernel `stride · window` and zero padding `padding`.
///
/// `stride × stride` patches become pixels; then `window × window` of these are seen at a time.
#[derive(Clone, Copy, Debug)]
pub struct ConvConfig {
    pub channels: [usize; 2],
    pub stride: usize,
    pub window: usize,
    pub padding: usize,
}

#[derive(Module, Debug)]
pub struct Conv {
    linear: Linear,
    #[module(skip)]
    config: ConvConfig,
}

impl ConvConfig {
    /// 3 × 3: keeps the size.
    pub fn same(channels: [usize; 2]) -> Self {
        Self { channels, stride: 1, window: 3, padding: 1 }
    }

    /// 4 × 4 at every second pixel: halves the size.
    pub fn halving(channels: [usize; 2]) -> Self {
        Self { channels, stride: 2, window: 2, padding: 1 }
    }

    pub fn init(&self, device: &Device) -> Conv {
        let kernel = self.stride * self.window;
        let linear = rectified_linear(kernel * kernel * self.channels[0], self.channels[1], device);
        Conv { linear, config: *self }
    }
}

impl Conv {
    /// `[b, h, w, c]` to `[b, h', w', c']`, with `h' = (h + 2 padding) / stride − window + 1`.
    pub fn forward(&self, picture: Tensor<4>) -> Tensor<4> {
        let ConvConfig { stride, window, padding, .. } = self.config;
        each_row(&self.linear, windows(patches(pad(picture, padding), stride), window))
    }
}

/// Doubles the size: every pixel becomes 2 × 2 (a transposed convolution, kernel and stride 2).
#[derive(Module, Debug)]
pub struct Upsample {
    linear: Linear,
}

impl Upsample {
    pub fn new(channels: [usize; 2], device: &Device) -> Self {
        Self { linear: rectified_linear(channels[0], 4 * channels[1], device) }
    }

    /// `[b, h, w, c]` to `[b, 2h, 2w, c']`.
    pub fn forward(&self, picture: Tensor<4>) -> Tensor<4> {
        let [b, h, w, _] = picture.dims();
        let blocks = each_row(&self.linear, picture); // [b, h, w, 2 · 2 · c']
        let c = blocks.dims()[3] / 4;
        blocks.reshape([b, h, w, 2, 2, c]).permute([0, 1, 3, 2, 4, 5]).reshape([b, 2 * h, 2 * w, c])
    }
}

/// A linear layer along the last axis, as one product of matrices.
///
/// Burn makes a product for each picture's row of it where it thinks that these fill the machine; on
/// CPUs they do not.
pub fn each_row<const D: usize>(linear: &Linear, input: Tensor<D>) -> Tensor<D> {
    let mut dims = input.dims();
    let n_rows = dims[..D - 1].iter().product();
    let output = linear.forward(input.reshape([n_rows, dims[D - 1]]));
    dims[D - 1] = output.dims()[1];
    output.reshape(dims)
}

/// A linear layer whose weights keep the variance of activations that pass a ReLU next.
pub fn rectified_linear(d_input: usize, d_output: usize, device: &Device) -> Linear {
    let mut linear = LinearConfig::new(d_input, d_output)
        .with_initializer(Initializer::KaimingUniform { gain: 2f64.sqrt(), fan_out_only: false })
        .init(device);
    linear.bias = Some(Initializer::Zeros.init([d_output], device));
    linear
}

fn pad(picture: Tensor<4>, padding: usize) -> Tensor<4> {
    match padding {
        0 => picture,
        p => picture.pad([(0, 0), (p, p), (p, p), (0, 0)], PadMode::Constant(0.0)),
    }
}

/// `[b, h, w, c]` to `[b, h/p, w/p, p · p · c]`: every patch becomes a pixel.
fn patches(picture: Tensor<4>, p: usize) -> Tensor<4> {
    let [b, h, w, c] = picture.dims();
    let (rows, columns) = (h / p, w / p);
    picture.reshape([b, rows, p, columns, p * c]).permute([0, 1, 3, 2, 4]).reshape([
        b,
        rows,
        columns,
        p * p * c,
    ])
}

/// `[b, h, w, c]` to `[b, h − k + 1, w − k + 1, k · k · c]`: every window becomes a pixel.
///
/// One `select` of pixel rows; joining shifted slices along the channels takes 20 times as long.
fn windows(picture: Tensor<4>, k: usize) -> Tensor<4> {
    if k == 1 {
        return picture;
    }
    let [b, h, w, c] = picture.dims();
    let (rows, columns) = (h - k + 1, w - k + 1);
    let mut pixel_idx = Vec::with_capacity(b * rows * columns * k * k);
    for (picture, row, column) in iproduct(b, rows, columns) {
        for (dy, dx) in (0..k * k).map(|i| (i / k, i % k)) {
            pixel_idx.push((((picture * h) + row + dy) * w + column + dx) as i64);
        }
    }
    let n = pixel_idx.len();
    let pixel_idx = Tensor::from_data(TensorData::new(pixel_idx, [n]), &picture.device());
    picture.reshape([b * h * w, c]).select(0, pixel_idx).reshape([b, rows, columns, k * k * c])
}

fn iproduct(a: usize, b: usize, c: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..a * b * c).map(move |i| (i / (b * c), i / c % b, i % c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Distribution, Tolerance, module::conv2d, ops::ConvOptions};

    /// Against Burn's own convolution, whose kernels are `[c', c, y, x]`.
    #[track_caller]
    fn check_against_conv2d(config: ConvConfig) {
        let device = Device::flex();
        let ConvConfig { channels: [c, c_out], stride, window, padding } = config;
        let conv = config.init(&device);
        let picture = Tensor::random([2, 8, 12, c], Distribution::Default, &device);

        // Our rows are [window y, window x, patch y, patch x, c].
        let kernel = conv
            .linear
            .weight
            .val()
            .reshape([window, window, stride, stride, c, c_out])
            .permute([5, 4, 0, 2, 1, 3])
            .reshape([c_out, c, window * stride, window * stride]);
        let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
        let expected = conv2d(picture.clone().permute([0, 3, 1, 2]), kernel, None, options);

        let actual = conv.forward(picture).permute([0, 3, 1, 2]);
        actual.into_data().assert_approx_eq::<f32>(&expected.into_data(), Tolerance::default());
    }

    #[test]
    fn a_3x3_convolution_is_burns() {
        check_against_conv2d(ConvConfig::same([3, 5]));
    }

    #[test]
    fn a_halving_convolution_is_burns() {
        check_against_conv2d(ConvConfig::halving([3, 5]));
    }

    #[test]
    fn a_patch_convolution_is_burns() {
        check_against_conv2d(ConvConfig { channels: [3, 5], stride: 4, window: 1, padding: 0 });
    }

    #[test]
    fn upsampling_puts_the_block_of_a_pixel_where_the_pixel_was() {
        let device = Device::flex();
        let mut upsample = Upsample::new([1, 1], &device);
        let weight = Tensor::<2>::from_floats([[1., 2., 3., 4.]], &device);
        upsample.linear.weight = burn::module::Param::from_tensor(weight);
        let picture = Tensor::<2>::from_floats([[1., 10.]], &device).reshape([1, 1, 2, 1]);
        let expected = [[1., 2., 10., 20.], [3., 4., 30., 40.]];
        let actual = upsample.forward(picture).reshape([2, 4]);
        actual
            .into_data()
            .assert_eq(&Tensor::<2>::from_floats(expected, &device).into_data(), true);
    }
}
