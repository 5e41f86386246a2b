//! The binaries, end to end: what they write, and how they refuse bad input.

use std::{fs, path::Path, process::Output};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn pba_infer(arguments: &[&str]) -> Output {
    Command::cargo_bin("pba-infer").unwrap().args(arguments).output().unwrap()
}

fn pba_train(arguments: &[&str]) -> Output {
    Command::cargo_bin("pba-train").unwrap().args(arguments).output().unwrap()
}

/// One line on stderr that says `expected`, an exit code that is not zero, and no panic.
#[track_caller]
fn check_refused(output: &Output, expected: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    let lines: Vec<&str> = message.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(lines.len(), 1, "{message}");
    assert!(!message.contains("panicked"), "{message}");
    for part in expected {
        assert!(lines[0].contains(part), "{:?} does not say {part:?}", lines[0]);
    }
}

/// A copy of the sample sequence, to be broken.
fn sample() -> TempDir {
    let folder = TempDir::new().unwrap();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sample-sequence");
    copy(&source, folder.path());
    folder
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn run(sequence: &Path, extra: &[&str]) -> Output {
    let out = TempDir::new().unwrap();
    let (sequence, out) = (sequence.to_str().unwrap(), out.path().to_str().unwrap());
    pba_infer(&[&["run", sequence, "--out", out], extra].concat())
}

#[test]
fn the_demo_writes_all_it_names() {
    let folder = TempDir::new().unwrap();
    let quick = folder.path().join("quick.toml");
    fs::write(&quick, "blurs = [1.0, 0.0]\n[lm]\niterations = 2\n").unwrap();
    let out = folder.path().join("demo");
    let arguments = ["demo", "--out", out.to_str().unwrap(), "--config", quick.to_str().unwrap()];
    let output = pba_infer(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for name in
        ["transforms.json", "points.ply", "history.csv", "config.toml", "stages.png", "cloud.png"]
    {
        assert!(out.join(name).metadata().unwrap().len() > 0, "{name} is empty");
    }
    assert!(out.join("stages/00_initial.png").is_file());

    let metrics: Value =
        serde_json::from_str(&fs::read_to_string(out.join("metrics.json")).unwrap()).unwrap();
    for key in ["iterations", "seconds", "n_points", "n_frames"] {
        assert!(metrics[key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert_eq!((&metrics["device"], &metrics["solver"]), (&"flex".into(), &"lm".into()));
    for state in ["initial", "final"] {
        for key in [
            "reference_rotation_error_deg",
            "rotation_error_deg_mean",
            "relative_rotation_error_deg_mean",
            "translation_error_mean",
            "style_error",
            "photometric_loss",
            "silhouette_loss",
        ] {
            assert!(metrics[state][key].as_f64().unwrap().is_finite(), "{state} {key}");
        }
    }
}

#[test]
fn estimated_cameras_are_a_sequence_of_the_same_convention() {
    let folder = TempDir::new().unwrap();
    let still = folder.path().join("still.toml");
    fs::write(
        &still,
        "solver = \"adam\"\nblurs = [0.0]\nn_hypotheses = 1\n[adam]\niterations = 1\n",
    )
    .unwrap();
    let out = folder.path().to_str().unwrap();
    let sequence = sample();
    let arguments = ["run", sequence.path().to_str().unwrap(), "--out", out];
    let output = pba_infer(&[&arguments[..], &["--config", still.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |path: &Path| -> Value {
        serde_json::from_str(&fs::read_to_string(path.join("transforms.json")).unwrap()).unwrap()
    };
    let (given, estimated) = (read(sequence.path()), read(folder.path()));
    for key in ["fl_x", "fl_y", "cx", "cy", "w", "h", "world"] {
        assert_eq!(given[key], estimated[key], "{key}");
    }
    let frames = |value: &Value| value["frames"].as_array().unwrap().len();
    assert_eq!(frames(&given), frames(&estimated));
}

#[test]
fn a_missing_frame_is_named() {
    let sequence = sample();
    fs::remove_file(sequence.path().join("images/frame_003.png")).unwrap();
    check_refused(&run(sequence.path(), &[]), &["frame_003.png"]);
}

#[test]
fn a_frame_of_another_size_is_named() {
    let sequence = sample();
    image::RgbImage::new(64, 32).save(sequence.path().join("images/frame_002.png")).unwrap();
    let mask = image::GrayImage::from_pixel(64, 32, image::Luma([255]));
    mask.save(sequence.path().join("masks/frame_002.png")).unwrap();
    check_refused(&run(sequence.path(), &[]), &["frame_002.png", "64"]);
}

#[test]
fn a_truncated_frame_is_named() {
    let sequence = sample();
    let path = sequence.path().join("images/frame_001.png");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    check_refused(&run(sequence.path(), &[]), &["frame_001.png"]);
}

#[test]
fn a_folder_without_a_sequence_is_named() {
    let empty = TempDir::new().unwrap();
    check_refused(&run(empty.path(), &[]), &["transforms.json"]);
}

#[test]
fn a_missing_prior_is_named() {
    let sequence = sample();
    check_refused(&run(sequence.path(), &["--prior", "/no/such/prior"]), &["/no/such/prior"]);
}

#[test]
fn an_unknown_config_key_is_named() {
    let sequence = sample();
    let config = sequence.path().join("typo.toml");
    fs::write(&config, "slover = \"adam\"\n").unwrap();
    let output = run(sequence.path(), &["--config", config.to_str().unwrap()]);
    check_refused(&output, &["typo.toml", "slover"]);
}

#[test]
fn a_broken_mesh_is_refused_with_its_file_and_line() {
    let root = TempDir::new().unwrap();
    for id in 0..6 {
        let model = root.path().join(format!("02958343/broken_{id}/models"));
        fs::create_dir_all(&model).unwrap();
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 nine\n";
        fs::write(model.join("model_normalized.obj"), text).unwrap();
    }
    let out = root.path().join("out");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tiny.toml");
    let output = pba_train(&[
        "prior",
        "--config",
        config.to_str().unwrap(),
        "--shapenet",
        root.path().to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);
    check_refused(&output, &["02958343", "model_normalized.obj", "line 4"]);
}
