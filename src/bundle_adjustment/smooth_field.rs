//! A Gaussian process on a surface: smooth movements along its normal.
//!
//! Two points move alike if they are near and face the same way: their covariance is
//! σ² n·n′ exp(−|x − x′|² / 2ℓ²), in which it does not matter which side of the surface is out. Points far
//! from each other stand for all (Nyström), and what they have in common with every point spreads their
//! principal components over the cloud.

use nalgebra::{DMatrix, DVector, Point3, Vector3};
use rayon::prelude::*;

use super::point_subset::farthest_points;
use crate::pseudo_render::surface::Surface;

/// Points that stand for all.
const N_NODES: usize = 256;
/// Smallest share of the largest variance that a component may have.
const LEAST_VARIANCE: f64 = 1e-6;
/// Rigid motions, which are for poses to do.
const N_RIGID: usize = 6;

/// A field over one cloud.
pub struct SmoothField {
    points: Vec<Patch>,
    seen: Vec<usize>,
    /// σ and ℓ, in world units.
    deviation: f32,
    length: f32,
}

struct Patch {
    at: Point3<f32>,
    normal: Vector3<f32>,
}

impl SmoothField {
    /// Over a cloud of which the points `seen` move, and others as they are correlated with those.
    pub fn new(points: &[[f32; 3]], seen: &[u32], deviation: f32, length: f32) -> Self {
        let cloud: Vec<Point3<f32>> = points.iter().map(|&point| Point3::from(point)).collect();
        let surface = Surface::of_cloud(&cloud);
        let patches = cloud.into_iter().zip(&surface.patches);
        Self {
            points: patches.map(|(at, patch)| Patch { at, normal: patch.normal }).collect(),
            seen: seen.iter().map(|&i| i as usize).collect(),
            deviation,
            length,
        }
    }

    /// At most `n_modes` orthonormal combinations of its leading components that neither move nor turn what
    /// is seen: the movement of every point `[3n]` for one standard deviation, in world units.
    pub fn modes(&self, n_modes: usize) -> Vec<Vec<f32>> {
        let components = self.components(n_modes + N_RIGID);
        let combinations = self.without_rigid_motion(&components);
        let amplitudes = components * combinations; // [n, modes]
        let movement = |column: usize| {
            let amplitudes = amplitudes.column(column);
            let moved = self.points.iter().zip(amplitudes.iter());
            moved.flat_map(|(patch, &by)| (patch.normal * by as f32).data.0[0]).collect()
        };
        (0..amplitudes.ncols()).map(movement).collect()
    }

