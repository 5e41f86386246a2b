//! Time of the objective, of its parts and of a step of Levenberg–Marquardt.
//!
//! A sequence of the paper, 15 frames of 128 × 128, and a generator as large as that of
//! `configs/car.toml`: its weights are random, its template is a car, and at a small style it shows
//! that car to within its points' spacing.
//!
//! Where the time goes, one core, of a value that takes 70 ms: the pseudo-renderer 36 (370,000 discs of
//! some 20 cells, 100 ns a disc; to move and project the points alone is 10 flops and 20 bytes each, a
//! few ms), silhouettes 16 (a counting sort of 370,000 locations, 100,000 queries, as many lookups of
//! coverage as locations), colours 5, the generator 3 (20 million multiplications, 25 MB of weights: the
//! memory's pace). The gradient adds 20, a linearisation 45, ∂X/∂s 20 where the style has moved.

use std::hint::black_box;

use burn::{
    module::Module,
    tensor::{Device, Tensor, s},
};
use divan::Bencher;
use nalgebra::{Isometry3, Vector3};
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, bundle_adjust,
        levenberg_marquardt::LevenbergMarquardtConfig,
        objective::{Objective, ObjectiveConfig},
        observations::Observations,
        shape_model::ShapeModel,
        unknowns::{Parameterisation, Unknowns},
    },
    camera::Pose,
    data::{
        keyed_rng,
        procedural::car,
        sequence::{Sequence, SequenceOptions},
        surface::sample_surface,
    },
    device::Backend,
    host::{host_pixels, index_tensor},
    loss::{SilhouetteMatching, SilhouetteTolerances, silhouette_pairs},
    pseudo_render::{PseudoRenderConfig, visible_points},
    sampling::ImageTable,
    shape_prior::{Generator, ShapePriorConfig},
    silhouette::Silhouette,
};
use rayon::prelude::*;

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

const SEED: u64 = 3;
const N_FRAMES: usize = 15;
/// The paper's N: points of the fully connected branch, and the side of the grid.
const SIZES: [usize; 2] = [8192, 128];
/// N = 1,536, 6,144, 24,576 and 98,304.
const ALL_SIZES: [[usize; 2]; 4] = [[512, 32], [2048, 64], SIZES, [32_768, 256]];

/// A sequence, and unknowns that lie near its truth.
struct Problem {
    sequence: Sequence,
    generator: Generator,
    unknowns: Unknowns,
    device: Device,
}

impl Problem {
    fn new(n_frames: usize, [n_fc_points, grid_side]: [usize; 2]) -> Self {
        let device = Backend::Flex.device().autodiff();
        device.seed(SEED);
        let mesh = car(SEED);
        let step_degrees = 28.0 / n_frames as f32;
        let options = SequenceOptions { n_frames, step_degrees, ..Default::default() };
        let sequence = Sequence::render(&mesh, &options, SEED);
        let prior = ShapePriorConfig {
            symmetric: true,
            n_fc_points,
            grid_side,
            grid_channels: 256,
            n_encoder_points: 512,
            ..Default::default()
        };
        let template = sample_surface(&mesh, prior.n_points(), &mut keyed_rng(SEED, [9, 0]));
        let template: Vec<[f32; 3]> = template.iter().map(|point| point.coords.into()).collect();
        let generator = prior.init(&template, &device).freeze().generator;
        let truth = sequence.truth.as_ref().expect("rendered");
        let nudge = Isometry3::rotation(Vector3::new(0.01, -0.02, 0.01));
        let poses: Vec<_> = truth.camera_from_world.iter().map(|pose| pose * nudge).collect();
        let style: Vec<f32> = (0..generator.n_style()).map(|i| 0.01 * (i as f32).sin()).collect();
        let unknowns = Unknowns::with_poses(&poses, &style, Parameterisation::default());
        Self { sequence, generator, unknowns, device }
    }

    fn objective<'a>(
        &'a self,
        observations: &'a Observations,
        config: &'a ObjectiveConfig,
    ) -> Objective<'a> {
        Objective { observations, shape: &self.generator, config, device: self.device.clone() }
    }

    fn poses(&self) -> Pose {
        self.unknowns.poses(&self.unknowns.leaves(&self.device.clone().inner()))
    }

    fn points(&self) -> Tensor<3> {
        self.generator.points(self.unknowns.leaves(&self.device).style).inner()
    }

    /// Where every point lands in every frame, `[L, n, 2]`.
    fn pixels(&self) -> Tensor<3> {
        self.sequence.intrinsics.project(self.poses().camera_from_world(self.points())).pixels
    }
}

/// L_ph + λ L_CD with its gradient: the default objective, then Eq. 6 as printed.
#[divan::bench(args = [false, true], sample_count = 20)]
fn with_gradient(bencher: Bencher, as_printed: bool) {
    let config = if as_printed { ObjectiveConfig::paper() } else { ObjectiveConfig::default() };
    bench_evaluation(bencher, N_FRAMES, SIZES, &config);
}

#[divan::bench(args = [false, true], sample_count = 20)]
fn value_only(bencher: Bencher, as_printed: bool) {
    let config = if as_printed { ObjectiveConfig::paper() } else { ObjectiveConfig::default() };
    let problem = Problem::new(N_FRAMES, SIZES);
    let observations = Observations::new(&problem.sequence, &[0.0], &problem.device);
    let objective = problem.objective(&observations, &config);
    bencher.bench(|| objective.value(&problem.unknowns, 0));
}

#[divan::bench(args = [2, 5, 15, 30, 60], sample_count = 5)]
fn by_frames(bencher: Bencher, n_frames: usize) {
    bench_evaluation(bencher, n_frames, SIZES, &ObjectiveConfig::default());
}

