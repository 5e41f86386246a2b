//! The rasteriser against a ray caster that shares nothing with it (Möller and Trumbore, 1997).

mod blender;

use std::path::Path;

use image::{Luma, Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::Rng;

use super::*;
use crate::data::{
    collection::{Collection, Selection},
    keyed_rng,
    lighting::Ground,
    viewpoint::look_at,
};

const SIZE: [usize; 2] = [64, 48];
const CAMERA: Intrinsics = Intrinsics { focal: [70.0, 75.0], center: [30.0, 25.0] };

/// Light from everywhere: what is drawn has its own colour.
fn flat_light() -> Scene {
    Scene { ambient: [1.0; 3], lights: vec![], ground: None, background: [0.0; 3] }
}

fn facing(z: f32) -> Isometry3<f32> {
    Isometry3::from_parts(Translation3::new(0.0, 0.0, z), UnitQuaternion::identity())
}

fn triangle(vertices: [u32; 3], color: [f32; 3]) -> Triangle {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    Triangle { vertices, uvs, color, texture: None }
}

/// Triangles of all sizes, anywhere in a cube of side 1, winding as they like.
fn random_mesh(seed: u64, n_triangles: u32) -> Mesh {
    let mut rng = keyed_rng(seed, [0, 0]);
    let mut mesh = Mesh::default();
    for idx in 0..n_triangles {
        let mut within = |range: f32| Vector3::from_fn(|_, _| rng.random_range(-range..range));
        let center = Point3::from(within(0.5));
        mesh.vertices.extend([within(0.2), within(0.2), within(0.2)].map(|edge| center + edge));
        mesh.triangles.push(triangle([3 * idx, 3 * idx + 1, 3 * idx + 2], [1.0; 3]));
    }
    mesh
}

fn real_car() -> Mesh {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/shapenet_v2");
    let models = Collection::open(&fixtures, &Selection::default()).expect("the fixture").models;
    models[0].load().expect("a car").mesh
}

/// A mesh's triangles in the camera frame.
fn corners_in_camera(mesh: &Mesh, pose: &Isometry3<f32>) -> Vec<[Vector3<f64>; 3]> {
    let corner = |idx: u32| (pose * mesh.vertices[idx as usize]).coords.cast();
    mesh.triangles.iter().map(|triangle| triangle.vertices.map(corner)).collect()
}

/// Camera z of the nearest hit beyond `near` of the ray through a pixel, by trying every triangle.
fn cast(triangles: &[[Vector3<f64>; 3]], pixel: [f32; 2], near: f64) -> Option<f64> {
    let ray = Vector3::new(
        f64::from((pixel[0] - CAMERA.center[0]) / CAMERA.focal[0]),
        f64::from((pixel[1] - CAMERA.center[1]) / CAMERA.focal[1]),
        1.0,
    );
    let hits = triangles.iter().filter_map(|[a, b, c]| {
        let [ab, ac] = [b - a, c - a];
        let across = ray.cross(&ac);
        let determinant = ab.dot(&across);
        let u = -a.dot(&across) / determinant;
        let along = (-a).cross(&ab);
        let v = ray.dot(&along) / determinant;
        let z = ac.dot(&along) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && z > near).then_some(z)
    });
    hits.min_by(f64::total_cmp)
}

/// The mesh's diagonal is about one. Silhouettes that overlap by 0.99 and a median depth error of
/// 1e-3 would do for training; single precision does ten and a hundred times better.
#[track_caller]
fn check_against_ray_caster(mesh: &Mesh, pose: &Isometry3<f32>) {
    let rendering = render(mesh, &flat_light(), pose, &CAMERA, SIZE);
    let triangles = corners_in_camera(mesh, pose);
    let [mut both, mut either] = [0.0, 0.0];
    let mut depth_errors = vec![];
    for (x, y, Luma([coverage])) in rendering.coverage.enumerate_pixels() {
        let hits: Vec<_> = (0..4)
            .map(|k| {
                [x as f32 + 0.25 + 0.5 * (k % 2) as f32, y as f32 + 0.25 + 0.5 * (k / 2) as f32]
            })
            .filter_map(|pixel| cast(&triangles, pixel, 1e-3))
            .collect();
        let expected = hits.len() as f32 / 4.0;
        both += coverage.min(expected);
        either += coverage.max(expected);
        if let Some(nearest) = hits.into_iter().min_by(f64::total_cmp)
            && *coverage > 0.0
        {
            depth_errors.push((f64::from(rendering.depth.get_pixel(x, y).0[0]) - nearest).abs());
        }
    }
    assert!(both / either >= 0.999, "silhouettes overlap by {}", both / either);
    depth_errors.sort_by(f64::total_cmp);
    let [median, high] = [50, 99].map(|percent| depth_errors[depth_errors.len() * percent / 100]);
    assert!(median < 1e-5 && high < 1e-3, "depth errors: median {median}, 99 % {high}");
}

#[test]
fn a_mesh_is_where_rays_meet_it() {
    let pose = Isometry3::from_parts(
        Translation3::new(0.1, -0.05, 1.8),
        UnitQuaternion::from_euler_angles(0.3, -0.8, 0.2),
    );
    check_against_ray_caster(&random_mesh(1, 60), &pose);
}

#[test]
fn a_real_car_is_where_rays_meet_it() {
    for (eye, fill) in [(Point3::new(0.7, 0.4, -0.9), 1.0), (Point3::new(-0.2, 0.9, 0.7), 0.8)] {
        let pose = look_at(eye * fill, Point3::origin());
        check_against_ray_caster(&real_car(), &pose);
    }
}

#[test]
fn a_mesh_around_the_camera_is_cut_at_the_near_plane() {
    check_against_ray_caster(&random_mesh(2, 60), &facing(0.1));
}

