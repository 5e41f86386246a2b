//! Exact nearest neighbours between point sets, on the host (the inner minima of Eq. 5 and 7).
//!
//! A bucket grid answers when clouds are alike: about one cell a point, so a query looks at a few
//! dozen candidates. It degrades when one cloud is a distant blob or collapses into a few cells, as
//! happens early in training; a k-d tree answers there. Both are exact, so the choice is only of
//! speed. Memory is O(points).

use std::sync::OnceLock;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Cells that the grid has for each point.
const CELLS_PER_POINT: f32 = 1.5;
/// Rings of cells that a query searches before it turns to the k-d tree.
const MAX_RING: i32 = 4;
/// Mean number of points that share a point's cell, above which the grid is not worth using.
const MAX_CROWD: usize = 48;

/// For each query, the index of its nearest point. Panics when there are queries but no points.
pub fn nearest_neighbours(queries: &[[f32; 3]], points: &[[f32; 3]]) -> Vec<u32> {
    if queries.is_empty() {
        return Vec::new();
    }
    let search = NearestNeighbours::new(points.to_vec());
    queries.iter().map(|&query| search.nearest(query)).collect()
}

/// A set of points, ready to be asked for its nearest one.
pub struct NearestNeighbours {
    points: Vec<[f32; 3]>,
    grid: Option<Grid>,
    tree: OnceLock<ImmutableKdTree<f32, 3>>,
}

impl NearestNeighbours {
    /// Panics when there are no points.
    pub fn new(points: Vec<[f32; 3]>) -> Self {
        assert!(!points.is_empty(), "a nearest neighbour needs points to choose from");
        Self { grid: Grid::new(&points), points, tree: OnceLock::new() }
    }

    /// Points of the image plane, to be asked by [`nearest_pixel`](Self::nearest_pixel).
    pub fn in_plane(pixels: impl IntoIterator<Item = [f32; 2]>) -> Self {
        Self::new(pixels.into_iter().map(lift).collect())
    }

    /// The index of the point nearest to `query`.
    pub fn nearest(&self, query: [f32; 3]) -> u32 {
        match self.grid.as_ref().and_then(|grid| grid.nearest(query)) {
            Some(point_idx) => point_idx,
            None => {
                let tree = self.tree.get_or_init(|| ImmutableKdTree::new_from_slice(&self.points));
                tree.nearest_one::<SquaredEuclidean>(&query).item as u32
            }
        }
    }

    /// The index of the point of the image plane nearest to `pixel`.
    pub fn nearest_pixel(&self, pixel: [f32; 2]) -> u32 {
        self.nearest(lift(pixel))
    }
}

/// The image plane as a plane of space, its rows along the axis that the grid stores contiguously.
fn lift([u, v]: [f32; 2]) -> [f32; 3] {
    [0.0, v, u]
}

/// Points sorted by the cell that they fall into.
struct Grid {
    origin: [f32; 3],
    cell_size: f32,
    n_cells: [i32; 3],
    /// Where each cell's points start in `points` and `point_idx`; one more entry than cells.
    starts: Vec<u32>,
    points: Vec<[f32; 3]>,
    point_idx: Vec<u32>,
}

impl Grid {
    /// `None` when the points crowd into too few cells, or are not finite.
    fn new(points: &[[f32; 3]]) -> Option<Self> {
        let (origin, extent) = bounds(points);
        let cell_size = cell_size(extent, points.len())?;
        let n_cells = extent.map(|extent| (extent / cell_size) as i32 + 1);
        let mut grid = Self {
            origin,
            cell_size,
            n_cells,
            starts: vec![0; n_cells.iter().product::<i32>() as usize + 1],
            points: vec![[0.0; 3]; points.len()],
            point_idx: vec![0; points.len()],
        };

        // A counting sort: count, accumulate, place.
        let cells: Vec<usize> = points.iter().map(|&p| grid.cell_idx(grid.cell(p))).collect();
        cells.iter().for_each(|&cell| grid.starts[cell + 1] += 1);
        let crowd: usize = grid.starts.iter().map(|&count| (count as usize).pow(2)).sum();
        if crowd > MAX_CROWD * points.len() {
            return None;
        }
        (1..grid.starts.len()).for_each(|cell| grid.starts[cell] += grid.starts[cell - 1]);
        let mut next = grid.starts.clone();
        for (idx, &cell) in cells.iter().enumerate() {
            let slot = next[cell] as usize;
            next[cell] += 1;
            grid.points[slot] = points[idx];
            grid.point_idx[slot] = idx as u32;
        }
        Some(grid)
    }

