//! Where pictures are taken from: random views that hold the whole object (Sec. 3.1).

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;

/// One view: a camera and its picture's `size` = `[width, height]`, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    pub camera_from_world: Isometry3<f32>,
    pub intrinsics: Intrinsics,
    pub size: [usize; 2],
}

/// The views to draw from; every pair is a range `[from, to]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewpointRange {
    /// 0 looks at the object's front, 90 at its right side (from +X).
    pub azimuth_degrees: [f32; 2],
    /// Above the object's equator.
    pub elevation_degrees: [f32; 2],
    /// About the optical axis.
    pub roll_degrees: [f32; 2],
    /// Across the picture's width.
    pub field_of_view_degrees: [f32; 2],
    /// Share of the picture's width or height, whichever is tighter, that the object takes.
    pub fill: [f32; 2],
    /// How far off centre the object may lie: 0 is centred, 1 reaches the picture's border.
    pub off_centre: f32,
}

impl Default for ViewpointRange {
    fn default() -> Self {
        Self {
            azimuth_degrees: [0.0, 360.0],
            elevation_degrees: [-5.0, 50.0],
            roll_degrees: [-10.0, 10.0],
            field_of_view_degrees: [25.0, 60.0],
            fill: [0.5, 0.9],
            off_centre: 0.5,
        }
    }
}

impl Viewpoint {
    /// A random view of `points_in_world`, say a mesh's vertices.
    pub fn random(
        points_in_world: &[Point3<f32>],
        size: [usize; 2],
        range: &ViewpointRange,
        rng: &mut impl Rng,
    ) -> Self {
        let [azimuth, elevation, roll, field_of_view] = [
            range.azimuth_degrees,
            range.elevation_degrees,
            range.roll_degrees,
            range.field_of_view_degrees,
        ]
        .map(|degrees| between(degrees, rng).to_radians());
        let fill = between(range.fill, rng);
        let off_centre = [0, 1].map(|_| range.off_centre * between([-1.0, 1.0], rng));

        let intrinsics = centered_intrinsics(size, field_of_view);
        let orbit = orbit_rotation(azimuth, elevation, roll);
        let camera_from_world =
            framed(points_in_world, orbit, &intrinsics, size, Framing { fill, off_centre });
        Self { camera_from_world, intrinsics, size }
    }
}

/// The camera of a picture seen under `field_of_view` radians across its width, without any shift.
pub fn centered_intrinsics(size: [usize; 2], field_of_view: f32) -> Intrinsics {
    let [width, height] = size.map(|side| side as f32);
    let focal = width / 2.0 / (field_of_view / 2.0).tan();
    Intrinsics { focal: [focal; 2], center: [width / 2.0, height / 2.0] }
}

/// Turns the world into the axes of a camera that looks at the origin; angles in radians.
///
/// At azimuth, elevation and roll zero it stands at −Z, before the object's front, upright.
pub fn orbit_rotation(azimuth: f32, elevation: f32, roll: f32) -> UnitQuaternion<f32> {
    // There, the camera's x, y and z are the world's −x, −y and z.
    let front = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f32::consts::PI);
    let turn = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    turn(Vector3::z_axis(), roll)
        * turn(Vector3::x_axis(), elevation)
        * front
        * turn(Vector3::y_axis(), azimuth)
}

/// `camera_from_world` of an upright camera at `eye` that looks at `target`.
///
/// Looking straight up or down, "upright" means nothing; the world's −Z then points up.
pub fn look_at(eye: Point3<f32>, target: Point3<f32>) -> Isometry3<f32> {
    let forward = target - eye;
    let upright = forward.cross(&Vector3::y()).norm() > 1e-6 * forward.norm();
    let up = if upright { Vector3::y() } else { -Vector3::z() };
    // face_towards() takes z to `forward` and y as near as it gets to its second argument.
    let world_from_camera = Rotation3::face_towards(&forward, &-up);
    let rotation = UnitQuaternion::from_rotation_matrix(&world_from_camera).inverse();
    Isometry3::from_parts(Translation3::from(-(rotation * eye.coords)), rotation)
}

/// π on the host: the pixel of a camera-frame point. Only meaningful before the camera.
pub fn project(point_in_camera: &Point3<f32>, intrinsics: &Intrinsics) -> [f32; 2] {
    let slopes = point_in_camera.xy() / point_in_camera.z;
    [0, 1].map(|axis| slopes[axis] * intrinsics.focal[axis] + intrinsics.center[axis])
}

/// The box `[left, top, right, bottom]` around the projected points, in pixels.
///
/// Points behind the camera have no projection and are left out; None if all are.
pub fn projected_box(
    points_in_world: &[Point3<f32>],
    camera_from_world: &Isometry3<f32>,
    intrinsics: &Intrinsics,
) -> Option<[f32; 4]> {
    points_in_world
        .iter()
        .map(|point| camera_from_world * point)
        .filter(|point| point.z > 0.0)
        .map(|point| project(&point, intrinsics))
        .map(|[x, y]| [x, y, x, y])
        .reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
}

/// Whether a box lies within a picture.
pub fn box_in_frame([left, top, right, bottom]: [f32; 4], size: [usize; 2]) -> bool {
    left >= 0.0 && top >= 0.0 && right <= size[0] as f32 && bottom <= size[1] as f32
}

/// How the object sits in the picture: see [`ViewpointRange`].
struct Framing {
    fill: f32,
    off_centre: [f32; 2],
}

