//! Time to draw a detailed, textured car of 20,000 triangles, on one core and on two.

use divan::{Bencher, counter::ItemsCount};
use nalgebra::center;
use object_pba::data::{
    keyed_rng,
    lighting::{Ground, Scene},
    mesh::{Mesh, Triangle},
    procedural::car,
    rasteriser::Renderer,
    viewpoint::{Viewpoint, ViewpointRange},
};
use rayon::{ThreadPoolBuilder, prelude::*};

const N_TRIANGLES: usize = 20_000;
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

/// A procedural car whose triangles are cut in four, one after the other, until there are enough.
fn detailed_car() -> Mesh {
    let mut mesh = car(1);
    let mut next = 0;
    while mesh.triangles.len() < N_TRIANGLES {
        let triangle = mesh.triangles[next];
        let first_vertex = mesh.vertices.len() as u32;
        let corners = mesh.corners(&triangle);
        let [a, b, c] = triangle.vertices;
        let [ab, bc, ca] = [0, 1, 2].map(|side| first_vertex + side);
        mesh.vertices
            .extend([[0, 1], [1, 2], [2, 0]].map(|[i, j]| center(&corners[i], &corners[j])));

        let [u, v, w] = triangle.uvs;
        let middle = |from: [f32; 2], to: [f32; 2]| [0, 1].map(|k| (from[k] + to[k]) / 2.0);
        let [uv, vw, wu] = [middle(u, v), middle(v, w), middle(w, u)];
        let part = |vertices, uvs| Triangle { vertices, uvs, ..triangle };
        mesh.triangles[next] = part([ab, bc, ca], [uv, vw, wu]);
        mesh.triangles.push(part([a, ab, ca], [u, uv, wu]));
        mesh.triangles.push(part([ab, b, bc], [uv, v, vw]));
        mesh.triangles.push(part([ca, bc, c], [wu, vw, w]));
        next += 1;
    }
    mesh
}
