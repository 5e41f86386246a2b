//! Focal lengths that digital cameras leave in their pictures.

use std::{fs::File, io::BufReader, path::Path};

use exif::{Exif, In, Reader, Tag, Value};

/// Diagonal of a frame of 35 mm film, 36 mm by 24 mm, in millimetres.
const FILM_DIAGONAL: f64 = 43.266_615;

/// The focal length in pixels of a picture of this size, by its EXIF data, if they tell.
///
/// The focal plane's resolution counts first, as it is the sensor's own; else the equivalent on 35 mm
/// film, which sees the same angle across the diagonal.
pub fn focal_in_pixels(path: &Path, [width, height]: [usize; 2]) -> Option<f64> {
    let file = File::open(path).ok()?;
    let exif = Reader::new().read_from_container(&mut BufReader::new(file)).ok()?;
    let [width, height] = [width as f64, height as f64];
    let focal = by_focal_plane(&exif, width.max(height)).or_else(|| {
        Some(number(&exif, Tag::FocalLengthIn35mmFilm)? / FILM_DIAGONAL * width.hypot(height))
    });
    focal.filter(|focal| focal.is_finite() && *focal > 0.0)
}

/// Millimetres times pixels a millimetre; the picture may have been made smaller since.
fn by_focal_plane(exif: &Exif, longer_side: f64) -> Option<f64> {
    let millimetres_a_unit = match number(exif, Tag::FocalPlaneResolutionUnit).unwrap_or(2.0) {
        2.0 => 25.4,
        3.0 => 10.0,
        4.0 => 1.0,
        _ => return None,
    };
    let taken = [Tag::PixelXDimension, Tag::PixelYDimension].map(|tag| number(exif, tag));
    let [across, down] = [taken[0]?, taken[1]?];
    let pixels_a_millimetre = number(exif, Tag::FocalPlaneXResolution)? / millimetres_a_unit;
    let focal = number(exif, Tag::FocalLength)? * pixels_a_millimetre;
    Some(focal * longer_side / across.max(down)).filter(|focal| focal.is_finite() && *focal > 0.0)
}

/// The first number of a field; zero stands for "unknown".
fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let field = exif.get_field(tag, In::PRIMARY)?;
    let number = match &field.value {
        Value::Rational(values) => values.first()?.to_f64(),
        value => f64::from(value.get_uint(0)?),
    };
    (number != 0.0).then_some(number)
}
