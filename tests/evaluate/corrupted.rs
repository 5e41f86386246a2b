//! Estimates of others, spoiled in known ways: each number moves as it should, and no other.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use object_pba::data::formats::{
    Trajectory, colmap,
    nerfstudio::{read_trajectory, write_trajectory},
    ply::{PointCloud, read_points, write_points},
};
use tempfile::TempDir;

use super::support::{Row, dataset, evaluate, number, row, rows};

const CAR: &str = "car_0-0";

/// The true cameras and points of a sequence, to be spoiled.
struct Estimate {
    trajectory: Trajectory,
    points: Vec<Point3<f32>>,
}

impl Estimate {
    fn of(sequence: &Path) -> Self {
        Self {
            trajectory: read_trajectory(&sequence.join("transforms.json")).unwrap(),
            points: read_points(&sequence.join("points.ply")).unwrap(),
        }
    }

    /// `camera_from_world` of every frame.
    fn poses(&mut self) -> &mut [Isometry3<f32>] {
        &mut self.trajectory.camera_from_world
    }

    fn write(&self, estimates: &Path) {
        let folder = estimates.join(CAR);
        fs::create_dir_all(&folder).unwrap();
        write_trajectory(&folder.join("transforms.json"), &self.trajectory).unwrap();
        let cloud = PointCloud { points: self.points.clone(), ..PointCloud::default() };
        write_points(&folder.join("points.ply"), &cloud).unwrap();
    }
}

type Spoil = fn(&mut Estimate);

const SPOILED: [(&str, Spoil); 7] = [
    ("true", |_| {}),
    ("turned", |estimate| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 10f32.to_radians());
        estimate.poses().iter_mut().for_each(|pose| pose.rotation *= turn);
    }),
    ("one-frame", |estimate| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 40f32.to_radians());
        estimate.poses()[3].rotation *= turn;
    }),
    ("far", |estimate| {
        estimate.poses().iter_mut().for_each(|pose| pose.translation.vector *= 1.1);
    }),
    ("swollen", |estimate| estimate.points.iter_mut().for_each(|point| *point *= 1.1)),
    ("halved", |estimate| estimate.points.retain(|point| point.x > 0.0)),
    ("other-world", |estimate| {
        estimate.trajectory.canonical = false;
        let world = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, 0.5, 0.6));
        estimate.poses().iter_mut().for_each(|pose| *pose *= world);
    }),
];