    /// Searches rings of cells around the query's own; `None` when nothing near was found.
    fn nearest(&self, query: [f32; 3]) -> Option<u32> {
        let center = self.cell(query);
        let mut best = (f32::INFINITY, None);
        for ring in 0..=MAX_RING {
            // Rings further out lie beyond this distance.
            let reach = self.distance_out_of(query, center, ring - 1);
            if reach > 0.0 && best.0 <= reach * reach {
                return best.1;
            }
            self.search_ring(query, center, ring, &mut best);
        }
        let reach = self.distance_out_of(query, center, MAX_RING);
        (reach > 0.0 && best.0 <= reach * reach).then_some(best.1).flatten()
    }

    /// Visits the cells at Chebyshev distance `ring`; a row inside the shell has only two ends.
    fn search_ring(
        &self,
        query: [f32; 3],
        center: [i32; 3],
        ring: i32,
        best: &mut (f32, Option<u32>),
    ) {
        let range = |axis: usize| {
            (center[axis] - ring).max(0)..=(center[axis] + ring).min(self.n_cells[axis] - 1)
        };
        for i in range(0) {
            for j in range(1) {
                let on_shell = (i - center[0]).abs() == ring || (j - center[1]).abs() == ring;
                if on_shell {
                    let (first, last) = (*range(2).start(), *range(2).end());
                    self.search_row([i, j], first, last, query, best);
                } else {
                    for k in [center[2] - ring, center[2] + ring] {
                        self.search_row([i, j], k.max(0), k.min(self.n_cells[2] - 1), query, best);
                    }
                }
            }
        }
    }

    /// Cells `first..=last` of a row are neighbours in memory.
    #[inline]
    fn search_row(
        &self,
        [i, j]: [i32; 2],
        first: i32,
        last: i32,
        query: [f32; 3],
        best: &mut (f32, Option<u32>),
    ) {
        if first > last {
            return;
        }
        let start = self.starts[self.cell_idx([i, j, first])] as usize;
        let end = self.starts[self.cell_idx([i, j, last]) + 1] as usize;
        for slot in start..end {
            let distance = squared_distance(query, self.points[slot]);
            if distance < best.0 {
                *best = (distance, Some(self.point_idx[slot]));
            }
        }
    }

    /// Distance from the query to the outside of the cells within `ring`; negative when outside.
    fn distance_out_of(&self, query: [f32; 3], center: [i32; 3], ring: i32) -> f32 {
        let sides = (0..3).map(|axis| {
            let low = self.origin[axis] + (center[axis] - ring) as f32 * self.cell_size;
            let high = self.origin[axis] + (center[axis] + ring + 1) as f32 * self.cell_size;
            (query[axis] - low).min(high - query[axis])
        });
        sides.fold(f32::INFINITY, f32::min)
    }

    /// The cell that holds a point, or the border cell nearest to it.
    fn cell(&self, point: [f32; 3]) -> [i32; 3] {
        std::array::from_fn(|axis| {
            let cell = ((point[axis] - self.origin[axis]) / self.cell_size).floor() as i32;
            cell.clamp(0, self.n_cells[axis] - 1)
        })
    }

    fn cell_idx(&self, [i, j, k]: [i32; 3]) -> usize {
        ((i * self.n_cells[1] + j) * self.n_cells[2] + k) as usize
    }
}

