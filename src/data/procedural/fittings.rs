//! What is mounted on a body, as separate closed parts.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Vector3};

use super::{
    parameters::BodyStyle,
    profile::Profile,
    solid::{Solid, superellipsoid},
};

/// Both mirrors, at the front ends of the side windows, unless they are folded away.
pub fn mirrors(profile: &Profile) -> Vec<Solid> {
    let size = profile.parameters.fittings.mirror;
    if size == 0.0 {
        return Vec::new();
    }
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

/// Two rails along the roof, if the car has them and the roof is long enough.
pub fn roof_rails(profile: &Profile) -> Vec<Solid> {
    let height = profile.parameters.fittings.roof_rail_height;
    let (start, end) = (profile.roof_start + 0.15, profile.roof_end - 0.3);
    if height == 0.0 || end - start < 0.6 {
        return Vec::new();
    }
    // The roof narrows and falls towards its ends, so these decide.
    let z = 0.5 * (start + end);
    let y = profile.top(start).min(profile.top(end)) + 0.4 * height;
    let x = profile.shoulder(start).min(profile.shoulder(end)) - 0.10;
    let half_size = Vector3::new(0.022, height, 0.5 * (end - start));
    [x, -x].map(|x| superellipsoid(Point3::new(x, y, z), half_size, 0.35)).into()
}

/// Bars across both ends, if they stand out of the body.
pub fn bumpers(profile: &Profile) -> Vec<Solid> {
    let depth = profile.parameters.fittings.bumper_depth;
    if depth == 0.0 {
        return Vec::new();
    }
    let bar = |end: f32, inwards: f32| {
        let half_width = profile.half_width(end + inwards * 0.3);
        let half_size = Vector3::new(half_width, 0.055 + 0.35 * depth, 0.06 + 0.5 * depth);
        let y = profile.bottom(end + inwards * 0.3) + half_size.y + 0.04;
        let z = end - inwards * (depth - half_size.z);
        superellipsoid(Point3::new(0.0, y, z), half_size, 0.25)
    };
    vec![bar(profile.front, 1.0), bar(profile.rear, -1.0)]
}

/// A sign, a light bar or a luggage box, if the roof carries one.
pub fn roof_load(profile: &Profile) -> Vec<Solid> {
    let [width, height, length] = profile.parameters.fittings.roof_load;
    if height == 0.0 {
        return Vec::new();
    }
    let z = 0.5 * (profile.roof_start + profile.roof_end);
    let half_size = Vector3::new(
        (0.5 * width).min(profile.shoulder(z) - 0.1),
        0.5 * height,
        (0.5 * length).min(0.5 * (profile.roof_end - profile.roof_start)),
    );
    let y = profile.top(z) + profile.parameters.cabin.crown + 0.42 * height;
    vec![superellipsoid(Point3::new(0.0, y, z), half_size, 0.3)]
}

/// The windscreen of an open car, which has no roof to lean on.
pub fn free_windscreen(profile: &Profile) -> Vec<Solid> {
    const HEIGHT: f32 = 0.36;
    const RAKE: f32 = 0.6; // from the horizontal, in radians
    if profile.parameters.style != BodyStyle::Roadster {
        return Vec::new();
    }
    let half_size = Vector3::new(0.9 * profile.shoulder(profile.cowl), HEIGHT / 2.0, 0.02);
    let mut pane = superellipsoid(Point3::origin(), half_size, 0.25);
    let rise = 0.5 * HEIGHT * RAKE.sin();
    let foot = Vector3::new(0.0, profile.top(profile.cowl) + rise, profile.cowl + 0.2);
    let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f32::consts::FRAC_PI_2 - RAKE);
    let pose = Isometry3::from_parts(Translation3::from(foot), lean.into());
    for vertex in &mut pane.vertices {
        *vertex = pose * *vertex;
    }
    vec![pane]
}

/// The backs of two seats, where a cockpit is open.
pub fn seats(profile: &Profile) -> Vec<Solid> {
    let Some([_, end]) = profile.bed().filter(|_| profile.parameters.style == BodyStyle::Roadster)
    else {
        return Vec::new();
    };
    let x = 0.42 * profile.shoulder(end);
    let y = profile.top(end) - 0.12;
    let half_size = Vector3::new(0.23, 0.3, 0.1);
    [x, -x].map(|x| superellipsoid(Point3::new(x, y, end - 0.25), half_size, 0.5)).into()
}