#[test]
fn each_number_moves_as_the_estimate_is_spoiled() {
    let (cars, out) = (dataset(1), TempDir::new().unwrap());
    let estimates = TempDir::new().unwrap();
    let mut extra: Vec<String> = Vec::new();
    for (name, spoil) in SPOILED {
        let mut estimate = Estimate::of(&cars.path().join(CAR));
        spoil(&mut estimate);
        let folder = estimates.path().join(name);
        estimate.write(&folder);
        extra.extend(["--estimates".into(), folder.to_string_lossy().into_owned()]);
    }
    let extra: Vec<&str> = extra.iter().map(String::as_str).collect();
    evaluate(cars.path(), out.path(), &extra);
    let rows = rows(out.path());
    let of = |name: &str| row(&rows, CAR, &format!("estimates-{name}"));
    let value = |row: &Row, key: &str| number(row, key).unwrap_or_else(|| panic!("no {key}"));
    let near = |name: &str, key: &str, expected: f64, tolerance: f64| {
        let found = value(&of(name), key);
        assert!((found - expected).abs() <= tolerance, "{name} {key}: {found} is not {expected}");
    };
    let truth = of("true");
    let grows = |name: &str, key: &str, factor: f64| {
        let (found, least) = (value(&of(name), key), value(&truth, key));
        assert!(found > factor * least && found > 1e-6, "{name} {key}: {found}, not above {least}");
    };
    let stays = |name: &str, keys: &[&str]| {
        for key in keys {
            let (found, expected) = (value(&of(name), key), value(&truth, key));
            let tolerance = 1e-4 * expected.abs() + if key.contains("deg") { 0.05 } else { 1e-5 };
            assert!((found - expected).abs() <= tolerance, "{name} {key}: {found}, {expected}");
        }
    };
    const SHAPE: [&str; 7] = [
        "style_error",
        "squared_to_truth",
        "squared_from_truth",
        "distance",
        "distance_to_truth",
        "distance_from_truth",
        "f_score",
    ];
    const ROTATION: [&str; 3] =
        ["rotation_error_deg_mean", "rotation_error_deg_median", "reference_rotation_error_deg"];
    const BETWEEN_FRAMES: [&str; 6] = [
        "relative_rotation_error_deg_mean",
        "aligned_rotation_error_deg_mean",
        "rra_5",
        "rra_15",
        "rra_30",
        "rra_auc_30",
    ];

    for key in ROTATION.iter().chain(&BETWEEN_FRAMES[..2]) {
        near("true", key, 0.0, 0.05);
    }
    for key in ["translation_error_mean", "style_error", "distance"] {
        near("true", key, 0.0, 1e-5);
    }
    for key in ["f_score", "rra_5", "rra_30", "rra_auc_30", "rotation_auc_30"] {
        near("true", key, 1.0, 2e-3);
    }
    // The losses of the true points are those that floors say.
    let floor = row(&rows, CAR, "floor-true-points");
    let silhouette = value(&truth, "silhouette_loss");
    // Floors take as few points as the prior has, which reach fewer pixels.
    assert!(value(&floor, "silhouette_loss") > silhouette);

    ROTATION.iter().for_each(|key| near("turned", key, 10.0, 0.05));
    near("turned", "rotation_auc_30", 2.0 / 3.0, 2e-3);
    stays("turned", &BETWEEN_FRAMES);
    stays("turned", &SHAPE);
    stays("turned", &["translation_error_mean", "scaled_translation_error_mean"]);
    near("turned", "aligned_center_error_mean", 0.0, 1e-4);
    grows("turned", "silhouette_loss", 1.05);

    near("one-frame", "rotation_error_deg_mean", 8.0, 0.05);
    near("one-frame", "rotation_error_deg_median", 0.0, 0.05);
    near("one-frame", "reference_rotation_error_deg", 0.0, 0.05);
    near("one-frame", "relative_rotation_error_deg_mean", 10.0, 0.05);
    // Four of ten pairs have that frame in them.
    ["rra_5", "rra_15", "rra_30"].iter().for_each(|key| near("one-frame", key, 0.6, 1e-9));
    grows("one-frame", "aligned_rotation_error_deg_mean", 2.0);
    grows("one-frame", "aligned_center_error_mean", 2.0);
    grows("one-frame", "photometric_loss", 1.05);
    stays("one-frame", &SHAPE);

    grows("far", "translation_error_mean", 2.0);
    near("far", "scaled_translation_error_mean", 0.0, 1e-4);
    stays("far", &ROTATION);
    stays("far", &BETWEEN_FRAMES);
    stays("far", &SHAPE);
    grows("far", "silhouette_loss", 1.05);

    SHAPE[..6].iter().for_each(|key| grows("swollen", key, 2.0));
    assert!(value(&of("swollen"), "f_score") < 0.9);
    stays("swollen", &ROTATION);
    stays("swollen", &BETWEEN_FRAMES);

    // What is there is right, and half is missing.
    near("halved", "squared_to_truth", 0.0, 1e-6);
    grows("halved", "squared_from_truth", 2.0);
    grows("halved", "silhouette_loss", 1.05);

    let other = of("other-world");
    for key in ["rotation_error_deg_mean", "translation_error_mean", "style_error"] {
        assert_eq!(number(&other, key), None, "{key}");
    }
    stays("other-world", &BETWEEN_FRAMES);
    near("other-world", "aligned_center_error_mean", 0.0, 1e-4);
}

