//! Pictures: where they lie, opening and writing them.

use std::{
    fs,
    io::{BufReader, Cursor},
    path::{Path, PathBuf},
};

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::{natural_order::natural_order, write_atomically};
use crate::{Error, Result};

/// Endings of the pictures that we read.
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The pictures in a folder, by their endings and in natural order; none if there is no such folder.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(vec![]);
    }
    let entries = fs::read_dir(folder).map_err(Error::io(folder))?;
    let mut paths = vec![];
    for entry in entries {
        let path = entry.map_err(Error::io(folder))?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if EXTENSIONS.contains(&extension.as_str()) && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(paths)
}

/// `[width, height]` in pixels, as stored or, if `upright`, turned as its EXIF data say.
pub fn size(path: &Path, upright: bool) -> Result<[usize; 2]> {
    let unusable = |error: image::ImageError| unusable(path, &error.to_string());
    let mut decoder = reader(path)?.into_decoder().map_err(unusable)?;
    let (width, height) = decoder.dimensions();
    let mut size = [width, height].map(|side| side as usize);
    // Orientations 5 to 8 are a quarter turn, mirrored or not.
    if upright && decoder.orientation().map_err(unusable)?.to_exif() >= 5 {
        size.reverse();
    }
    Ok(size)
}

/// Whether a picture has an alpha channel.
pub fn has_alpha(path: &Path) -> Result<bool> {
    let decoder = reader(path)?.into_decoder();
    let decoder = decoder.map_err(|error| unusable(path, &error.to_string()))?;
    Ok(decoder.color_type().has_alpha())
}

/// Opens a picture, as stored or, if `upright`, turned as its EXIF data say.
pub fn open(path: &Path, upright: bool) -> Result<DynamicImage> {
    let unusable = |error: image::ImageError| unusable(path, &error.to_string());
    let mut decoder = reader(path)?.into_decoder().map_err(unusable)?;
    let orientation = decoder.orientation().map_err(unusable)?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(unusable)?;
    if upright {
        picture.apply_orientation(orientation);
    }
    Ok(picture)
}

fn reader(path: &Path) -> Result<ImageReader<BufReader<fs::File>>> {
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    reader.map_err(|error| unusable(path, &error.to_string()))
}

/// Writes a picture as an 8-bit PNG.
pub fn write_png(path: &Path, picture: &DynamicImage) -> Result<()> {
    let mut bytes = Cursor::new(vec![]);
    picture.write_to(&mut bytes, ImageFormat::Png).map_err(Error::image(path))?;
    write_atomically(path, bytes.get_ref())
}

/// The error of a file that is no part of a sequence.
pub fn unusable(path: &Path, reason: &str) -> Error {
    Error::Sequence { path: path.into(), reason: reason.into() }
}
