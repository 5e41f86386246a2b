//! Exact nearest neighbours between point sets, on the host (the inner minima of Eq. 5 and 7).
//!
//! Points stand in a packed tree: every eight, and every eight of those, share a tight box. Boxes of
//! equally many points suit any cloud, be it a surface, a distant blob or a single location, and a
//! query compares eight of them at once. Memory is O(points).
//!
//! Distances are those of single precision, and no point has a smaller one than the answer. Of
//! points that tie, the answer is always the same one. Points that are not finite are never found;
//! where no distance is finite, the answer is just some point.

mod lanes;
mod packing;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use lanes::{Boxes, Locations, WIDTH, smaller_than};

/// Queries that are answered one after the other, whatever the number of threads: each begins at the
/// answer of the one before, which is near in the order of their own tree.
const QUERIES_PER_TASK: usize = 1024;

/// For each query, the index of its nearest point. Panics when there are queries but no points.
pub fn nearest_neighbours(queries: &[[f32; 3]], points: &[[f32; 3]]) -> Vec<u32> {
    if queries.is_empty() {
        return Vec::new();
    }
    NearestNeighbours::new(points).nearest_to_each(&NearestNeighbours::new(queries))
}

/// For each point of either set, the index of the nearest of the other: `[of_a, of_b]`.
pub fn mutual_neighbours(a: &[[f32; 3]], b: &[[f32; 3]]) -> [Vec<u32>; 2] {
    let (a, b) = rayon::join(|| NearestNeighbours::new(a), || NearestNeighbours::new(b));
    rayon::join(|| b.nearest_to_each(&a), || a.nearest_to_each(&b)).into()
}

/// A set of points, ready to be asked for its nearest one.
pub struct NearestNeighbours {
    n_points: usize,
    /// Index of the point in each slot; the slots of a leaf follow each other.
    point_idx: Vec<u32>,
    leaves: Vec<Locations>,
    /// Boxes around leaves, around those of the level before, and so on up to a single node.
    levels: Vec<Vec<Boxes>>,
}

/// The nearest slot so far, and its squared distance.
#[derive(Clone, Copy)]
struct Best {
    squared: f32,
    slot: usize,
}

impl NearestNeighbours {
    /// Panics when there are no points.
    pub fn new(points: &[[f32; 3]]) -> Self {
        assert!(!points.is_empty(), "a nearest neighbour needs points to choose from");
        let (point_idx, leaves, levels) = packing::pack(points);
        Self { n_points: points.len(), point_idx, leaves, levels }
    }

    /// Points of the image plane, to be asked by [`nearest_pixel`](Self::nearest_pixel).
    pub fn in_plane(pixels: impl IntoIterator<Item = [f32; 2]>) -> Self {
        Self::new(&pixels.into_iter().map(lift).collect::<Vec<_>>())
    }

    /// The index of the point nearest to `query`.
    pub fn nearest(&self, query: [f32; 3]) -> u32 {
        let best = self.nearest_slot(query, Best { squared: f32::INFINITY, slot: 0 });
        self.point_idx.get(best.slot).copied().unwrap_or(0)
    }

    /// The index of the point of the image plane nearest to `pixel`.
    pub fn nearest_pixel(&self, pixel: [f32; 2]) -> u32 {
        self.nearest(lift(pixel))
    }

    /// For each point of another set, in its order, the index of the nearest of this one.
    pub fn nearest_to_each(&self, queries: &Self) -> Vec<u32> {
        let mut in_order = vec![0; queries.n_points];
        if self.leaves.is_empty() {
            return in_order;
        }
        let mut found = vec![0; queries.point_idx.len()];
        found.par_chunks_mut(QUERIES_PER_TASK).enumerate().for_each(|(task, found)| {
            let mut slot = 0;
            for (query_slot, found) in (task * QUERIES_PER_TASK..).zip(found) {
                let query = queries.leaves[query_slot / WIDTH].get(query_slot % WIDTH);
                slot = self.nearest_slot(query, self.at(slot, query)).slot;
                *found = self.point_idx[slot];
            }
        });
        for (&query_idx, found) in queries.point_idx.iter().zip(found) {
            in_order[query_idx as usize] = found;
        }
        in_order
    }

    fn nearest_slot(&self, query: [f32; 3], mut best: Best) -> Best {
        let is_finite = query.iter().all(|x| x.is_finite());
        if let Some(top) = self.levels.len().checked_sub(1).filter(|_| is_finite) {
            self.search_node(top, 0, query, &mut best);
        }
        best
    }

    /// Visits what is closer than `best` in a node of a level, the nearest box first.
    fn search_node(&self, level: usize, node: usize, query: [f32; 3], best: &mut Best) {
        let squared = self.levels[level][node].squared_distances(query);
        let mut closer = smaller_than(&squared, best.squared);
        while closer != 0 {
            let nearest = lanes::smallest_among(&squared, closer);
            if squared[nearest] >= best.squared {
                return;
            }
            closer &= !(1 << nearest);
            let child = node * WIDTH + nearest;
            match level {
                0 => self.search_leaf(child, query, best),
                _ => self.search_node(level - 1, child, query, best),
            }
        }
    }

    #[inline]
    fn search_leaf(&self, leaf: usize, query: [f32; 3], best: &mut Best) {
        let squared = self.leaves[leaf].squared_distances(query);
        let smallest = lanes::smallest(&squared);
        if smallest < best.squared {
            let lane = squared.iter().position(|&distance| distance == smallest);
            let lane = lane.expect("the smallest is one of them");
            *best = Best { squared: smallest, slot: leaf * WIDTH + lane };
        }
    }

    /// The point in a slot as an answer to begin with.
    fn at(&self, slot: usize, query: [f32; 3]) -> Best {
        let point = self.leaves[slot / WIDTH].get(slot % WIDTH);
        Best { squared: lanes::squared_distance(point, query), slot }
    }
}

/// The image plane as a plane of space.
fn lift([u, v]: [f32; 2]) -> [f32; 3] {
    [u, v, 0.0]
}
