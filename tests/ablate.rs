//! Studies from one command: their tables follow from what is stored, and that is not done again.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Output,
    time::SystemTime,
};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// A few iterations: how well anything is solved does not matter here.
const HASTY: &str =
    "blurs = [1.0]\n[lm]\niterations = 2\nrelative_first = 1\n[adam]\niterations = 3\n";

/// Three sequences of the sample's frames, of which one starts later and one lacks its first mask.
fn dataset() -> TempDir {
    let folder = TempDir::new().unwrap();
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sample-sequence");
    for name in ["car-0", "car-1", "car-2"] {
        copy(&sample, &folder.path().join(name));
    }
    let transforms = folder.path().join("car-1/transforms.json");
    let mut listing: Value = serde_json::from_slice(&fs::read(&transforms).unwrap()).unwrap();
    listing["frames"].as_array_mut().unwrap().drain(..4);
    fs::write(transforms, listing.to_string()).unwrap();
    let mask = folder.path().join("car-2/masks/frame_000.png");
    let size = image::open(&mask).unwrap().to_luma8().dimensions();
    image::GrayImage::new(size.0, size.1).save(mask).unwrap();
    fs::write(folder.path().join("hasty.toml"), HASTY).unwrap();
    folder
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true => copy(&entry.path(), &target),
            false => drop(fs::copy(entry.path(), target).unwrap()),
        }
    }
}

fn ablate(dataset: &Path, out: &Path, extra: &[&str]) -> Output {
    let mut command = Command::cargo_bin("pba-infer").unwrap();
    command.arg("ablate").arg(dataset).arg("--out").arg(out);
    command.arg("--config").arg(dataset.join("hasty.toml"));
    let output = command.args(["--points", "1536"]).args(extra).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The cells of a table's row, by its first one.
fn row(table: &str, arm: &str) -> Vec<String> {
    let begin = format!("| {arm} |");
    let line = table.lines().find(|line| line.starts_with(&begin));
    let line = line.unwrap_or_else(|| panic!("{arm} is not in {table}"));
    line.trim_matches('|').split('|').map(|cell| cell.trim().into()).collect()
}

/// When each stored result was written.
fn results(out: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let files = fs::read_dir(out.join("results")).unwrap().map(|entry| entry.unwrap().path());
    files.map(|file| (file.clone(), fs::metadata(file).unwrap().modified().unwrap())).collect()
}

/// An arm's values at the end, of the sequences that have one, from the lines of a CSV file.
fn values(csv: &str, arm: &str, column: &str) -> Vec<f64> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let place = reader.headers().unwrap().iter().position(|name| name == column).unwrap();
    let records: Vec<_> = reader.records().map(Result::unwrap).collect();
    let of_arm = records.iter().filter(|record| &record[1] == arm);
    of_arm.filter_map(|record| record[place].parse().ok()).collect()
}

#[test]
fn a_study_tabulates_all_arms_and_counts_failures() {
    let (dataset, out) = (dataset(), TempDir::new().unwrap());
    ablate(dataset.path(), out.path(), &["--study", "parameterisation"]);
    let folder = out.path().join("parameterisation");
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    let (table, sequences) = (read("table.md"), read("per_sequence.csv"));
    assert_eq!(fs::read_to_string(out.path().join("table.md")).unwrap().trim(), table.trim());
    for arm in ["object", "camera"] {
        assert_eq!(row(&table, arm)[1], "1", "{table}");
        let errors = values(&sequences, arm, "pose error (deg), end");
        let [a, b] = errors[..] else { panic!("{errors:?}") };
        let cell = &row(&table, arm)[2];
        let median: f64 = cell.split([' ', '[']).nth(2).unwrap().parse().unwrap();
        assert!((median - (a + b) / 2.0).abs() < 1e-3 * median, "{cell} of {errors:?}");
    }
    assert!(table.contains("failed: object, car-2: ") && table.contains("mask"), "{table}");
    assert_ne!(row(&table, "object")[2..9], row(&table, "camera")[2..9]);

    let summary = read("table.csv");
    assert_eq!(summary.lines().count(), 1 + 2 * 7 * 2);
    let figure = read("figure.svg");
    assert!(figure.starts_with("<svg") && figure.contains("camera"), "{figure}");
    // A median each, of two arms and three metrics.
    assert_eq!(figure.matches("r=\"4\"").count(), 6);
    let configs: Vec<_> = fs::read_dir(folder.join("arms")).unwrap().map(Result::unwrap).collect();
    let config = |entry: &fs::DirEntry| fs::read_to_string(entry.path()).unwrap();
    let camera = configs.iter().filter(|entry| config(entry).contains("camera-centred"));
    assert_eq!((configs.len(), camera.count()), (2, 1));
}

