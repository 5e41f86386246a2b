//! Masks: where they lie, and how they follow from pictures that have none.

use std::path::{Path, PathBuf};

use image::{DynamicImage, GrayImage, Luma, RgbImage};

use crate::data::ScalarImage;

/// Where masks lie, below the folder of a sequence.
const MASK_FOLDERS: [&str; 2] = ["masks", "mask"];

/// What tells the object from its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub enum MaskSource {
    /// A picture in which the object is white.
    File(PathBuf),
    /// The picture's own alpha channel.
    Alpha,
    /// The alpha channel where there is one; else all but the white or black around the object.
    Background,
}

/// The mask that goes with a picture of this name below `folder`, by nerfstudio's and COLMAP's habits:
/// `masks/NAME.png.png`, `masks/NAME.png` or the same for `mask/`. Without any, it is the alpha channel.
pub fn mask_beside(folder: &Path, name: &Path) -> MaskSource {
    let folders = MASK_FOLDERS.map(|masks| folder.join(masks));
    let mut candidates = folders.iter().flat_map(|folder| mask_names(folder, name));
    candidates.find(|path| path.is_file()).map_or(MaskSource::Alpha, MaskSource::File)
}

/// The mask of this picture in a folder that must hold it.
pub fn mask_in(folder: &Path, name: &Path) -> MaskSource {
    let [colmap, same, png] = mask_names(folder, name);
    let found = [&colmap, &same, &png].into_iter().find(|path| path.is_file()).cloned();
    MaskSource::File(found.unwrap_or(png))
}

fn mask_names(folder: &Path, name: &Path) -> [PathBuf; 3] {
    let mut colmap = folder.join(name).into_os_string();
    colmap.push(".png");
    [colmap.into(), folder.join(name), folder.join(name).with_extension("png")]
}

/// The coverage of a picture's alpha channel; none if it has no such channel, or is opaque.
pub fn alpha(picture: &DynamicImage) -> Option<ScalarImage> {
    let rgba = picture.color().has_alpha().then(|| picture.to_rgba32f())?;
    let opaque = rgba.pixels().all(|pixel| pixel.0[3] == 1.0);
    let (width, height) = rgba.dimensions();
    (!opaque).then(|| ScalarImage::from_fn(width, height, |x, y| Luma([rgba.get_pixel(x, y).0[3]])))
}

/// All but the ground colour: what is white, or black, and joined to the border through its like.
///
/// The ground's colour is that of the top-left pixel. Parts of the object of that colour stay covered
/// where they lie inside; none if the corner is neither white nor black.
pub fn off_background(picture: &RgbImage) -> Option<ScalarImage> {
    let (width, height) = picture.dimensions();
    let is_white = |x, y| picture.get_pixel(x, y).0.iter().all(|channel| *channel >= 254);
    let is_black = |x, y| picture.get_pixel(x, y).0.iter().all(|channel| *channel <= 1);
    let is_ground = |x: u32, y: u32| if is_white(0, 0) { is_white(x, y) } else { is_black(x, y) };
    if width == 0 || height == 0 || !is_ground(0, 0) {
        return None;
    }
    let mut mask = ScalarImage::from_pixel(width, height, Luma([1.0]));
    let sides = (0..height).flat_map(|y| [(0, y), (width - 1, y)]);
    let mut open: Vec<_> =
        (0..width).flat_map(|x| [(x, 0), (x, height - 1)]).chain(sides).collect();
    while let Some((x, y)) = open.pop() {
        if x < width && y < height && mask.get_pixel(x, y).0[0] == 1.0 && is_ground(x, y) {
            mask.put_pixel(x, y, Luma([0.0]));
            let [left, above] = [x, y].map(|coordinate| coordinate.wrapping_sub(1));
            open.extend([(left, y), (x + 1, y), (x, above), (x, y + 1)]);
        }
    }
    Some(mask)
}

/// An 8-bit copy of a mask.
pub fn mask_to_luma8(mask: &ScalarImage) -> DynamicImage {
    let to_byte = |coverage: f32| (coverage.clamp(0.0, 1.0) * 255.0).round() as u8;
    let (width, height) = mask.dimensions();
    GrayImage::from_fn(width, height, |x, y| Luma([to_byte(mask.get_pixel(x, y).0[0])])).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, Rgba, RgbaImage};
    use std::fs;

    #[test]
    fn masks_are_found_by_every_habit() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let picture = Path::new("left/a.jpg");
        assert_eq!(mask_beside(folder.path(), picture), MaskSource::Alpha);
        fs::create_dir_all(folder.path().join("mask/left")).expect("it is writable");
        fs::create_dir_all(folder.path().join("masks/left")).expect("it is writable");
        for name in ["mask/left/a.png", "masks/left/a.jpg", "masks/left/a.jpg.png"] {
            let path = folder.path().join(name);
            fs::write(&path, "").expect("it is writable");
            assert_eq!(mask_beside(folder.path(), picture), MaskSource::File(path));
        }
    }

    #[test]
    fn a_white_part_inside_the_object_is_of_the_object() {
        // A dark ring with a white hole, on white.
        let picture = RgbImage::from_fn(9, 9, |x, y| {
            let ring = (2..7).contains(&x) && (2..7).contains(&y) && (x, y) != (4, 4);
            Rgb(if ring { [90; 3] } else { [255; 3] })
        });
        let mask = off_background(&picture).expect("the ground is white");
        let covered: f32 = mask.as_raw().iter().sum();
        assert_eq!((covered, mask.get_pixel(4, 4).0), (25.0, [1.0]));
        assert_eq!(off_background(&RgbImage::from_pixel(3, 3, Rgb([90; 3]))), None);
    }

    #[test]
    fn opaque_pictures_have_no_alpha() {
        let rgba = |alpha| RgbaImage::from_pixel(2, 2, Rgba([1, 2, 3, alpha])).into();
        assert_eq!(alpha(&rgba(255)), None);
        assert_eq!(alpha(&rgba(51)).map(|mask| mask.get_pixel(0, 0).0[0]), Some(0.2));
        assert_eq!(alpha(&DynamicImage::new_rgb8(2, 2)), None);
    }
}