/// The pose of this rotation at which the points' box takes its place in the picture.
///
/// A fixed point. Every correction is computed as for the point nearest to the camera, which moves
/// most: so none overshoots, and the camera stays outside the object.
fn framed(
    points_in_world: &[Point3<f32>],
    rotation: UnitQuaternion<f32>,
    intrinsics: &Intrinsics,
    size: [usize; 2],
    framing: Framing,
) -> Isometry3<f32> {
    /// Usually half of them are needed.
    const CORRECTIONS: usize = 20;
    /// A correction this small, relative to the distance, moves the box by a hundredth of a pixel.
    const SETTLED: f32 = 1e-4;
    let frame = size.map(|side| side as f32);
    let radius = points_in_world.iter().map(|point| point.coords.norm()).fold(1e-3, f32::max);
    let mut pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 4.0 * radius), rotation);

    for _ in 0..CORRECTIONS {
        let Some([left, top, right, bottom]) = projected_box(points_in_world, &pose, intrinsics)
        else {
            break;
        };
        let extent = [right - left, bottom - top];
        let center = [(left + right) / 2.0, (top + bottom) / 2.0];
        let fill = (extent[0] / frame[0]).max(extent[1] / frame[1]);

        let before = pose.translation.vector;
        let nearest = (pose.translation.vector.z - radius) * fill / framing.fill;
        pose.translation.vector.z = radius + nearest;
        for axis in 0..2 {
            let slack = (frame[axis] - extent[axis]).max(0.0) / 2.0;
            let target = frame[axis] / 2.0 + framing.off_centre[axis] * slack;
            let step = (target - center[axis]) * nearest / intrinsics.focal[axis];
            pose.translation.vector[axis] += step;
        }
        if (pose.translation.vector - before).norm() < SETTLED * nearest {
            break;
        }
    }
    pose
}

/// A number between the two, which may be equal.
pub fn between([from, to]: [f32; 2], rng: &mut impl Rng) -> f32 {
    from + (to - from) * rng.random::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_6};

    /// The corners of a car-like box with diagonal 1.
    fn corners() -> Vec<Point3<f32>> {
        let half = Vector3::new(0.42, 0.32, 0.85) / 2.0;
        let sides = [-1.0, 1.0];
        let grid = sides.iter().flat_map(|x| sides.iter().map(move |y| (x, y)));
        grid.flat_map(|(x, y)| sides.map(|z| Vector3::new(*x, *y, z)))
            .map(|corner| Point3::from(corner.component_mul(&half)))
            .collect()
    }

    #[track_caller]
    fn check_near(actual: Vector3<f32>, expected: Vector3<f32>) {
        assert!((actual - expected).norm() < 1e-5, "{actual} is not {expected}");
    }

    #[test]
    fn azimuth_zero_stands_before_the_front_and_ninety_at_the_right() {
        let eye =
            |azimuth, elevation| orbit_rotation(azimuth, elevation, 0.0).inverse() * -Vector3::z();
        check_near(eye(0.0, 0.0), -Vector3::z());
        check_near(eye(FRAC_PI_2, 0.0), Vector3::x());
        check_near(eye(0.3, FRAC_PI_2), Vector3::y());
    }

    #[test]
    fn orbits_are_upright_and_agree_with_look_at() {
        for [azimuth, elevation] in [[0.0, 0.0], [1.0, 0.4], [4.0, -0.2]] {
            let orbit = orbit_rotation(azimuth, elevation, 0.0);
            let eye = Point3::from(orbit.inverse() * -Vector3::z() * 2.0);
            let pose = look_at(eye, Point3::origin());
            assert!(pose.rotation.angle_to(&orbit) < 1e-3);
            check_near(pose.translation.vector, Vector3::new(0.0, 0.0, 2.0));
        }
    }

    #[test]
    fn a_positive_roll_turns_the_picture_clockwise() {
        // y points down, so a turn about z takes the picture's right towards its bottom.
        let right = orbit_rotation(0.0, 0.0, FRAC_PI_6) * -Vector3::x();
        check_near(right, Vector3::new(FRAC_PI_6.cos(), FRAC_PI_6.sin(), 0.0));
    }

    #[test]
    fn looking_straight_down_is_defined() {
        let pose = look_at(Point3::new(0.0, 2.0, 0.0), Point3::origin());
        check_near((pose * Point3::origin()).coords, Vector3::new(0.0, 0.0, 2.0));
    }

    #[test]
    fn random_views_hold_the_whole_object_at_the_size_asked_for() {
        let points = corners();
        let range = ViewpointRange::default();
        for seed in 0..300 {
            for size in [[128, 128], [200, 120], [60, 90]] {
                let mut rng = keyed_rng(seed, [0, 0]);
                let view = Viewpoint::random(&points, size, &range, &mut rng);
                let bounds = projected_box(&points, &view.camera_from_world, &view.intrinsics)
                    .expect("the object is before the camera");
                assert!(box_in_frame(bounds, size), "seed {seed}: {bounds:?}");
                let fill = ((bounds[2] - bounds[0]) / size[0] as f32)
                    .max((bounds[3] - bounds[1]) / size[1] as f32);
                assert!((0.495..0.905).contains(&fill), "seed {seed}: fill {fill}");
            }
        }
    }

    #[test]
    fn a_range_reads_from_toml_and_refuses_unknown_keys() {
        let range: ViewpointRange = toml::from_str("fill = [0.7, 0.7]").expect("a valid range");
        assert_eq!(range, ViewpointRange { fill: [0.7, 0.7], ..ViewpointRange::default() });
        assert!(toml::from_str::<ViewpointRange>("fil = [0.7, 0.7]").is_err());
    }
}