/// A program that is called colmap: it writes its arguments down, and what it is told to register.
fn colmap_program(folder: &Path, sequence: &Path, n_registered: usize) -> PathBuf {
    let mut trajectory = read_trajectory(&sequence.join("transforms.json")).unwrap();
    let world = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, 0.1));
    trajectory.camera_from_world.iter_mut().for_each(|pose| *pose *= world);
    trajectory.camera_from_world.truncate(n_registered);
    trajectory.pictures.truncate(n_registered);
    let model = folder.join("model");
    fs::create_dir_all(&model).unwrap();
    colmap::write(&model, &trajectory, &PointCloud::default()).unwrap();
    let program = folder.join("colmap");
    let script = format!(
        "#!/bin/sh\necho \"$*\" >> {0}/arguments\nif [ $1 = mapper ]; then\n\
         while [ $# -gt 0 ]; do if [ $1 = --output_path ]; then out=$2; fi; shift; done\n\
         mkdir -p $out/0 && cp {0}/model/* $out/0/\nfi\n",
        folder.display()
    );
    fs::write(&program, script).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    program
}

#[test]
fn colmap_is_called_with_the_camera_and_the_masks_and_what_it_registers_is_judged() {
    let (cars, out) = (dataset(1), TempDir::new().unwrap());
    let folder = TempDir::new().unwrap();
    let program = colmap_program(folder.path(), &cars.path().join(CAR), 4);
    let extra = ["--methods", "colmap,colmap-unmasked", "--colmap", program.to_str().unwrap()];
    evaluate(cars.path(), out.path(), &extra);

    let arguments = fs::read_to_string(folder.path().join("arguments")).unwrap();
    let calls: Vec<&str> = arguments.lines().collect();
    assert_eq!(calls.len(), 6, "{arguments}");
    let camera = read_trajectory(&cars.path().join(CAR).join("transforms.json")).unwrap();
    let ([fx, fy], [cx, cy]) = (camera.intrinsics.focal, camera.intrinsics.center);
    assert!(calls[0].contains(&format!("--ImageReader.camera_params {fx},{fy},{cx},{cy}")));
    assert!(calls[0].contains("mask_path") && !calls[3].contains("mask_path"), "{arguments}");
    assert!(calls[2].contains("--Mapper.ba_refine_focal_length 0"), "{arguments}");
    let masks = out.path().join("sequences").join(CAR).join("colmap/masks/frame_000.png.png");
    assert!(image::open(masks).unwrap().into_luma8().pixels().any(|pixel| pixel.0[0] == 255));

    let rows = rows(out.path());
    for state in ["colmap", "colmap-unmasked"] {
        let row = row(&rows, CAR, state);
        assert_eq!((row["n_posed"].as_str(), row["n_frames"].as_str()), ("4", "5"));
        assert_eq!(number(&row, "rotation_error_deg_mean"), None);
        assert!(number(&row, "relative_rotation_error_deg_mean").unwrap() < 0.05, "{row:?}");
        assert!(number(&row, "aligned_center_error_mean").unwrap() < 1e-3, "{row:?}");
    }
}

#[test]
fn colmap_that_fails_or_is_not_there_is_a_failure_of_its_own_only() {
    let (cars, out) = (dataset(1), TempDir::new().unwrap());
    let folder = TempDir::new().unwrap();
    let program = colmap_program(folder.path(), &cars.path().join(CAR), 1);
    for (program, expected) in [
        (program.to_str().unwrap(), "COLMAP registered 1 of 5 frames"),
        ("/no/such/colmap", "install COLMAP or give --colmap PATH"),
        ("false", "COLMAP's feature_extractor failed"),
    ] {
        evaluate(cars.path(), out.path(), &["--methods", "colmap", "--colmap", program]);
        let rows = rows(out.path());
        let failure = row(&rows, CAR, "colmap")["failure"].clone();
        assert!(failure.contains(expected), "{failure}");
        assert!(row(&rows, CAR, "solver")["failure"].is_empty());
    }
}
