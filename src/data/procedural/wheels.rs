//! Wheels, as separate closed parts: four on the road and perhaps one on the tailgate.

use std::f32::consts::{FRAC_PI_2, PI};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::{
    profile::Profile,
    solid::{Solid, lathe},
};

/// The rim's share of a wheel's radius.
pub const RIM_FRACTION: f32 = 0.68;
/// Height of the floor over the wheels' centres, in metres, from which axles are seen.
const VISIBLE_AXLE: f32 = 0.02;

/// A wheel around the origin; its outer face looks towards +x.
pub fn wheel(profile: &Profile) -> Solid {
    const N_COLUMNS: usize = 20;
    let axles = &profile.parameters.axles;
    let (r, half) = (axles.radius, axles.tyre_width / 2.0);
    lathe(
        &[
            [0.25 * r, -0.9 * half],
            [0.80 * r, -half],
            [0.97 * r, -0.92 * half],
            [r, -0.6 * half],
            [r, 0.6 * half],
            [0.97 * r, 0.92 * half],
            [0.85 * r, half],
            [RIM_FRACTION * r, 0.96 * half],
            [0.95 * RIM_FRACTION * r, 0.80 * half],
            [0.40 * r, 0.72 * half],
            [0.20 * r, 0.80 * half],
            [0.12 * r, 0.86 * half],
        ],
        N_COLUMNS,
    )
}

/// Where the wheels are, each as its part's own frame in the workshop frame.
pub fn wheel_poses(profile: &Profile) -> Vec<Isometry3<f32>> {
    let axles = &profile.parameters.axles;
    let on_the_road = profile.axles.into_iter().flat_map(|z| {
        let x = wheel_center(profile, z);
        [posed([x, axles.radius, z], 0.0), posed([-x, axles.radius, z], PI)]
    });
    on_the_road.chain(spare_wheel_pose(profile)).collect()
}

/// Rods between wheels, where the floor is high enough for them to be seen.
pub fn axle_rods(profile: &Profile) -> Vec<Solid> {
    const RADIUS: f32 = 0.06;
    let radius = profile.parameters.axles.radius;
    if profile.parameters.size.clearance < radius + VISIBLE_AXLE {
        return Vec::new();
    }
    let rod = |z: f32| {
        let x = wheel_center(profile, z);
        let mut rod = lathe(&[[RADIUS, -x], [RADIUS, x]], 12);
        for vertex in &mut rod.vertices {
            *vertex += Vector3::new(0.0, radius, z);
        }
        rod
    };
    profile.axles.map(rod).into()
}

/// x of the middle of the right wheel on the axle at `z`.
fn wheel_center(profile: &Profile, z: f32) -> f32 {
    let axles = &profile.parameters.axles;
    let arch_edge = 0.975 * profile.half_width(z) + 0.6 * profile.parameters.hull.flare;
    arch_edge - axles.tyre_width / 2.0 + axles.stance
}

/// Upright on the tailgate, outer face to the rear.
fn spare_wheel_pose(profile: &Profile) -> Option<Isometry3<f32>> {
    let radius = profile.parameters.axles.radius;
    let y = profile.parameters.size.clearance + 0.25 + radius;
    let z = profile.rear + 0.35 * profile.parameters.axles.tyre_width;
    profile.parameters.fittings.spare_wheel.then(|| posed([0.0, y, z], -FRAC_PI_2))
}

/// Turned by `angle` about the vertical, then moved to `place`.
fn posed(place: [f32; 3], angle: f32) -> Isometry3<f32> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
    Isometry3::from_parts(Translation3::from(Point3::from(place).coords), turn)
}
