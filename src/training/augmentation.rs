//! What pictures of other cameras, renderers and masks differ in: light, sharpness, noise,
//! compression, and what the mask leaves out or lets in.

use image::{ImageFormat, RgbImage, codecs::jpeg::JpegEncoder, imageops};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::batches::normal;

/// How much the crops of a training step are changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AugmentationConfig {
    /// Whether a mirrored shape is a shape: half of the pictures are then mirrored.
    pub mirror: bool,
    /// Standard deviations of each colour channel's gain, and of each pixel's noise.
    pub gain_noise: f32,
    pub pixel_noise: f32,
    /// Pictures are blurred by a Gaussian of up to this standard deviation, in pixels of the crop.
    pub blur: f32,
    /// The share of the pictures that go through JPEG, of quality 30 to 95.
    pub jpeg_share: f64,
    /// The share of the pictures from whose mask a rectangle is missing.
    pub occluded_share: f64,
    /// The share of the pictures whose mask is everything, before some background.
    pub background_share: f64,
}

impl Default for AugmentationConfig {
    fn default() -> Self {
        Self {
            mirror: true,
            gain_noise: 0.15,
            pixel_noise: 0.02,
            blur: 0.8,
            jpeg_share: 0.25,
            occluded_share: 0.15,
            background_share: 0.0,
        }
    }
}

impl AugmentationConfig {
    /// Nothing is changed.
    pub const NONE: Self = Self {
        mirror: false,
        gain_noise: 0.0,
        pixel_noise: 0.0,
        blur: 0.0,
        jpeg_share: 0.0,
        occluded_share: 0.0,
        background_share: 0.0,
    };

    /// Why this cannot be done, if it cannot.
    pub fn check(&self) -> Result<(), String> {
        let shares = [self.jpeg_share, self.occluded_share, self.background_share];
        if shares.iter().any(|share| !(0.0..=1.0).contains(share)) {
            return Err("the shares of an augmentation must be within [0, 1]".into());
        }
        let deviations = [self.gain_noise, self.pixel_noise, self.blur];
        if deviations.iter().any(|deviation| !(0.0..=10.0).contains(deviation)) {
            return Err("the deviations of an augmentation must be within [0, 10]".into());
        }
        Ok(())
    }

    /// Changes a crop `[size, size, 4]`, see [`crop_values`](crate::regressor::crop_values).
    pub(super) fn apply(&self, values: &mut [f32], size: usize, rng: &mut impl Rng) {
        if rng.random_bool(self.occluded_share) {
            occlude(values, size, rng);
        }
        if rng.random_bool(self.background_share) {
            add_background(values, size, rng);
        }
        let blur = self.blur * rng.random::<f32>();
        if blur > 0.3 {
            filter(values, size, |picture| imageops::blur(picture, blur));
        }
        self.relight(values, rng);
        if rng.random_bool(self.jpeg_share) {
            let quality = rng.random_range(30..=95);
            filter(values, size, |picture| compress(picture, quality));
        }
    }

    /// Gains of the channels, and noise of the pixels.
    fn relight(&self, values: &mut [f32], rng: &mut impl Rng) {
        let gains: [f32; 3] = std::array::from_fn(|_| 1.0 + self.gain_noise * normal(rng));
        for pixel in values.as_chunks_mut::<4>().0.iter_mut().filter(|pixel| pixel[3] > 0.0) {
            let mask = pixel[3];
            for (channel, gain) in pixel.iter_mut().zip(gains) {
                let noisy = *channel * gain + mask * self.pixel_noise * normal(rng);
                *channel = noisy.clamp(0.0, 1.0);
            }
        }
    }
}

/// Something stands before a part of the crop, a third of its side at most.
fn occlude(values: &mut [f32], size: usize, rng: &mut impl Rng) {
    let mut side = || rng.random_range(size / 10..=size / 3);
    let [width, height] = [side(), side()];
    let [left, top] = [width, height].map(|extent| rng.random_range(0..size - extent));
    for row in values.chunks_mut(4 * size).skip(top).take(height) {
        row[4 * left..4 * (left + width)].fill(0.0);
    }
}

