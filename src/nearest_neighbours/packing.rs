//! The order of points in a packed tree, and its boxes.

use std::cmp::Ordering;

use super::lanes::{Bounds, Boxes, Locations, WIDTH};

/// Points from which on the two halves of a set are arranged side by side.
const N_PARALLEL: usize = 4096;

#[derive(Clone, Copy)]
struct Point {
    at: [f32; 3],
    idx: u32,
}

/// The finite points' indices in the order of the leaves, the leaves, and the levels above.
pub fn pack(points: &[[f32; 3]]) -> (Vec<u32>, Vec<Locations>, Vec<Vec<Boxes>>) {
    let mut points: Vec<Point> = (0..)
        .zip(points)
        .filter(|(_, point)| point.iter().all(|x| x.is_finite()))
        .map(|(idx, &at)| Point { at, idx })
        .collect();
    arrange(&mut points);

    let leaves = points.chunks(WIDTH).map(|leaf| Locations::new(leaf.iter().map(|p| p.at)));
    let leaves = leaves.collect();
    let mut bounds: Vec<Bounds> = points.chunks(WIDTH).map(bounds_of).collect();
    let mut levels = Vec::new();
    while bounds.len() > 1 || levels.is_empty() && !bounds.is_empty() {
        levels.push(bounds.chunks(WIDTH).map(Boxes::new).collect());
        let union = |node: &[Bounds]| node.iter().copied().fold(Bounds::NONE, Bounds::with);
        bounds = bounds.chunks(WIDTH).map(union).collect();
    }
    (points.iter().map(|point| point.idx).collect(), leaves, levels)
}

/// Orders points such that leaves, and the nodes above, each take up little space.
///
/// As in a k-d tree, the longest axis is halved again and again, but between whole nodes.
fn arrange(points: &mut [Point]) {
    if points.len() <= WIDTH {
        return;
    }
    let mut n_child = WIDTH;
    while n_child * WIDTH < points.len() {
        n_child *= WIDTH;
    }
    let middle = n_child * (points.len().div_ceil(n_child) / 2);
    let axis = bounds_of(points).longest_axis();
    // All are finite, and this compares in fewer instructions than `total_cmp`.
    let by_axis = |a: &Point, b: &Point| a.at[axis].partial_cmp(&b.at[axis]);
    points.select_nth_unstable_by(middle, |a, b| by_axis(a, b).unwrap_or(Ordering::Equal));

    let (left, right) = points.split_at_mut(middle);
    if left.len() + right.len() < N_PARALLEL {
        arrange(left);
        arrange(right);
    } else {
        rayon::join(|| arrange(left), || arrange(right));
    }
}

fn bounds_of(points: &[Point]) -> Bounds {
    points.iter().map(|point| Bounds::from(point.at)).fold(Bounds::NONE, Bounds::with)
}
