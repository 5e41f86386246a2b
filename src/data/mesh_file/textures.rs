//! Texture files that a mesh file names.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use image::RgbImage;

use super::{decode_texture, resolve_inside};

/// The textures of one model, each decoded once. It reads nothing outside of the model's folder.
pub struct Textures {
    pub images: Vec<RgbImage>,
    /// What was named and could not be had.
    pub warnings: Vec<String>,
    model_folder: PathBuf,
    /// By path below `model_folder`; `None` where they could not be read.
    decoded: HashMap<PathBuf, Option<u32>>,
}

impl Textures {
    pub fn new(model_folder: &Path) -> Self {
        Self {
            images: Vec::new(),
            warnings: Vec::new(),
            model_folder: model_folder.into(),
            decoded: HashMap::new(),
        }
    }

    /// The place among `images` of a file that is named in `folder`, itself below the model's.
    pub fn read(&mut self, folder: &Path, name: &str) -> Option<u32> {
        let Some(path) = resolve_inside(folder, name) else {
            self.warnings.push(format!("texture {name:?} lies outside of the model's folder"));
            return None;
        };
        if let Some(&texture) = self.decoded.get(&path) {
            return texture;
        }
        let bytes = fs::read(self.model_folder.join(&path)).map_err(|error| error.to_string());
        let texture = match bytes.and_then(|bytes| decode_texture(&bytes)) {
            Ok(image) => {
                self.images.push(image);
                Some(self.images.len() as u32 - 1)
            }
            Err(reason) => {
                self.warnings.push(format!("texture {name:?}: {reason}"));
                None
            }
        };
        self.decoded.insert(path, texture);
        texture
    }
}
