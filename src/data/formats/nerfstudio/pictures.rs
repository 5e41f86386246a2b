//! The pictures of a sequence's frames.

use std::{
    io::Cursor,
    path::{Path, PathBuf},
};

use image::{DynamicImage, GrayImage, ImageFormat, Luma};

use super::transforms::FrameEntry;
use crate::{
    Error, Result,
    data::{ScalarImage, formats::write_atomically, sequence::Frame},
};

/// Coverage that some pixel of every mask must reach.
const COVERED: f32 = 0.5;

/// Reads a frame's picture and its mask.
pub fn read_frame(folder: &Path, entry: &FrameEntry) -> Result<Frame> {
    let path = with_extension(folder.join(&entry.file_path));
    let picture = open(&path)?;
    let (mask_path, mask) = match &entry.mask_path {
        Some(mask_path) => {
            let mask_path = folder.join(mask_path);
            let mask = open(&mask_path)?.to_luma32f();
            (mask_path, mask)
        }
        None if picture.color().has_alpha() => (path, alpha(&picture)),
        None => return Err(unusable(&path, "it has neither a mask_path nor an alpha channel")),
    };
    if mask.dimensions() != (picture.width(), picture.height()) {
        return Err(unusable(&mask_path, "the mask is not of its picture's size"));
    }
    if mask.pixels().all(|coverage| coverage.0[0] < COVERED) {
        return Err(unusable(&mask_path, "the mask is empty"));
    }
    Ok(Frame { path: entry.file_path.clone(), color: picture.into_rgb32f(), mask })
}

/// Writes a picture as an 8-bit PNG.
pub fn write_png(path: &Path, picture: &DynamicImage) -> Result<()> {
    let mut bytes = Cursor::new(vec![]);
    picture.write_to(&mut bytes, ImageFormat::Png).map_err(Error::image(path))?;
    write_atomically(path, bytes.get_ref())
}

/// An 8-bit copy of a mask.
pub fn mask_to_luma8(mask: &ScalarImage) -> DynamicImage {
    let to_byte = |coverage: f32| (coverage.clamp(0.0, 1.0) * 255.0).round() as u8;
    let (width, height) = mask.dimensions();
    GrayImage::from_fn(width, height, |x, y| Luma([to_byte(mask.get_pixel(x, y).0[0])])).into()
}

/// NeRF's own files leave out `.png`.
fn with_extension(path: PathBuf) -> PathBuf {
    if path.extension().is_none() && !path.exists() { path.with_extension("png") } else { path }
}

fn open(path: &Path) -> Result<DynamicImage> {
    image::open(path).map_err(|error| unusable(path, &error.to_string()))
}

fn alpha(picture: &DynamicImage) -> ScalarImage {
    let picture = picture.to_rgba32f();
    ScalarImage::from_fn(picture.width(), picture.height(), |x, y| {
        Luma([picture.get_pixel(x, y).0[3]])
    })
}

fn unusable(path: &Path, reason: &str) -> Error {
    Error::Sequence { path: path.into(), reason: reason.into() }
}