#[divan::bench(args = [0, 1, 2, 3], sample_count = 5)]
fn by_points(bencher: Bencher, size: usize) {
    bench_evaluation(bencher, N_FRAMES, ALL_SIZES[size], &ObjectiveConfig::default());
}

fn bench_evaluation(
    bencher: Bencher,
    n_frames: usize,
    sizes: [usize; 2],
    config: &ObjectiveConfig,
) {
    let problem = Problem::new(n_frames, sizes);
    let observations = Observations::new(&problem.sequence, &[0.0], &problem.device);
    let objective = problem.objective(&observations, config);
    bencher.bench(|| objective.evaluate(&problem.unknowns, 0));
}

/// Iterations at one level; the difference of two rows is that of the iterations between.
#[divan::bench(args = [0, 1, 5], sample_count = 5)]
fn levenberg_marquardt(bencher: Bencher, iterations: usize) {
    let problem = Problem::new(N_FRAMES, SIZES);
    let lm = LevenbergMarquardtConfig { iterations, relative_first: 0, ..Default::default() };
    let config = BundleAdjustmentConfig { lm, blurs: vec![0.0], ..Default::default() };
    let starts = [problem.unknowns.clone().into()];
    bencher.bench(|| {
        let Problem { sequence, generator, device, .. } = &problem;
        bundle_adjust(sequence, generator, &starts, &config, device, &mut |_, _| ())
    });
}

/// All levels of blur from Δp = 0, with one initial pose and with another that is turned round.
#[divan::bench(args = [1, 2], sample_count = 2)]
fn reconstruction(bencher: Bencher, n_hypotheses: usize) {
    let problem = Problem::new(N_FRAMES, SIZES);
    let Problem { sequence, generator, unknowns, device } = &problem;
    let style = unknowns.values[unknowns.style()].iter().map(|&s| s as f32).collect::<Vec<_>>();
    let start = |degrees: f32| -> Hypothesis {
        let turn = Isometry3::rotation(Vector3::y() * degrees.to_radians());
        let pose = unknowns.camera_from_world(device)[0] * turn;
        Unknowns::new(pose, N_FRAMES, &style, Parameterisation::default()).into()
    };
    let starts: Vec<Hypothesis> = [5.0, 180.0].map(start)[..n_hypotheses].to_vec();
    let config = BundleAdjustmentConfig::default();
    bencher.bench(|| {
        bundle_adjust(sequence, generator, &starts, &config, device, &mut |_, _| ()).iterations
    });
}

#[divan::bench_group(sample_count = 20)]
mod parts {
    use super::*;

    #[divan::bench]
    fn generator(bencher: Bencher) {
        let problem = Problem::new(1, SIZES);
        bencher.bench(|| problem.points());
    }

    #[divan::bench]
    fn generator_with_gradient(bencher: Bencher) {
        let problem = Problem::new(1, SIZES);
        bencher.bench(|| {
            let style = problem.unknowns.leaves(&problem.device).style;
            let gradients = problem.generator.points(style.clone()).sum().backward();
            black_box(style.grad(&gradients))
        });
    }

    /// A cloud, and one beside it for each of 16 directions of the style.
    #[divan::bench]
    fn decoder_jacobian(bencher: Bencher) {
        let problem = Problem::new(1, SIZES);
        let style = problem.unknowns.leaves(&problem.device.clone().inner()).style;
        let styles = style.repeat_dim(0, 17);
        bencher.bench(|| problem.generator.points(styles.clone()));
    }

    /// All 15 frames.
    #[divan::bench]
    fn pseudo_render(bencher: Bencher) {
        let problem = Problem::new(N_FRAMES, SIZES);
        let Sequence { intrinsics, size, .. } = &problem.sequence;
        let (points, poses) = (problem.points(), problem.poses());
        let config = PseudoRenderConfig::default();
        bencher.bench(|| visible_points(points.clone(), &poses, intrinsics, *size, &config));
    }

    /// All 15 frames, every point and the outline.
    #[divan::bench]
    fn silhouettes(bencher: Bencher) {
        let problem = Problem::new(N_FRAMES, SIZES);
        let frames = &problem.sequence.frames;
        let silhouettes: Vec<_> =
            frames.iter().map(|frame| Silhouette::new(&frame.mask).expect("a car")).collect();
        let pixels = host_pixels(&problem.pixels());
        let everything: Vec<u32> = (0..pixels[0].len() as u32).collect();
        let matching = SilhouetteMatching {
            to_outline: true,
            weights: [1.0; 2],
            tolerances: SilhouetteTolerances { coverage: 0.0, hole: 1.0, containment: 0.0 },
            trim: 0.0,
        };
        bencher.bench(|| {
            let pairs = silhouettes.par_iter().zip(&pixels).map(|(silhouette, pixels)| {
                silhouette_pairs(silhouette, pixels, &everything, &matching).len()
            });
            pairs.sum::<usize>()
        });
    }

    /// A third of the points, compared with 14 frames.
    #[divan::bench]
    fn photometric_with_gradient(bencher: Bencher) {
        let problem = Problem::new(N_FRAMES, SIZES);
        let images: Vec<_> =
            problem.sequence.frames.iter().map(|frame| frame.color.clone()).collect();
        let table = ImageTable::new(&images, &problem.device);
        let pixels = problem.pixels();
        let seen = index_tensor((0..8192).collect(), &pixels);
        let frames: Vec<usize> = (0..N_FRAMES).collect();
        bencher.bench(|| {
            let pixels = Tensor::from_inner(pixels.clone()).require_grad();
            let colors = table.sample_bilinear(&frames, pixels.clone().select(1, seen.clone()));
            let residuals = colors.clone().slice(s![0..1]) - colors.slice(s![1..]);
            black_box(pixels.grad(&residuals.square().sum().backward()))
        });
    }
}
