//! Diffuse materials from MTL files, and their textures.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use super::numbers;
use crate::data::{
    mesh::GREY,
    mesh_file::{Textures, resolve_inside},
};

/// A diffuse colour, times a texture if there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub color: [f32; 3],
    pub texture: Option<u32>,
}

impl Default for Material {
    fn default() -> Self {
        Self { color: GREY, texture: None }
    }
}

/// A material as its file has it.
#[derive(Clone, Copy, Default)]
struct Entry {
    color: Option<[f32; 3]>,
    texture: Option<u32>,
}

/// The materials of one model. It reads nothing outside of the model's folder.
pub struct Library {
    pub textures: Textures,
    model_folder: PathBuf,
    /// Where the OBJ file lies, below `model_folder`.
    obj_folder: PathBuf,
    materials: HashMap<String, Entry>,
}

impl Library {
    pub fn new(model_folder: &Path, obj_folder: &Path) -> Self {
        Self {
            textures: Textures::new(model_folder),
            model_folder: model_folder.into(),
            obj_folder: obj_folder.strip_prefix(model_folder).unwrap_or(Path::new("")).into(),
            materials: HashMap::new(),
        }
    }

    /// Adds the materials of an MTL file, named relative to the OBJ file, or of several.
    pub fn read(&mut self, names: &str) {
        // Spaces stand between names, and in names.
        let one = resolve_inside(&self.obj_folder, names)
            .is_some_and(|path| self.model_folder.join(path).is_file());
        if one || !names.contains(char::is_whitespace) {
            self.read_file(names);
        } else {
            names.split_whitespace().for_each(|name| self.read_file(name));
        }
    }

    fn read_file(&mut self, name: &str) {
        let Some(path) = resolve_inside(&self.obj_folder, name) else {
            return self.warn(format!("materials {name:?} lie outside of the model's folder"));
        };
        let bytes = match fs::read(self.model_folder.join(&path)) {
            Ok(bytes) => bytes,
            Err(error) => return self.warn(format!("materials {name:?}: {error}")),
        };
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let mut material_name = String::new();
        for line in String::from_utf8_lossy(&bytes).lines().map(str::trim) {
            let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            match keyword {
                "newmtl" => {
                    material_name = rest.trim().to_owned();
                    self.materials.insert(material_name.clone(), Entry::default());
                }
                "Kd" => self.set_color(&material_name, rest),
                "map_Kd" => self.set_texture(&material_name, rest, &folder),
                _ => {}
            }
        }
    }

    /// A material by name; the plain one where there is none of that name.
    pub fn material(&mut self, name: &str) -> Material {
        if !self.materials.contains_key(name) {
            self.warn(format!("there is no material {name:?}"));
        }
        let Entry { color, texture } = *self.materials.entry(name.to_owned()).or_default();
        // A texture without a colour is meant to be seen as it is.
        let plain = if texture.is_some() { [1.0; 3] } else { GREY };
        Material { color: color.unwrap_or(plain), texture }
    }

    fn set_color(&mut self, material_name: &str, words: &str) {
        match numbers::<3>(words) {
            Ok(color) if color.iter().all(|value| value.is_finite()) => {
                let color = color.map(|value| value.clamp(0.0, 1.0));
                self.materials.entry(material_name.to_owned()).or_default().color = Some(color);
            }
            _ => self.warn(format!("material {material_name:?} has no usable colour: {words:?}")),
        }
    }

    fn set_texture(&mut self, material_name: &str, words: &str, folder: &Path) {
        // Options such as `-s 1 1 1` stand before the name.
        let options = words.trim_start().starts_with('-');
        let name = if options { words.split_whitespace().next_back() } else { Some(words.trim()) };
        let texture = self.textures.read(folder, name.unwrap_or(""));
        self.materials.entry(material_name.to_owned()).or_default().texture = texture;
    }

    fn warn(&mut self, warning: String) {
        self.textures.warnings.push(warning);
    }
}
