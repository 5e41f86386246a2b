//! The direct point set regression, trained as a whole on its tiny preset.

use std::{fs, path::Path};

use assert_cmd::Command;
use burn::tensor::Device;
use object_pba::{
    checkpoint::PSGN_FILE,
    data::{
        crop::CropCamera,
        procedural::car,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
    psgn::Psgn,
    silhouette::MASK_THRESHOLD,
    training::{PsgnTrainingConfig, train_psgn},
};
use serde_json::Value;
use tempfile::TempDir;

const TINY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/psgn-tiny.toml");
const TINY_PRIOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/tiny.toml");

fn tiny() -> PsgnTrainingConfig {
    PsgnTrainingConfig::read(Path::new(TINY)).unwrap()
}

fn trained(config: &PsgnTrainingConfig, backend: Backend) -> TempDir {
    let out = tempfile::tempdir().unwrap();
    train_psgn(config, out.path(), &backend.device()).unwrap();
    out
}

/// A quantity over the lines of metrics.jsonl that have it.
fn history(out: &Path, name: &str) -> Vec<f64> {
    let text = fs::read_to_string(out.join("metrics.jsonl")).unwrap();
    let lines = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.filter_map(|line| line[name].as_f64()).collect()
}

/// What the network makes of the first frame of this car's sequence.
fn cloud(psgn: &Psgn, seed: u64) -> Vec<[f32; 3]> {
    let options = SequenceOptions { n_frames: 1, n_true_points: 0, ..Default::default() };
    let sequence = Sequence::render(&car(seed), &options, seed);
    let (frame, intrinsics) = (&sequence.frames[0], &sequence.intrinsics);
    let (size, margin) = (psgn.crop_size(), psgn.crop_margin());
    let crop = CropCamera::around_silhouette(&frame.mask, MASK_THRESHOLD, intrinsics, size, margin);
    let crop = crop.expect("the car is in view");
    let (color, mask) = crop.warp(&frame.color, &frame.mask);
    psgn.predict(&color, &mask, &crop)
}

#[track_caller]
fn check_learns(backend: Backend) {
    let config = tiny();
    let out = trained(&config, backend);
    let losses = history(out.path(), "chamfer");
    let half = losses.len() / 2;
    let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
    assert!(mean(&losses[half..]) < 0.7 * mean(&losses[..half]), "{losses:?}");

    let psgn = Psgn::load(out.path(), &backend.device()).unwrap();
    let (one, other) = (cloud(&psgn, 1), cloud(&psgn, 2));
    assert_eq!(one.len(), config.network.n_points());
    assert!(one.iter().flatten().all(|x| x.abs() < 1.0));
    let apart = one.iter().zip(&other).map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs()).sum());
    let apart = apart.fold(0.0f32, f32::max);
    assert!(apart > 1e-3, "{apart}");
}

#[test]
fn flex_learns() {
    check_learns(Backend::Flex);
}

#[test]
fn ndarray_learns() {
    check_learns(Backend::Ndarray);
}

#[test]
fn one_seed_gives_the_same_weights_and_another_does_not() {
    let mut config = tiny();
    config.schedule.steps = 10;
    let other = PsgnTrainingConfig { seed: 2, ..config.clone() };
    let [one, same, other] = [&config, &config, &other]
        .map(|config| fs::read(trained(config, Backend::Flex).path().join(PSGN_FILE)).unwrap());
    assert!(one == same && one != other);
}

#[test]
fn a_finished_run_is_left_alone_and_another_refused() {
    let mut config = tiny();
    config.schedule.steps = 5;
    let out = trained(&config, Backend::Flex);
    let modified = || fs::metadata(out.path().join(PSGN_FILE)).unwrap().modified().unwrap();
    let before = modified();
    train_psgn(&config, out.path(), &Device::flex()).unwrap();
    assert_eq!(modified(), before);

    let error = train_psgn(&tiny(), out.path(), &Device::flex()).unwrap_err().to_string();
    assert!(error.contains("another config"), "{error}");
    // A prior's folder is not overwritten, either.
    fs::remove_file(out.path().join(PSGN_FILE)).unwrap();
    fs::copy(TINY_PRIOR, out.path().join("config.toml")).unwrap();
    let error = train_psgn(&config, out.path(), &Device::flex()).unwrap_err().to_string();
    assert!(error.contains("another config"), "{error}");
    assert_eq!(fs::read(TINY_PRIOR).unwrap(), fs::read(out.path().join("config.toml")).unwrap());
}

#[test]
fn the_table_compares_clouds_of_the_same_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let [prior, out] = ["prior", "psgn"].map(|name| folder.path().join(name));
    let pba_train = |command: &str, config: &str, out: &Path, extra: &[&str]| {
        let mut pba_train = Command::cargo_bin("pba-train").unwrap();
        pba_train.args([command, "--config", config, "--out"]).arg(out).args(extra);
        pba_train.output().unwrap()
    };
    assert!(pba_train("all", TINY_PRIOR, &prior, &[]).status.success());
    let with_prior = ["--prior", prior.to_str().unwrap()];
    let output = pba_train("psgn", TINY, &out, &with_prior);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = fs::read_to_string(out.join("psgn.md")).unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), table);
    assert!(table.contains("clouds of 128 points") && table.contains("8 pictures of 4 shapes"));
    let cell = |row: &str, column: usize| -> f64 {
        let line = table.lines().find(|line| line.starts_with(&format!("| {row}"))).unwrap();
        line.split('|').nth(column).unwrap().trim().parse().unwrap()
    };
    // The held-out shapes and pictures are those that training measured on, their points drawn anew.
    let measured = *history(&out, "held_out_chamfer").last().unwrap();
    let direct = cell("direct regression", 2);
    assert!((direct - measured).abs() < 0.1 * measured, "{direct} {measured}");
    let floor = cell("another sampling", 2);
    for row in ["mean shape", "direct regression", "regressed style", "encoded true style"] {
        assert!(cell(row, 2) > floor && cell(row, 3) > 0.0, "{table}");
    }

    // Of other shapes, it might have been trained on those that are held out here.
    let other = folder.path().join("other.toml");
    fs::write(&other, fs::read_to_string(TINY).unwrap().replace("seed = 1", "seed = 2")).unwrap();
    let output =
        pba_train("psgn", other.to_str().unwrap(), &folder.path().join("other"), &with_prior);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && message.contains("other shapes"), "{message}");
}
