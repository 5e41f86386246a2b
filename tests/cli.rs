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

/// A finished run, as far as `export` reads it: the sample sequence has the same files.
#[test]
fn a_run_is_exported_to_every_format() {
    let run = sample();
    let output = pba_infer(&["export", run.path().to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for name in ["colmap/images.txt", "trajectory.txt", "scene.glb", "run.npz"] {
        assert!(run.path().join(name).metadata().unwrap().len() > 0, "{name} is empty");
    }
    fs::remove_file(run.path().join("points.ply")).unwrap();
    let output = pba_infer(&["export", run.path().to_str().unwrap(), "--format", "tum,glb"]);
    check_refused(&output, &["points.ply"]);
}

/// A folder with a file that is called a video, and a program that is called ffmpeg.
#[cfg(unix)]
fn video(ffmpeg: &str) -> TempDir {
    use std::os::unix::fs::PermissionsExt;
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("clip.mp4"), "frames").unwrap();
    let program = folder.path().join("ffmpeg");
    fs::write(&program, ffmpeg).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    folder
}

#[cfg(unix)]
fn run_video(folder: &Path, path: &str, extra: &[&str]) -> Output {
    let video = folder.join("clip.mp4");
    let out = folder.join("out");
    let arguments = ["run", video.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let arguments = [&arguments[..], extra].concat();
    let mut command = Command::cargo_bin("pba-infer").unwrap();
    command.env("PATH", path).args(arguments).output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_video_without_ffmpeg_says_what_to_install() {
    let folder = video("");
    check_refused(&run_video(folder.path(), "/nowhere", &[]), &["clip.mp4", "ffmpeg", "install"]);
}

#[cfg(unix)]
#[test]
fn a_video_s_frames_are_those_that_ffmpeg_extracts() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sample-sequence/images");
    // The last argument is the pattern of the frames, in the folder where they go.
    let folder = video(&format!(
        "#!/bin/sh\nfor last; do :; done\necho \"$*\" > \"$(dirname \"$0\")/arguments\"\n\
         cp {0}/frame_000.png \"$(dirname \"$last\")/000001.png\"\n\
         cp {0}/frame_001.png \"$(dirname \"$last\")/000002.png\"\n",
        source.display()
    ));
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
    let extra = ["--frames", "5..9", "--every", "2", "--fov", "50"];
    // The sample's pictures have no alpha channel, and no masks are named after the video's frames.
    let output = run_video(folder.path(), &path, &extra);
    check_refused(&output, &["clip.mp4", "no alpha channel", "--masks"]);
    let arguments = fs::read_to_string(folder.path().join("arguments")).unwrap();
    assert!(arguments.contains("select='gte(n,5)*not(mod(n-5,2))*lt(n,9)'"), "{arguments}");

    let masks = folder.path().join("video_masks");
    copy(&source.with_file_name("masks"), &masks);
    for (from, to) in [("frame_000.png", "frame_000005.png"), ("frame_001.png", "frame_000007.png")]
    {
        fs::rename(masks.join(from), masks.join(to)).unwrap();
    }
    let quick = folder.path().join("quick.toml");
    fs::write(&quick, "blurs = [1.0]\n[lm]\niterations = 1\n").unwrap();
    let [masks, quick] = [&masks, &quick].map(|path| path.to_str().unwrap());
    let extra = [&extra[..], &["--masks", masks, "--config", quick]].concat();
    let output = run_video(folder.path(), &path, &extra);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && message.contains("video, 2 frames of 128"), "{message}");
    let cameras = fs::read_to_string(folder.path().join("out/transforms.json")).unwrap();
    assert!(cameras.contains("frame_000005.png") && cameras.contains("frame_000007.png"));
}
