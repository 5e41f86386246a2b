//! Points as small discs, tangent to the surface that they lie on.
//!
//! On a plane n·X = d, inverse depth is affine in the pixel: 1/z = n·K⁻¹u / d. So a disc is an
//! ellipse on the image plane with an inverse depth and a slope, and compares exactly with its
//! neighbours on the same surface, however steep that is.

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    PseudoRenderConfig,
    surface::{Patch, Surface},
};
use crate::camera::{Intrinsics, NEAR};

/// Cells that a disc reaches at most to each side: a bound, for views from within the cloud.
const MAX_REACH: f32 = 24.0;
/// Cells that are compared with a disc side by side.
const LANES: usize = 4;

/// For each view, the points that no disc hides. One cloud, in the world frame.
pub(super) fn visible_points(
    points: &[[f32; 3]],
    camera_from_world: &[Isometry3<f32>],
    intrinsics: &Intrinsics,
    size: [usize; 2],
    config: &PseudoRenderConfig,
) -> Vec<Vec<u32>> {
    let points: Vec<Point3<f32>> = points.iter().map(|&point| point.into()).collect();
    let surface = Surface::of_cloud(&points);
    camera_from_world
        .par_iter()
        .map(|pose| {
            let view = View::new(pose, intrinsics, size, &surface, &points, config);
            view.visible_points(&points, &surface, config)
        })
        .collect()
}

/// A view and the plane of its cells.
struct View {
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
    focal: Vector2<f32>,
    center: Vector2<f32>,
    size: [f32; 2],
    /// Side of a cell, in pixels.
    cell: f32,
    columns: usize,
    rows: usize,
}

/// A disc in an image, around its point's pixel.
struct Disc {
    pixel: Vector2<f32>,
    /// 1/z at the pixel, and how it changes along u and v.
    inverse_depth: f32,
    slope: Vector2<f32>,
    /// m of the ellipse m_0 δu² + 2 m_1 δu δv + m_2 δv² ≤ 1, and how far it reaches along u and v.
    ellipse: [f32; 3],
    reach: Vector2<f32>,
}

impl View {
    fn new(
        camera_from_world: &Isometry3<f32>,
        intrinsics: &Intrinsics,
        size: [usize; 2],
        surface: &Surface,
        points: &[Point3<f32>],
        config: &PseudoRenderConfig,
    ) -> Self {
        /// No finer than this, so that the plane's memory is bounded by the image.
        const FINEST_CELL: f32 = 0.2;
        let center = points.iter().map(|point| point.coords).sum::<Vector3<f32>>()
            / points.len().max(1) as f32;
        let depth = (camera_from_world * Point3::from(center)).z.max(NEAR);
        let spacing = surface.spacing * intrinsics.focal[0].max(intrinsics.focal[1]) / depth;
        let size = size.map(|side| side as f32);
        let coarsest = size[0].max(size[1]).max(1.0);
        // Of NaN and of clouds of no extent, `max` keeps the other.
        let cell = (config.disc_cell * spacing).max(FINEST_CELL).min(coarsest);
        let [columns, rows] = size.map(|side| (side / cell).ceil() as usize);
        let rotation = camera_from_world.rotation.to_rotation_matrix().into_inner();
        let translation = camera_from_world.translation.vector;
        let [focal, center] = [intrinsics.focal, intrinsics.center].map(Vector2::from);
        Self { rotation, translation, focal, center, size, cell, columns, rows }
    }

    fn visible_points(
        &self,
        points: &[Point3<f32>],
        surface: &Surface,
        config: &PseudoRenderConfig,
    ) -> Vec<u32> {
        let mut plane = vec![0.0f32; self.stride() * self.rows];
        // For each point, its cell and the inverse depth of its disc there.
        let mut found = vec![(0, 0.0f32); points.len()];
        for ((point, patch), found) in points.iter().zip(&surface.patches).zip(&mut found) {
            if let Some(disc) = self.disc(point, patch, config.disc_radius) {
                *found = self.splat(&disc, &mut plane);
            }
        }
        let tolerance = config.disc_tolerance * surface.spacing;
        // 1/z ≥ 1/(z_nearest + tolerance), exact for the nearest disc itself.
        let seen = |&(cell, inverse_depth): &(usize, f32)| {
            inverse_depth > 0.0 && inverse_depth * (1.0 + tolerance * plane[cell]) >= plane[cell]
        };
        (0..points.len() as u32).filter(|&i| seen(&found[i as usize])).collect()
    }

