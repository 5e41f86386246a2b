//! The body: cross-sections along the car, lofted into one closed shell.

use std::f32::consts::{FRAC_PI_2, PI};

use nalgebra::Point3;

use super::{
    profile::{Cant, FLARE_WIDTH, Profile},
    solid::{Solid, loft},
};

/// Sections between the ends, before those that features add.
const N_SECTIONS: usize = 34;
/// Sizes of the smaller copies of the end section that close an end.
const CAP_SCALES: [f32; 4] = [0.85, 0.65, 0.4, 0.2];
/// Space beside a tyre in its arch, in metres.
const ARCH_DEPTH_GAP: f32 = 0.04;

/// Columns of half a section from the middle of the floor to the middle of the roof.
const N_FLOOR: usize = 2;
const N_ARCH_WALL: usize = 2;
const N_ARCH_ROOF: usize = 2;
const N_SIDE: usize = 6;
const N_SHELF: usize = 1;
const N_WINDOW: usize = 3;
const N_CANT: usize = 4;
const N_ROOF: usize = 8;
const N_UNDER: usize = N_FLOOR + N_ARCH_WALL + N_ARCH_ROOF;
const N_HALF: usize = N_UNDER + N_SIDE + N_SHELF + N_WINDOW + N_CANT + N_ROOF;

/// The shell, without wheels and fittings, in the workshop frame.
pub fn body(profile: &Profile) -> Solid {
    let sections: Vec<_> = stations(profile).iter().map(|&z| section(profile, z)).collect();
    let scaled = |ring: &Vec<Point3<f32>>, scale: f32| {
        let center = middle(ring);
        ring.iter().map(|point| center + (point - center) * scale).collect::<Vec<_>>()
    };
    let (first, last) = (&sections[0], &sections[sections.len() - 1]);

    let mut rings: Vec<_> = CAP_SCALES.iter().rev().map(|&scale| scaled(first, scale)).collect();
    rings.extend(sections.iter().cloned());
    rings.extend(CAP_SCALES.iter().map(|&scale| scaled(last, scale)));
    for point in rings.iter_mut().flatten() {
        point.z += profile.bow(point.x, point.z);
    }
    loft(&rings)
}

/// Whether a column of [`body`] belongs to the floor or to a wheel arch.
pub fn is_underside(column: usize) -> bool {
    !(N_UNDER..2 * N_HALF - N_UNDER).contains(&column)
}

/// Whether a column of [`body`] belongs to the roof, the bonnet, the deck or the bed.
pub fn is_upper_side(column: usize) -> bool {
    (N_HALF - N_ROOF..N_HALF + N_ROOF).contains(&column)
}

/// Where sections stand, z: evenly along the roof line, and closer where edges want to be crisp.
fn stations(profile: &Profile) -> Vec<f32> {
    let Profile { front, rear, arch_radius, cowl, roof_start, roof_end, deck_start, .. } = *profile;
    let edge = profile.parameters.ends.edge_radius;
    let mut crisp = vec![cowl, roof_start, roof_end, deck_start];
    for step in 0..=5 {
        let depth = edge * (1.0 - (step as f32 / 5.0 * FRAC_PI_2).cos());
        crisp.extend([front + depth, rear - depth]);
    }
    for axle in profile.axles {
        crisp.extend([-1.0, 1.0].map(|side| axle + side * (arch_radius + 0.006)));
        crisp.extend([-1.0, 1.0].map(|side| axle + side * (arch_radius + FLARE_WIDTH)));
        crisp.extend((0..=8).map(|step| axle - arch_radius * (step as f32 / 8.0 * PI).cos()));
    }
    if let Some([start, end]) = profile.bed() {
        crisp.extend([start - 0.008, start, end, end + 0.008]);
    }

    if profile.in_box(rear) {
        crisp.push(roof_end - 0.008);
    }

    let mut stations = evenly_along_roof_line(profile);
    stations.retain(|z| crisp.iter().all(|other| (z - other).abs() > 0.02));
    stations.extend(crisp);
    stations.sort_by(f32::total_cmp);
    // Arches may reach into the rounded edges, where two features then share a place.
    stations.dedup_by(|a, b| (*a - *b).abs() < 0.003);
    stations
}

fn evenly_along_roof_line(profile: &Profile) -> Vec<f32> {
    const N_STEPS: usize = 2000;
    let at =
        |step: usize| profile.front + (profile.rear - profile.front) * step as f32 / N_STEPS as f32;
    let mut walked = vec![0.0];
    for step in 0..N_STEPS {
        let rise = profile.top(at(step + 1)) - profile.top(at(step));
        walked.push(walked[step] + rise.hypot(at(step + 1) - at(step)));
    }
    (1..N_SECTIONS)
        .map(|idx| walked[N_STEPS] * idx as f32 / N_SECTIONS as f32)
        .map(|distance| at(walked.partition_point(|&w| w < distance)))
        .collect()
}

