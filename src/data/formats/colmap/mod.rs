//! COLMAP models, text or binary: `cameras`, `images` and, when written, `points3D`.
//!
//! Sparse points are not the object's surface; they are not read.

mod binary;
mod lenses;
#[cfg(test)]
mod tests;
mod text;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use nalgebra::Isometry3;

use super::{
    calibration::Calibration,
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{mask_beside, mask_in},
    pictures::unusable,
};
use crate::Result;

pub use text::write;

/// Where a model lies below the folder of a sequence.
const MODEL_FOLDERS: [&str; 5] = ["", "sparse/0", "sparse", "colmap/sparse/0", "colmap"];
/// Where pictures lie, from the folder of a sequence or from that of its model.
const PICTURE_FOLDERS: [&str; 4] = ["images", "", "../images", "../../images"];

/// How a model is written down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    Text,
    Binary,
}

#[derive(Debug, Default, PartialEq)]
struct Model {
    /// By their ids.
    cameras: BTreeMap<u32, Camera>,
    images: Vec<Image>,
}

#[derive(Clone, Debug, PartialEq)]
struct Camera {
    calibration: Calibration,
    size: [usize; 2],
}

#[derive(Clone, Debug, PartialEq)]
struct Image {
    /// Relative to the folder of the pictures.
    name: String,
    camera_id: u32,
    camera_from_world: Isometry3<f32>,
}

/// The folder of the model that belongs to a sequence. Binary comes first, as in COLMAP itself.
pub fn find_model(folder: &Path) -> Option<(PathBuf, Encoding)> {
    let candidates = MODEL_FOLDERS.map(|below| folder.join(below));
    let found = |encoding: Encoding| {
        move |model: &PathBuf| {
            let has = |name| encoding.file(model, name).is_file();
            (has("cameras") && has("images")).then(|| (model.clone(), encoding))
        }
    };
    candidates
        .iter()
        .find_map(|model| found(Encoding::Binary)(model).or_else(|| found(Encoding::Text)(model)))
}

/// Reads a model's images without opening them: their names, and `camera_from_world` of each.
pub fn read_poses(
    model_folder: &Path,
    encoding: Encoding,
) -> Result<Vec<(PathBuf, Isometry3<f32>)>> {
    let images = read_model(model_folder, encoding)?.images;
    Ok(images.into_iter().map(|image| (image.name.into(), image.camera_from_world)).collect())
}

/// Lists the images of a model.
pub(super) fn list(
    folder: &Path,
    model_folder: &Path,
    encoding: Encoding,
    hints: &SequenceHints,
) -> Result<Listing> {
    let [cameras_path, images_path] =
        ["cameras", "images"].map(|name| encoding.file(model_folder, name));
    hints.refuse_focal().map_err(|reason| unusable(&cameras_path, &reason))?;
    let model = read_model(model_folder, encoding)?;
    let Some(first) = model.images.first() else {
        return Err(unusable(&images_path, "it has no images"));
    };
    let below = PICTURE_FOLDERS.iter().find(|below| folder.join(below).join(&first.name).is_file());
    let below = Path::new(below.ok_or_else(|| {
        let reason = format!("there is no {} in {folder:?} or its images/", first.name);
        unusable(&images_path, &reason)
    })?);
    let mut shots = vec![];
    for image in &model.images {
        let Image { name, camera_id, camera_from_world } = image;
        let Some(Camera { calibration, size }) = model.cameras.get(camera_id) else {
            let reason = format!("{name} has camera {camera_id}, which cameras does not list");
            return Err(unusable(&images_path, &reason));
        };
        let mask = match &hints.masks {
            Some(masks) => mask_in(masks, name.as_ref()),
            // Masks lie beside the folder of the pictures, or in it where it is the sequence's own.
            None => mask_beside(&folder.join(below.parent().unwrap_or(below)), name.as_ref()),
        };
        shots.push(Shot {
            path: folder.join(below).join(name),
            name: below.join(name),
            upright: false,
            mask,
            calibration: *calibration,
            size: *size,
            camera_from_world: Some(*camera_from_world),
        });
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Listing { name, shots, ..Listing::default() })
}

fn read_model(folder: &Path, encoding: Encoding) -> Result<Model> {
    let [cameras, images] = ["cameras", "images"].map(|name| encoding.file(folder, name));
    match encoding {
        Encoding::Text => text::read(&cameras, &images),
        Encoding::Binary => binary::read(&cameras, &images),
    }
}

impl Encoding {
    fn file(self, model_folder: &Path, name: &str) -> PathBuf {
        model_folder.join(name).with_extension(match self {
            Self::Text => "txt",
            Self::Binary => "bin",
        })
    }
}
