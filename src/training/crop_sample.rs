//! A crop as a sample of a shard, and back: the very same crop.

use image::{GrayImage, RgbImage};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::crops::Crop;
use crate::data::formats::{
    axes::{TransformMatrix, to_opengl_matrix},
    webdataset::{DecodedSample, Sample},
};

/// What other programs ask of a crop, in the words of `transforms.json`, and what we read back.
#[derive(Serialize)]
struct Metadata {
    seed: u64,
    model: usize,
    w: usize,
    h: usize,
    fl_x: f32,
    fl_y: f32,
    cx: f32,
    cy: f32,
    world: &'static str,
    transform_matrix: TransformMatrix,
    #[serde(flatten)]
    truth: CropTruth,
}

/// To the last bit, as a matrix does not keep a quaternion.
#[derive(Serialize, Deserialize)]
pub(super) struct CropTruth {
    view: usize,
    crop_from_world: Isometry3<f32>,
    focal_ratio: f32,
}

/// Encodes a crop of this model, `size` pixels wide and high.
pub(super) fn sample_of_crop(crop: &Crop, size: usize, seed: u64, model: usize) -> Sample {
    let &Crop { crop_from_world, focal_ratio, view, .. } = crop;
    let [focal, center] = [focal_ratio * size as f32, size as f32 / 2.0];
    let metadata = Metadata {
        seed,
        model,
        w: size,
        h: size,
        fl_x: focal,
        fl_y: focal,
        cx: center,
        cy: center,
        world: "canonical",
        transform_matrix: to_opengl_matrix(&crop_from_world),
        truth: CropTruth { view, crop_from_world, focal_ratio },
    };
    let pixels = crop.pixels.as_chunks::<4>().0;
    let pixel = |x: u32, y: u32| pixels[y as usize * size + x as usize];
    let color = RgbImage::from_fn(size as u32, size as u32, |x, y| {
        let [red, green, blue, _] = pixel(x, y);
        [red, green, blue].into()
    });
    let mask = GrayImage::from_fn(size as u32, size as u32, |x, y| [pixel(x, y)[3]].into());
    Sample::new(&color, &mask, &metadata)
}

/// The crop that was encoded, of a shape that is still to be told.
pub(super) fn crop_of_sample(sample: &DecodedSample<CropTruth>) -> Crop {
    let &CropTruth { view, crop_from_world, focal_ratio } = &sample.metadata;
    let pixels = sample.color.pixels().zip(sample.mask.pixels());
    let pixels = pixels.flat_map(|(color, mask)| {
        let [red, green, blue] = color.0;
        [red, green, blue, mask.0[0]]
    });
    Crop { pixels: pixels.collect(), crop_from_world, focal_ratio, shape_idx: 0, view }
}
