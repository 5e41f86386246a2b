//! The pictures, in the forms that the losses ask for.

use burn::tensor::Device;
use image::{Rgb, imageops::blur};
use rayon::prelude::*;

use crate::{
    camera::Intrinsics,
    data::{
        ColorImage, ScalarImage,
        sequence::{Frame, Sequence},
    },
    sampling::ImageTable,
    silhouette::Silhouette,
};

/// Coverage from which on a pixel holds nothing of the background.
const COVERED: f32 = 0.9;
/// Share of a Gaussian that must fall on the object for a blurred colour to be the object's.
const LEAST_SHARE: f32 = 0.05;

/// A sequence, ready to be compared with any shape from any poses.
pub struct Observations {
    pub intrinsics: Intrinsics,
    /// [width, height] of every frame, in pixels.
    pub size: [usize; 2],
    /// Each level's blur, a Gaussian's standard deviation in pixels.
    pub(super) blurs: Vec<f32>,
    /// The frames at each level of blur.
    pub(super) images: Vec<ImageTable>,
    /// The same on the host.
    pub(super) host_images: Vec<Vec<ColorImage>>,
    /// None of a frame that has no mask.
    pub(super) silhouettes: Vec<Option<Silhouette>>,
    /// For each frame, whether a pixel and its neighbours hold nothing of the background, as far as is
    /// known: without a mask, all may be the object.
    interiors: Vec<Vec<bool>>,
}

impl Observations {
    /// One level for each of `blurs`, a Gaussian's standard deviation in pixels (0 leaves the
    /// frames as they are). Masks stay sharp.
    pub fn new(sequence: &Sequence, blurs: &[f32], device: &Device) -> Self {
        let frames = &sequence.frames;
        let level = |&blur: &f32| match blur > 0.0 {
            true => frames.par_iter().map(|frame| blurred_object(frame, blur)).collect(),
            false => frames.iter().map(|frame| frame.color.clone()).collect(),
        };
        let host_images: Vec<Vec<ColorImage>> = blurs.iter().map(level).collect();
        Self {
            intrinsics: sequence.intrinsics,
            size: sequence.size,
            blurs: blurs.to_vec(),
            images: host_images.iter().map(|level| ImageTable::new(level, device)).collect(),
            host_images,
            silhouettes: frames.iter().map(|frame| Silhouette::new(&frame.mask)).collect(),
            interiors: frames
                .iter()
                .map(|frame| match frame.has_mask() {
                    true => interior(&frame.mask),
                    false => vec![true; frame.mask.pixels().len()],
                })
                .collect(),
        }
    }

    /// Whether a location of a frame shows the object and nothing else; if it has no mask, whether it is
    /// in the frame.
    pub(super) fn shows_object(&self, frame: usize, [u, v]: [f32; 2]) -> bool {
        let inside = u >= 0.0 && v >= 0.0 && u < self.size[0] as f32 && v < self.size[1] as f32;
        inside && self.interiors[frame][v as usize * self.size[0] + u as usize]
    }
}

/// A blur that keeps the background out of the object: blur(M I) / blur(M).
///
/// A plain one lets the background bleed into the outline, which then moves with the estimate.
///
/// Without a mask there is no other.
fn blurred_object(frame: &Frame, sigma: f32) -> ColorImage {
    if !frame.has_mask() {
        return blur(&frame.color, sigma);
    }
    let (width, height) = frame.color.dimensions();
    let coverage = |u, v| frame.mask.get_pixel(u, v)[0];
    let object = ColorImage::from_fn(width, height, |u, v| {
        Rgb(frame.color.get_pixel(u, v).0.map(|channel| channel * coverage(u, v)))
    });
    let share = ColorImage::from_fn(width, height, |u, v| Rgb([coverage(u, v); 3]));
    let (object, share) = (blur(&object, sigma), blur(&share, sigma));
    ColorImage::from_fn(width, height, |u, v| {
        let share = share.get_pixel(u, v)[0];
        match share > LEAST_SHARE {
            true => Rgb(object.get_pixel(u, v).0.map(|channel| channel / share)),
            false => *frame.color.get_pixel(u, v),
        }
    })
}

/// The mask, eroded by a pixel: bilinear colours there are made of the object's pixels only.
fn interior(mask: &ScalarImage) -> Vec<bool> {
    let covered = |u: i64, v: i64| {
        let inside =
            u >= 0 && v >= 0 && u < i64::from(mask.width()) && v < i64::from(mask.height());
        // Beyond the frame nothing is known, and nothing speaks against.
        !inside || mask.get_pixel(u as u32, v as u32)[0] >= COVERED
    };
    let around = |u: i64, v: i64| (-1..=1).all(|dv| (-1..=1).all(|du| covered(u + du, v + dv)));
    mask.enumerate_pixels().map(|(u, v, _)| around(i64::from(u), i64::from(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Backend;
    use image::Luma;

    /// A grey disc on a red ground.
    fn frame() -> Frame {
        let inside = |u: u32, v: u32| (u as f32 - 15.5).hypot(v as f32 - 15.5) < 9.0;
        Frame {
            path: "disc.png".into(),
            color: ColorImage::from_fn(32, 32, |u, v| {
                Rgb(if inside(u, v) { [0.5; 3] } else { [1.0, 0.0, 0.0] })
            }),
            mask: ScalarImage::from_fn(32, 32, |u, v| Luma([f32::from(u8::from(inside(u, v)))])),
        }
    }

    #[test]
    fn a_blurred_object_keeps_its_color_up_to_its_outline() {
        let frame = frame();
        let blurred = blurred_object(&frame, 2.0);
        for (u, v, coverage) in frame.mask.enumerate_pixels().filter(|(_, _, m)| m[0] > 0.5) {
            let color = blurred.get_pixel(u, v).0;
            assert!(color.iter().all(|c| (c - 0.5).abs() < 1e-3), "{color:?} {coverage:?}");
        }
    }

    #[test]
    fn a_frame_without_a_mask_is_blurred_as_a_whole_and_may_show_the_object_anywhere() {
        let unknown = Frame { mask: ScalarImage::new(32, 32), ..frame() };
        let expected = blur(&unknown.color, 2.0);
        assert_ne!(expected, unknown.color);
        let sequence = Sequence {
            name: "disc".into(),
            intrinsics: Intrinsics { focal: [30.0; 2], center: [16.0; 2] },
            size: [32, 32],
            frames: vec![frame(), unknown],
            truth: None,
        };
        let observations = Observations::new(&sequence, &[2.0], &Backend::Flex.device());
        assert_eq!(observations.host_images[0][1], expected);
        assert!(observations.silhouettes[0].is_some() && observations.silhouettes[1].is_none());
        let shown = |frame, at| observations.shows_object(frame, at);
        assert_eq!([shown(0, [16.0; 2]), shown(0, [1.0; 2])], [true, false]);
        assert_eq!(
            [shown(1, [1.0; 2]), shown(1, [31.9; 2]), shown(1, [33.0; 2])],
            [true, true, false]
        );
    }

    #[test]
    fn the_interior_is_the_mask_without_its_rim() {
        let mask = ScalarImage::from_fn(5, 4, |u, _| Luma([if u >= 2 { 1.0 } else { 0.0 }]));
        let row = [false, false, false, true, true];
        assert_eq!(interior(&mask), row.repeat(4));
    }
}
