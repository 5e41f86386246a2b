//! The pictures, in the forms that the losses ask for.

use burn::tensor::Device;
use rayon::prelude::*;

use crate::{
    camera::Intrinsics,
    data::{ColorImage, ScalarImage, sequence::Sequence},
    loss::{MASK_THRESHOLD, Silhouette},
    sampling::ImageTable,
};

/// A sequence, ready to be compared with any shape from any poses.
pub struct Observations {
    pub intrinsics: Intrinsics,
    /// [width, height] of every frame, in pixels.
    pub size: [usize; 2],
    /// The frames at each level of blur.
    pub(super) images: Vec<ImageTable>,
    /// The same on the host.
    pub(super) host_images: Vec<Vec<ColorImage>>,
    pub(super) silhouettes: Vec<Option<Silhouette>>,
    masks: Vec<ScalarImage>,
}

impl Observations {
    /// One level for each of `blurs`, a Gaussian's standard deviation in pixels (0 leaves the
    /// frames as they are). Masks stay sharp.
    pub fn new(sequence: &Sequence, blurs: &[f32], device: &Device) -> Self {
        let level = |&blur: &f32| {
            let blurred = |image: &ColorImage| match blur > 0.0 {
                true => image::imageops::blur(image, blur),
                false => image.clone(),
            };
            sequence.frames.par_iter().map(|f| blurred(&f.color)).collect()
        };
        let host_images: Vec<Vec<ColorImage>> = blurs.iter().map(level).collect();
        Self {
            intrinsics: sequence.intrinsics,
            size: sequence.size,
            images: host_images.iter().map(|level| ImageTable::new(level, device)).collect(),
            host_images,
            silhouettes: sequence.frames.iter().map(|f| Silhouette::new(&f.mask)).collect(),
            masks: sequence.frames.iter().map(|frame| frame.mask.clone()).collect(),
        }
    }

    /// Whether a location of a frame shows the object.
    pub(super) fn in_mask(&self, frame: usize, [u, v]: [f32; 2]) -> bool {
        let inside = u >= 0.0 && v >= 0.0 && u < self.size[0] as f32 && v < self.size[1] as f32;
        inside && self.masks[frame].get_pixel(u as u32, v as u32)[0] > MASK_THRESHOLD
    }
}
