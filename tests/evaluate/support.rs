//! A tiny prior, small sequences, and reading what an evaluation writes: plain JSON, CSV and PLY.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Output,
    sync::OnceLock,
};

use assert_cmd::Command;
use object_pba::{
    data::{
        formats::nerfstudio::write_sequence,
        procedural::car,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
    training::{TrainingConfig, train_regressors, train_shape_prior},
};
use serde_json::Value;
use tempfile::TempDir;

/// A config under which the solver takes a few steps.
const HASTY: &str =
    "blurs = [1.0]\nn_hypotheses = 1\n[lm]\niterations = 3\n[adam]\niterations = 3\n";

/// 512 points, trained for a second or two: its reconstructions are bad, and so worth measuring.
pub fn prior() -> &'static Path {
    static PRIOR: OnceLock<TempDir> = OnceLock::new();
    let train = || {
        let folder = TempDir::new().unwrap();
        let tiny = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/tiny.toml");
        let config = TrainingConfig::read(Path::new(tiny)).unwrap();
        let device = Backend::Flex.device();
        train_shape_prior(&config, folder.path(), &device).unwrap();
        train_regressors(&config, folder.path(), &device).unwrap();
        fs::write(folder.path().join("hasty.toml"), HASTY).unwrap();
        folder
    };
    PRIOR.get_or_init(train).path()
}

/// Sequences `car_0-0`, `car_1-0` and so on of five frames, with their truth.
pub fn dataset(n: u64) -> TempDir {
    let folder = TempDir::new().unwrap();
    let options = SequenceOptions {
        n_frames: 5,
        size: [64, 64],
        n_true_points: 1500,
        ..SequenceOptions::default()
    };
    for idx in 0..n {
        let sequence = Sequence::render(&car(90 + idx), &options, 7 + idx);
        write_sequence(&sequence, &folder.path().join(format!("car_{idx}-0"))).unwrap();
    }
    folder
}

/// The command, hasty unless it is given a config.
pub fn command(dataset: &Path, out: &Path, extra: &[&str]) -> Command {
    let config = prior().join("hasty.toml");
    let mut command = Command::cargo_bin("pba-infer").unwrap();
    command.arg("evaluate").arg(dataset).arg("--out").arg(out).arg("--prior").arg(prior());
    if !extra.contains(&"--config") {
        command.arg("--config").arg(config);
    }
    command.args(extra);
    command
}

#[track_caller]
pub fn evaluate(dataset: &Path, out: &Path, extra: &[&str]) -> Output {
    let output = command(dataset, out, extra).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// A line of per_sequence.csv, by its headings.
pub type Row = BTreeMap<String, String>;

pub fn rows(out: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(out.join("per_sequence.csv")).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// The line of a sequence and a state.
#[track_caller]
pub fn row(rows: &[Row], sequence: &str, state: &str) -> Row {
    let found = rows.iter().find(|row| row["sequence"] == sequence && row["state"] == state);
    found.unwrap_or_else(|| panic!("no line of {sequence} and {state}")).clone()
}

pub fn number(row: &Row, key: &str) -> Option<f64> {
    let text = &row[key];
    (!text.is_empty()).then(|| text.parse().unwrap())
}

pub fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

pub type Matrix = [[f64; 4]; 4];

/// The `transform_matrix` of every frame, camera to world.
pub fn matrices(folder: &Path) -> Vec<Matrix> {
    let file = json(&folder.join("transforms.json"));
    let frames = file["frames"].as_array().unwrap().iter();
    let matrix = |frame: &Value| -> Matrix {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| frame["transform_matrix"][i][j].as_f64().unwrap())
        })
    };
    frames.map(matrix).collect()
}

/// The points of a binary PLY of three floats a point, or of three floats and more bytes.
pub fn cloud(path: &Path) -> Vec<[f64; 3]> {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
    let count = header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
    let stride = (bytes.len() - start) / count.parse::<usize>().unwrap();
    let float = |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
    let point = |bytes: &[u8]| std::array::from_fn(|i| float(&bytes[4 * i..4 * i + 4]));
    bytes[start..].chunks_exact(stride).map(point).collect()
}

/// Where an evaluation keeps what a method found of a sequence.
pub fn estimate(out: &Path, sequence: &str, method: &str) -> PathBuf {
    out.join("sequences").join(sequence).join(method)
}
