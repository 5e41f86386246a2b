//! Sequences of other programs, from file to frames, and our results back into their formats.

mod cameras;

use std::{
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use image::{GrayImage, Luma, RgbImage};
use nalgebra::{Isometry3, Matrix4, Point3};
use object_pba::{
    camera::Intrinsics,
    data::{
        formats::{
            Layout, Reading, SequenceHints, Trajectory, axes, colmap, glb, nerfstudio, npz,
            ply::{self, PointCloud},
            read_sequence, tum,
        },
        sequence::Sequence,
    },
};
use tempfile::TempDir;

/// Entries of a matrix differ by this much where a quaternion of f32 differs in its last bit.
const TO_THE_BIT: f32 = 2.0 * f32::EPSILON;

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

fn read(path: &Path, hints: &SequenceHints) -> Reading {
    read_sequence(path, hints).unwrap()
}

#[track_caller]
fn check_refused(path: &Path, hints: &SequenceHints, expected: &[&str]) {
    let message = read_sequence(path, hints).unwrap_err().to_string();
    for part in expected {
        assert!(message.contains(part), "{message:?} does not say {part:?}");
    }
}

fn names(sequence: &Sequence) -> Vec<String> {
    let file_name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    sequence.frames.iter().map(|frame| file_name(&frame.path)).collect()
}

fn poses(sequence: &Sequence) -> &[Isometry3<f32>] {
    &sequence.truth.as_ref().unwrap().camera_from_world
}

#[track_caller]
fn check_poses(actual: &[Isometry3<f32>], expected: &[Isometry3<f32>], tolerance: f32) {
    assert_eq!(actual.len(), expected.len());
    for (a, b) in actual.iter().zip(expected) {
        let difference = (a.to_homogeneous() - b.to_homogeneous()).amax();
        assert!(difference <= tolerance, "{a} is not {b}");
    }
}

/// One scene as COLMAP wrote it, text and binary, and as nerfstudio converted it.
fn views() -> [Reading; 3] {
    let views = fixtures().join("views");
    let paths = [views.join("text"), views.join("binary"), views.join("transforms.json")];
    paths.map(|path| read(&path, &SequenceHints::default()))
}

#[test]
fn colmap_and_nerfstudio_describe_one_scene() {
    let [text, binary, nerfstudio] = views();
    assert!(matches!(text.layout, Layout::Colmap(_, colmap::Encoding::Text)));
    assert!(matches!(binary.layout, Layout::Colmap(_, colmap::Encoding::Binary)));
    assert!(matches!(nerfstudio.layout, Layout::Nerfstudio(_)));

    let [text, binary, nerfstudio] = [text, binary, nerfstudio].map(|reading| reading.sequence);
    for sequence in [&text, &binary, &nerfstudio] {
        assert_eq!(names(sequence), ["view_1.png", "view_2.png", "view_10.png"]);
        assert_eq!((sequence.size, sequence.intrinsics), (text.size, text.intrinsics));
        assert!(!sequence.truth.as_ref().unwrap().canonical);
        for (frame, expected) in sequence.frames.iter().zip(&text.frames) {
            assert_eq!((&frame.color, &frame.mask), (&expected.color, &expected.mask));
        }
    }
    check_poses(poses(&binary), poses(&text), 0.0);
    // nerfstudio turns the world; what one camera is to another stays.
    let relative = |sequence: &Sequence| -> Vec<Isometry3<f32>> {
        poses(sequence).iter().map(|pose| pose * poses(sequence)[0].inverse()).collect()
    };
    check_poses(&relative(&nerfstudio), &relative(&text), 1e-6);
}

#[test]
fn points_lie_on_the_object_once_the_lens_is_undone() {
    let [Reading { sequence, notes, .. }, ..] = views();
    assert!(notes[0].contains("distortion undone in 3 frames"), "{notes:?}");
    assert!(notes[1].contains("2 frames of other cameras"), "{notes:?}");
    let text = fs::read_to_string(fixtures().join("views/text/points3D.txt")).unwrap();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let values: Vec<f32> = line.split(' ').filter_map(|field| field.parse().ok()).collect();
        for (pose, frame) in poses(&sequence).iter().zip(&sequence.frames) {
            let point = pose * Point3::from_slice(&values[1..4]);
            let Intrinsics { focal, center } = sequence.intrinsics;
            let pixel = [0, 1].map(|axis| point[axis] / point.z * focal[axis] + center[axis]);
            let [x, y] = pixel.map(|coordinate| coordinate as u32);
            assert_eq!(frame.mask.get_pixel(x, y).0, [1.0], "at {pixel:?}");
        }
    }
}

