//! Numbers and pictures as text: what a page can hold.

use anyhow::{Context, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use image::{DynamicImage, ImageFormat, RgbImage, codecs::jpeg::JpegEncoder, imageops::FilterType};
use object_pba::data::ColorImage;

/// Longest side of a picture that is kept as it is, without loss.
const LOSSLESS_SIDE: u32 = 256;
/// Longest side of any picture. Larger ones are shrunk, and stored as JPEG.
const LONGEST_SIDE: u32 = 480;
const JPEG_QUALITY: u8 = 88;

/// The box in which coordinates are counted in steps of 1/65,535 of its sides.
pub type Bounds = [[f32; 3]; 2];

/// The least box around some clouds.
pub fn bounds<'a>(clouds: impl IntoIterator<Item = &'a [[f32; 3]]>) -> Bounds {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for point in clouds.into_iter().flatten() {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(point[axis]);
            bounds[1][axis] = bounds[1][axis].max(point[axis]);
        }
    }
    bounds
}

/// Points as 16-bit steps in `bounds`, x y z by turns.
pub fn cloud(points: &[[f32; 3]], [least, most]: &Bounds) -> String {
    let steps = points.iter().flat_map(|point| {
        (0..3).map(|axis| (point[axis] - least[axis]) / (most[axis] - least[axis]))
    });
    shares(steps)
}

/// Numbers in [0, 1] as 16 bits each, least byte first.
pub fn shares(values: impl IntoIterator<Item = f32>) -> String {
    let step = |share: f32| (share.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16;
    let bytes: Vec<u8> = values.into_iter().flat_map(|share| step(share).to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

/// Which of `n` points are listed: a bit each, the first one lowest in its byte.
pub fn bits(listed: &[u32], n: usize) -> String {
    let mut bytes = vec![0u8; n.div_ceil(8)];
    for &idx in listed {
        bytes[idx as usize / 8] |= 1 << (idx % 8);
    }
    STANDARD.encode(bytes)
}

/// A picture as a `data:` address.
pub fn picture(image: &ColorImage) -> Result<String> {
    let image = DynamicImage::ImageRgb32F(image.clone()).to_rgb8();
    let longest = image.width().max(image.height());
    let mut bytes = std::io::Cursor::new(Vec::new());
    let kind = if longest <= LOSSLESS_SIDE {
        image.write_to(&mut bytes, ImageFormat::Png).context("cannot encode a frame")?;
        "png"
    } else {
        let encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
        shrunk(image).write_with_encoder(encoder).context("cannot encode a frame")?;
        "jpeg"
    };
    Ok(format!("data:image/{kind};base64,{}", STANDARD.encode(bytes.into_inner())))
}

fn shrunk(image: RgbImage) -> RgbImage {
    let image = DynamicImage::ImageRgb8(image);
    if image.width().max(image.height()) <= LONGEST_SIDE {
        return image.into_rgb8();
    }
    image.resize(LONGEST_SIDE, LONGEST_SIDE, FilterType::Triangle).into_rgb8()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(text: &str) -> Vec<u8> {
        STANDARD.decode(text).unwrap()
    }

    #[test]
    fn points_come_back_within_half_a_step() {
        let points = [[-0.5, 0.0, 0.25], [0.5, 0.3, 0.75], [0.1234, 0.2, 0.5]];
        let bounds = bounds([points.as_slice()]);
        assert_eq!(bounds, [[-0.5, 0.0, 0.25], [0.5, 0.3, 0.75]]);
        let bytes = decoded(&cloud(&points, &bounds));
        assert_eq!(bytes.len(), 3 * 3 * 2);
        for (i, pair) in bytes.as_chunks::<2>().0.iter().enumerate() {
            let (point, axis) = (i / 3, i % 3);
            let side = bounds[1][axis] - bounds[0][axis];
            let x = bounds[0][axis] + f32::from(u16::from_le_bytes(*pair)) / 65_535.0 * side;
            assert!((x - points[point][axis]).abs() < 0.51 / 65_535.0, "{x}");
        }
    }

    #[test]
    fn a_bit_says_whether_a_point_is_listed() {
        assert_eq!(decoded(&bits(&[0, 3, 9], 10)), [0b1001, 0b10]);
    }

    #[test]
    fn small_pictures_keep_every_pixel_and_large_ones_are_shrunk() {
        let gradient = |side: u32| {
            ColorImage::from_fn(side, side, |x, y| {
                image::Rgb([x as f32 / 255.0, y as f32 / 255.0, 0.5])
            })
        };
        let read = |side: u32| {
            let text = picture(&gradient(side)).unwrap();
            let (_, data) = text.split_once("base64,").unwrap();
            image::load_from_memory(&decoded(data)).unwrap().to_rgb8()
        };
        assert_eq!(read(64).get_pixel(17, 40).0, [17, 40, 128]);
        assert_eq!(read(600).dimensions(), (LONGEST_SIDE, LONGEST_SIDE));
    }
}
