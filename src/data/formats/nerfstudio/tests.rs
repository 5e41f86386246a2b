use image::{Luma, Rgb, RgbImage, RgbaImage};
use nalgebra::Point3;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::data::{ColorImage, ScalarImage, sequence::Frame, viewpoint::look_at};

/// What is wrong with a description.
type Edit = fn(&mut Value);

fn temporary() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Two 4 × 3 frames with a pose each.
fn sequence() -> Sequence {
    let frame = |shift: u32| Frame {
        path: format!("images/frame_{shift:03}.png").into(),
        color: ColorImage::from_fn(4, 3, |x, y| Rgb([x + shift, y, 2].map(|v| v as f32 / 5.0))),
        mask: ScalarImage::from_fn(4, 3, |x, _| Luma([x as f32 / 3.0])),
    };
    let eye = |x| look_at(Point3::new(x, 0.5, -2.0), Point3::origin());
    Sequence {
        name: "two".into(),
        intrinsics: Intrinsics { focal: [5.5, 6.5], center: [2.25, 1.5] },
        size: [4, 3],
        frames: vec![frame(0), frame(1)],
        truth: Some(Truth {
            camera_from_world: vec![eye(0.0), eye(0.3)],
            canonical: true,
            points: Some(vec![Point3::new(0.1, 0.2, 0.3)]),
        }),
    }
}

/// A folder with [`sequence`], whose JSON may be edited.
fn written(edit: impl FnOnce(&mut Value)) -> TempDir {
    let folder = temporary();
    write_sequence(&sequence(), folder.path()).expect("it is writable");
    let path = folder.path().join(TRANSFORMS);
    let text = fs::read_to_string(&path).expect("it is there");
    let mut json = serde_json::from_str(&text).expect("it is JSON");
    edit(&mut json);
    fs::write(path, json.to_string()).expect("it is writable");
    folder
}

#[track_caller]
fn check_refused(folder: &TempDir, file: &str, reason: &str) {
    let Err(error @ Error::Sequence { .. }) = read_sequence(folder.path()) else {
        panic!("it should not be a usable sequence");
    };
    let text = error.to_string();
    assert!(text.contains(file) && text.contains(reason), "{text}");
}

