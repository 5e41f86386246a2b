//! Exact nearest neighbours in an image (the first minimum of Eq. 5), in time O(pixels + points).
//!
//! Points fall into the buckets of a grid, and a query looks at its own bucket and at ring after ring
//! around it. Points that cover an image end that search at once; where they do not, a tree goes on for
//! the many pixels, and rings for the few pieces of an outline.

use std::cell::OnceCell;

use crate::{
    nearest_neighbours::NearestNeighbours,
    silhouette::{Segment, Target},
};

/// Rings around a query that are searched before the tree is asked.
const MAX_RINGS: i32 = 12;

/// Locations of an image, ready to be asked for the nearest one.
pub struct PixelGrid {
    /// Side of a bucket, in pixels.
    side: f32,
    columns: i32,
    rows: i32,
    /// Where each bucket's locations start in `locations`, row by row, and where the last one's end.
    starts: Vec<u32>,
    /// Locations and their places in the order that they came in.
    locations: Vec<([f32; 2], u32)>,
    tree: OnceCell<NearestNeighbours>,
}

/// Share of the squared distance from a segment's middle that counts: as much as rounding does, so that the
/// order of locations is nothing that is seen.
const TIE_BREAK: f32 = 1e-6;

/// The nearest so far, and its squared distance.
type Best = (f32, u32);

impl PixelGrid {
    /// Of locations in and around an image of `size` = [width, height] pixels. Those that are not
    /// finite are never found.
    pub fn new(size: [usize; 2], pixels: impl Iterator<Item = [f32; 2]>) -> Self {
        let found = pixels.zip(0..).filter(|(pixel, _)| pixel.iter().all(|x| x.is_finite()));
        let found: Vec<([f32; 2], u32)> = found.collect();
        let [width, height] = size.map(|side| side.max(1) as f32);
        let side = (width * height / found.len().max(1) as f32).sqrt().max(1.0);
        let [columns, rows] = [width, height].map(|length| (length / side).ceil() as i32);
        let mut grid = Self {
            side,
            columns,
            rows,
            starts: vec![0; (columns * rows) as usize + 1],
            locations: vec![([0.0; 2], 0); found.len()],
            tree: OnceCell::new(),
        };
        let buckets: Vec<usize> = found.iter().map(|(pixel, _)| grid.bucket_of(*pixel)).collect();
        // Where each bucket ends; filling them from behind moves that to where it starts.
        buckets.iter().for_each(|&bucket| grid.starts[bucket] += 1);
        let mut end = 0;
        grid.starts.iter_mut().for_each(|count| {
            end += *count;
            *count = end;
        });
        for (location, &bucket) in found.iter().zip(&buckets) {
            grid.starts[bucket] -= 1;
            grid.locations[grid.starts[bucket] as usize] = *location;
        }
        grid
    }

    /// The index of the location nearest to `query`, which lies in the image; where there are none, it
    /// is just zero.
    pub fn nearest(&self, query: [f32; 2]) -> u32 {
        if self.locations.is_empty() {
            return 0;
        }
        let squared = |[u, v]: [f32; 2]| (u - query[0]).powi(2) + (v - query[1]).powi(2);
        self.search(query, 0.0, MAX_RINGS, squared)
            .unwrap_or_else(|| self.locations[self.tree().nearest_pixel(query) as usize].1)
    }

    /// The index of the location nearest to a segment whose middle lies in the image, and of those that are
    /// equally near the one nearest to that; where there are no locations, it is just zero.
    pub fn nearest_to(&self, segment: &Segment) -> u32 {
        let squared = |location| {
            let from_middle = Target::from(segment.middle).squared(location);
            segment.nearest(location).squared(location) + TIE_BREAK * from_middle
        };
        let all_rings = self.columns.max(self.rows);
        self.search(segment.middle, segment.reach, all_rings, squared).unwrap_or(0)
    }

    /// The location with the least squared distance from something around `center` that extends over
    /// `extent` pixels; `None` where it may lie beyond the last ring.
    fn search(
        &self,
        center: [f32; 2],
        extent: f32,
        n_rings: i32,
        squared: impl Fn([f32; 2]) -> f32,
    ) -> Option<u32> {
        let cell = self.cell_of(center);
        let to_border = [0, 1].map(|axis| {
            let from_left = center[axis] - cell[axis] as f32 * self.side;
            from_left.min(self.side - from_left)
        });
        let to_border = to_border[0].min(to_border[1]);
        let mut best: Best = (f32::INFINITY, 0);
        for ring in 0..n_rings {
            self.search_ring(cell, ring, &squared, &mut best);
            // Whatever lies beyond this ring is farther away.
            let reached = (ring as f32 * self.side + to_border - extent).max(0.0);
            if best.0 <= reached * reached {
                return Some(best.1);
            }
        }
        let seen_all = n_rings >= self.columns.max(self.rows);
        seen_all.then_some(best.1)
    }

    fn tree(&self) -> &NearestNeighbours {
        let pixels = || self.locations.iter().map(|(pixel, _)| *pixel);
        self.tree.get_or_init(|| NearestNeighbours::in_plane(pixels()))
    }

