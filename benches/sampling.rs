//! Time to draw the paper's 24,576 points from a surface of 20,000 triangles.

mod cars;

use cars::{detailed_car, write_car};
use divan::{Bencher, counter::ItemsCount};
use object_pba::data::{
    collection::{Collection, Selection},
    keyed_rng,
    surface::{N_POINTS, sample_surface},
    surface_cache::SurfaceSampler,
};
use rand::Rng;

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

#[divan::bench]
fn surface(bencher: Bencher) {
    let mesh = detailed_car();
    let mut rng = keyed_rng(0, [0, 0]);
    bencher
        .counter(ItemsCount::new(N_POINTS))
        .bench_local(|| sample_surface(&mesh, N_POINTS, &mut rng));
}

/// The floor: the random numbers alone, three a point.
#[divan::bench]
fn random_numbers(bencher: Bencher) {
    let mut rng = keyed_rng(0, [0, 0]);
    let mut draw = || -> f32 { (0..3 * N_POINTS).map(|_| rng.random::<f32>()).sum() };
    bencher.counter(ItemsCount::new(N_POINTS)).bench_local(&mut draw);
}

/// From an OBJ file that was sampled before: its hash, and the points from the cache.
#[divan::bench]
fn cached_surface(bencher: Bencher) {
    let [meshes, cache] = [(); 2].map(|()| tempfile::tempdir().expect("a temporary folder"));
    write_car(meshes.path(), "car.obj");
    let collection = Collection::open(meshes.path(), &Selection::default()).expect("one mesh");
    let cache = Some(cache.path().to_owned());
    let sampler = SurfaceSampler::new(0, cache).expect("a writable folder");
    let sample = || sampler.sample(&collection.models[0], N_POINTS).expect("a usable mesh");
    sample();
    bencher.counter(ItemsCount::new(N_POINTS)).bench(sample);
}
