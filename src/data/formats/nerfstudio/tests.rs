use image::{Luma, Rgb, RgbImage, RgbaImage};
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::{
    camera::Intrinsics,
    data::{
        ColorImage, ScalarImage,
        sequence::{Frame, Truth},
        viewpoint::look_at,
    },
};

/// What is wrong with a description.
type Edit = fn(&mut Value);

fn temporary() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn read_sequence(folder: &Path) -> Result<Sequence> {
    let path = folder.join(TRANSFORMS);
    Ok(list(&path, &SequenceHints::default())?.load(&path)?.0)
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
    let edits: [(Edit, &str); 13] = [
        (|json| json["frames"] = json!([]), "no frames"),
        (|json| json["frames"] = json!("none"), "invalid type"),
        (|json| json["fl_x"] = json!(0.0), "not positive"),
        (|json| json["fl_x"] = json!(-5.0), "not positive"),
        (|json| json["fl_x"] = Value::Null, "no fl_x"),
        (|json| json["k4"] = json!(0.01), "k4"),
        (|json| json["camera_model"] = json!("OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
        (|json| json["is_fisheye"] = json!(true), "fisheye"),
        (|json| json["frames"][1]["fl_x"] = json!(0.0), "frame 1: its focal lengths"),
        (|json| json["frames"][1]["camera_model"] = json!("FOV"), "frame 1: camera model FOV"),
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
fn a_frame_of_another_camera_is_brought_to_the_first_one_s() {
    let plain = read_sequence(written(|_| ()).path()).expect("it is usable");
    // Half the focal length about the same point: each of our pixels is two of the first frame's.
    let folder = written(|json| {
        json["frames"][1]["fl_x"] = json!(2.75);
        json["frames"][1]["fl_y"] = json!(3.25);
    });
    let mixed = read_sequence(folder.path()).expect("it is usable");
    assert_eq!(mixed.intrinsics, plain.intrinsics);
    assert_eq!(mixed.frames[0].color, plain.frames[0].color);
    // The principal point, (2.25, 1.5), stays; a pixel to the right of it is half of one there.
    let value = mixed.frames[1].color.get_pixel(3, 1).0[0];
    let there: f32 = 2.25 + (3.5 - 2.25) / 2.0;
    assert!((value - (there - 0.5 + 1.0) / 5.0).abs() < 2e-3, "{value}");
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
    check_refused(&replaced("masks/frame_001.png", black(3, 4)), "masks/frame_001", "size");

    let folder = replaced("images/frame_001.png", black(8, 6));
    mask_to_luma8(&ScalarImage::from_pixel(8, 6, Luma([1.0])))
        .save(folder.path().join("masks/frame_001.png"))
        .expect("it is writable");
    check_refused(&folder, "images/frame_001.png", "it is [8, 6] pixels");
    let folder = written(|json| json["w"] = json!(5));
    check_refused(&folder, "images/frame_000.png", "its camera takes [5, 3]");
}

#[test]
fn frames_may_lack_masks() {
    let masked = |folder: &TempDir| {
        let sequence = read_sequence(folder.path()).expect("it is usable");
        [0, 1].map(|idx| sequence.frames[idx].has_mask())
    };
    let folder = written(|_| ());
    assert_eq!(masked(&folder), [true, true]);
    // A mask that its frame names, and is not there.
    fs::remove_file(folder.path().join("masks/frame_001.png")).expect("it is there");
    assert_eq!(masked(&folder), [true, false]);
    // A mask that is empty.
    let black = DynamicImage::from(RgbImage::new(4, 3));
    black.save(folder.path().join("masks/frame_000.png")).expect("it is writable");
    assert_eq!(masked(&folder), [false, false]);
    // No mask by any habit.
    let folder = written(|json| json["frames"][0]["mask_path"] = Value::Null);
    fs::remove_file(folder.path().join("masks/frame_000.png")).expect("it is there");
    assert_eq!(masked(&folder), [false, true]);
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
fn masks_of_the_same_name_need_no_mask_path() {
    let folder = written(|json| json["frames"][0]["mask_path"] = Value::Null);
    let sequence = read_sequence(folder.path()).expect("it is usable");
    assert_eq!(sequence.frames[0].mask, sequence.frames[1].mask);
}

#[test]
fn trajectories_read_back() {
    let folder = written(|_| ());
    let Sequence { intrinsics, size, truth, .. } = sequence();
    let camera_from_world = truth.expect("it has poses").camera_from_world;
    let pictures = vec!["images/a.png".into(), "images/b.png".into()];
    let written = Trajectory { intrinsics, size, camera_from_world, pictures, canonical: true };
    let path = folder.path().join("estimate.json");
    write_trajectory(&path, &written).expect("it is writable");
    let read = read_trajectory(&path).expect("it is usable");
    let matrices = |trajectory: &Trajectory| -> Vec<_> {
        trajectory.camera_from_world.iter().map(Isometry3::to_homogeneous).collect()
    };
    let differences = matrices(&read).into_iter().zip(matrices(&written)).map(|(a, b)| a - b);
    assert!(differences.clone().all(|difference| difference.amax() < 1e-6));
    let without_poses = |trajectory| Trajectory { camera_from_world: vec![], ..trajectory };
    assert_eq!(without_poses(read), without_poses(written));
}
