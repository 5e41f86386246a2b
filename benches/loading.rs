//! Time to get what is drawn and what is reconstructed: meshes of 20,000 triangles, and pictures.

mod cars;

use std::path::Path;

use cars::{detailed_car, write_car};
use divan::{
    Bencher,
    counter::{BytesCount, ItemsCount},
};
use object_pba::data::{
    formats::{SequenceHints, read_sequence},
    mesh_file::read_mesh,
    procedural::car,
    rasteriser::Renderer,
};

/// As the binaries have it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

/// A file of each format; the first has materials and five pictures.
#[divan::bench(args = ["car.obj", "car.off", "car.ply"])]
fn mesh(bencher: Bencher, name: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = write_car(folder.path(), name);
    bencher
        .counter(BytesCount::new(file_size(&path)))
        .bench(|| read_mesh(&path).expect("a usable mesh"));
}

/// The yardstick: the same OBJ file through tobj, without its pictures.
#[divan::bench]
fn mesh_by_tobj(bencher: Bencher) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = write_car(folder.path(), "car.obj");
    bencher
        .counter(BytesCount::new(file_size(&path)))
        .bench(|| tobj::load_obj(&path, &tobj::GPU_LOAD_OPTIONS).expect("a usable mesh"));
}

/// A car of the procedural family, shape and paint.
#[divan::bench]
fn procedural_car(bencher: Bencher) {
    let mut seeds = 0..;
    bencher.bench_local(|| car(seeds.next().expect("endless")));
}

/// What the rasteriser does once a mesh.
#[divan::bench]
fn renderer(bencher: Bencher) {
    let mesh = detailed_car();
    bencher.bench(|| Renderer::new(&mesh));
}

/// The bundled sequence: 15 frames and masks of 128 × 128 pixels.
#[divan::bench]
fn sequence(bencher: Bencher) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sample-sequence");
    let read = || read_sequence(&path, &SequenceHints::default()).expect("it is bundled");
    bencher.counter(ItemsCount::new(15_usize)).bench(read);
}

fn file_size(path: &Path) -> u64 {
    path.metadata().expect("it was just written").len()
}
