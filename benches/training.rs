//! Time of a training step, forward, backward and Adam, on either CPU backend.
//!
//! The networks and sizes are those of `benches/pytorch.py`, which times PyTorch's steps.

use burn::{
    optim::{AdamConfig, GradientsParams},
    tensor::{Device, Distribution, Tensor},
};
use divan::Bencher;
use nalgebra::{Isometry3, Vector3};
use object_pba::{
    chamfer::chamfer_distance,
    data::{keyed_rng, procedural::CarParameters, surface::sample_surface},
    device::Backend,
    regressor::{PoseTarget, RegressorConfig},
    shape_prior::ShapePriorConfig,
};

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

const BACKENDS: [Backend; 2] = [Backend::Flex, Backend::Ndarray];

/// N = 2,048: 1,024 points of either branch.
#[divan::bench(args = BACKENDS, sample_count = 10)]
fn autoencoder_2048(bencher: Bencher, backend: Backend) {
    let network = ShapePriorConfig { n_fc_points: 1024, grid_side: 32, ..Default::default() };
    bench_autoencoder(bencher, backend, &network);
}

/// The paper's N = 24,576: 8,192 points and a grid of 128 × 128.
#[divan::bench(args = BACKENDS, sample_count = 5)]
fn autoencoder_24576(bencher: Bencher, backend: Backend) {
    let network = ShapePriorConfig { n_fc_points: 8192, grid_side: 128, ..Default::default() };
    bench_autoencoder(bencher, backend, &network);
}

/// 32 crops of 64 × 64 pixels.
#[divan::bench(args = BACKENDS, sample_count = 10)]
fn regressors(bencher: Bencher, backend: Backend) {
    const BATCH: usize = 32;
    let device = backend.device().autodiff();
    let config = RegressorConfig::default();
    let mut network = Some(config.init(64, &device));
    let mut optimizer = AdamConfig::new().init();

    let random = |shape: [usize; 2]| Tensor::<2>::random(shape, Distribution::Default, &device);
    let size = config.crop_size;
    let crops = random([BATCH, size * size * 4]).reshape([BATCH, size, size, 4]);
    let (focal_ratios, styles) = (random([BATCH, 1]) + 1.0, random([BATCH, 64]));
    let pose = |i: usize| Isometry3::new(Vector3::z() * 2.0, Vector3::y() * i as f32);
    let poses: Vec<_> = (0..BATCH).map(|i| PoseTarget::new(&pose(i), 1.5)).collect();
    bencher.bench_local(|| {
        let module = network.take().expect("it is put back");
        let (predicted, outputs) = module.forward(crops.clone(), focal_ratios.clone());
        let style = module.style.loss(predicted, styles.clone(), Tensor::ones([64], &device));
        let gradients = (module.pose.loss(outputs, &poses) + style).backward();
        let gradients = GradientsParams::from_grads(gradients, &module);
        network = Some(optimizer.step(1e-3, module, gradients));
    });
}

/// Eight cars, and the whole Chamfer distance.
fn bench_autoencoder(bencher: Bencher, backend: Backend, network: &ShapePriorConfig) {
    let device = backend.device().autodiff();
    let n = network.n_points();
    let clouds: Vec<_> = (0..8).map(|seed| cloud(seed, n)).collect();
    let mut prior = Some(network.init(&clouds[0], &device));
    let mut optimizer = AdamConfig::new().init();
    let target = points(&clouds, &device);
    let seen = target.clone().slice([0..8, 0..network.n_encoder_points]);
    bencher.bench_local(|| {
        let module = prior.take().expect("it is put back");
        let decoded = module.generator.forward(module.encoder.forward(seen.clone()));
        let gradients = chamfer_distance(decoded, target.clone()).mean().backward();
        let gradients = GradientsParams::from_grads(gradients, &module);
        prior = Some(optimizer.step(1e-3, module, gradients));
    });
}

fn cloud(seed: u64, n: usize) -> Vec<[f32; 3]> {
    let mut rng = keyed_rng(seed, [0, 0]);
    let mesh = CarParameters::random(&mut rng).unpainted_mesh();
    sample_surface(&mesh, n, &mut rng).into_iter().map(|point| point.coords.into()).collect()
}

fn points(clouds: &[Vec<[f32; 3]>], device: &Device) -> Tensor<3> {
    let shape = [clouds.len(), clouds[0].len(), 3];
    let data = burn::tensor::TensorData::new(clouds.concat().into_flattened(), shape);
    Tensor::from_data(data, device)
}