#[test]
fn colmap_s_folders_are_found_from_their_root() {
    let folder = TempDir::new().unwrap();
    let model = folder.path().join("sparse/0");
    for below in ["images", "masks", "sparse/0"] {
        fs::create_dir_all(folder.path().join(below)).unwrap();
    }
    let copy = |from: &str, to: &Path| {
        for entry in fs::read_dir(fixtures().join("views").join(from)).unwrap().map(Result::unwrap)
        {
            fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
    };
    copy("images", &folder.path().join("images"));
    copy("masks", &folder.path().join("masks"));
    copy("text", &model);
    let found = read(folder.path(), &SequenceHints::default());
    assert!(matches!(found.layout, Layout::Colmap(_, colmap::Encoding::Text)));
    assert_eq!(names(&found.sequence), ["view_1.png", "view_2.png", "view_10.png"]);
    copy("binary", &model);
    let found = read(folder.path(), &SequenceHints::default());
    assert!(matches!(found.layout, Layout::Colmap(_, colmap::Encoding::Binary)));

    let hints = SequenceHints { focal: Some(50.0), ..SequenceHints::default() };
    check_refused(folder.path(), &hints, &["cameras.bin", "--focal"]);
    fs::remove_file(folder.path().join("masks/view_2.png.png")).unwrap();
    let found = read(folder.path(), &SequenceHints::default());
    let masked: Vec<bool> = found.sequence.frames.iter().map(|frame| frame.has_mask()).collect();
    assert_eq!(masked, [true, false, true]);
    let note = "1 of 3 frames have no mask, or an empty one; the first is images/view_2.png";
    assert!(found.notes.iter().any(|found| found == note), "{:?}", found.notes);
    let hints = SequenceHints { masks: Some("no/such/masks".into()), ..SequenceHints::default() };
    check_refused(folder.path(), &hints, &["no/such/masks", "no such masks"]);
}

/// Twelve frames of 8 × 6 with masks, `image_0.png` to `image_11.png`, and no camera.
fn plain() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("masks")).unwrap();
    for idx in 0..12 {
        let name = format!("image_{idx}.png");
        let mask = GrayImage::from_fn(8, 6, |x, _| Luma([if x > 2 { 255 } else { 0 }]));
        RgbImage::new(8, 6).save(folder.path().join(&name)).unwrap();
        mask.save(folder.path().join("masks").join(&name)).unwrap();
    }
    folder
}

#[test]
fn a_plain_folder_needs_a_focal_length_or_a_field_of_view() {
    let folder = plain();
    check_refused(folder.path(), &SequenceHints::default(), &["image_0.png", "--focal", "--fov"]);
    let hints = SequenceHints { field_of_view: Some(90.0), ..SequenceHints::default() };
    let Reading { sequence, layout, notes } = read(folder.path(), &hints);
    assert_eq!((layout.to_string().as_str(), notes.len()), ("pictures and masks", 0));
    assert_eq!(sequence.intrinsics, Intrinsics { focal: [4.0; 2], center: [4.0, 3.0] });
    assert!(sequence.truth.is_none());

    RgbImage::new(6, 8).save(folder.path().join("image_3.png")).unwrap();
    check_refused(folder.path(), &hints, &["image_3.png", "[6, 8]"]);
}

#[test]
fn frames_are_counted_in_natural_order() {
    let folder = plain();
    let hints = SequenceHints { focal: Some(9.0), every: 2, ..SequenceHints::default() };
    let taken = |hints| names(&read(folder.path(), &hints).sequence);
    assert_eq!(
        taken(SequenceHints { frames: Some(7..12), ..hints.clone() }),
        ["image_7.png", "image_9.png", "image_11.png"]
    );
    let few = SequenceHints { max_frames: Some(2), ..hints.clone() };
    assert_eq!(taken(few), ["image_0.png", "image_2.png"]);
    let none = SequenceHints { frames: Some(40..50), ..hints };
    check_refused(folder.path(), &none, &["no frames"]);
}