/// A ring around the car at `z`: up the right side from the floor, and down the left.
fn section(profile: &Profile, z: f32) -> Vec<Point3<f32>> {
    let right = half_section(profile, z);
    // The middles of floor and roof belong to both halves.
    let left = right[1..right.len() - 1].iter().rev().map(|&[x, y]| [-x, y]);
    right.iter().copied().chain(left).map(|[x, y]| Point3::new(x, y, z)).collect()
}

/// The right half, `[x, y]`, from the middle of the floor to the middle of the roof.
fn half_section(profile: &Profile, z: f32) -> Vec<[f32; 2]> {
    let parameters = &profile.parameters;
    let (top, bottom, width) = (profile.top(z), profile.bottom(z), profile.half_width(z));
    let belt = profile.belt(z).min(top - 0.06);
    let arch = profile.arch(z);
    // The floor of a lifted car passes over the arches' ends.
    let side_bottom = arch.unwrap_or(0.0).max(bottom + 0.01).min(belt - 0.05);
    let arch_wall = parameters.size.width / 2.0 - parameters.axles.tyre_width - ARCH_DEPTH_GAP;
    let arch_wall = arch_wall.min(0.85 * width);
    let floor = if arch.is_some() { arch_wall } else { 0.9 * arch_wall };
    let Cant { half_width: cant_width, radius } = profile.cant(z);
    // But for flares, the side is a function of height alone, so that it runs straight over arches,
    // and so that sections of different height follow each other without steps.
    let side_at = |y: f32| {
        let height = ((y - bottom) / (profile.belt(z) - bottom)).clamp(0.0, 1.0);
        let bulge = 0.5 * parameters.hull.bulge * (PI * height).sin();
        width * (0.965 + 0.028 * height + bulge) + profile.flare(y, z)
    };

    let mut half = Vec::with_capacity(N_HALF + 1);
    half.extend(segment([0.0, bottom], [floor, bottom], N_FLOOR));
    half.extend(segment([floor, bottom], [arch_wall, side_bottom], N_ARCH_WALL));
    half.extend(segment(
        [arch_wall, side_bottom],
        [side_at(side_bottom), side_bottom],
        N_ARCH_ROOF,
    ));
    half.extend(segment([0.0, side_bottom], [0.0, belt], N_SIDE).map(|[_, y]| [side_at(y), y]));
    half.push([side_at(belt), belt]);
    let window_foot = [side_at(belt) - profile.shelf(z), belt + 0.01];
    // The side reaches its full width at the belt, which is above the bonnet.
    let cant_width = cant_width.min(window_foot[0]);
    half.extend(segment(window_foot, [cant_width, top - radius], N_WINDOW));
    half.extend((0..N_CANT).map(|step| {
        let (sine, cosine) = (step as f32 / N_CANT as f32 * FRAC_PI_2).sin_cos();
        [cant_width - radius * (1.0 - cosine), top - radius * (1.0 - sine)]
    }));
    half.extend(upper_side(profile, z, cant_width - radius));
    half
}

/// From the roof's edge at `half_width` to its middle: crowned, or sunk where a bed is.
fn upper_side(profile: &Profile, z: f32, half_width: f32) -> [[f32; 2]; N_ROOF + 1] {
    let (top, parameters) = (profile.top(z), &profile.parameters);
    if let Some(bed) = profile.bed().filter(|[start, end]| (*start..=*end).contains(&z)) {
        let over_axle = profile.axles.iter().any(|axle| (bed[0]..=bed[1]).contains(axle));
        let arches = if over_axle { parameters.axles.radius + profile.arch_radius } else { 0.0 };
        let lowest = arches.max(profile.bottom(z)) + 0.04;
        let floor = (top - parameters.fittings.bed_depth).max(lowest).min(top - 0.05);
        let columns = [1.0, 0.95, 0.94, 0.93, 0.75, 0.55, 0.35, 0.18, 0.0];
        let heights = [top, top, 0.5 * (top + floor), floor, floor, floor, floor, floor, floor];
        return std::array::from_fn(|i| [half_width * columns[i], heights[i]]);
    }
    std::array::from_fn(|column| {
        let inward = column as f32 / N_ROOF as f32;
        let crown = parameters.cabin.crown * (inward * FRAC_PI_2).sin();
        [half_width * (1.0 - inward), top + crown]
    })
}

/// `n` points from `from` towards `to`, which is left to the next segment.
fn segment(from: [f32; 2], to: [f32; 2], n: usize) -> impl Iterator<Item = [f32; 2]> {
    (0..n).map(move |step| {
        let t = step as f32 / n as f32;
        [from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t]
    })
}

/// A point from which the whole ring can be seen.
fn middle(ring: &[Point3<f32>]) -> Point3<f32> {
    let heights = ring.iter().map(|point| point.y);
    let low = heights.clone().fold(f32::INFINITY, f32::min);
    let high = heights.fold(f32::NEG_INFINITY, f32::max);
    Point3::new(0.0, 0.5 * (low + high), ring[0].z)
}