#[test]
fn sequences_round_trip() {
    let folder = written(|_| ());
    let [before, after] = [sequence(), read_sequence(folder.path()).expect("it is usable")];
    assert_eq!((after.intrinsics, after.size), (before.intrinsics, before.size));
    for (a, b) in before.frames.iter().zip(&after.frames) {
        let colors = a.color.as_raw().iter().zip(b.color.as_raw());
        let masks = a.mask.as_raw().iter().zip(b.mask.as_raw());
        assert!(colors.chain(masks).all(|(a, b)| (a - b).abs() <= 0.5001 / 255.0));
    }
    let [before, after] = [before, after].map(|sequence| sequence.truth.expect("it has poses"));
    for (a, b) in before.camera_from_world.iter().zip(&after.camera_from_world) {
        assert!((a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-5);
    }
    assert_eq!((after.canonical, after.points), (true, before.points));
}

#[test]
fn poses_are_optional_and_a_world_is_unknown_unless_it_says_otherwise() {
    let folder = written(|json| {
        for idx in 0..2 {
            json["frames"][idx].as_object_mut().expect("a frame").remove("transform_matrix");
        }
    });
    assert!(read_sequence(folder.path()).expect("it is usable").truth.is_none());

    let folder = written(|json| json["world"] = json!("colmap"));
    let truth = read_sequence(folder.path()).expect("it is usable").truth;
    assert!(!truth.expect("it has poses").canonical);
}

#[test]
fn nerf_s_own_layout_is_read() {
    let folder = temporary();
    let picture = RgbaImage::from_fn(8, 6, |x, _| image::Rgba([10, 20, 30, 36 * x as u8]));
    picture.save(folder.path().join("r_0.png")).expect("it is writable");
    let json = json!({
        "camera_angle_x": std::f64::consts::FRAC_PI_2,
        "aabb_scale": 16,
        "frames": [{"file_path": "./r_0", "rotation": 0.01}],
    });
    fs::write(folder.path().join(TRANSFORMS), json.to_string()).expect("it is writable");
    let sequence = read_sequence(folder.path()).expect("it is usable");
    assert!((sequence.intrinsics.focal[0] - 4.0).abs() < 1e-5);
    assert_eq!((sequence.size, sequence.intrinsics.center), ([8, 6], [4.0, 3.0]));
    assert!((sequence.frames[0].mask.get_pixel(5, 2).0[0] - 180.0 / 255.0).abs() < 1e-6);
}

#[test]
fn broken_descriptions_are_refused() {
    let edits: [(Edit, &str); 12] = [
        (|json| json["frames"] = json!([]), "no frames"),
        (|json| json["frames"] = json!("none"), "invalid type"),
        (|json| json["fl_x"] = json!(0.0), "not positive"),
        (|json| json["fl_x"] = json!(-5.0), "not positive"),
        (|json| json["fl_x"] = Value::Null, "no fl_x"),
        (|json| json["k1"] = json!(0.01), "distortion"),
        (|json| json["camera_model"] = json!("OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
        (|json| json["frames"][1]["fl_x"] = json!(9.0), "own intrinsics"),
        (|json| json["w"] = json!(5), "w × h"),
        (|json| json["frames"][1]["transform_matrix"] = Value::Null, "some have none"),
        (|json| json["frames"][1]["transform_matrix"][0][3] = Value::Null, "null"),
        (
            |json| {
                for row in 0..3 {
                    let value = json["frames"][0]["transform_matrix"][row][0].as_f64();
                    json["frames"][0]["transform_matrix"][row][0] = json!(value.map(|v| -v));
                }
            },
            "mirrors",
        ),
    ];
    for (edit, reason) in edits {
        check_refused(&written(edit), TRANSFORMS, reason);
    }
}

#[test]
fn broken_pictures_are_refused() {
    let folder = written(|_| ());
    fs::remove_file(folder.path().join("images/frame_001.png")).expect("it is there");
    check_refused(&folder, "frame_001.png", "No such file");

    let replaced = |file: &str, picture: DynamicImage| {
        let folder = written(|_| ());
        picture.save(folder.path().join(file)).expect("it is writable");
        folder
    };
    let black = |width, height| DynamicImage::from(RgbImage::new(width, height));
    check_refused(&replaced("masks/frame_000.png", black(4, 3)), "masks/frame_000", "empty");
    check_refused(&replaced("masks/frame_001.png", black(3, 4)), "masks/frame_001", "size");

    let folder = replaced("images/frame_001.png", black(8, 6));
    mask_to_luma8(&ScalarImage::from_pixel(8, 6, Luma([1.0])))
        .save(folder.path().join("masks/frame_001.png"))
        .expect("it is writable");
    check_refused(&folder, TRANSFORMS, "frame_001.png is [8, 6]");

    let folder = written(|json| json["frames"][0]["mask_path"] = Value::Null);
    check_refused(&folder, "images/frame_000", "neither");
}

#[test]
fn a_missing_folder_and_broken_json_are_errors_by_name() {
    let folder = temporary();
    let error = read_sequence(&folder.path().join("nowhere")).unwrap_err().to_string();
    assert!(error.contains("nowhere"), "{error}");
    fs::write(folder.path().join(TRANSFORMS), "{\"frames\": [NaN]}").expect("it is writable");
    check_refused(&folder, TRANSFORMS, "expected value");
}

#[test]
fn estimated_poses_read_back() {
    let folder = written(|_| ());
    let Sequence { intrinsics, size, truth, .. } = sequence();
    let poses = truth.expect("it has poses").camera_from_world;
    let paths = [0, 1].map(|idx| PathBuf::from(format!("images/frame_{idx:03}.png")));
    let path = folder.path().join("estimate.json");
    write_transforms(&path, &intrinsics, size, &poses, &paths, true).expect("it is writable");
    let text = fs::read_to_string(path).expect("it is there");
    let transforms: Transforms = serde_json::from_str(&text).expect("it is JSON");
    let read = transforms.poses().expect("they are rigid").expect("there are some");
    assert!((read[1].to_homogeneous() - poses[1].to_homogeneous()).amax() < 1e-5);
}
