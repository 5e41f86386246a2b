//! Training runs as a whole, on the tiny preset.

use std::{
    fs,
    path::Path,
    process::Command,
    thread::sleep,
    time::{Duration, Instant},
};

use burn::tensor::{Device, Tensor, TensorData, s};
use object_pba::{
    chamfer::chamfer_distance,
    checkpoint::{REGRESSORS_FILE, SHAPE_FILE, load_shape},
    config::write_config,
    data::{keyed_rng, procedural::car, surface::sample_surface},
    device::Backend,
    host::host_values,
    training::{TrainingConfig, train_regressors, train_shape_prior, write_shard},
};
use serde_json::Value;
use tempfile::TempDir;

const TINY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/tiny.toml");

fn tiny() -> TrainingConfig {
    TrainingConfig::read(Path::new(TINY)).unwrap()
}

fn train_prior(config: &TrainingConfig, backend: Backend) -> TempDir {
    let out = tempfile::tempdir().unwrap();
    train_shape_prior(config, out.path(), &backend.device()).unwrap();
    out
}

fn train(config: &TrainingConfig, backend: Backend) -> TempDir {
    let out = train_prior(config, backend);
    train_regressors(config, out.path(), &backend.device()).unwrap();
    out
}

fn weights(out: &Path) -> [Vec<u8>; 2] {
    [SHAPE_FILE, REGRESSORS_FILE].map(|file| fs::read(out.join(file)).unwrap())
}

/// A quantity of a stage, over its logged steps.
fn history(out: &Path, stage: &str, name: &str) -> Vec<f64> {
    let text = fs::read_to_string(out.join("metrics.jsonl")).unwrap();
    let lines = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.filter(|line| line["stage"] == stage).filter_map(|line| line[name].as_f64()).collect()
}

#[track_caller]
fn check_falls(losses: &[f64]) {
    let half = losses.len() / 2;
    let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
    let (early, late) = (mean(&losses[..half]), mean(&losses[half..]));
    assert!(late < 0.9 * early, "{losses:?}");
}

#[track_caller]
fn check_learns(backend: Backend) {
    let out = train(&tiny(), backend);
    check_falls(&history(out.path(), "prior", "chamfer"));
    check_falls(&history(out.path(), "regressors", "pose"));
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
    let [one, same] = [tiny(), tiny()].map(|config| train(&config, Backend::Flex));
    let other = train(&TrainingConfig { seed: 2, ..tiny() }, Backend::Flex);
    let [one, same, other] = [one, same, other].map(|out| weights(out.path()));
    assert!(one == same);
    assert!(one[0] != other[0] && one[1] != other[1]);
}

/// Kills a run in both stages, and compares what it comes to.
#[track_caller]
fn check_goes_on(config: &Path) {
    let out = tempfile::tempdir().unwrap();
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pba-train"));
        command.args(["all", "--config"]).arg(config).arg("--out").arg(out.path());
        command
    };
    for (checkpoint, weights) in
        [("prior.checkpoint", SHAPE_FILE), ("regressors.checkpoint", REGRESSORS_FILE)]
    {
        let mut run = command().spawn().unwrap();
        let start = Instant::now();
        while !out.path().join(checkpoint).exists() && start.elapsed() < Duration::from_secs(60) {
            sleep(Duration::from_millis(1));
        }
        run.kill().unwrap();
        run.wait().unwrap();
        assert!(out.path().join(checkpoint).exists(), "the run was not interrupted");
        assert!(!out.path().join(weights).exists(), "the run was not interrupted");
    }
    assert!(command().status().unwrap().success());

    let uninterrupted = train(&TrainingConfig::read(config).unwrap(), Backend::Flex);
    assert!(weights(out.path()) == weights(uninterrupted.path()));
    for stage in ["prior", "regressors"] {
        let steps = history(out.path(), stage, "step");
        assert_eq!(steps, history(uninterrupted.path(), stage, "step"));
    }
}

