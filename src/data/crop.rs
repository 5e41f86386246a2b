//! The square crop that the regressors see, as a camera of its own.
//!
//! Cutting a square out of a picture shifts its principal point: the same object then looks turned,
//! depending on where in the picture it was. Turning the camera towards the object instead is exact,
//! a homography K′ R K⁻¹, and gives every crop the same kind of camera: its axis meets the centre.

use image::{Luma, Rgb};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::Rng;

use super::{ColorImage, ScalarImage, bilinear::bilinear, viewpoint::project};
use crate::camera::Intrinsics;

/// A virtual camera in the place of another one, turned towards a box in its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CropCamera {
    pub crop_from_camera: UnitQuaternion<f32>,
    /// Of the crop: one focal length, and the principal point in the middle.
    pub intrinsics: Intrinsics,
    /// Side of the crop, in pixels.
    pub size: usize,
    /// Of the camera that took the picture.
    source: Intrinsics,
}

impl CropCamera {
    /// Looks at the middle of the box `[left, top, right, bottom]`, in pixels, and holds all of it.
    ///
    /// `margin` is what to leave around it on each side, as a share of the crop's side: 0.1 leaves
    /// the box 0.8 of it.
    pub fn around(box_in_pixels: [f32; 4], source: &Intrinsics, size: usize, margin: f32) -> Self {
        let [left, top, right, bottom] = box_in_pixels;
        let axis = ray(source, [(left + right) / 2.0, (top + bottom) / 2.0]);
        let corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
        Self::along(axis, &corners.map(|corner| ray(source, corner)), source, size, margin)
    }

    /// Looks at the middle of a silhouette and holds all of it; `None` if the mask is empty.
    ///
    /// The box that is centred and fitted is the one that the crop's own camera sees, so that the crop
    /// is the same wherever in a picture the object lies: off the axis, pictures stretch.
    pub fn around_silhouette(
        mask: &ScalarImage,
        threshold: f32,
        source: &Intrinsics,
        size: usize,
        margin: f32,
    ) -> Option<Self> {
        /// Each brings the middle some ten times nearer.
        const CORRECTIONS: usize = 4;
        let mut crop = Self::around(silhouette_box(mask, threshold)?, source, size, margin);
        let rays: Vec<Vector3<f32>> =
            outline(mask, threshold).into_iter().map(|pixel| ray(source, pixel)).collect();
        for _ in 0..CORRECTIONS {
            let seen = rays.iter().map(|ray| crop.crop_from_camera * ray);
            let slopes = seen.map(|ray| [ray.x / ray.z, ray.y / ray.z]);
            let [left, top, right, bottom] = bounds(slopes.map(|[x, y]| [x, y, x, y]))?;
            let middle = Vector3::new((left + right) / 2.0, (top + bottom) / 2.0, 1.0);
            let axis = crop.crop_from_camera.inverse() * middle;
            crop = Self::along(axis, &rays, source, size, margin);
        }
        Some(crop)
    }

    /// Looks along `axis` and holds all rays, both in the source's frame.
    fn along(
        axis: Vector3<f32>,
        rays: &[Vector3<f32>],
        source: &Intrinsics,
        size: usize,
        margin: f32,
    ) -> Self {
        // No rotation between opposite directions is unique; no ray with z > 0 opposes the axis.
        let crop_from_camera =
            UnitQuaternion::rotation_between(&axis, &Vector3::z()).unwrap_or_default();
        let reach = rays
            .iter()
            .map(|ray| crop_from_camera * ray)
            .map(|ray| (ray.x / ray.z).abs().max((ray.y / ray.z).abs()))
            .fold(f32::MIN_POSITIVE, f32::max);
        let half = size as f32 / 2.0;
        let focal = half * (1.0 - 2.0 * margin) / reach;
        let intrinsics = Intrinsics { focal: [focal; 2], center: [half; 2] };
        Self { crop_from_camera, intrinsics, size, source: *source }
    }