/// Colours that change evenly across the crop, with the mask of a picture that has none.
fn add_background(values: &mut [f32], size: usize, rng: &mut impl Rng) {
    let corners: [[f32; 3]; 3] = rng.random();
    for (i, pixel) in values.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let [x, y] = [i % size, i / size].map(|i| i as f32 / size as f32);
        let mask = std::mem::replace(&mut pixel[3], 1.0);
        for (c, channel) in pixel[..3].iter_mut().enumerate() {
            let [a, b, d] = corners.map(|corner| corner[c]);
            *channel += (1.0 - mask) * (a + (b - a) * x + (d - a) * y).clamp(0.0, 1.0);
        }
    }
}

/// Changes the colours as a picture of bytes; they stay within the mask.
fn filter(values: &mut [f32], size: usize, change: impl Fn(&RgbImage) -> RgbImage) {
    let pixels = values.as_chunks_mut::<4>().0;
    let bytes = pixels.iter().flat_map(|[red, green, blue, _]| {
        [red, green, blue].map(|channel| (channel * 255.0).round() as u8)
    });
    let size = size as u32;
    let picture = RgbImage::from_raw(size, size, bytes.collect()).expect("three bytes a pixel");
    for (pixel, changed) in pixels.iter_mut().zip(change(&picture).pixels()) {
        let mask = pixel[3];
        for (channel, byte) in pixel.iter_mut().zip(changed.0) {
            *channel = (f32::from(byte) / 255.0).min(mask);
        }
    }
}

fn compress(picture: &RgbImage, quality: u8) -> RgbImage {
    let mut bytes = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut bytes, quality);
    picture.write_with_encoder(encoder).expect("memory is writable");
    let decoded = image::load_from_memory_with_format(&bytes, ImageFormat::Jpeg);
    decoded.expect("it was just encoded").into_rgb8()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;

    const SIZE: usize = 32;

    /// A grey disc.
    fn crop() -> Vec<f32> {
        let pixel = |i: usize| {
            let [x, y] = [i % SIZE, i / SIZE].map(|i| i as f32 - 15.5);
            let mask = f32::from(u8::from(x * x + y * y < 140.0));
            [0.5 * mask, 0.5 * mask, 0.5 * mask, mask]
        };
        (0..SIZE * SIZE).flat_map(pixel).collect()
    }

    fn applied(config: &AugmentationConfig, seed: u64) -> Vec<f32> {
        let mut values = crop();
        config.apply(&mut values, SIZE, &mut keyed_rng(seed, [0, 0]));
        values
    }

    #[test]
    fn nothing_changes_nothing() {
        assert_eq!(applied(&AugmentationConfig::NONE, 1), crop());
    }

    #[test]
    fn values_stay_within_the_mask_and_one() {
        for seed in 0..40 {
            let values =
                applied(&AugmentationConfig { jpeg_share: 1.0, ..Default::default() }, seed);
            for pixel in values.as_chunks::<4>().0 {
                assert!(pixel.iter().all(|value| (0.0..=1.0).contains(value)), "{pixel:?}");
                assert!(pixel[3] > 0.0 || pixel[..3] == [0.0; 3], "{pixel:?}");
            }
        }
    }

    #[test]
    fn an_occluder_takes_mask_and_colour_away_and_a_background_fills_both() {
        let covered = |values: &[f32]| values.iter().skip(3).step_by(4).sum::<f32>();
        let occluded = AugmentationConfig { occluded_share: 1.0, ..AugmentationConfig::NONE };
        let backed = AugmentationConfig { background_share: 1.0, ..AugmentationConfig::NONE };
        let least = (0..20).map(|seed| covered(&applied(&occluded, seed))).fold(f32::MAX, f32::min);
        assert!(least < covered(&crop()) && least > 0.5 * covered(&crop()));
        assert_eq!(covered(&applied(&backed, 3)), (SIZE * SIZE) as f32);
    }

    #[test]
    fn blur_and_compression_keep_the_mean_colour() {
        let mean = |values: &[f32]| values.iter().step_by(4).sum::<f32>();
        let rough = AugmentationConfig { blur: 1.0, jpeg_share: 1.0, ..AugmentationConfig::NONE };
        for seed in 0..10 {
            let ratio = mean(&applied(&rough, seed)) / mean(&crop());
            assert!((0.85..1.05).contains(&ratio), "{ratio}");
        }
    }
}