/// The side of a cell such that the box holds [`CELLS_PER_POINT`] of them a point.
///
/// Flat and needle-like boxes are handled by leaving out the axes that are thinner than a cell.
/// `None` when the points coincide or are not finite.
fn cell_size(extent: [f32; 3], n_points: usize) -> Option<f32> {
    let n_cells = CELLS_PER_POINT * n_points as f32;
    let mut axes = extent;
    axes.sort_by(|a, b| b.total_cmp(a));
    let [longest, middle, shortest] = axes;
    let cube = (longest * middle * shortest / n_cells).cbrt();
    let square = (longest * middle / n_cells).sqrt();
    let size = if cube < shortest {
        cube
    } else if square < middle {
        square
    } else {
        longest / n_cells
    };
    (size.is_finite() && size > 0.0 && longest / size < 1e6).then_some(size)
}

fn bounds(points: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    let low = |axis: usize| points.iter().map(|p| p[axis]).fold(f32::INFINITY, f32::min);
    let high = |axis: usize| points.iter().map(|p| p[axis]).fold(f32::NEG_INFINITY, f32::max);
    let origin = [low(0), low(1), low(2)];
    (origin, [high(0) - origin[0], high(1) - origin[1], high(2) - origin[2]])
}

#[inline]
fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    /// Neighbours may differ where distances tie; distances may not.
    #[track_caller]
    fn check_exact(queries: &[[f32; 3]], points: &[[f32; 3]]) {
        let found = nearest_neighbours(queries, points);
        for (&query, &found) in queries.iter().zip(&found) {
            let nearest = points.iter().map(|&p| squared_distance(query, p));
            let nearest = nearest.fold(f32::INFINITY, f32::min);
            assert_eq!(squared_distance(query, points[found as usize]), nearest, "{query:?}");
        }
    }

    fn cloud(n_points: usize, seed: u64, scale: [f32; 3], offset: f32) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(seed, [0, 0]);
        let mut point = || scale.map(|scale| scale * rng.random_range(-0.5..0.5) + offset);
        (0..n_points).map(|_| point()).collect()
    }

    #[test]
    fn clouds_that_overlap_match_brute_force() {
        check_exact(&cloud(400, 1, [1.0; 3], 0.0), &cloud(700, 2, [1.0, 0.4, 0.3], 0.0));
    }

    #[test]
    fn clouds_that_are_apart_match_brute_force() {
        check_exact(&cloud(200, 1, [1.0; 3], 0.0), &cloud(500, 2, [1e-3; 3], 2.0));
        check_exact(&cloud(200, 1, [1e-3; 3], 5.0), &cloud(500, 2, [1.0; 3], 0.0));
    }

    #[test]
    fn flat_needle_and_collapsed_clouds_match_brute_force() {
        for scale in [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0; 3], [1.0, 1e-6, 1e-7]] {
            check_exact(&cloud(200, 1, [1.0; 3], 0.1), &cloud(500, 2, scale, 0.0));
        }
    }

    #[test]
    fn one_far_outlier_costs_no_exactness() {
        let mut points = cloud(2000, 3, [0.1; 3], 0.0);
        points.push([1e4, -1e4, 3.0]);
        check_exact(&cloud(200, 4, [0.2; 3], 0.0), &points);
    }

    #[test]
    fn pixels_match_brute_force() {
        let pixels: Vec<_> = cloud(600, 5, [128.0; 3], 64.0).iter().map(|p| [p[0], p[1]]).collect();
        let queries: Vec<_> = (0..40).map(|i| [i as f32 * 4.0 - 10.0, 130.0 - i as f32]).collect();
        let search = NearestNeighbours::in_plane(pixels.iter().copied());
        for query in &queries {
            let found = search.nearest_pixel(*query);
            let distance = |p: &[f32; 2]| (p[0] - query[0]).powi(2) + (p[1] - query[1]).powi(2);
            let nearest = pixels.iter().map(distance).fold(f32::INFINITY, f32::min);
            assert_eq!(distance(&pixels[found as usize]), nearest);
        }
    }
}