    fn search_ring(
        &self,
        [column, row]: [i32; 2],
        ring: i32,
        squared: &impl Fn([f32; 2]) -> f32,
        best: &mut Best,
    ) {
        let (left, right) = (column - ring, column + ring);
        for at in [row - ring, row + ring].iter().take(if ring == 0 { 1 } else { 2 }) {
            self.search_run(*at, left, right, squared, best);
        }
        for at in row - ring + 1..row + ring {
            self.search_run(at, left, left, squared, best);
            self.search_run(at, right, right, squared, best);
        }
    }

    /// Buckets beside one another hold locations behind one another.
    fn search_run(
        &self,
        row: i32,
        left: i32,
        right: i32,
        squared: &impl Fn([f32; 2]) -> f32,
        best: &mut Best,
    ) {
        let (left, right) = (left.max(0), right.min(self.columns - 1));
        if row < 0 || row >= self.rows || left > right {
            return;
        }
        let first = (row * self.columns + left) as usize;
        let last = (row * self.columns + right) as usize + 1;
        let run = self.starts[first] as usize..self.starts[last] as usize;
        for &(location, idx) in &self.locations[run] {
            let squared = squared(location);
            if squared < best.0 {
                *best = (squared, idx);
            }
        }
    }

    fn bucket_of(&self, pixel: [f32; 2]) -> usize {
        let [column, row] = self.cell_of(pixel);
        (row * self.columns + column) as usize
    }

    /// Locations out of the image belong to the bucket at its border, which is nearer to any query.
    fn cell_of(&self, [u, v]: [f32; 2]) -> [i32; 2] {
        let cell = |at: f32, count: i32| ((at / self.side) as i32).clamp(0, count - 1);
        [cell(u, self.columns), cell(v, self.rows)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    const SIZE: [usize; 2] = [40, 30];

    /// Distances are compared: of locations that tie, either is right.
    #[track_caller]
    fn check_nearest(locations: &[[f32; 2]]) {
        let grid = PixelGrid::new(SIZE, locations.iter().copied());
        let mut rng = keyed_rng(2, [0, 0]);
        for _ in 0..300 {
            let query = SIZE.map(|side| rng.random_range(0.0..side as f32));
            let squared = |at: &[f32; 2]| (at[0] - query[0]).powi(2) + (at[1] - query[1]).powi(2);
            let least = locations.iter().map(squared).fold(f32::INFINITY, f32::min);
            let found = &locations[grid.nearest(query) as usize];
            assert_eq!(squared(found), least, "{found:?} is not the nearest to {query:?}");
        }
    }

    fn random(n: usize, seed: u64, [low, high]: [f32; 2]) -> Vec<[f32; 2]> {
        let mut rng = keyed_rng(seed, [0, 0]);
        (0..n).map(|_| [rng.random_range(low..high), rng.random_range(low..high)]).collect()
    }

    #[test]
    fn the_nearest_location_is_the_brute_force_one() {
        check_nearest(&random(2000, 1, [0.0, 40.0]));
        check_nearest(&random(60, 2, [-10.0, 50.0]));
    }

    #[test]
    fn locations_in_a_corner_and_out_of_the_image_are_found() {
        check_nearest(&random(300, 3, [0.0, 2.0]));
        check_nearest(&random(50, 4, [-500.0, -80.0]));
        check_nearest(&[[3.0, 4.0]]);
    }

    /// Against the distance to many places along the segment.
    #[test]
    fn the_location_nearest_to_a_segment_is_the_brute_force_one() {
        let mut rng = keyed_rng(5, [0, 0]);
        for locations in [
            random(1500, 6, [0.0, 40.0]),
            random(40, 7, [-10.0, 50.0]),
            random(50, 8, [-500.0, -80.0]),
        ] {
            let grid = PixelGrid::new(SIZE, locations.iter().copied());
            for _ in 0..100 {
                let middle = SIZE.map(|side| rng.random_range(0.0..side as f32));
                let turn: f32 = rng.random_range(0.0..6.3);
                let segment = Segment { middle, tangent: [turn.cos(), turn.sin()], reach: 3.0 };
                let distance = |at: &[f32; 2]| {
                    let places = (-300..=300).map(|k| {
                        let place =
                            [0, 1].map(|i| middle[i] + 0.01 * k as f32 * segment.tangent[i]);
                        (at[0] - place[0]).hypot(at[1] - place[1])
                    });
                    places.fold(f32::INFINITY, f32::min)
                };
                let least = locations.iter().map(distance).fold(f32::INFINITY, f32::min);
                let found = distance(&locations[grid.nearest_to(&segment) as usize]);
                assert!(found < least + 0.01, "{found} is not {least}");
            }
        }
    }

    #[test]
    fn locations_that_are_not_finite_are_never_found() {
        let grid = PixelGrid::new(SIZE, [[f32::NAN, 1.0], [9.0, 9.0]].into_iter());
        assert_eq!(grid.nearest([0.5, 0.5]), 1);
        assert_eq!(PixelGrid::new(SIZE, [[f32::NAN; 2]].into_iter()).nearest([0.5, 0.5]), 0);
    }
}