#[test]
fn what_is_done_is_not_done_again_and_what_is_shared_is_done_once() {
    let (dataset, out) = (dataset(), TempDir::new().unwrap());
    ablate(dataset.path(), out.path(), &["--study", "parameterisation"]);
    let table = fs::read(out.path().join("parameterisation/table.csv")).unwrap();
    let before = results(out.path());
    assert_eq!(before.len(), 2 * 3);

    // The first arm is that of the default hypotheses, too, and one result was lost.
    let lost = before.keys().find(|path| path.to_str().unwrap().contains("car-0")).unwrap();
    fs::write(lost, "{\"sequence\": \"car").unwrap();
    let lost_at = results(out.path())[lost];
    let output = ablate(dataset.path(), out.path(), &["--study", "hypotheses,parameterisation"]);
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(messages.contains("9 reconstructions"), "{messages}");
    let after = results(out.path());
    assert_eq!(after.len(), 2 * 3 + 2 * 3);
    for (path, written) in &before {
        let again = path.to_str().unwrap().contains("car-2") || path == lost;
        assert_eq!(after[path] != *written, again, "{path:?}");
    }
    assert_ne!(after[lost], lost_at);
    assert_eq!(fs::read(out.path().join("parameterisation/table.csv")).unwrap(), table);
}

#[test]
fn other_settings_are_other_results() {
    let (dataset, out) = (dataset(), TempDir::new().unwrap());
    let only = ["--study", "parameterisation", "--max-sequences", "1"];
    ablate(dataset.path(), out.path(), &only);
    let first = results(out.path());
    fs::write(dataset.path().join("hasty.toml"), HASTY.replace("iterations = 2", "iterations = 1"))
        .unwrap();
    ablate(dataset.path(), out.path(), &only);
    assert_eq!(results(out.path()).len(), 4);
    assert!(first.keys().all(|path| results(out.path()).contains_key(path)));
}

#[test]
fn views_and_points_are_as_many_as_the_arm_says() {
    let (dataset, out) = (dataset(), TempDir::new().unwrap());
    fs::remove_dir_all(dataset.path().join("car-2")).unwrap();
    ablate(dataset.path(), out.path(), &["--study", "views,prior"]);
    let table = fs::read_to_string(out.path().join("table.md")).unwrap();
    for l in ["1", "2", "5", "10"] {
        assert_eq!(row(&table, l)[1], "0", "{table}");
    }
    // One of the two has eleven frames.
    assert_eq!(row(&table, "15")[1], "1", "{table}");
    assert!(table.contains("failed: 15, car-1: it has 11 frames only"), "{table}");
    // Of one frame, nothing is relative.
    assert_eq!(row(&table, "1")[3], "–", "{table}");

    let sequences = fs::read_to_string(out.path().join("prior/per_sequence.csv")).unwrap();
    let column = |state: &str| format!("style error, Eq. 7 (1e-3), {state}");
    let [prior, free] = ["shape prior", "free points"]
        .map(|arm| ["start", "end"].map(|state| values(&sequences, arm, &column(state))));
    // The same cloud to start from, and another one in the end.
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 * a);
    assert!(close(&prior[0], &free[0]), "{prior:?} {free:?}");
    assert!(!close(&prior[1], &free[1]) && !close(&free[0], &free[1]), "{prior:?} {free:?}");
}
