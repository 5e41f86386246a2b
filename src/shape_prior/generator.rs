//! From a style to its cloud: G(s) = X.

use burn::{
    module::{Module, Param},
    nn::{Initializer, Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData, activation::relu},
};

use super::{COARSEST_SIDE, ShapePriorConfig, Whitening};
use crate::layers::{Conv, ConvConfig, Upsample, rectified_linear};

/// First hidden layer of both branches.
const HIDDEN: usize = 256;
/// Channels of the finest grids.
const FEWEST_CHANNELS: usize = 16;
/// The output layers start out this small, in world units: training starts at the template.
const OUTPUT_WEIGHT: f64 = 0.01;

/// G: a template of points, moved by two branches that see the style.
#[derive(Module, Debug)]
pub struct Generator {
    pub(super) whitening: Whitening,
    template: Param<Tensor<2>>, // [n, 3]: first the points of the FC branch, then those of the grid
    fc: [Linear; 2],
    fc_output: Linear,
    grid: [Linear; 2],
    upsamples: Vec<Upsample>,
    /// Lets neighbouring cells of the grid agree on their border, before the last doubling.
    refine: Conv,
    grid_output: Linear,
    #[module(skip)]
    grid_channels: usize,
}

impl Generator {
    pub(super) fn new(
        config: &ShapePriorConfig,
        template: &[[f32; 3]],
        n_style: usize,
        device: &Device,
    ) -> Self {
        let k = config.n_latent;
        let whitening = match n_style == k {
            true => Whitening::identity(k, device),
            false => Whitening::zeros(n_style, k, device),
        };
        let doublings = (config.grid_side / COARSEST_SIDE).ilog2();
        let channels: Vec<usize> = (0..=doublings)
            .map(|i| (config.grid_channels >> i).max(FEWEST_CHANNELS.min(config.grid_channels)))
            .collect();
        let upsamples = channels.windows(2).map(|c| Upsample::new([c[0], c[1]], device)).collect();
        let penultimate = channels[channels.len().saturating_sub(2)];
        let coarsest = COARSEST_SIDE * COARSEST_SIDE * channels[0];
        Self {
            whitening,
            template: template_param(template, config, device),
            fc: [(k, HIDDEN), (HIDDEN, config.fc_width)]
                .map(|(i, o)| rectified_linear(i, o, device)),
            fc_output: output_layer(config.fc_width, 3 * config.n_fc_points, device),
            grid: [(k, HIDDEN), (HIDDEN, coarsest)].map(|(i, o)| rectified_linear(i, o, device)),
            upsamples,
            refine: ConvConfig::same([penultimate, penultimate]).init(device),
            grid_output: output_layer(channels[channels.len() - 1], 3, device),
            grid_channels: channels[0],
        }
    }

    /// Numbers in a style.
    pub fn n_style(&self) -> usize {
        self.whitening.n_style()
    }

    pub fn n_points(&self) -> usize {
        self.template.dims()[0]
    }

    /// Standard deviation of the latent along each style direction, `[k]`, largest first.
    pub fn deviations(&self) -> Tensor<1> {
        self.whitening.deviations()
    }

    /// Clouds `[b, n, 3]`, in world units, of styles `[b, k]`.
    pub fn forward(&self, style: Tensor<2>) -> Tensor<3> {
        let latent = self.whitening.latent_from_style(style);
        let offsets =
            Tensor::cat(vec![self.fc_branch(latent.clone()), self.grid_branch(latent)], 1);
        self.template.val().unsqueeze() + offsets
    }

    fn fc_branch(&self, latent: Tensor<2>) -> Tensor<3> {
        let [b, _] = latent.dims();
        let [first, second] = &self.fc;
        let hidden = relu(second.forward(relu(first.forward(latent))));
        self.fc_output.forward(hidden).reshape([b as i32, -1, 3])
    }