#[test]
fn neighbours_leave_no_gap() {
    // A fan of thin triangles around an off-grid centre tiles the whole picture.
    let mut rng = keyed_rng(3, [0, 0]);
    let mut mesh = Mesh { vertices: vec![Point3::new(0.013, 0.007, 0.0)], ..Mesh::default() };
    let mut angle = 0.0_f32;
    while angle < std::f32::consts::TAU {
        mesh.vertices.push(Point3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 0.0));
        angle += rng.random_range(0.001..0.03);
    }
    let n_rim = mesh.vertices.len() as u32 - 1;
    mesh.triangles =
        (0..n_rim).map(|i| triangle([0, 1 + i, 1 + (i + 1) % n_rim], [1.0; 3])).collect();
    let coverage = render(&mesh, &flat_light(), &facing(1.0), &CAMERA, SIZE).coverage;
    assert!(coverage.pixels().all(|Luma([value])| *value == 1.0));
}

#[test]
fn the_near_face_hides_the_far_one_and_winding_does_not_matter() {
    let corners = [[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]];
    let vertices = |z: f32| corners.map(|[x, y]| Point3::new(x, y, z));
    let mesh = Mesh {
        vertices: [vertices(1.0), vertices(0.0)].concat(),
        triangles: vec![triangle([0, 1, 2], [1., 0., 0.]), triangle([5, 4, 3], [0., 1., 0.])],
        textures: vec![],
    };
    let rendering = render(&mesh, &flat_light(), &facing(2.0), &CAMERA, SIZE);
    assert_eq!(rendering.color.get_pixel(30, 25).0, [0.0, 1.0, 0.0]);
    assert!((rendering.depth.get_pixel(30, 25).0[0] - 2.0).abs() < 1e-5);
}

#[test]
fn texture_coordinates_are_perspective_correct() {
    // A floor receding from y = 1, z = 1 to z = 9 carries v = (z − 1) / 8, dark to bright.
    let ramp = RgbImage::from_fn(1, 256, |_, row| Rgb([255 - row as u8; 3]));
    let mut floor = triangle([0, 1, 2], [1.0; 3]);
    floor.texture = Some(0);
    floor.uvs = [[0.0, 0.0], [0.0, 0.0], [0.0, 2.0]];
    let mesh = Mesh {
        vertices: [[-9., 1., 1.], [9., 1., 1.], [0., 1., 17.]].map(Point3::from).to_vec(),
        triangles: vec![floor],
        textures: vec![ramp],
    };
    let color = render(&mesh, &flat_light(), &facing(0.0), &CAMERA, SIZE).color;
    for row in [37, 42, 47] {
        let z = CAMERA.focal[1] / (row as f32 + 0.5 - CAMERA.center[1]);
        let [value, _, _] = color.get_pixel(30, row).0;
        assert!((value - (z - 1.0) / 8.0).abs() < 0.02, "row {row}: {value} at z = {z}");
    }
}

#[test]
fn a_surface_point_has_one_colour_from_every_side() {
    let mut mesh = random_mesh(6, 1);
    mesh.textures = vec![RgbImage::from_fn(64, 64, |x, y| Rgb([4 * x as u8, 4 * y as u8, 90]))];
    mesh.triangles[0].texture = Some(0);
    let corners: Vec<_> = mesh.vertices.iter().map(|vertex| vertex.coords).collect();
    let target = Point3::from((corners[0] + corners[1] + corners[2]) / 3.0);
    let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
    let tangent = (corners[1] - corners[0]).normalize();

    let scene = Scene::random(&mut keyed_rng(6, [0, 1]), None);
    // The pixel grid is such that the optical axis meets the middle of a pixel.
    let camera = Intrinsics { focal: [90.0; 2], center: [16.5; 2] };
    let color_from = |eye: Point3<f32>| {
        let pose = look_at(eye, target);
        render(&mesh, &scene, &pose, &camera, [33, 33]).color.get_pixel(16, 16).0
    };
    let head_on = color_from(target + normal);
    for slant in [-0.8, 0.5, 1.0] {
        let slanted = color_from(target + normal * 1.3 + tangent * slant);
        let difference = head_on.iter().zip(slanted).map(|(a, b)| (a - b).abs());
        assert!(difference.fold(0.0, f32::max) < 4e-3, "{head_on:?} and {slanted:?}");
    }
}

#[test]
fn the_carpet_begins_below_the_horizon() {
    let mut rng = keyed_rng(4, [0, 0]);
    let scene = Scene {
        background: [0.0, 0.0, 1.0],
        ground: Some(Ground::random(&mut rng, -0.2)),
        ..flat_light()
    };
    // The world's y points up and the camera's down, so a level camera is turned about z.
    let level = Isometry3::rotation(Vector3::z() * std::f32::consts::PI);
    let color = render(&Mesh::default(), &scene, &level, &CAMERA, SIZE).color;
    assert_eq!(color.get_pixel(30, 24).0, scene.background);
    assert!(color.get_pixel(30, 25).0 != scene.background);
}

#[test]
fn a_broken_mesh_draws_what_is_left_of_it() {
    let mut mesh = random_mesh(5, 1);
    let mut lost_texture = triangle([0, 1, 2], [1.0; 3]);
    lost_texture.texture = Some(7);
    mesh.triangles = vec![triangle([0, 1, 99], [1.0; 3]), triangle([0; 3], [1.0; 3]), lost_texture];
    mesh.vertices.push(Point3::new(f32::NAN, 0.0, 0.0));
    mesh.triangles.push(triangle([0, 1, 3], [1.0; 3]));
    let coverage = render(&mesh, &flat_light(), &facing(1.5), &CAMERA, SIZE).coverage;
    assert!(coverage.pixels().any(|Luma([value])| *value > 0.0));
}
