//! The surface that a cloud samples: which way it faces, and how far apart its points lie.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Side of the voxels whose moments are taken, in spacings. A window of three by three by three then
/// holds about twenty points of a surface.
const VOXEL_SIZE: f32 = 1.6;
/// Area of a plane in a voxel of unit size, over all directions and places.
const AREA_PER_VOXEL: f32 = 2.0 / 3.0;
/// Voxels that there may be for each point: a few stray points must not cost all memory.
const MAX_VOXELS_PER_POINT: usize = 64;

/// A patch of surface around a point.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Unit length; inside and outside are not told apart. Zero where the points do not tell.
    pub normal: Vector3<f32>,
    /// Distance between neighbouring points, were they on a square grid, in world units.
    pub spacing: f32,
}

/// The surface around every point, and the mean spacing of points on it.
pub struct Surface {
    pub patches: Vec<Patch>,
    pub spacing: f32,
}

impl Surface {
    /// Fits a plane to the points around each point, or rather around its voxel.
    pub fn of_cloud(points: &[Point3<f32>]) -> Self {
        let Some(frame) = Voxels::around(points) else {
            let patch = Patch { normal: Vector3::zeros(), spacing: 0.0 };
            return Self { patches: vec![patch; points.len()], spacing: 0.0 };
        };
        let voxels: Vec<usize> = points.iter().map(|point| frame.voxel(point)).collect();
        let (slots, occupied) = slots(&voxels, frame.len());
        let mut moments = vec![Moments::default(); occupied.len() + 1];
        for (point, &voxel) in points.iter().zip(&voxels) {
            moments[slots[voxel] as usize].add_point((point - frame.origin) / frame.size);
        }
        let fitted: Vec<Patch> =
            occupied.par_iter().map(|&voxel| frame.patch(&moments, &slots, voxel)).collect();
        let patch = |&voxel: &usize| fitted[slots[voxel] as usize - 1];
        let spacing = frame.size / VOXEL_SIZE;
        Self { patches: voxels.iter().map(patch).collect(), spacing }
    }
}

/// Numbers the occupied of `n` voxels from one; zero is for those that are empty. Returns each voxel's
/// number, and the voxels in the order of theirs.
fn slots(voxels: &[usize], n: usize) -> (Vec<u32>, Vec<usize>) {
    let (mut slots, mut occupied) = (vec![0; n], Vec::new());
    for &voxel in voxels {
        if slots[voxel] == 0 {
            occupied.push(voxel);
            slots[voxel] = occupied.len() as u32;
        }
    }
    (slots, occupied)
}

/// A grid of voxels with a margin of one all round, so that every window is whole.
struct Voxels {
    origin: Point3<f32>,
    size: f32,
    counts: [usize; 3],
}

impl Voxels {
    /// `None` when the points are not finite, or all in one place.
    fn around(points: &[Point3<f32>]) -> Option<Self> {
        let first = *points.first()?;
        let low = points.iter().fold(first, |low, point| low.inf(point));
        let high = points.iter().fold(first, |high, point| high.sup(point));
        let finite = points.iter().all(|point| point.iter().all(|x| x.is_finite()));
        let diagonal = (high - low).norm();
        if !finite || !diagonal.is_finite() || diagonal <= 0.0 {
            return None;
        }
        // Voxels that hold several points each tell the area, and with it the spacing.
        let n_points = points.len() as f32;
        let coarse = Self::of_size(4.0 * diagonal / n_points.sqrt(), low, high, points.len());
        let voxels: Vec<usize> = points.iter().map(|point| coarse.voxel(point)).collect();
        let (_, occupied) = slots(&voxels, coarse.len());
        let area = AREA_PER_VOXEL * occupied.len() as f32 * coarse.size * coarse.size;
        let size = VOXEL_SIZE * (area / n_points).sqrt();
        Some(Self::of_size(size, low, high, points.len()))
    }

