//! Time to find the nearest neighbours of two clouds, both ways, and of the Chamfer distance.
//!
//! Clouds have the paper's N points and the mesh's unit diagonal. A k-d tree and brute force stand
//! beside as yardsticks.

use std::hint::black_box;

use burn::tensor::{Device, Tensor, TensorData};
use divan::{Bencher, counter::ItemsCount};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use object_pba::{
    chamfer::chamfer_distance,
    data::{
        keyed_rng,
        procedural::car,
        surface::{N_POINTS, sample_surface},
    },
    nearest_neighbours::{NearestNeighbours, mutual_neighbours},
};
use rand::Rng;
use rayon::ThreadPoolBuilder;

type Cloud = Vec<[f32; 3]>;

/// Of the camera that the silhouette's rows look through, in pixels.
const IMAGE_SIDE: f32 = 128.0;
/// Samples of a silhouette's outline.
const N_OUTLINE: usize = 1500;

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

/// What two clouds may have to do with each other.
#[derive(Clone, Copy, Debug)]
enum Pair {
    /// Two samplings of one surface: the end of training.
    OneCar,
    /// A sampling, and another with noise of 1 % of the diagonal: a good reconstruction.
    Noise1,
    Noise3,
    TwoCars,
    /// A ball of 2 % of the diagonal inside of a car: the start of training.
    Blob,
    /// A single location against a car.
    Collapsed,
    /// Two samplings of a slanted plane.
    Plane,
    /// One sampling with each of its points eight times.
    Duplicates,
    /// A car, one of whose points lies 10,000 diagonals away.
    Outlier,
}

const PAIRS: [Pair; 9] = [
    Pair::OneCar,
    Pair::Noise1,
    Pair::Noise3,
    Pair::TwoCars,
    Pair::Blob,
    Pair::Collapsed,
    Pair::Plane,
    Pair::Duplicates,
    Pair::Outlier,
];

impl Pair {
    fn clouds(self) -> (Cloud, Cloud) {
        let target = surface(1, 1, N_POINTS);
        let predicted = match self {
            Pair::OneCar => surface(1, 2, N_POINTS),
            Pair::Noise1 => jittered(surface(1, 2, N_POINTS), 0.01),
            Pair::Noise3 => jittered(surface(1, 2, N_POINTS), 0.03),
            Pair::TwoCars => surface(5, 2, N_POINTS),
            Pair::Blob => jittered(vec![[0.01, 0.02, 0.03]; N_POINTS], 0.01),
            Pair::Collapsed => vec![[0.01, 0.02, 0.03]; N_POINTS],
            Pair::Plane => return (plane(1), plane(2)),
            Pair::Duplicates => surface(1, 2, N_POINTS / 8).repeat(8),
            Pair::Outlier => {
                let mut cloud = surface(1, 2, N_POINTS);
                cloud[7] = [6e3, -8e3, 0.1];
                cloud
            }
        };
        (predicted, target)
    }
}

/// Both ways, on one core.
#[divan::bench(args = PAIRS)]
fn both_ways(bencher: Bencher, pair: Pair) {
    let (x, y) = pair.clouds();
    let one_core = ThreadPoolBuilder::new().num_threads(1).build().expect("a thread starts");
    bencher
        .counter(ItemsCount::new(x.len() + y.len()))
        .bench(|| one_core.install(|| mutual_neighbours(&x, &y)));
}

/// The yardstick: a k-d tree, on one core.
#[divan::bench(args = PAIRS, sample_count = 5)]
fn both_ways_by_kd_tree(bencher: Bencher, pair: Pair) {
    let (x, y) = pair.clouds();
    let one_way = |queries: &Cloud, points: &Cloud| -> Vec<u32> {
        let tree = ImmutableKdTree::<f32, 3>::new_from_slice(points);
        queries.iter().map(|q| tree.nearest_one::<SquaredEuclidean>(q).item as u32).collect()
    };
    bencher
        .counter(ItemsCount::new(x.len() + y.len()))
        .bench(|| (one_way(&x, &y), one_way(&y, &x)));
}

