//! Polygons as triangles.

use earcut::Earcut;
use nalgebra::{Point3, Vector3};

/// Share of a polygon's area by which a triangle of it may look the other way: its corners are rounded.
const ROUNDING: f64 = 1e-6;
/// Share of a polygon's area that its ears may leave out before a fan is better.
const MOST_LOST: f64 = 1e-3;

/// A polygon's triangles. Where the first corner sees all of it, as in every convex one, they fan out
/// from there; else ears are clipped in the plane of its normal.
///
/// A polygon that crosses itself has no inside, nor one without area: what becomes of these is of no
/// meaning, but no panic, and where ears would leave some of the surface out, it is a fan.
pub fn triangles<T: Copy>(
    corners: &[T],
    position: impl Fn(T) -> Point3<f32>,
) -> impl Iterator<Item = [T; 3]> {
    let ears = if corners.len() > 3 { ears_if_needed(corners, position) } else { None };
    let n_triangles = ears.as_ref().map_or(corners.len().saturating_sub(2), Vec::len);
    (0..n_triangles).map(move |idx| {
        let triangle = ears.as_ref().map_or([0, idx + 1, idx + 2], |ears| ears[idx]);
        triangle.map(|corner| corners[corner])
    })
}

/// The fan about the first corner.
pub fn fan<T: Copy>(corners: &[T]) -> impl Iterator<Item = [T; 3]> {
    corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]])
}

/// Triangles as positions among the corners; `None` where the fan is right, or nothing is better.
fn ears_if_needed<T: Copy>(
    corners: &[T],
    position: impl Fn(T) -> Point3<f32>,
) -> Option<Vec<[usize; 3]>> {
    // From the first corner on, and in double precision: the area of a small polygon far from the
    // origin would drown in rounding.
    let first = position(corners[0]).cast::<f64>();
    let from_first = |idx: usize| position(corners[idx]).cast::<f64>() - first;
    let doubled_area = |[a, b, c]: [usize; 3]| {
        (from_first(b) - from_first(a)).cross(&(from_first(c) - from_first(a)))
    };
    let fan_areas = || (2..corners.len()).map(|idx| from_first(idx - 1).cross(&from_first(idx)));
    // Newell's normal, of twice the polygon's area.
    let normal: Vector3<f64> = fan_areas().sum();
    let lowest = -ROUNDING * normal.norm_squared();
    if fan_areas().all(|area| area.dot(&normal) >= lowest) {
        return None;
    }

    // Seen along the axis that is nearest to the normal, the polygon keeps its shape but for a stretch.
    let [x, y] = [(normal.iamax() + 1) % 3, (normal.iamax() + 2) % 3];
    let outline = (0..corners.len()).map(|idx| [from_first(idx)[x], from_first(idx)[y]]);
    let mut indices = Vec::<usize>::new();
    Earcut::new().earcut(outline, &[], &mut indices);
    let facing = |[a, b, c]: [usize; 3]| {
        if doubled_area([a, b, c]).dot(&normal) < 0.0 { [a, c, b] } else { [a, b, c] }
    };
    let (ears, _) = indices.as_chunks::<3>();
    let ears: Vec<_> = ears.iter().copied().map(facing).collect();
    let covered: f64 = ears.iter().map(|&ear| doubled_area(ear).dot(&normal)).sum();
    (covered >= (1.0 - MOST_LOST) * normal.norm_squared()).then_some(ears)
}

#[cfg(test)]
pub mod tests;
