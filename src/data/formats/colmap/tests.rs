use nalgebra::{Isometry3, Point3};

use super::*;
use crate::{
    camera::Intrinsics,
    data::formats::{Trajectory, ply::PointCloud},
};

/// A model that pycolmap wrote, with two lenses that distort; see tests/fixtures/README.md.
fn fixture(encoding: Encoding) -> Model {
    let name = if encoding == Encoding::Text { "text" } else { "binary" };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/views").join(name);
    read_model(&folder, encoding).expect("it is a model")
}

/// The numbers in a line, words left out.
fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().filter_map(|field| field.parse().ok()).collect()
}

#[test]
fn points_project_to_where_pycolmap_saw_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/views/text");
    let lines = |name: &str| {
        let text = std::fs::read_to_string(folder.join(name)).expect("it is there");
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_string).collect::<Vec<_>>()
    };
    let points: Vec<Point3<f64>> =
        lines("points3D.txt").iter().map(|line| Point3::from_slice(&numbers(line)[1..4])).collect();
    let model = fixture(Encoding::Text);
    for (image, lines) in model.images.iter().zip(lines("images.txt").chunks(2)) {
        let camera = &model.cameras[&image.camera_id];
        for seen in numbers(&lines[1]).chunks(3) {
            let point = image.camera_from_world.cast() * points[seen[2] as usize - 1];
            let pixel = camera.calibration.project([point.x / point.z, point.y / point.z]);
            let error = (pixel[0] - seen[0]).hypot(pixel[1] - seen[1]);
            assert!(error < 1e-4, "{}: {pixel:?} and {seen:?}", image.name);
        }
    }
}

#[test]
fn text_and_binary_models_are_equal() {
    let [text, binary] = [Encoding::Text, Encoding::Binary].map(fixture);
    assert_eq!(text.images.len(), 3);
    assert_eq!(text, binary);
}

#[test]
fn models_round_trip_to_the_last_bit_of_f32() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let poses: Vec<Isometry3<f32>> =
        fixture(Encoding::Text).images.iter().map(|image| image.camera_from_world).collect();
    let trajectory = Trajectory {
        intrinsics: Intrinsics { focal: [123.071_014, 120.3], center: [64.1, 33.3] },
        size: [128, 96],
        camera_from_world: poses.clone(),
        pictures: ["images/a b.png", "../images/c.png", "d.png"].map(PathBuf::from).to_vec(),
        canonical: true,
    };
    let points = vec![Point3::new(0.1, -2e-7, 3.25)];
    let cloud = PointCloud { points, colors: Some(vec![[1, 2, 3]]), visible: None };
    write(folder.path(), &trajectory, &cloud).expect("it is writable");
    let model = read_model(folder.path(), Encoding::Text).expect("it is a model");
    assert_eq!(model.cameras[&1].calibration.intrinsics, trajectory.intrinsics);
    for (image, pose) in model.images.iter().zip(poses) {
        let difference = image.camera_from_world.to_homogeneous() - pose.to_homogeneous();
        assert!(difference.amax() <= f32::EPSILON, "{difference}");
    }
    let names: Vec<&str> = model.images.iter().map(|image| image.name.as_str()).collect();
    assert_eq!(names, ["a b.png", "c.png", "d.png"]);
    let text = std::fs::read_to_string(folder.path().join("points3D.txt")).expect("it is there");
    assert_eq!(text, "1 0.1 -0.0000002 3.25 1 2 3 0\n");
}

#[test]
fn broken_text_is_refused_by_line() {
    let camera = "# a camera\n1 PINHOLE 4 3 5 5 2 1.5\n";
    let image = "1 1 0 0 0 0 0 1 1 a.png\n\n";
    for (cameras, images, expected) in [
        ("1 PINHOLE 4 3 5 5 2\n", image, "cameras.txt"),
        ("1 PINHOLE 4 3 5 5 2\n", image, "line 1: a PINHOLE camera has 4 parameters, not 3"),
        ("1 OPENCV_FISHEYE 4 3 5 5 2 2 0 0 0 0\n", image, "OPENCV_FISHEYE is not supported"),
        ("1 PINHOLE 4 3 0 5 2 2\n", image, "focal"),
        ("1 PINHOLE 4\n", image, "line 1: CAMERA_ID"),
        (camera, "\n1 1 0 0 0 0 0 x 1 a.png\n", "images.txt: not a usable sequence: line 2: \"x\""),
        (camera, "1 1 0 0 0 0 0 1 1\n", "line 1: IMAGE_ID"),
        (camera, "1 1 1 0 0 0 0 1 1 a.png\n", "line 1: its quaternion"),
    ] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("cameras.txt"), cameras).expect("it is writable");
        std::fs::write(folder.path().join("images.txt"), images).expect("it is writable");
        let error = read_model(folder.path(), Encoding::Text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn truncated_binaries_are_refused_at_any_length() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/views/binary");
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["cameras.bin", "images.bin"] {
        std::fs::copy(source.join("cameras.bin"), folder.path().join("cameras.bin"))
            .expect("copied");
        std::fs::copy(source.join("images.bin"), folder.path().join("images.bin")).expect("copied");
        let bytes = std::fs::read(source.join(name)).expect("it is there");
        for n in 0..bytes.len() {
            std::fs::write(folder.path().join(name), &bytes[..n]).expect("it is writable");
            let error = read_model(folder.path(), Encoding::Binary).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("ends early"), "{error}");
        }
    }
    // A number of points that no file could hold.
    let mut bytes = std::fs::read(source.join("images.bin")).expect("it is there");
    let n_points = 8 + 4 + 7 * 8 + 4 + "view_10.png\0".len();
    bytes[n_points..n_points + 8].fill(0xff);
    std::fs::write(folder.path().join("images.bin"), &bytes).expect("it is writable");
    assert!(read_model(folder.path(), Encoding::Binary).is_err());
}