    /// How far each point moves along its normal for one standard deviation of each of the leading
    /// principal components, `[n, at most n_components]`.
    fn components(&self, n_components: usize) -> DMatrix<f64> {
        let nodes = self.nodes();
        let among = DMatrix::from_fn(nodes.len(), nodes.len(), |i, j| {
            self.covariance(&self.points[nodes[i]], &self.points[nodes[j]])
        });
        let eigen = among.symmetric_eigen();
        let mut order: Vec<usize> = (0..nodes.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let largest = order.first().map_or(0.0, |&first| eigen.eigenvalues[first]);
        order.retain(|&i| eigen.eigenvalues[i] > LEAST_VARIANCE * largest);
        order.truncate(n_components);
        let weights = DMatrix::from_fn(nodes.len(), order.len(), |i, j| {
            eigen.eigenvectors[(i, order[j])] / eigen.eigenvalues[order[j]].sqrt()
        });
        let rows: Vec<DVector<f64>> = self
            .points
            .par_iter()
            .map(|point| {
                let with_nodes =
                    nodes.iter().map(|&node| self.covariance(point, &self.points[node]));
                weights.tr_mul(&DVector::from_iterator(nodes.len(), with_nodes))
            })
            .collect();
        DMatrix::from_fn(rows.len(), order.len(), |i, j| rows[i][j])
    }

    fn covariance(&self, a: &Patch, b: &Patch) -> f64 {
        let squared = (a.at - b.at).norm_squared() / (2.0 * self.length * self.length);
        f64::from(self.deviation * self.deviation * a.normal.dot(&b.normal) * (-squared).exp())
    }

    /// Points among those seen that lie far from each other.
    fn nodes(&self) -> Vec<usize> {
        let seen: Vec<[f32; 3]> = self.seen.iter().map(|&i| self.points[i].at.into()).collect();
        let chosen = farthest_points(&seen, N_NODES.min(seen.len()));
        chosen.into_iter().map(|i| self.seen[i as usize]).collect()
    }

    /// Combinations of components, a column each, whose movements of what is seen add up to no rigid one.
    fn without_rigid_motion(&self, components: &DMatrix<f64>) -> DMatrix<f64> {
        let n_components = components.ncols();
        let mut rigid = DMatrix::<f64>::zeros(N_RIGID, n_components);
        for &i in &self.seen {
            let Patch { at, normal } = &self.points[i];
            let turn = at.coords.cross(normal);
            for j in 0..n_components {
                for axis in 0..3 {
                    rigid[(axis, j)] += f64::from(normal[axis]) * components[(i, j)];
                    rigid[(3 + axis, j)] += f64::from(turn[axis]) * components[(i, j)];
                }
            }
        }
        // The null space: eigenvectors of RᵀR whose eigenvalues vanish.
        let eigen = rigid.tr_mul(&rigid).symmetric_eigen();
        let mut order: Vec<usize> = (0..n_components).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        order.truncate(n_components.saturating_sub(N_RIGID));
        DMatrix::from_fn(n_components, order.len(), |i, j| eigen.eigenvectors[(i, order[j])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{keyed_rng, procedural, surface::sample_surface};

    const DEVIATION: f32 = 0.01;
    const LENGTH: f32 = 0.12;

    fn car() -> Vec<[f32; 3]> {
        let points = sample_surface(&procedural::car(3), 4000, &mut keyed_rng(3, [0, 0]));
        points.iter().map(|point| point.coords.into()).collect()
    }

    fn point(values: &[f32], i: usize) -> Vector3<f32> {
        Vector3::from_row_slice(&values[3 * i..][..3])
    }

    /// On a plane with all components there are, the modes and the rigid motions make up the process.
    #[test]
    fn modes_are_smooth_and_as_strong_as_asked() {
        let car = car();
        let seen: Vec<u32> = (0..car.len() as u32).collect();
        let modes = SmoothField::new(&car, &seen, DEVIATION, LENGTH).modes(100);
        assert_eq!(modes.len(), 100);
        let variance =
            |i: usize| -> f32 { modes.iter().map(|mode| point(mode, i).norm_squared()).sum() };
        let mean = (0..car.len()).map(variance).sum::<f32>() / car.len() as f32;
        let share = mean / (DEVIATION * DEVIATION);
        assert!((0.6..1.02).contains(&share), "{share} of the variance");
    }

    #[test]
    fn modes_do_not_turn_or_move_what_is_seen() {
        let car = car();
        let seen: Vec<u32> = (0..car.len() as u32).filter(|&i| car[i as usize][0] > 0.0).collect();
        for mode in SmoothField::new(&car, &seen, DEVIATION, LENGTH).modes(20) {
            let (mut push, mut turn, mut all) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for &i in &seen {
                let (at, by) = (Vector3::from(car[i as usize]), point(&mode, i as usize));
                push += by;
                turn += at.cross(&by);
                all += by.norm();
            }
            assert!(push.norm() < 2e-3 * all && turn.norm() < 2e-3 * all, "{push} {turn} {all}");
        }
    }

    #[test]
    fn what_is_far_from_all_that_is_seen_stays() {
        let car = car();
        let front = |i: &u32| car[*i as usize][2] < -0.2;
        let seen: Vec<u32> = (0..car.len() as u32).filter(front).collect();
        let modes = SmoothField::new(&car, &seen, DEVIATION, LENGTH).modes(20);
        for i in (0..car.len()).filter(|&i| car[i][2] > 0.3) {
            let moved = modes.iter().map(|mode| point(mode, i).norm()).fold(0.0, f32::max);
            assert!(moved < 1e-3 * DEVIATION, "{:?} moves by {moved}", car[i]);
        }
    }
}
