//! Cameras of SRN and 3D-R2N2, as the programs compute them that made these data sets: see
//! `fixtures/cameras/render.py`, which drew the pictures without anything of ours.

use std::{collections::HashMap, fs};

use nalgebra::{Isometry3, Matrix4};
use object_pba::{
    camera::Intrinsics,
    data::{
        formats::{Layout, SequenceHints},
        keyed_rng,
        lighting::Scene,
        mesh_file::read_mesh,
        rasteriser::Renderer,
        sequence::{Frame, Sequence},
    },
};

use super::{fixtures, poses, read};

const MESH: &str = "shapenet_v2/02958343/smarts_simple_car/models/model_normalized.obj";

/// What the mesh covers of a sequence's masks, intersection over union, at these poses.
fn overlaps(sequence: &Sequence, poses: &[Isometry3<f32>], camera: &Intrinsics) -> Vec<f32> {
    let mesh = read_mesh(&fixtures().join(MESH)).unwrap().mesh.normalised();
    let renderer = Renderer::new(&mesh);
    let scene = Scene::random(&mut keyed_rng(0, [0, 0]), None);
    let overlap = |(frame, pose): (&Frame, &Isometry3<f32>)| {
        let drawn = renderer.render(&scene, pose, camera, sequence.size).coverage;
        let inside = |coverage: &f32| *coverage > 0.5;
        let pairs = || drawn.as_raw().iter().zip(frame.mask.as_raw());
        let both = pairs().filter(|(a, b)| inside(a) && inside(b)).count();
        let any = pairs().filter(|(a, b)| inside(a) || inside(b)).count();
        both as f32 / any as f32
    };
    sequence.frames.iter().zip(poses).map(overlap).collect()
}

/// Reads a folder; the mesh lies on its silhouettes, and beside them were the camera half a pixel off.
#[track_caller]
fn check_cameras(name: &str, layout: fn(&Layout) -> bool, canonical: bool) {
    let folder = fixtures().join("cameras");
    let reading = read(&folder.join(name), &SequenceHints::default());
    assert!(layout(&reading.layout), "{:?}", reading.layout);
    let sequence = reading.sequence;
    assert_eq!(sequence.truth.as_ref().unwrap().canonical, canonical);

    let text = fs::read_to_string(folder.join("camera_from_world.json")).unwrap();
    let mut truth: HashMap<String, Vec<[[f32; 4]; 4]>> = serde_json::from_str(&text).unwrap();
    let truth = truth.remove(name).unwrap();
    assert_eq!(truth.len(), sequence.frames.len());
    for (pose, rows) in poses(&sequence).iter().zip(truth) {
        let expected = Matrix4::from_fn(|row, column| rows[row][column]);
        assert!((pose.to_homogeneous() - expected).amax() < 1e-5, "{pose} is not {expected}");
    }

    let camera = sequence.intrinsics;
    let aligned = overlaps(&sequence, poses(&sequence), &camera);
    assert!(aligned.iter().all(|overlap| *overlap > 0.98), "{aligned:?}");
    let aside = Intrinsics { center: camera.center.map(|at| at - 0.5), ..camera };
    let aside = overlaps(&sequence, poses(&sequence), &aside);
    assert!(aside.iter().all(|overlap| *overlap < 0.98), "{aside:?}");
}

#[test]
fn the_mesh_lies_on_the_silhouettes_of_srn() {
    check_cameras("srn", |layout| *layout == Layout::Srn, false);
}

#[test]
fn the_mesh_lies_on_the_silhouettes_of_3d_r2n2() {
    check_cameras("r2n2", |layout| matches!(layout, Layout::R2n2(_)), true);
}
