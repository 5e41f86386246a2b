use super::*;
use crate::data::collection::{Axes, Collection, Selection};
use std::collections::BTreeMap;
use tempfile::TempDir;

/// Triangles of several shapes, as plain meshes.
fn shapes() -> (TempDir, Vec<Model>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for idx in 1..=6 {
        let text = format!("v 0 0 0\nv {idx} 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n");
        fs::write(folder.path().join(format!("{idx}.obj")), text).expect("writable");
    }
    let collection = Collection::open(folder.path(), &Selection::default()).expect("shapes");
    (folder, collection.models)
}

fn sampler(cache: Option<&Path>) -> SurfaceSampler {
    SurfaceSampler::new(7, cache.map(Path::to_owned)).expect("a writable folder")
}

fn sample_all(models: &[Model], cache: &Path) {
    let sampler = sampler(Some(cache));
    models.iter().for_each(|model| drop(sampler.sample(model, 200).expect("a surface")));
}

fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("it is there").map(|entry| entry.expect("a file"));
    entries
        .map(|entry| (entry.file_name().into(), fs::read(entry.path()).expect("readable")))
        .collect()
}

#[test]
fn points_are_the_same_with_and_without_a_cache() {
    let (_shapes, models) = shapes();
    let cache = tempfile::tempdir().expect("a temporary folder");
    let fresh = sampler(None).sample(&models[0], 200).expect("a surface");
    assert_eq!(fresh.len(), 200);
    for _ in ["written", "read"] {
        let kept = sampler(Some(cache.path())).sample(&models[0], 200).expect("a surface");
        assert_eq!(kept, fresh);
    }
    assert_eq!(contents(cache.path()).len(), 1);
}

#[test]
fn what_is_kept_is_read_and_not_sampled() {
    let (_shapes, models) = shapes();
    let cache = tempfile::tempdir().expect("a temporary folder");
    let sampler = sampler(Some(cache.path()));
    sampler.sample(&models[0], 200).expect("a surface");
    let key = sampler.key(&models[0], 200).expect("a readable file");
    let path = cache.path().join(format!("{}.npz", hex(&key)));
    let others = vec![Point3::new(1.0, 2.0, 3.0); 200];
    fs::write(path, encode(&key, &others)).expect("writable");
    assert_eq!(sampler.sample(&models[0], 200).expect("what was kept"), others);
}

#[test]
fn an_interrupted_cache_completes_byte_for_byte() {
    let (_shapes, models) = shapes();
    let [whole, interrupted] = [(), ()].map(|()| tempfile::tempdir().expect("a folder"));
    sample_all(&models, whole.path());
    let expected = contents(whole.path());
    assert_eq!(expected.len(), models.len());

    // Some files were written, one of them only in part; one was cut off by a full disk, and
    // one has a bad bit.
    sample_all(&models[..4], interrupted.path());
    let written: Vec<_> = contents(interrupted.path()).into_iter().collect();
    let store = |name: &Path, bytes: &[u8]| {
        fs::write(interrupted.path().join(name), bytes).expect("writable");
    };
    let (name, bytes) = &written[0];
    store(name, &bytes[..bytes.len() / 2]);
    let (name, bytes) = &written[1];
    let mut damaged = bytes.clone();
    damaged[1000] ^= 1;
    store(name, &damaged);
    let (name, bytes) = &written[2];
    fs::remove_file(interrupted.path().join(name)).expect("it is there");
    store(&name.with_extension("npz.4711.partial"), &bytes[..100]);

    sample_all(&models, interrupted.path());
    assert_eq!(contents(interrupted.path()), expected);
}

#[test]
fn every_bit_of_a_kept_file_counts() {
    let key = [3; 32];
    let points = vec![Point3::new(0.5, -1.0, 2.0), Point3::new(0.0, 1e-7, -3.0)];
    let bytes = encode(&key, &points);
    assert_eq!(decode(&key, &bytes), Some(points));
    assert_eq!(decode(&[4; 32], &bytes), None);
    for len in 0..bytes.len() {
        assert_eq!(decode(&key, &bytes[..len]), None);
        let mut damaged = bytes.clone();
        damaged[len] ^= 0x10;
        assert_eq!(decode(&key, &damaged), None, "byte {len}");
    }
}

#[test]
fn another_shape_seed_count_or_frame_gives_other_points() {
    let (folder, models) = shapes();
    let key = |seed: u64, model: &Model, n_points: usize| {
        let sampler = SurfaceSampler { seed, cache: None };
        sampler.key(model, n_points).expect("a readable file")
    };
    let expected = key(7, &models[0], 200);
    let turned = Model { axes: Axes::SHAPENET_V1, ..models[0].clone() };
    let renamed = Model { id: "other".into(), ..models[0].clone() };
    assert_ne!(key(7, &models[1], 200), expected);
    assert_ne!(key(7, &turned, 200), expected);
    assert_ne!(key(8, &models[0], 200), expected);
    assert_ne!(key(7, &models[0], 201), expected);
    assert_eq!(key(7, &renamed, 200), expected);
    fs::copy(folder.path().join("2.obj"), &models[0].path).expect("writable");
    assert_ne!(key(7, &models[0], 200), expected);
}

#[test]
fn a_cache_that_cannot_be_written_is_an_error_of_its_own() {
    let (_shapes, models) = shapes();
    let cache = tempfile::tempdir().expect("a temporary folder");
    let sampler = sampler(Some(cache.path()));
    fs::remove_dir(cache.path()).expect("it is empty");
    assert!(matches!(sampler.sample(&models[0], 200), Err(Error::Cache { .. })));
}