    /// The crop's own pose: both cameras stand in one place.
    pub fn crop_from_world(&self, camera_from_world: &Isometry3<f32>) -> Isometry3<f32> {
        self.crop_from_camera * camera_from_world
    }

    /// Back from the crop's pose to that of the camera that took the picture.
    pub fn camera_from_world(&self, crop_from_world: &Isometry3<f32>) -> Isometry3<f32> {
        self.crop_from_camera.inverse() * crop_from_world
    }

    /// The picture and its mask as the crop's camera would have taken them. Where the picture ends,
    /// the mask is empty and the last colours go on.
    ///
    /// Each pixel is the mean of bilinear lookups about a source pixel apart, at least 2 × 2.
    pub fn warp(&self, color: &ColorImage, mask: &ScalarImage) -> (ColorImage, ScalarImage) {
        let side = self.size as u32;
        let mut warped = (ColorImage::new(side, side), ScalarImage::new(side, side));
        let n = self.samples_per_side();
        let share = 1.0 / (n * n) as f32;
        for y in 0..side {
            for x in 0..side {
                let (mut sum, mut coverage) = (Vector3::zeros(), 0.0);
                for sample in 0..n * n {
                    let [right, down] =
                        [sample % n, sample / n].map(|k| (k as f32 + 0.5) / n as f32);
                    let pixel = self.source_pixel([x as f32 + right, y as f32 + down]);
                    sum += share * Vector3::from(bilinear(color, pixel));
                    if in_picture(mask, pixel) {
                        let [covered] = bilinear(mask, pixel);
                        coverage += share * covered;
                    }
                }
                warped.0.put_pixel(x, y, Rgb(sum.into()));
                warped.1.put_pixel(x, y, Luma([coverage]));
            }
        }
        warped
    }

    /// K R⁻¹ K′⁻¹: where in the picture a crop's pixel looks.
    pub fn source_pixel(&self, crop_pixel: [f32; 2]) -> [f32; 2] {
        let ray = self.crop_from_camera.inverse() * ray(&self.intrinsics, crop_pixel);
        project(&Point3::from(ray), &self.source)
    }

    fn samples_per_side(&self) -> usize {
        let minification =
            self.source.focal[0].max(self.source.focal[1]) / self.intrinsics.focal[0];
        // The bound only matters to nonsensical input, such as a box of no size.
        minification.ceil().clamp(2.0, 64.0) as usize
    }
}

/// Moves each side of a box at random by up to `fraction` of its extent.
pub fn jitter([left, top, right, bottom]: [f32; 4], fraction: f32, rng: &mut impl Rng) -> [f32; 4] {
    let mut moved = |side: f32, extent: f32| side + fraction * extent * rng.random_range(-1.0..1.0);
    let [width, height] = [right - left, bottom - top];
    [moved(left, width), moved(top, height), moved(right, width), moved(bottom, height)]
}

/// The box `[left, top, right, bottom]`, in pixels, around all mask values above `threshold`.
pub fn silhouette_box(mask: &ScalarImage, threshold: f32) -> Option<[f32; 4]> {
    let covered = mask.enumerate_pixels().filter(|(_, _, value)| value.0[0] > threshold);
    bounds(covered.map(|(x, y, _)| [x as f32, y as f32, x as f32 + 1.0, y as f32 + 1.0]))
}

/// The corners of the first and the last covered pixel of each row: all that bounds need.
fn outline(mask: &ScalarImage, threshold: f32) -> Vec<[f32; 2]> {
    let ends = |(y, row): (u32, image::buffer::Pixels<Luma<f32>>)| {
        let covered = |value: &Luma<f32>| value.0[0] > threshold;
        let values: Vec<bool> = row.map(covered).collect();
        let first = values.iter().position(|covered| *covered)?;
        let last = values.iter().rposition(|covered| *covered)?;
        Some([y, y + 1].map(|y| [[first as f32, y as f32], [last as f32 + 1.0, y as f32]]))
    };
    (0..).zip(mask.rows()).filter_map(ends).flatten().flatten().collect()
}