#[test]
fn masks_may_lie_elsewhere() {
    let folder = plain();
    let elsewhere = folder.path().join("elsewhere");
    fs::rename(folder.path().join("masks"), &elsewhere).unwrap();
    let hints = SequenceHints { focal: Some(9.0), ..SequenceHints::default() };
    assert!(!read(folder.path(), &hints).sequence.frames.iter().any(|frame| frame.has_mask()));
    let hints = SequenceHints { masks: Some(elsewhere.clone()), ..hints };
    let n_masked = || {
        let frames = read(folder.path(), &hints).sequence.frames;
        frames.iter().filter(|frame| frame.has_mask()).count()
    };
    assert_eq!(n_masked(), 12);
    fs::remove_file(elsewhere.join("image_5.png")).unwrap();
    assert_eq!(n_masked(), 11);
}

/// The camera of a folder with one of the photographs and a mask of this size.
fn photo(name: &str, size: [u32; 2]) -> Reading {
    let folder = TempDir::new().unwrap();
    fs::copy(fixtures().join("photos").join(name), folder.path().join(name)).unwrap();
    fs::create_dir(folder.path().join("mask")).unwrap();
    let mask = GrayImage::from_pixel(size[0], size[1], Luma([255]));
    mask.save(folder.path().join("mask").join(name).with_extension("png")).unwrap();
    read(folder.path(), &SequenceHints::default())
}

#[test]
fn exif_tells_the_focal_length_and_which_side_is_up() {
    let Reading { sequence, notes, .. } = photo("portrait.jpg", [30, 40]);
    assert!(notes[0].contains("EXIF"), "{notes:?}");
    // 26 mm by a diagonal of 43.27 mm, on one of 50 pixels.
    assert!((sequence.intrinsics.focal[0] - 30.046).abs() < 1e-2, "{:?}", sequence.intrinsics);
    assert_eq!((sequence.size, sequence.intrinsics.center), ([30, 40], [15.0, 20.0]));
    // Red grew to the right as stored; a quarter turn makes that downwards.
    let red = |x, y| sequence.frames[0].color.get_pixel(x, y).0[0];
    assert!(red(15, 35) > red(15, 5) + 0.5);

    // 50 mm at 100 pixels a millimetre, and then made half as wide.
    let landscape = photo("landscape.jpg", [40, 30]).sequence;
    assert!((landscape.intrinsics.focal[0] - 2500.0).abs() < 1e-1, "{:?}", landscape.intrinsics);
}

#[test]
fn what_is_no_sequence_is_refused_by_name() {
    let folder = TempDir::new().unwrap();
    let hints = SequenceHints::default();
    check_refused(folder.path(), &hints, &["transforms.json", "COLMAP"]);
    check_refused(&folder.path().join("nowhere"), &hints, &["nowhere"]);
    let file = folder.path().join("notes.txt");
    fs::write(&file, "").unwrap();
    check_refused(&file, &hints, &["notes.txt", "video"]);
}

/// A run with a cloud and cameras that are no round numbers.
fn results() -> (Trajectory, PointCloud) {
    let pose = |x: f32| {
        let rotation = nalgebra::UnitQuaternion::from_euler_angles(0.3 * x, -1.1 + x, 0.01);
        Isometry3::from_parts(nalgebra::Translation3::new(x / 3.0, -0.1, 1.7), rotation)
    };
    let trajectory = Trajectory {
        intrinsics: Intrinsics { focal: [123.071_01, 120.3], center: [61.1, 50.7] },
        size: [128, 96],
        camera_from_world: (0..4).map(|idx| pose(idx as f32)).collect(),
        pictures: (0..4).map(|idx| format!("images/frame_{idx:03}.png").into()).collect(),
        canonical: true,
    };
    let points = (0..5).map(|idx| Point3::new(0.1, -0.3, 0.07) * (idx as f32 + 0.9)).collect();
    let colors = (0..5).map(|idx| [idx * 50, 255 - idx, 128]).collect();
    let visible = (0..5).map(|idx| idx % 2 == 0).collect();
    (trajectory, PointCloud { points, colors: Some(colors), visible: Some(visible) })
}

