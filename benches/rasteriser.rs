//! Time to draw a detailed, textured car of 20,000 triangles, on one core and on two.

mod cars;

use cars::detailed_car;
use divan::{Bencher, counter::ItemsCount};
use object_pba::data::{
    keyed_rng,
    lighting::{Ground, Scene},
    mesh::Mesh,
    rasteriser::Renderer,
    viewpoint::{Viewpoint, ViewpointRange},
};
use rayon::{ThreadPoolBuilder, prelude::*};

/// Views of a batch.
const N_VIEWS: u64 = 32;

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

/// One view of so many pixels' side.
#[divan::bench(args = [64, 128, 256])]
fn object(bencher: Bencher, side: usize) {
    bench_view(bencher, side, false);
}

#[divan::bench(args = [64, 128, 256])]
fn object_on_carpet(bencher: Bencher, side: usize) {
    bench_view(bencher, side, true);
}

/// Views of 128 × 128 pixels, side by side on so many threads.
#[divan::bench(args = [1, 2])]
fn batch(bencher: Bencher, n_threads: usize) {
    let mesh = detailed_car();
    let views: Vec<_> = (0..N_VIEWS).map(|idx| view(&mesh, 128, idx)).collect();
    let scene = Scene::random(&mut keyed_rng(2, [0, 0]), None);
    let renderer = Renderer::new(&mesh);
    let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads start");
    bencher.counter(ItemsCount::new(N_VIEWS)).bench(|| {
        let draw = |view: &Viewpoint| {
            renderer.render(&scene, &view.camera_from_world, &view.intrinsics, view.size)
        };
        pool.install(|| views.par_iter().map(draw).collect::<Vec<_>>())
    });
}

fn bench_view(bencher: Bencher, side: usize, carpeted: bool) {
    let mesh = detailed_car();
    let view = view(&mesh, side, 0);
    let mut rng = keyed_rng(2, [0, 0]);
    let ground = carpeted.then(|| Ground::random(&mut rng, -0.2));
    let scene = Scene::random(&mut rng, ground);
    let renderer = Renderer::new(&mesh);
    bencher
        .counter(ItemsCount::new(mesh.triangles.len()))
        .bench(|| renderer.render(&scene, &view.camera_from_world, &view.intrinsics, view.size));
}

fn view(mesh: &Mesh, side: usize, idx: u64) -> Viewpoint {
    let range = ViewpointRange { fill: [0.8, 0.8], ..ViewpointRange::default() };
    Viewpoint::random(&mesh.vertices, [side, side], &range, &mut keyed_rng(1, [idx, 0]))
}