    fn of_size(mut size: f32, low: Point3<f32>, high: Point3<f32>, n_points: usize) -> Self {
        let counts = |size: f32| [0, 1, 2].map(|axis| ((high - low)[axis] / size) as usize + 3);
        let product =
            |counts: [usize; 3]| counts.iter().fold(1, |a: usize, &b| a.saturating_mul(b));
        while product(counts(size)) > MAX_VOXELS_PER_POINT * n_points.max(27) {
            size *= 1.25;
        }
        Self { origin: low, size, counts: counts(size) }
    }

    fn len(&self) -> usize {
        self.counts.iter().product()
    }

    fn voxel(&self, point: &Point3<f32>) -> usize {
        let [i, j, k] = [0, 1, 2].map(|axis| {
            let voxel = ((point[axis] - self.origin[axis]) / self.size) as usize + 1;
            voxel.min(self.counts[axis] - 2)
        });
        (i * self.counts[1] + j) * self.counts[2] + k
    }

    /// The plane through the points of the window around a voxel.
    fn patch(&self, moments: &[Moments], slots: &[u32], voxel: usize) -> Patch {
        let [_, rows, columns] = self.counts;
        let mut window = Moments::default();
        for i in 0..3 {
            for j in 0..3 {
                let first = voxel + (i * rows + j) * columns - (rows + 1) * columns - 1;
                let slots = slots[first..first + 3].iter().filter(|&&slot| slot > 0);
                slots.for_each(|&slot| window.add(&moments[slot as usize]));
            }
        }
        let eigen = window.covariance().symmetric_eigen();
        // The plane cuts about nine voxels' faces out of the window.
        let spacing = self.size * (9.0 / window.count).sqrt().min(2.0);
        Patch { normal: eigen.eigenvectors.column(eigen.eigenvalues.imin()).into(), spacing }
    }
}

/// Sums over points of 1, x and x xᵀ, in voxels.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: f32,
    sum: Vector3<f32>,
    squares: Matrix3<f32>,
}

impl Moments {
    fn add_point(&mut self, point: Vector3<f32>) {
        self.add(&Self { count: 1.0, sum: point, squares: point * point.transpose() });
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    fn covariance(&self) -> Matrix3<f32> {
        let mean = self.sum / self.count;
        self.squares / self.count - mean * mean.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;
    use std::f32::consts::PI;

    fn on_sphere(n_points: usize, radius: f32) -> Vec<Point3<f32>> {
        let mut rng = keyed_rng(1, [0, 0]);
        let mut point = || {
            let (z, turn) = (rng.random_range(-1.0..1.0f32), rng.random_range(-PI..PI));
            let around = (1.0 - z * z).sqrt();
            Point3::new(around * turn.cos(), around * turn.sin(), z) * radius
        };
        (0..n_points).map(|_| point()).collect()
    }

    #[test]
    fn normals_of_a_sphere_point_from_its_centre() {
        for (n_points, least) in [(6144, 0.97), (1000, 0.9)] {
            let points = on_sphere(n_points, 0.4);
            let surface = Surface::of_cloud(&points);
            let spacing = (4.0 * PI * 0.16 / n_points as f32).sqrt();
            assert!((surface.spacing / spacing - 1.0).abs() < 0.15, "{}", surface.spacing);
            let cosines = points.iter().zip(&surface.patches);
            let cosines = cosines.map(|(p, patch)| p.coords.normalize().dot(&patch.normal).abs());
            let mean = cosines.sum::<f32>() / n_points as f32;
            assert!(mean > least, "the mean cosine is {mean}");
        }
    }

    #[test]
    fn clouds_that_are_no_surface_do_no_harm() {
        let one = Point3::new(0.1, 0.2, 0.3);
        let line: Vec<_> = (0..50).map(|i| Point3::new(i as f32, 0.0, 0.0)).collect();
        let mut stray = on_sphere(500, 0.4);
        stray.push(Point3::new(1e6, -1e6, 1e6));
        let nan = vec![one, Point3::new(f32::NAN, 0.0, 0.0)];
        for points in [vec![], vec![one], vec![one; 9], line, stray, nan] {
            let surface = Surface::of_cloud(&points);
            assert_eq!(surface.patches.len(), points.len());
            let finite = |patch: &Patch| patch.normal.iter().all(|x| x.is_finite());
            assert!(surface.patches.iter().all(finite) && surface.spacing.is_finite());
        }
    }
}
