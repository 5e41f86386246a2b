//! What the networks see does not depend on the camera: any size, focal length and principal point.

use std::path::Path;

use burn::tensor::Device;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use object_pba::{
    camera::Intrinsics,
    checkpoint::Prior,
    data::{
        keyed_rng,
        lighting::Scene,
        procedural::car,
        rasteriser::Renderer,
        sequence::{Frame, Sequence},
        viewpoint::{centered_intrinsics, orbit_rotation},
    },
    initial_guess::InitialGuess,
};

/// The scene at this pose, as a sequence of one frame.
fn photograph(
    renderer: &Renderer,
    scene: &Scene,
    camera_from_world: &Isometry3<f32>,
    intrinsics: Intrinsics,
    size: [usize; 2],
) -> Sequence {
    let picture = renderer.render(scene, camera_from_world, &intrinsics, size);
    let frame = Frame { path: "frame".into(), color: picture.color, mask: picture.coverage };
    Sequence { name: "one".into(), intrinsics, size, frames: vec![frame], truth: None }
}

/// Degrees between the likeliest initial pose and the true one.
fn initial_error(prior: &Prior, sequence: &Sequence, truth: &Isometry3<f32>) -> f32 {
    let guess = InitialGuess::of_frame(prior, sequence, &sequence.frames[0])
        .expect("the mask is not empty");
    guess.poses[0].0.rotation.angle_to(&truth.rotation).to_degrees()
}

#[test]
fn an_off_centre_car_in_a_photo_initialises_like_a_centred_render() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/car-prior");
    let prior = Prior::load(&folder, &Device::flex()).expect("it is bundled");
    let [mut centred, mut off_centre] = [0.0, 0.0];
    const SCENES: usize = 8;
    for seed in 0..SCENES {
        let mesh = car(100 + seed as u64);
        let renderer = Renderer::new(&mesh);
        let scene = Scene::random(&mut keyed_rng(7, [0, seed as u64]), None);
        let rotation = orbit_rotation(0.3 + 0.8 * seed as f32, 0.1 + 0.06 * seed as f32, 0.0);
        let at_centre = Isometry3::from_parts(Vector3::new(0.0, 0.0, 1.7).into(), rotation);
        let render = photograph(
            &renderer,
            &scene,
            &at_centre,
            centered_intrinsics([128; 2], 45_f32.to_radians()),
            [128; 2],
        );

        // The same place, turned away, so that the car comes to lie in a corner of a wide picture
        // whose principal point is not in its middle.
        let side = if seed % 2 == 0 { 1.0 } else { -1.0 };
        let aside = Vector3::new(side * 0.3, 0.25, 1.0);
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &aside).expect("not opposite");
        let in_corner = turn * at_centre;
        let intrinsics = Intrinsics { focal: [430.0, 425.0], center: [290.0, 238.0] };
        let photo = photograph(&renderer, &scene, &in_corner, intrinsics, [600, 450]);
        let place = in_corner * Point3::origin();
        assert!((place.x / place.z).abs() * 430.0 > 100.0, "it is off-centre");

        let errors =
            [initial_error(&prior, &render, &at_centre), initial_error(&prior, &photo, &in_corner)];
        centred += errors[0] / SCENES as f32;
        off_centre += errors[1] / SCENES as f32;
    }
    assert!((centred - off_centre).abs() < 1.5, "{centred} and {off_centre} degrees");
}
