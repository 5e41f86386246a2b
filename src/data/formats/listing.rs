//! What every layout of a sequence comes down to: pictures, their masks, cameras and poses.

use std::path::{Path, PathBuf};

use image::DynamicImage;
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use super::{
    calibration::{Calibration, Distortion},
    hints::SequenceHints,
    masks::{MaskSource, alpha, off_background},
    natural_order::natural_order,
    pictures::{self, unusable},
    undistortion::undistort,
};
use crate::{
    Result,
    camera::Intrinsics,
    data::{
        ScalarImage,
        sequence::{Frame, Sequence, Truth},
    },
};

/// Pixels of all frames together, at 16 bytes each: what an ordinary machine holds.
const MOST_PIXELS: usize = 1 << 28;

/// A sequence before its pictures are opened.
#[derive(Clone, Debug, Default)]
pub struct Listing {
    pub name: String,
    pub shots: Vec<Shot>,
    /// Whether poses are in the object's canonical frame.
    pub canonical: bool,
    /// The object's true surface, in that frame.
    pub points: Option<Vec<Point3<f32>>>,
    /// What was assumed, and a user should know.
    pub notes: Vec<String>,
}

/// One picture, as the files describe it.
#[derive(Clone, Debug)]
pub struct Shot {
    pub path: PathBuf,
    /// Relative to the sequence's folder.
    pub name: PathBuf,
    /// Whether to turn the picture as its EXIF data say. Files that state a camera mean it as stored.
    pub upright: bool,
    pub mask: MaskSource,
    pub calibration: Calibration,
    /// `[width, height]`, in pixels, that the calibration is for.
    pub size: [usize; 2],
    pub camera_from_world: Option<Isometry3<f32>>,
}

impl Listing {
    /// Brings the frames into the natural order of their names and keeps those asked for.
    pub fn select(&mut self, hints: &SequenceHints) {
        self.shots
            .sort_by(|a, b| natural_order(&a.name.to_string_lossy(), &b.name.to_string_lossy()));
        let mut idx = 0..;
        self.shots.retain(|_| idx.next().is_some_and(|idx| hints.selects(idx)));
        self.shots.truncate(hints.max_frames.unwrap_or(usize::MAX));
    }

    /// Opens all pictures and brings them to the pinhole camera of the first one.
    pub fn load(mut self, path: &Path) -> Result<(Sequence, Vec<String>)> {
        let Some(first) = self.shots.first() else {
            return Err(unusable(path, "it has no frames, or none that were asked for"));
        };
        let (intrinsics, size) = (first.calibration.intrinsics, first.size);
        let n_frames = self.shots.len();
        if n_frames.saturating_mul(size[0]).saturating_mul(size[1]) > MOST_PIXELS {
            let reason = format!(
                "{n_frames} frames of {size:?} pixels are too many to hold; take fewer (--every, --max-frames) or smaller ones"
            );
            return Err(unusable(path, &reason));
        }
        let camera_from_world = self.poses().map_err(|reason| unusable(path, &reason))?;
        self.note_resampling(&intrinsics, size);

        let load = |shot: &Shot| shot.load(&intrinsics, size);
        let frames: Vec<Result<Frame>> = self.shots.par_iter().map(load).collect();
        // Of several broken frames, the first one is named, whichever thread was faster.
        let frames = frames.into_iter().collect::<Result<Vec<Frame>>>()?;
        self.note_missing_masks(&frames);
        let Self { name, canonical, points, notes, .. } = self;
        let truth = camera_from_world.map(|camera_from_world| Truth {
            camera_from_world,
            canonical,
            points,
        });
        Ok((Sequence { name, intrinsics, size, frames, truth }, notes))
    }

    /// `camera_from_world` of every frame, or of none.
    fn poses(&self) -> Result<Option<Vec<Isometry3<f32>>>, String> {
        let poses: Vec<_> = self.shots.iter().filter_map(|shot| shot.camera_from_world).collect();
        match poses.len() {
            0 => Ok(None),
            n if n == self.shots.len() => Ok(Some(poses)),
            _ => Err("some frames have a pose and some have none".into()),
        }
    }

    fn note_missing_masks(&mut self, frames: &[Frame]) {
        let missing: Vec<_> = frames.iter().filter(|frame| !frame.has_mask()).collect();
        if let Some(first) = missing.first() {
            let (n, of, name) = (missing.len(), frames.len(), first.path.display());
            let note =
                format!("{n} of {of} frames have no mask, or an empty one; the first is {name}");
            self.notes.push(note);
        }
    }

    fn note_resampling(&mut self, intrinsics: &Intrinsics, size: [usize; 2]) {
        let count = |of: &dyn Fn(&Shot) -> bool| self.shots.iter().filter(|shot| of(shot)).count();
        let distorted = count(&|shot| shot.calibration.distortion != Distortion::default());
        let differing =
            count(&|shot| shot.calibration.intrinsics != *intrinsics || shot.size != size);
        if distorted > 0 {
            self.notes.push(format!("lens distortion undone in {distorted} frames"));
        }
        if differing > 0 {
            let note = format!("{differing} frames of other cameras brought to the first one's");
            self.notes.push(note);
        }
    }
}

impl Shot {
    fn load(&self, intrinsics: &Intrinsics, size: [usize; 2]) -> Result<Frame> {
        let picture = pictures::open(&self.path, self.upright)?;
        let found = [picture.width(), picture.height()].map(|side| side as usize);
        if found != self.size {
            let reason = format!("it is {found:?} pixels, and its camera takes {:?}", self.size);
            return Err(unusable(&self.path, &reason));
        }
        let mask = self.mask(&picture)?;
        let color = picture.into_rgb32f();
        let pinhole = Calibration { intrinsics: *intrinsics, distortion: Distortion::default() };
        let (color, mask) = if self.calibration == pinhole && self.size == size {
            (color, mask)
        } else {
            undistort(&color, &mask, &self.calibration, intrinsics, size)
        };
        Ok(Frame { path: self.name.clone(), color, mask })
    }

    /// The mask; empty, where there is none.
    fn mask(&self, picture: &DynamicImage) -> Result<ScalarImage> {
        let size = (picture.width(), picture.height());
        let found = match &self.mask {
            MaskSource::File(path) => {
                path.exists().then(|| mask_of_size(path, size)).transpose()?
            }
            MaskSource::Alpha => alpha(picture),
            MaskSource::Background => alpha(picture).or_else(|| off_background(&picture.to_rgb8())),
        };
        Ok(found.unwrap_or_else(|| ScalarImage::new(size.0, size.1)))
    }
}

fn mask_of_size(path: &Path, size: (u32, u32)) -> Result<ScalarImage> {
    let mask = pictures::open(path, false)?.to_luma32f();
    match mask.dimensions() == size {
        true => Ok(mask),
        false => Err(unusable(path, "the mask is not of its picture's size")),
    }
}
