//! Wheels, mirrors, spoiler and roof rails, as separate closed parts.

use nalgebra::{Point3, Vector3};

use super::{
    profile::Profile,
    solid::{Solid, lathe, superellipsoid},
};

/// The rim's share of a wheel's radius.
pub const RIM_FRACTION: f32 = 0.68;

/// A wheel around the origin; its outer face looks towards +x.
pub fn wheel(profile: &Profile) -> Solid {
    const N_COLUMNS: usize = 32;
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

/// Centres of the wheels, with whether they stand on the right.
pub fn wheel_places(profile: &Profile) -> impl Iterator<Item = (Vector3<f32>, bool)> {
    let axles = &profile.parameters.axles;
    profile.axles.into_iter().flat_map(move |z| {
        let x = 0.975 * profile.half_width(z) - axles.tyre_width / 2.0;
        [(Vector3::new(x, axles.radius, z), true), (Vector3::new(-x, axles.radius, z), false)]
    })
}

/// Both mirrors, at the front ends of the side windows.
pub fn mirrors(profile: &Profile) -> Vec<Solid> {
    let size = profile.parameters.fittings.mirror;
    let z = profile.cowl + 0.35 * (profile.roof_start - profile.cowl) + 0.1;
    let x = profile.half_width(z) + 0.45 * size;
    let y = profile.belt(z) + 0.5 * size;
    let half_size = Vector3::new(0.75 * size, 0.5 * size, 0.4 * size);
    [x, -x].map(|x| superellipsoid(Point3::new(x, y, z), half_size, 0.6)).into()
}

/// A wing on two posts over the deck, if the car has one.
pub fn spoiler(profile: &Profile) -> Vec<Solid> {
    let height = profile.parameters.fittings.spoiler_height;
    if height == 0.0 {
        return Vec::new();
    }
    let z = profile.rear - 0.22;
    let (deck, half_width) = (profile.top(z), 0.9 * profile.shoulder(z));
    let wing = superellipsoid(
        Point3::new(0.0, deck + height, z),
        Vector3::new(half_width, 0.022, 0.13),
        0.4,
    );
    let post = |x: f32| {
        let center = Point3::new(x, deck + 0.45 * height, z);
        superellipsoid(center, Vector3::new(0.025, 0.6 * height, 0.06), 0.4)
    };
    vec![wing, post(0.75 * half_width), post(-0.75 * half_width)]
}

/// Two rails along the roof, if the car has them.
pub fn roof_rails(profile: &Profile) -> Vec<Solid> {
    let height = profile.parameters.fittings.roof_rail_height;
    if height == 0.0 {
        return Vec::new();
    }
    // The roof narrows and falls towards its ends, so these decide.
    let (start, end) = (profile.roof_start + 0.15, profile.roof_end - 0.3);
    let z = 0.5 * (start + end);
    let y = profile.top(start).min(profile.top(end)) + 0.4 * height;
    let x = profile.shoulder(start).min(profile.shoulder(end)) - 0.10;
    let half_size = Vector3::new(0.022, height, 0.5 * (end - start));
    [x, -x].map(|x| superellipsoid(Point3::new(x, y, z), half_size, 0.35)).into()
}
