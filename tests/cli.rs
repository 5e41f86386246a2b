//! The binaries, end to end: what they write, and how they refuse bad input.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Output, Stdio},
    time::{Duration, Instant},
};

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
fn a_run_that_starts_at_the_truth_starts_without_an_error_and_needs_one() {
    let folder = TempDir::new().unwrap();
    let quick = folder.path().join("quick.toml");
    fs::write(&quick, "blurs = [0.0]\n[lm]\niterations = 1\n").unwrap();
    let [quick, out] = [&quick, folder.path()].map(|path| path.to_str().unwrap());
    let sequence = sample();
    let arguments = ["--config", quick, "--start", "truth"];
    let path = sequence.path().to_str().unwrap();
    let output = pba_infer(&[&["run", path, "--out", out], &arguments[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metrics = fs::read_to_string(folder.path().join("metrics.json")).unwrap();
    let metrics: Value = serde_json::from_str(&metrics).unwrap();
    let error = |name: &str| metrics["initial"][name].as_f64().unwrap();
    assert!(error("rotation_error_deg_mean") < 0.01 && error("translation_error_mean") < 1e-4);
    // What the encoder makes of the true shape: twice the noise of sampling it, not more.
    assert!(error("style_error") < 1.5e-4);

    fs::remove_file(sequence.path().join("points.ply")).unwrap();
    check_refused(&run(sequence.path(), &arguments), &["true poses and points", "not known"]);
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

/// A configuration in which each solver takes a step or two.
const HASTY: &str = "
    blurs = [0.0]
    n_hypotheses = 1
    adam = { iterations = 2 }
    lbfgs = { evaluations = 12, relative_first = 0 }
    alternating = { max_rounds = 1, lbfgs = { max_evaluations = 3 } }
";

/// Ablates the sample; the cells of the table's style error, and what went to stderr.
fn ablated(solver: &str, expected: &str) -> ([String; 3], String) {
    let folder = TempDir::new().unwrap();
    let (hasty, out) = (folder.path().join("hasty.toml"), folder.path().join("ablation"));
    fs::write(&hasty, HASTY).unwrap();
    let sequence = sample();
    let [path, hasty, out] = [sequence.path(), &hasty, &out].map(|path| path.to_str().unwrap());
    let arguments = ["--out", out, "--config", hasty, "--solver", solver];
    let output = pba_infer(&[&["ablate", path], &arguments[..]].concat());
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{messages}");
    let config = fs::read_to_string(Path::new(out).join("config.toml")).unwrap();
    assert!(config.contains(&format!("solver = \"{expected}\"")), "{config}");
    let table = fs::read_to_string(Path::new(out).join("table.md")).unwrap();
    let row = table.lines().find(|line| line.contains("style error")).unwrap();
    let cells: Vec<String> = row.split('|').map(|cell| cell.trim().into()).collect();
    ([cells[3].clone(), cells[4].clone(), cells[5].clone()], messages)
}

#[test]
fn both_arms_of_the_ablation_move_under_each_solver() {
    for solver in ["adam", "lbfgs", "alternating-lbfgs"] {
        let ([initial, with_prior, free], messages) = ablated(solver, solver);
        let cells = [&initial, &with_prior, &free];
        assert!(cells.iter().all(|cell| cell.parse::<f64>().is_ok()), "{cells:?}");
        assert!(initial != with_prior && initial != free && with_prior != free, "{cells:?}");
        assert!(!messages.contains("note:"), "{messages}");
    }
}

#[test]
fn the_ablation_says_when_it_does_not_use_lm() {
    let (_, messages) = ablated("lm", "adam");
    assert!(messages.contains("lm") && messages.contains("adam"), "{messages}");
}

#[test]
fn exposures_and_the_focal_length_are_reported_where_they_are_solved_for() {
    let sequence = sample();
    let config = sequence.path().join("options.toml");
    let options = "[objective]\nsolve_exposure = true\nrefine_focal = true\n\
        silhouette_norm = \"saturating\"\nsilhouette_trim = 0.01\n";
    fs::write(&config, format!("blurs = [1.0]\n[lm]\niterations = 6\n{options}")).unwrap();
    let out = TempDir::new().unwrap();
    let [path, config, folder] =
        [sequence.path(), &config, out.path()].map(|path| path.to_str().unwrap());
    let output = pba_infer(&["run", path, "--out", folder, "--config", config]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |folder: &Path, name: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(folder.join(name)).unwrap()).unwrap()
    };
    let metrics = read(out.path(), "metrics.json");
    let exposures = metrics["exposures"].as_array().unwrap();
    assert_eq!(exposures.len(), 14);
    for exposure in exposures {
        // The sample's pictures are exposed alike.
        assert!((exposure["gain"].as_f64().unwrap() - 1.0).abs() < 0.1, "{exposures:?}");
    }
    let (given, found) =
        (read(sequence.path(), "transforms.json"), read(out.path(), "transforms.json"));
    let [given, found, focal] =
        [&given["fl_x"], &found["fl_x"], &metrics["focal"][0]].map(|focal| focal.as_f64().unwrap());
    assert!(found != given && (found / given - 1.0).abs() < 0.2, "{found} from {given}");
    assert!((found - focal).abs() < 1e-3 * focal, "{found} is not {focal}");
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
fn frames_may_lack_masks_and_the_reference_may_not() {
    let sequence = sample();
    let quick = sequence.path().join("quick.toml");
    fs::write(&quick, "blurs = [1.0]\n[lm]\niterations = 2\n").unwrap();
    let arguments = ["--config", quick.to_str().unwrap()];
    let mask = |frame: usize| sequence.path().join(format!("masks/frame_{frame:03}.png"));
    fs::remove_file(mask(3)).unwrap();
    image::GrayImage::new(128, 128).save(mask(7)).unwrap();
    let out = TempDir::new().unwrap();
    let [path, folder] = [&sequence, &out].map(|folder| folder.path().to_str().unwrap());
    let output = pba_infer(&[&["run", path, "--out", folder], &arguments[..]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let note = "2 of 15 frames have no mask, or an empty one; the first is images/frame_003.png";
    assert!(message.contains(note), "{message}");
    let metrics = fs::read_to_string(out.path().join("metrics.json")).unwrap();
    let metrics: Value = serde_json::from_str(&metrics).unwrap();
    let error = |state: &str| metrics[state]["rotation_error_deg_mean"].as_f64().unwrap();
    assert!(error("final") < error("initial"), "{metrics}");

    (0..15).for_each(|frame| drop(fs::remove_file(mask(frame))));
    let missing = ["first frame", "no mask", "--masks", "--frames"];
    check_refused(&run(sequence.path(), &arguments), &missing);
    let from_truth = [&arguments[..], &["--start", "truth"]].concat();
    let output = run(sequence.path(), &from_truth);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
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

const BROKEN: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 nine\n";

/// A folder of `n` boxes of different lengths, as plain meshes.
fn boxes(n: usize) -> TempDir {
    let folder = TempDir::new().unwrap();
    for idx in 0..n {
        let z = 2.0 + 0.1 * idx as f64;
        let lid = |y: u8| format!("v 0 {y} 0\nv 1 {y} 0\nv 1 {y} {z}\nv 0 {y} {z}\n");
        let faces = "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        let text = format!("{}{}{faces}", lid(0), lid(1));
        fs::write(folder.path().join(format!("box_{idx:02}.obj")), text).unwrap();
    }
    folder
}

#[test]
fn inspecting_a_collection_counts_draws_and_lists_what_failed() {
    let meshes = boxes(5);
    fs::write(meshes.path().join("broken.obj"), BROKEN).unwrap();
    let out = meshes.path().join("out");
    let [folder, out] = [meshes.path(), &out].map(|path| path.to_str().unwrap());
    let output = pba_train(&["inspect", folder, "--out", out]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = String::from_utf8_lossy(&output.stdout);
    for part in ["6 models, 5 of them usable", "z (5)", "unusable      1", "broken.obj", "line 4"] {
        assert!(table.contains(part), "{table} does not say {part:?}");
    }

    let report = fs::read_to_string(Path::new(out).join("inspect.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let models = report["models"].as_array().unwrap();
    let triangles: Vec<_> = models.iter().map(|model| model["n_triangles"].as_u64()).collect();
    assert_eq!(triangles, [Some(12); 5]);
    assert_eq!(models[4]["tile"], serde_json::json!([2, 2]));
    assert_eq!(report["unusable"][0]["id"], "broken");

    // Three columns, two rows, and a box in the middle of each tile but the last.
    let sheet = image::open(Path::new(out).join("contact_sheet.png")).unwrap().to_rgb8();
    let (side, paper) = (sheet.width() / 3, sheet.get_pixel(0, 0));
    assert_eq!(sheet.height(), 2 * side);
    for tile in 0..6 {
        let centre = sheet.get_pixel((tile % 3) * side + side / 2, (tile / 3) * side + side / 2);
        assert_eq!(centre == paper, tile == 5, "tile {tile}");
    }
}

#[test]
fn inspecting_a_prior_compares_its_reconstructions_with_what_needs_no_network() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let paths = [root.join("tests/fixtures/shapenet_v2"), root.join("assets/car-prior"), out];
    let [meshes, prior, out] = paths.each_ref().map(|path| path.to_str().unwrap());
    let output = pba_train(&["inspect", meshes, "--prior", prior, "--out", out]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("smarts_simple_car"));

    let report = fs::read_to_string(Path::new(out).join("prior.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let error = |name: &str| report["shapes"][0][name].as_f64().unwrap();
    assert!(error("noise_floor") < error("fitted").min(error("retrieved")));
    assert!(error("fitted") < error("decoded"));
    assert!(error("retrieved") < error("mean_shape"));

    // The car, its reconstruction, its fit and its nearest, then six directions; the last four tiles
    // of the first row are empty.
    let sheet = image::open(Path::new(out).join("prior.png")).unwrap().to_rgb8();
    let (side, paper) = (sheet.width() / 8, image::Rgb([255; 3]));
    assert_eq!(sheet.height(), 7 * side);
    for tile in 0..8 {
        let middle = sheet.get_pixel(tile * side + side / 2, side / 2);
        assert_eq!(*middle == paper, tile >= 4, "tile {tile}");
    }
    let nothing = pba_train(&["inspect", "--out", out]);
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("<FOLDER>"));
}

#[test]
fn axes_that_are_parallel_are_refused() {
    let meshes = boxes(1);
    let folder = meshes.path().to_str().unwrap();
    let output = pba_train(&["inspect", folder, "--up", "z", "--front", "-z"]);
    check_refused(&output, &["up is z", "front cannot be -z"]);
}

#[test]
fn rendering_skips_and_lists_what_cannot_be_read() {
    let meshes = boxes(2);
    fs::write(meshes.path().join("broken.obj"), BROKEN).unwrap();
    let config = meshes.path().join("short.toml");
    fs::write(&config, "n_frames = 2\n").unwrap();
    let render = |out: &TempDir, include: &str| {
        let [folder, out, config] =
            [meshes.path(), out.path(), &config].map(|path| path.to_str().unwrap());
        let arguments = ["render", "--meshes", folder, "--out", out, "--config", config];
        pba_train(&[&arguments[..], &["--include", include]].concat())
    };
    let out = TempDir::new().unwrap();
    let output = render(&out, "*");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    assert!(message.contains("skipped: ") && message.contains("broken.obj"), "{message}");
    assert!(out.path().join("box_00-0/transforms.json").is_file());
    assert!(out.path().join("box_01-0/transforms.json").is_file());
    let other = TempDir::new().unwrap();
    check_refused(&render(&other, "broken"), &["broken.obj", "line 4"]);
}

/// A run that trains for one step on `meshes`, with many points to sample.
fn training_on(meshes: &Path, out: &Path, cache: &Path) -> std::process::Command {
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tiny.toml");
    let text = fs::read_to_string(tiny).unwrap();
    let text = text.replace("points_per_model = 1024", "points_per_model = 100000");
    let text = text.replace("steps = 40", "steps = 1");
    let config = meshes.join("one-step.toml");
    fs::write(&config, text).unwrap();
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("pba-train"));
    command.arg("prior").arg("--config").arg(config).arg("--meshes").arg(meshes);
    command.arg("--out").arg(out).arg("--cache").arg(cache);
    command
}

fn contents(folder: &Path) -> BTreeMap<std::ffi::OsString, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries.map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap())).collect()
}

#[test]
fn a_cache_of_points_survives_a_killed_run_byte_for_byte() {
    let meshes = boxes(21);
    fs::write(meshes.path().join("broken.obj"), BROKEN).unwrap();
    let folder = TempDir::new().unwrap();
    let [whole, killed, run_a, run_b] =
        ["whole", "killed", "run_a", "run_b"].map(|name| folder.path().join(name));
    let output = training_on(meshes.path(), &run_a, &whole).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    assert!(message.contains("skipped: ") && message.contains("broken.obj"), "{message}");
    let expected = contents(&whole);
    assert!(expected.len() >= 20, "{}", expected.len());

    let mut child =
        training_on(meshes.path(), &run_b, &killed).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while fs::read_dir(&killed).map_or(0, Iterator::count) < 3 {
        assert!(start.elapsed() < Duration::from_secs(60), "nothing is kept");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(training_on(meshes.path(), &run_b, &killed).output().unwrap().status.success());
    assert!(contents(&killed) == expected, "the caches differ");
    let weights = |run: &Path| fs::read(run.join("prior.safetensors")).unwrap();
    assert!(weights(&run_a) == weights(&run_b), "the weights differ");
}

#[test]
fn a_broken_mesh_is_refused_with_its_file_and_line() {
    let root = TempDir::new().unwrap();
    for id in 0..6 {
        let model = root.path().join(format!("02958343/broken_{id}/models"));
        fs::create_dir_all(&model).unwrap();
        fs::write(model.join("model_normalized.obj"), BROKEN).unwrap();
    }
    let out = root.path().join("out");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tiny.toml");
    let output = pba_train(&[
        "prior",
        "--config",
        config.to_str().unwrap(),
        "--meshes",
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