#[test]
fn an_interrupted_run_goes_on_to_the_same_weights() {
    check_goes_on(Path::new(TINY));
}

#[test]
fn a_run_goes_on_in_the_middle_of_a_later_round() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tiny.toml");
    let mut config = tiny();
    config.data.views_per_round = 1;
    config.regressors.schedule.checkpoint_every = 7;
    let steps_per_round = config.data.n_models / config.regressors.schedule.batch_size;
    assert_eq!((7 / steps_per_round, 7 % steps_per_round), (3, 1));
    write_config(&path, &config).unwrap();
    check_goes_on(&path);
}

#[test]
fn shards_give_the_weights_that_rendering_gives() {
    let rendered = train(&tiny(), Backend::Flex);
    let [shards, out] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    for part in ["2/2", "1/2"] {
        write_shard(&tiny(), part.parse().unwrap(), shards.path()).unwrap();
    }
    fs::copy(rendered.path().join(SHAPE_FILE), out.path().join(SHAPE_FILE)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_pba-train"));
    command.args(["regressors", "--config", TINY, "--out"]).arg(out.path());
    command.arg("--shards").arg(shards.path());
    assert!(command.status().unwrap().success());
    assert!(weights(out.path()) == weights(rendered.path()));
}

#[test]
fn a_cars_style_says_more_of_it_than_the_mean_style() {
    let device = Device::flex();
    let mut config = tiny();
    config.data.n_models = 48;
    config.prior.schedule.steps = 200;
    let out = train_prior(&config, Backend::Flex);
    let prior = load_shape(&config, &out.path().join(SHAPE_FILE), &device).unwrap();
    let cloud = |seed| {
        let points = sample_surface(&car(seed), 512, &mut keyed_rng(seed, [0, 0]));
        let values: Vec<f32> = points.iter().flat_map(|point| point.coords.data.0[0]).collect();
        Tensor::<3>::from_data(TensorData::new(values, [1, 512, 3]), &device)
    };
    let clouds = Tensor::cat((0..12).map(cloud).collect(), 0);
    let seen = clouds.clone().slice(s![.., 0..tiny().prior.network.n_encoder_points as i32, ..]);

    let styles = prior.encode(seen);
    let error = |styles: Tensor<2>| {
        let distances = chamfer_distance(prior.generator.forward(styles), clouds.clone());
        host_values(&distances.mean())[0]
    };
    let (own, mean) = (error(styles.clone()), error(styles.zeros_like()));
    assert!(own < 0.9 * mean, "{own} {mean}");
}

#[test]
fn a_finished_run_is_left_alone_and_another_config_refused() {
    let out = train_prior(&tiny(), Backend::Flex);
    let modified = || fs::metadata(out.path().join(SHAPE_FILE)).unwrap().modified().unwrap();
    let before = modified();
    train_shape_prior(&tiny(), out.path(), &Device::flex()).unwrap();
    assert_eq!(modified(), before);

    let other = TrainingConfig { seed: 2, ..tiny() };
    let error = train_shape_prior(&other, out.path(), &Device::flex()).unwrap_err();
    assert!(error.to_string().contains("another config"));
}

#[test]
fn what_cannot_be_trained_is_one_line_on_stderr() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.toml");
    fs::write(&broken, "[data]\nmodels = 3\n").unwrap();
    for config in [broken.clone(), folder.path().join("missing.toml")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pba-train"));
        let out = folder.path().join("out");
        command.arg("prior").arg("--config").arg(&config).arg("--out").arg(&out);
        let output = command.output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success());
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert!(message.contains(config.to_str().unwrap()), "{message}");
    }
}

#[test]
fn every_training_preset_can_be_trained() {
    for name in ["tiny.toml", "car-small.toml", "car-paper.toml"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
        TrainingConfig::read(&path).unwrap();
    }
}
