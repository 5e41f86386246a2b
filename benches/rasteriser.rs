//! Time to draw a procedural car, by the picture's side and with or without a carpet.

use divan::Bencher;
use object_pba::data::{
    keyed_rng,
    lighting::{Ground, Scene},
    procedural::car,
    rasteriser::Renderer,
    viewpoint::{Viewpoint, ViewpointRange},
};

fn main() {
    divan::main();
}

#[divan::bench(args = [64, 128, 256])]
fn object(bencher: Bencher, side: usize) {
    bench_view(bencher, side, false);
}

#[divan::bench(args = [64, 128, 256])]
fn object_on_carpet(bencher: Bencher, side: usize) {
    bench_view(bencher, side, true);
}

fn bench_view(bencher: Bencher, side: usize, carpeted: bool) {
    let mesh = car(1);
    let mut rng = keyed_rng(1, [0, 0]);
    let range = ViewpointRange { fill: [0.8, 0.8], ..ViewpointRange::default() };
    let view = Viewpoint::random(&mesh.vertices, [side, side], &range, &mut rng);
    let ground = carpeted.then(|| Ground::random(&mut rng, -0.2));
    let scene = Scene::random(&mut rng, ground);
    let renderer = Renderer::new(&mesh);
    bencher
        .counter(divan::counter::ItemsCount::new(mesh.triangles.len()))
        .bench(|| renderer.render(&scene, &view.camera_from_world, &view.intrinsics, view.size));
}