    fn grid_branch(&self, latent: Tensor<2>) -> Tensor<3> {
        let [b, _] = latent.dims();
        let [first, second] = &self.grid;
        let coarsest = relu(second.forward(relu(first.forward(latent))));
        let mut grid = coarsest.reshape([b, COARSEST_SIDE, COARSEST_SIDE, self.grid_channels]);
        for (i, upsample) in self.upsamples.iter().enumerate() {
            if i + 1 == self.upsamples.len() {
                grid = relu(self.refine.forward(grid));
            }
            grid = relu(upsample.forward(grid));
        }
        self.grid_output.forward(grid).reshape([b as i32, -1, 3])
    }
}

fn output_layer(d_input: usize, d_output: usize, device: &Device) -> Linear {
    let initializer = Initializer::Uniform { min: -OUTPUT_WEIGHT, max: OUTPUT_WEIGHT };
    // The template is the bias.
    LinearConfig::new(d_input, d_output).with_bias(false).with_initializer(initializer).init(device)
}

fn template_param(
    points: &[[f32; 3]],
    config: &ShapePriorConfig,
    device: &Device,
) -> Param<Tensor<2>> {
    let (fc, grid) = points.split_at(config.n_fc_points);
    let mut ordered = fc.to_vec();
    ordered.resize(config.n_points(), [0.0; 3]);
    let cells = &mut ordered[config.n_fc_points..];
    lay_out(&mut grid.to_vec(), cells, config.grid_side, [0, 0], config.grid_side);
    Param::from_data(TensorData::new(ordered.concat(), [config.n_points(), 3]), device)
}

/// Lays points out on a square of the grid so that neighbours in space are neighbours on it, as
/// the deconvolutions assume: each half of the square takes a half of the points along the axis
/// of their greatest extent.
fn lay_out(
    points: &mut [[f32; 3]],
    cells: &mut [[f32; 3]],
    stride: usize,
    [row, column]: [usize; 2],
    side: usize,
) {
    if side == 1 {
        cells[row * stride + column] = points[0];
        return;
    }
    let half = side / 2;
    for (i, rows) in halves(points).into_iter().enumerate() {
        for (j, block) in halves(rows).into_iter().enumerate() {
            lay_out(block, cells, stride, [row + i * half, column + j * half], half);
        }
    }
}

fn halves(points: &mut [[f32; 3]]) -> [&mut [[f32; 3]]; 2] {
    let extent = |axis: usize| {
        let range = points
            .iter()
            .map(|p| p[axis])
            .fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
        range.1 - range.0
    };
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).expect("three axes");
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    let (low, high) = points.split_at_mut(middle);
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{data::keyed_rng, shape_prior::tests::tiny};
    use rand::Rng;

    fn scattered_points(n: usize) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(1, [0, 0]);
        (0..n).map(|_| rng.random()).collect()
    }

    #[test]
    fn training_starts_near_the_template() {
        let device = Device::flex();
        let template = scattered_points(tiny().n_points());
        let points =
            tiny().init(&template, &device).generator.forward(Tensor::zeros([2, 6], &device));
        assert_eq!(points.dims(), [2, tiny().n_points(), 3]);
        let mut generated: Vec<f32> = points.into_data().iter::<f32>().take(384).collect();
        let mut template = template.concat();
        generated.sort_by(f32::total_cmp);
        template.sort_by(f32::total_cmp);
        assert!(generated.iter().zip(&template).all(|(a, b)| (a - b).abs() < 0.1));
    }

    #[test]
    fn neighbours_on_the_grid_are_neighbours_in_space() {
        let side = 16;
        let points = scattered_points(side * side);
        let mut cells = vec![[0.0; 3]; side * side];
        lay_out(&mut points.clone(), &mut cells, side, [0, 0], side);
        let mean_step = |points: &[[f32; 3]]| {
            let steps = points
                .windows(2)
                .map(|p| (0..3).map(|i| (p[0][i] - p[1][i]).powi(2)).sum::<f32>().sqrt());
            steps.sum::<f32>() / points.len() as f32
        };
        assert!(mean_step(&cells) < 0.5 * mean_step(&points));
    }
}