#[test]
fn tum_lines_hold_where_each_camera_stands() {
    let folder = TempDir::new().unwrap();
    let (trajectory, _) = results();
    let path = folder.path().join("trajectory.txt");
    tum::write(&path, &trajectory).unwrap();
    let text = fs::read_to_string(path).unwrap();
    let lines: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(' ').map(|field| field.parse().unwrap()).collect())
        .collect();
    for ((idx, line), pose) in lines.iter().enumerate().zip(&trajectory.camera_from_world) {
        let [time, x, y, z, i, j, k, w] = line[..] else { panic!("{line:?} is not of eight") };
        assert_eq!(time, idx as f64);
        let rotation =
            nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
        let world_from_camera =
            Isometry3::from_parts(nalgebra::Translation3::new(x, y, z), rotation);
        check_poses(&[world_from_camera.inverse().cast()], &[*pose], TO_THE_BIT);
    }
}

#[test]
fn glb_files_hold_the_cloud_and_the_cameras() {
    let folder = TempDir::new().unwrap();
    let (trajectory, cloud) = results();
    let path = folder.path().join("scene.glb");
    glb::write(&path, &trajectory, &cloud).unwrap();
    let gltf::Gltf { document, blob } = gltf::Gltf::open(path).unwrap();
    let blob = blob.unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Points);
    let reader = primitive.reader(|_| Some(&blob));
    let points: Vec<Point3<f32>> = reader.read_positions().unwrap().map(Point3::from).collect();
    assert_eq!(points, cloud.points);
    // The crate rounds linear colours to bytes; white stays white, and mid-grey is a fifth.
    let colors: Vec<[f32; 4]> = reader.read_colors(0).unwrap().into_rgba_f32().collect();
    assert_eq!((colors[0][1], colors[0][3]), (1.0, 1.0));
    assert!((colors[0][2] - 0.2158).abs() < 1e-3, "{:?}", colors[0]);

    let cameras: Vec<_> = document.nodes().filter(|node| node.camera().is_some()).collect();
    let back: Vec<Isometry3<f32>> = cameras
        .iter()
        .map(|node| {
            let columns = Matrix4::from(node.transform().matrix()).cast::<f64>();
            let rows = [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| columns[(row, column)]));
            axes::from_opengl_matrix(&rows).unwrap()
        })
        .collect();
    check_poses(&back, &trajectory.camera_from_world, 1e-6);
}

#[test]
fn npz_files_hold_arrays_of_the_right_shape() {
    let folder = TempDir::new().unwrap();
    let (trajectory, cloud) = results();
    let path = folder.path().join("run.npz");
    npz::write(&path, &trajectory, &cloud).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(fs::read(path).unwrap())).unwrap();
    let mut array = |name: &str| {
        let mut bytes = vec![];
        std::io::copy(&mut archive.by_name(name).unwrap(), &mut bytes).unwrap();
        bytes
    };
    let poses = array("camera_from_world.npy");
    let poses = npyz::NpyFile::new(&poses[..]).unwrap();
    assert_eq!(poses.shape(), [4, 4, 4]);
    let values = poses.into_vec::<f32>().unwrap();
    for (pose, values) in trajectory.camera_from_world.iter().zip(values.chunks(16)) {
        assert_eq!(pose.to_homogeneous(), Matrix4::from_row_slice(values));
    }
    let points = array("points.npy");
    let points = npyz::NpyFile::new(&points[..]).unwrap();
    assert_eq!(points.shape(), [5, 3]);
    assert_eq!(points.into_vec::<f32>().unwrap()[..3], *cloud.points[0].coords.as_slice());
    let visible = array("visible.npy");
    let visible = npyz::NpyFile::new(&visible[..]).unwrap().into_vec::<bool>().unwrap();
    assert_eq!(Some(visible), cloud.visible);
}

#[test]
fn our_own_files_read_back() {
    let folder = TempDir::new().unwrap();
    let (trajectory, cloud) = results();
    let path = folder.path().join("transforms.json");
    nerfstudio::write_trajectory(&path, &trajectory).unwrap();
    let back = nerfstudio::read_trajectory(&path).unwrap();
    check_poses(&back.camera_from_world, &trajectory.camera_from_world, TO_THE_BIT);
    assert_eq!((back.intrinsics, back.size), (trajectory.intrinsics, trajectory.size));
    let path = folder.path().join("points.ply");
    ply::write_points(&path, &cloud).unwrap();
    assert_eq!(ply::read_cloud(&path).unwrap(), cloud);
}