/// The box `[left, top, right, bottom]` around boxes.
fn bounds(boxes: impl Iterator<Item = [f32; 4]>) -> Option<[f32; 4]> {
    boxes.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
}

/// The direction through a pixel, with z = 1.
fn ray(Intrinsics { focal, center }: &Intrinsics, pixel: [f32; 2]) -> Vector3<f32> {
    Vector3::new((pixel[0] - center[0]) / focal[0], (pixel[1] - center[1]) / focal[1], 1.0)
}

pub(super) fn in_picture(picture: &ScalarImage, [x, y]: [f32; 2]) -> bool {
    (0.0..picture.width() as f32).contains(&x) && (0.0..picture.height() as f32).contains(&y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{
        keyed_rng,
        lighting::Scene,
        mesh::{Mesh, Triangle},
        rasteriser::render,
        viewpoint::projected_box,
    };
    use nalgebra::Translation3;
    use std::f32::consts::{PI, TAU};

    const SOURCE: Intrinsics = Intrinsics { focal: [520.0, 540.0], center: [310.0, 215.0] };
    const SIZE: [usize; 2] = [600, 450];

    /// A lumpy, colourful ball of diameter about 0.8.
    fn ball() -> Mesh {
        const N: u32 = 24;
        let vertex = |i: u32, j: u32| {
            let [a, b] = [i as f32 / N as f32 * TAU, j as f32 / N as f32 * PI];
            let radius = 0.35 + 0.05 * (3.0 * a).sin() * b.sin();
            Point3::new(a.cos() * b.sin(), b.cos(), a.sin() * b.sin()) * radius
        };
        let index = |i: u32, j: u32| i % N * (N + 1) + j;
        let face = |vertices, [i, j]: [u32; 2]| {
            let color = [0.3 + 0.02 * i as f32, 0.4 + 0.02 * j as f32, 0.5];
            Triangle { vertices, uvs: [[0.0; 2]; 3], color, texture: None }
        };
        let grid = || (0..N).flat_map(|i| (0..N).map(move |j| [i, j]));
        Mesh {
            vertices: (0..N).flat_map(|i| (0..=N).map(move |j| vertex(i, j))).collect(),
            triangles: grid()
                .flat_map(|[i, j]| {
                    let [a, b, c, d] =
                        [index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1)];
                    [face([a, b, c], [i, j]), face([c, b, d], [i, j])]
                })
                .collect(),
            textures: vec![],
        }
    }

    /// Seen well off the axis.
    fn pose() -> Isometry3<f32> {
        let rotation = UnitQuaternion::from_euler_angles(0.4, -0.9, 0.2);
        Isometry3::from_parts(Translation3::new(0.3, 0.15, 1.6), rotation)
    }

    #[test]
    fn warping_a_picture_equals_rendering_through_the_crop() {
        let mesh = ball();
        let scene = Scene::random(&mut keyed_rng(1, [0, 0]), None);
        let bounds = projected_box(&mesh.vertices, &pose(), &SOURCE).expect("it is in view");
        for size in [32, 64, 256] {
            let crop = CropCamera::around(bounds, &SOURCE, size, 0.1);
            let picture = render(&mesh, &scene, &pose(), &SOURCE, SIZE);
            let (color, mask) = crop.warp(&picture.color, &picture.coverage);
            let crop_pose = crop.crop_from_world(&pose());
            let direct = render(&mesh, &scene, &crop_pose, &crop.intrinsics, [size; 2]);

            let [mut both, mut either, mut difference] = [0.0; 3];
            for (x, y, warped) in mask.enumerate_pixels() {
                let rendered = direct.coverage.get_pixel(x, y).0[0];
                both += rendered.min(warped.0[0]);
                either += rendered.max(warped.0[0]);
                let [a, b] = [color.get_pixel(x, y).0, direct.color.get_pixel(x, y).0];
                difference += (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f32>() / 3.0;
            }
            let mean = difference / (size * size) as f32;
            assert!(both / either > 0.97, "at {size}: IoU {}", both / either);
            assert!(mean < 0.01, "at {size}: mean difference {mean}");
        }
    }

    #[test]
    fn the_box_fits_and_its_middle_meets_the_crop_s_centre() {
        let bounds = [400.0, 20.0, 590.0, 140.0];
        let crop = CropCamera::around(bounds, &SOURCE, 64, 0.1);
        let [x, y] = crop.source_pixel([32.0, 32.0]);
        assert!((x - 495.0).abs() < 1e-2 && (y - 80.0).abs() < 1e-2, "{x}, {y}");

        let corner = crop.crop_from_camera * ray(&SOURCE, [400.0, 20.0]);
        let [x, y] = project(&Point3::from(corner), &crop.intrinsics);
        let inside = 6.3..57.7;
        assert!(inside.contains(&x) && inside.contains(&y), "{x}, {y}");
    }

    #[test]
    fn a_silhouette_s_crop_is_the_same_wherever_it_lies() {
        let mesh = ball();
        let scene = Scene::random(&mut keyed_rng(1, [0, 0]), None);
        // The camera in its place turns the object from the middle of its picture into a corner.
        let centred = Isometry3::translation(0.0, 0.0, 1.6) * pose().rotation;
        let aside = Vector3::new(-0.25, 0.12, 1.0);
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &aside).expect("not opposite");
        let crops = [UnitQuaternion::identity(), turn].map(|turn| {
            let picture = render(&mesh, &scene, &(turn * centred), &SOURCE, SIZE);
            let crop = CropCamera::around_silhouette(&picture.coverage, 0.5, &SOURCE, 64, 0.1);
            let crop = crop.expect("it is in view");
            (crop.crop_from_camera * turn, crop.intrinsics.focal[0])
        });
        let [(first, focal), (second, other)] = crops;
        assert!(first.angle_to(&second).to_degrees() < 0.3, "{}", first.angle_to(&second));
        assert!((focal / other - 1.0).abs() < 0.02, "{focal} and {other}");
    }

    #[test]
    fn poses_go_to_the_crop_and_back() {
        let crop = CropCamera::around([30.0, 300.0, 200.0, 440.0], &SOURCE, 64, 0.1);
        let back = crop.camera_from_world(&crop.crop_from_world(&pose()));
        assert!((back.to_homogeneous() - pose().to_homogeneous()).norm() < 1e-5);
    }

    #[test]
    fn silhouette_boxes_are_tight_and_empty_masks_have_none() {
        let mut mask = ScalarImage::new(20, 10);
        assert_eq!(silhouette_box(&mask, 0.5), None);
        mask.put_pixel(3, 7, Luma([1.0]));
        mask.put_pixel(11, 2, Luma([0.6]));
        mask.put_pixel(19, 9, Luma([0.4]));
        assert_eq!(silhouette_box(&mask, 0.5), Some([3.0, 2.0, 12.0, 8.0]));
    }

    #[test]
    fn jitter_moves_each_side_within_its_fraction() {
        let mut rng = keyed_rng(2, [0, 0]);
        for _ in 0..100 {
            let moved = jitter([10.0, 20.0, 110.0, 60.0], 0.1, &mut rng);
            let limits = [(10.0, 10.0), (20.0, 4.0), (110.0, 10.0), (60.0, 4.0)];
            let within = |(side, (at, limit)): (f32, (f32, f32))| (side - at).abs() <= limit;
            assert!(moved.into_iter().zip(limits).all(within), "{moved:?}");
        }
    }
}
