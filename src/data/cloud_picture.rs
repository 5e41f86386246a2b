//! Point clouds as pictures.

use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3};

/// The colour where there is nothing.
pub const PAPER: Rgb<u8> = Rgb([255; 3]);

/// A cloud around the world's origin, of about unit extent, in a square picture of `side` pixels.
///
/// Points are squares, nearer ones over farther ones and darker with distance.
pub fn draw_cloud(
    camera_from_world: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
    side: u32,
) -> RgbImage {
    let mut picture = RgbImage::from_pixel(side, side, PAPER);
    let side = side as f32;
    let distance = camera_from_world.translation.vector.norm();
    // The object's diagonal of 1 spans most of the picture.
    let scale = side * 0.9 * distance;
    let size = side * 2.0 / (points.len() as f32).sqrt();
    let center = camera_from_world.translation.vector;
    let mut placed: Vec<(f32, [f32; 2], [u8; 3])> = points
        .iter()
        .zip(colors)
        .map(|(&point, &color)| {
            let p = camera_from_world * Point3::from(point);
            let at = |i: usize| side / 2.0 + scale * (p[i] / p.z - center[i] / center.z);
            (p.z, [at(0), at(1)], color)
        })
        .filter(|(depth, ..)| *depth > 0.0)
        .collect();
    placed.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (depth, at, color) in placed {
        let shade = (1.0 - 0.7 * (depth - distance + 0.3)).clamp(0.4, 1.0);
        splat(&mut picture, at, size, Rgb(color.map(|channel| (f32::from(channel) * shade) as u8)));
    }
    picture
}

/// Draws a square around a location, in pixels.
pub fn splat(picture: &mut RgbImage, [u, v]: [f32; 2], side: f32, color: Rgb<u8>) {
    let range = |center: f32, limit: u32| {
        let first = (center - side / 2.0).round().max(0.0) as u32;
        let last = (center + side / 2.0).round().clamp(0.0, limit as f32) as u32;
        first..last
    };
    for y in range(v, picture.height()) {
        for x in range(u, picture.width()) {
            picture.put_pixel(x, y, color);
        }
    }
}
