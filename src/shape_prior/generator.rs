//! From a style to its cloud: G(s) = X.

use burn::{
    module::{Module, Param},
    nn::{Initializer, Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData, activation::relu},
};

use super::{COARSEST_SIDE, ShapePriorConfig, Whitening};
use crate::layers::{Conv, ConvConfig, Upsample, each_row, rectified_linear};

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
    /// `[n, 3]`, half of them where shapes are symmetric: first the points of the FC branch, then
    /// those of the grid.
    template: Param<Tensor<2>>,
    fc: [Linear; 2],
    fc_output: Linear,
    grid: [Linear; 2],
    upsamples: Vec<Upsample>,
    /// Lets neighbouring cells of the grid agree on their border, before the last doubling.
    refine: Conv,
    grid_output: Linear,
    /// `[rows, columns, channels]` of the coarsest grid.
    #[module(skip)]
    coarsest: [usize; 3],
    #[module(skip)]
    symmetric: bool,
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
        let columns = if config.symmetric { COARSEST_SIDE / 2 } else { COARSEST_SIDE };
        let coarsest = [COARSEST_SIDE, columns, channels[0]];
        let (n_coarsest, n_fc) = (coarsest.iter().product(), config.n_fc_points / config.copies());
        Self {
            whitening,
            template: template_param(template, config, device),
            fc: [(k, HIDDEN), (HIDDEN, config.fc_width)]
                .map(|(i, o)| rectified_linear(i, o, device)),
            fc_output: output_layer(config.fc_width, 3 * n_fc, device),
            grid: [(k, HIDDEN), (HIDDEN, n_coarsest)].map(|(i, o)| rectified_linear(i, o, device)),
            upsamples,
            refine: ConvConfig::same([penultimate, penultimate]).init(device),
            grid_output: output_layer(channels[channels.len() - 1], 3, device),
            coarsest,
            symmetric: config.symmetric,
        }
    }

    /// Numbers in a style.
    pub fn n_style(&self) -> usize {
        self.whitening.n_style()
    }

    pub fn n_points(&self) -> usize {
        self.template.dims()[0] * if self.symmetric { 2 } else { 1 }
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
        let points = self.template.val().unsqueeze() + offsets;
        if self.symmetric { with_mirror_image(points) } else { points }
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
        let [rows, columns, channels] = self.coarsest;
        let mut grid = coarsest.reshape([b, rows, columns, channels]);
        for (i, upsample) in self.upsamples.iter().enumerate() {
            if i + 1 == self.upsamples.len() {
                grid = relu(self.refine.forward(grid));
            }
            grid = relu(upsample.forward(grid));
        }
        each_row(&self.grid_output, grid).reshape([b as i32, -1, 3])
    }
}

fn output_layer(d_input: usize, d_output: usize, device: &Device) -> Linear {
    let initializer = Initializer::Uniform { min: -OUTPUT_WEIGHT, max: OUTPUT_WEIGHT };
    // The template is the bias.
    LinearConfig::new(d_input, d_output).with_bias(false).with_initializer(initializer).init(device)
}

/// `[b, n, 3]` to `[b, 2n, 3]`: the points, then what they are in the mirror.
fn with_mirror_image(points: Tensor<3>) -> Tensor<3> {
    let mirror = Tensor::<1>::from_floats([-1.0, 1.0, 1.0], &points.device()).unsqueeze();
    Tensor::cat(vec![points.clone(), points * mirror], 1)
}

fn template_param(
    points: &[[f32; 3]],
    config: &ShapePriorConfig,
    device: &Device,
) -> Param<Tensor<2>> {
    // Of symmetric shapes one side is decoded, so that neighbours on the grid stay neighbours.
    let n = config.n_points() / config.copies();
    let on_one_side =
        |&[x, y, z]: &[f32; 3]| if config.symmetric { [x.abs(), y, z] } else { [x, y, z] };
    let points: Vec<_> = points[..n].iter().map(on_one_side).collect();

    let (fc, grid) = points.split_at(config.n_fc_points / config.copies());
    let mut ordered = points.clone();
    let cells = &mut ordered[fc.len()..];
    lay_out(&mut grid.to_vec(), cells, [config.grid_side, config.grid_side / config.copies()]);
    Param::from_data(TensorData::new(ordered.concat(), [n, 3]), device)
}

/// Lays points out on the rows of a grid so that neighbours in space are neighbours on it, as the
/// deconvolutions assume: each half of the grid takes a half of the points along the axis of their
/// greatest extent.
fn lay_out(points: &mut [[f32; 3]], cells: &mut [[f32; 3]], [rows, columns]: [usize; 2]) {
    let mut place = |[row, column]: [usize; 2], point| cells[row * columns + column] = point;
    spread(points, [0, 0], [rows, columns], &mut place);
}

fn spread(
    points: &mut [[f32; 3]],
    [row, column]: [usize; 2],
    [rows, columns]: [usize; 2],
    place: &mut impl FnMut([usize; 2], [f32; 3]),
) {
    if let [point] = points {
        return place([row, column], *point);
    }
    let [low, high] = halves(points);
    if rows >= columns {
        spread(low, [row, column], [rows / 2, columns], place);
        spread(high, [row + rows / 2, column], [rows / 2, columns], place);
    } else {
        spread(low, [row, column], [rows, columns / 2], place);
        spread(high, [row, column + columns / 2], [rows, columns / 2], place);
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
    use crate::{data::keyed_rng, host::host_points, shape_prior::tests::tiny};
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
    fn symmetric_shapes_look_the_same_in_the_mirror() {
        let device = Device::flex();
        let config = ShapePriorConfig { symmetric: true, ..tiny() };
        let prior = config.init(&scattered_points(config.n_points()), &device);
        let style = Tensor::random([2, 6], burn::tensor::Distribution::Default, &device);
        let points = prior.generator.forward(style);
        assert_eq!(points.dims(), [2, config.n_points(), 3]);
        assert_eq!(prior.generator.n_points(), config.n_points());

        for cloud in host_points(&points).chunks(config.n_points()) {
            let (one, other) = cloud.split_at(config.n_points() / 2);
            assert!(one.iter().zip(other).all(|([x, y, z], mirrored)| *mirrored == [-x, *y, *z]));
        }
    }

    #[test]
    fn neighbours_on_the_grid_are_neighbours_in_space() {
        let side = 16;
        let points = scattered_points(side * side);
        let mut cells = vec![[0.0; 3]; side * side];
        lay_out(&mut points.clone(), &mut cells, [side, side]);
        let mean_step = |points: &[[f32; 3]]| {
            let steps = points
                .windows(2)
                .map(|p| (0..3).map(|i| (p[0][i] - p[1][i]).powi(2)).sum::<f32>().sqrt());
            steps.sum::<f32>() / points.len() as f32
        };
        assert!(mean_step(&cells) < 0.5 * mean_step(&points));
    }
}