    /// `None` out of the frame or behind the camera.
    fn disc(&self, point: &Point3<f32>, patch: &Patch, radius: f32) -> Option<Disc> {
        let at = self.rotation * point.coords + self.translation;
        let inverse_depth = at.z.recip();
        let pixel = at.xy().component_mul(&self.focal) * inverse_depth + self.center;
        let inside = |axis: usize| pixel[axis] >= 0.0 && pixel[axis] < self.size[axis];
        if !(at.z > NEAR && inside(0) && inside(1)) {
            return None;
        }
        let normal = self.rotation * patch.normal;
        let slope = normal.xy().component_div(&self.focal) / normal.dot(&at);
        // ∂X/∂u and ∂X/∂v along the plane.
        let along_u = Vector3::new(at.z / self.focal.x, 0.0, 0.0) - at * (at.z * slope.x);
        let along_v = Vector3::new(0.0, at.z / self.focal.y, 0.0) - at * (at.z * slope.y);
        let scale = (radius * patch.spacing).powi(-2);
        let [uu, uv, vv] = [along_u.norm_squared(), along_u.dot(&along_v), along_v.norm_squared()];
        // Of a Gram matrix, without the cancellation that a disc seen edge-on would suffer from.
        let determinant = scale * along_u.cross(&along_v).norm_squared();
        let reach = Vector2::new((vv / determinant).sqrt(), (uu / determinant).sqrt());
        Some(match (reach.sum() + slope.sum()).is_finite() {
            true => Disc {
                pixel,
                inverse_depth,
                slope,
                ellipse: [scale * uu, scale * uv, scale * vv],
                reach: reach.inf(&Vector2::repeat(MAX_REACH * self.cell)),
            },
            // Seen edge-on, or of no extent: only the point itself is left.
            false => Disc {
                pixel,
                inverse_depth,
                slope: Vector2::zeros(),
                ellipse: [0.0; 3],
                reach: Vector2::zeros(),
            },
        })
    }

    /// Leaves the disc on the plane; returns the cell of its point, and its inverse depth there.
    fn splat(&self, disc: &Disc, plane: &mut [f32]) -> (usize, f32) {
        let Disc { pixel, inverse_depth, slope, ellipse: [uu, uv, vv], reach } = *disc;
        let offset = |axis: usize, cell: usize| (cell as f32 + 0.5) * self.cell - pixel[axis];
        // Cells whose centres lie within reach.
        let low = (pixel - reach) / self.cell;
        let high = (pixel + reach) / self.cell;
        let first_cell = |axis: usize| (low[axis] + 0.5).max(0.0) as usize;
        let end_cell = |axis: usize| (high[axis] + 0.5) as usize;
        let (first, end) = (first_cell(0), end_cell(0).min(self.columns));
        for row in first_cell(1)..end_cell(1).min(self.rows) {
            let dv = offset(1, row);
            let (start, middle) = (inverse_depth + slope.y * dv, 2.0 * uv * dv);
            let room = 1.0 - vv * dv * dv;
            // Several columns side by side, of which those beyond the ellipse keep what they have.
            let start_cell = row * self.stride() + first;
            let n_chunks = end.saturating_sub(first).div_ceil(LANES);
            let cells = plane[start_cell..][..n_chunks * LANES].as_chunks_mut::<LANES>().0;
            for (chunk, kept) in cells.iter_mut().enumerate() {
                let du = offset(0, first + chunk * LANES);
                for (lane, kept) in kept.iter_mut().enumerate() {
                    let du = du + lane as f32 * self.cell;
                    let value = start + slope.x * du;
                    let covered = (uu * du + middle) * du <= room;
                    let value = if covered { value } else { 0.0 };
                    *kept = if value > *kept { value } else { *kept };
                }
            }
        }
        // Its own cell's centre may lie beyond the disc, which then counts at its nearest edge.
        let cell = |axis: usize, count: usize| ((pixel[axis] / self.cell) as usize).min(count - 1);
        let own = [cell(0, self.columns), cell(1, self.rows)];
        let [du, dv] = [offset(0, own[0]), offset(1, own[1])];
        let beyond = (uu * du * du + 2.0 * uv * du * dv + vv * dv * dv).max(1.0).sqrt();
        let value = inverse_depth + (slope.x * du + slope.y * dv) / beyond;
        let cell = own[1] * self.stride() + own[0];
        plane[cell] = plane[cell].max(value);
        (cell, value)
    }