/// The other yardstick, whose time grows with the square of N.
#[divan::bench(args = [1024, 2048], sample_count = 5)]
fn both_ways_by_brute_force(bencher: Bencher, n_points: usize) {
    let (x, y) = (surface(1, 1, n_points), surface(1, 2, n_points));
    let one_way = |queries: &Cloud, points: &Cloud| -> Vec<usize> {
        let nearest = |q: &[f32; 3]| {
            let squared = |p: &[f32; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f32>();
            (0..points.len()).min_by(|&i, &j| squared(&points[i]).total_cmp(&squared(&points[j])))
        };
        queries.iter().map(|q| nearest(q).expect("there are points")).collect()
    };
    bencher.counter(ItemsCount::new(2 * n_points)).bench(|| (one_way(&x, &y), one_way(&y, &x)));
}

/// Preparing a cloud to be asked, without asking.
#[divan::bench]
fn preparation(bencher: Bencher) {
    let points = surface(1, 1, N_POINTS);
    bencher.bench(|| NearestNeighbours::new(&points));
}

/// Samples of an outline look for the nearest of all projected points, one after the other.
#[divan::bench]
fn outline_to_projected_points(bencher: Bencher) {
    let (pixels, outline) = (projected(), outline());
    bencher.counter(ItemsCount::new(N_OUTLINE)).bench(|| {
        let search = NearestNeighbours::in_plane(pixels.iter().copied());
        outline.iter().map(|&pixel| search.nearest_pixel(pixel)).sum::<u32>()
    });
}

/// All projected points look for the nearest sample of an outline.
#[divan::bench]
fn projected_points_to_outline(bencher: Bencher) {
    let (pixels, outline) = (projected(), outline());
    let search = NearestNeighbours::in_plane(outline);
    bencher
        .counter(ItemsCount::new(pixels.len()))
        .bench(|| pixels.iter().map(|&pixel| search.nearest_pixel(pixel)).sum::<u32>());
}

/// Eq. 7 and its gradient for batches of two samplings, on all cores.
#[divan::bench(args = [(1, 2048), (8, 2048), (1, N_POINTS), (8, N_POINTS)])]
fn chamfer_with_gradient(bencher: Bencher, (batch, n_points): (usize, usize)) {
    let device = Device::flex().autodiff();
    let cloud = |seed: u64| -> Tensor<3> {
        let clouds = (0..batch as u64).flat_map(|b| surface(b, seed, n_points)).flatten();
        let data = TensorData::new(clouds.collect::<Vec<f32>>(), [batch, n_points, 3]);
        Tensor::from_data(data, &device)
    };
    let (predicted, target) = (cloud(1).require_grad(), cloud(2));
    bencher.counter(ItemsCount::new(2 * batch * n_points)).bench(|| {
        let gradients = chamfer_distance(predicted.clone(), target.clone()).sum().backward();
        black_box(predicted.grad(&gradients).expect("depends on the prediction")).into_data()
    });
}

fn surface(mesh_seed: u64, seed: u64, n_points: usize) -> Cloud {
    let points = sample_surface(&car(mesh_seed), n_points, &mut keyed_rng(seed, [mesh_seed, 1]));
    points.iter().map(|point| point.coords.into()).collect()
}

fn jittered(mut cloud: Cloud, sigma: f32) -> Cloud {
    let mut rng = keyed_rng(3, [0, 0]);
    // Twelve uniform variates add up to a variance of one, and to nearly a normal one.
    let mut noise = || sigma * (0..12).map(|_| rng.random::<f32>() - 0.5).sum::<f32>();
    cloud.as_flattened_mut().iter_mut().for_each(|x| *x += noise());
    cloud
}

fn plane(seed: u64) -> Cloud {
    let mut rng = keyed_rng(seed, [0, 2]);
    let point = |u: f32, v: f32| [0.6 * u, 0.5 * v, 0.3 * u - 0.4 * v];
    (0..N_POINTS).map(|_| point(rng.random(), rng.random())).collect()
}

/// A car in profile, in pixels.
fn projected() -> Vec<[f32; 2]> {
    let at = |x: f32| 0.5 * IMAGE_SIDE + 0.8 * IMAGE_SIDE * x;
    surface(1, 1, N_POINTS).iter().map(|p| [at(p[0]), at(p[1])]).collect()
}

/// A rounded outline of about that size.
fn outline() -> Vec<[f32; 2]> {
    let turn = |k: usize| k as f32 * std::f32::consts::TAU / N_OUTLINE as f32;
    let at = |k: usize| [64.0 + 45.0 * turn(k).cos(), 64.0 + 20.0 * turn(k).sin()];
    (0..N_OUTLINE).map(at).collect()
}
