//! A small picture of a reconstruction, for lists of them.

use image::{DynamicImage, RgbImage, imageops};
use nalgebra::Isometry3;
use object_pba::data::{
    cloud_picture::{PAPER, draw_cloud},
    sequence::Frame,
};

/// Side of each half, in pixels.
const SIDE: u32 = 112;
/// The cloud is drawn this much larger first, so that points blend.
const OVERSAMPLING: u32 = 3;

/// A frame, cropped to a square, and beside it the cloud as its camera sees it.
pub fn draw(
    frame: &Frame,
    camera_from_world: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> RgbImage {
    let mut picture = RgbImage::from_pixel(2 * SIDE, SIDE, PAPER);
    let filter = imageops::FilterType::Triangle;
    let frame = DynamicImage::ImageRgb32F(frame.color.clone()).to_rgb8();
    let frame = DynamicImage::ImageRgb8(frame).resize_to_fill(SIDE, SIDE, filter);
    imageops::replace(&mut picture, &frame.into_rgb8(), 0, 0);
    let cloud = draw_cloud(camera_from_world, points, colors, OVERSAMPLING * SIDE);
    let cloud = imageops::resize(&cloud, SIDE, SIDE, filter);
    imageops::replace(&mut picture, &cloud, i64::from(SIDE), 0);
    picture
}