    /// Cells of the plane from one row to the next: room for the lanes beyond the last column.
    fn stride(&self) -> usize {
        self.columns + LANES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    const SIZE: [usize; 2] = [48, 32];
    const CAMERA: Intrinsics = Intrinsics { focal: [40.0, 42.0], center: [24.0, 16.0] };

    fn in_front(points: &[[f32; 3]], config: &PseudoRenderConfig) -> Vec<u32> {
        let pose = Isometry3::translation(0.0, 0.0, 2.0);
        visible_points(points, &[pose], &CAMERA, SIZE, config).remove(0)
    }

    fn random(n_points: usize, seed: u64, scale: [f32; 3]) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(seed, [0, 0]);
        (0..n_points).map(|_| scale.map(|scale| scale * rng.random_range(-1.0..1.0f32))).collect()
    }

    /// The definition, pair by pair in f64: seen unless, where the ray through the centre of the
    /// point's cell meets another's disc, that lies further in front than the tolerance. In its own
    /// cell, a disc that the ray misses counts at its nearest edge.
    fn by_brute_force(
        points: &[[f32; 3]],
        pose: &Isometry3<f32>,
        config: &PseudoRenderConfig,
    ) -> Vec<u32> {
        let points: Vec<Point3<f32>> = points.iter().map(|&point| point.into()).collect();
        let surface = Surface::of_cloud(&points);
        let cell = f64::from(View::new(pose, &CAMERA, SIZE, &surface, &points, config).cell);
        let ray = |[u, v]: [f64; 2]| {
            let [[fx, fy], [cx, cy]] =
                [CAMERA.focal, CAMERA.center].map(|pair| pair.map(f64::from));
            Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0)
        };
        let project = |at: &Vector3<f64>| {
            [0, 1].map(|i| at[i] / at.z * f64::from(CAMERA.focal[i]) + f64::from(CAMERA.center[i]))
        };
        let placed: Vec<_> = points
            .iter()
            .zip(&surface.patches)
            .map(|(point, patch)| {
                let at: Vector3<f64> = (pose * point).coords.cast();
                (at, (pose.rotation * patch.normal).cast::<f64>(), f64::from(patch.spacing))
            })
            .collect();
        let in_frame = |at: &Vector3<f64>| {
            let [u, v] = project(at);
            at.z > f64::from(NEAR)
                && (0.0..SIZE[0] as f64).contains(&u)
                && (0.0..SIZE[1] as f64).contains(&v)
        };
        type Placed = (Vector3<f64>, Vector3<f64>, f64);
        let meet = |(at, normal, _): &Placed, pixel: [f64; 2]| {
            ray(pixel) * (normal.dot(at) / normal.dot(&ray(pixel)))
        };
        // How far along its plane a pixel is from a disc's point, in radii of the disc.
        let radii = |disc: &Placed, there: [f64; 2]| {
            let ([u, v], step) = (project(&disc.0), 1e-4);
            let along_u = meet(disc, [u + step, v]) - meet(disc, [u - step, v]);
            let along_v = meet(disc, [u, v + step]) - meet(disc, [u, v - step]);
            let moved = (along_u * (there[0] - u) + along_v * (there[1] - v)) / (2.0 * step);
            moved.norm() / (f64::from(config.disc_radius) * disc.2)
        };
        let covers = |disc: &Placed, there: [f64; 2]| {
            (radii(disc, there) <= 1.0).then(|| meet(disc, there).z.recip())
        };
        let own_inverse_depth = |disc: &Placed, center: [f64; 2]| {
            let (pixel, share) = (project(&disc.0), radii(disc, center).max(1.0).recip());
            let edge = [0, 1].map(|i| pixel[i] + share * (center[i] - pixel[i]));
            meet(disc, edge).z.recip()
        };
        let tolerance = f64::from(config.disc_tolerance * surface.spacing);
        let cell_center =
            |disc: &Placed| project(&disc.0).map(|x| ((x / cell).floor() + 0.5) * cell);
        let seen = |&i: &usize| {
            let center = cell_center(&placed[i]);
            let own = own_inverse_depth(&placed[i], center);
            let hides = |other: &Placed| {
                let shared = cell_center(other) == center;
                let there = shared.then(|| own_inverse_depth(other, center));
                let there = there.or_else(|| covers(other, center));
                in_frame(&other.0) && there.is_some_and(|w| 1.0 / w + tolerance < 1.0 / own)
            };
            in_frame(&placed[i].0) && !placed.iter().any(hides)
        };
        (0..points.len()).filter(seen).map(|i| i as u32).collect()
    }

    #[test]
    fn the_visible_set_matches_a_brute_force_z_buffer() {
        for (seed, disc_radius, disc_tolerance) in [(1, 1.0, 0.1), (2, 1.5, 0.5), (3, 0.4, 0.1)] {
            let config = PseudoRenderConfig { disc_radius, disc_tolerance, ..Default::default() };
            // Some lie out of the frame and behind the camera.
            let points = random(500, seed, [1.6, 1.2, 2.4]);
            let pose = Isometry3::new(Vector3::new(0.1, 0.0, 2.0), Vector3::new(0.3, -0.5, 0.2));
            let found = visible_points(&points, &[pose], &CAMERA, SIZE, &config).remove(0);
            assert!(found.len() > 3, "{}", found.len());
            assert_eq!(found, by_brute_force(&points, &pose, &config));
        }
    }

    #[test]
    fn a_plane_hides_none_of_its_points_however_it_is_tilted() {
        let flat = random(2000, 4, [0.4, 0.4, 0.0]);
        for (degrees, least) in [(0.0f32, 1980), (40.0, 1980), (75.0, 1980), (84.0, 1800)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let tilted: Vec<_> = flat.iter().map(|[x, y, _]| [x * cos, *y, x * sin]).collect();
            let n_seen = in_front(&tilted, &PseudoRenderConfig::default()).len();
            assert!(n_seen >= least, "{n_seen} of 2000 at {degrees} degrees");
        }
    }

    #[test]
    fn a_sphere_hides_its_far_side() {
        let mut points = random(40_000, 5, [1.0; 3]);
        points.retain(|p| (0.01..1.0).contains(&Vector3::from(*p).norm()));
        let points: Vec<[f32; 3]> =
            points.iter().map(|p| (Vector3::from(*p).normalize() * 0.5).into()).collect();
        // The tangent cone from (0, 0, −2) touches at z = −r²/2.
        let is_near = |i: usize| points[i][2] <= -0.125;
        let found = in_front(&points, &PseudoRenderConfig::default());
        let n_right = found.iter().filter(|&&i| is_near(i as usize)).count();
        let n_near = (0..points.len()).filter(|&i| is_near(i)).count();
        assert!(n_right as f32 > 0.97 * found.len() as f32, "{n_right} of {}", found.len());
        // Discs before the limb jut out over it.
        assert!(n_right as f32 > 0.9 * n_near as f32, "{n_right} of {n_near}");
    }

    #[test]
    fn points_at_equal_depth_are_equally_visible() {
        let config = PseudoRenderConfig { disc_tolerance: 0.0, ..Default::default() };
        assert_eq!(in_front(&[[0.0; 3], [0.0; 3], [0.0, 0.0, 0.1]], &config), [0, 1]);
    }

    #[test]
    fn nothing_is_visible_behind_the_camera_or_out_of_the_frame() {
        let points = [[0.0, 0.0, -4.0], [9.0, 0.0, 0.0], [0.0, f32::NAN, 1.0]];
        assert!(in_front(&points, &PseudoRenderConfig::default()).is_empty());
    }
}
