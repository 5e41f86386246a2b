//! Mesh files of any format, in the frame and the units of their authors.
//!
//! Shape is strict: a file that does not parse is refused, with its line where it has lines.
//! Appearance is lenient: a missing material or texture leaves a plain colour and a warning.

mod textures;

use std::{
    fs,
    io::Cursor,
    path::{Component, Path, PathBuf},
};

use image::{ImageReader, RgbImage};
use sha2::{Digest, Sha256};

pub(super) use self::textures::Textures;
use super::{
    glb::{read_gltf, read_gltf_buffers},
    mesh::Mesh,
    obj::read_obj,
    off::read_off,
    ply_mesh::read_ply,
};
use crate::{Error, Result};

/// Extensions of the formats that [`read_mesh`] reads.
pub const EXTENSIONS: [&str; 5] = ["obj", "glb", "gltf", "ply", "off"];
/// Largest side of a texture that is decoded, in pixels.
const LARGEST_TEXTURE: u32 = 16_384;
/// Beyond so many repeats of a texture, its coordinates are taken for noise.
const LARGEST_UV: f32 = 1e4;

/// A mesh, and what its file promised but did not deliver.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub mesh: Mesh,
    pub warnings: Vec<String>,
}

/// Reads a mesh, in the format that its extension says.
pub fn read_mesh(path: &Path) -> Result<Loaded> {
    match extension(path).as_str() {
        "obj" => read_obj(path),
        "glb" | "gltf" => read_gltf(path),
        "ply" => read_ply(path),
        "off" => read_off(path),
        other => {
            let reason =
                format!("its extension is {other:?}, not one of {}", EXTENSIONS.join(", "));
            Err(Error::Mesh { path: path.into(), reason })
        }
    }
}

/// Whether [`read_mesh`] knows the format.
pub fn is_mesh_file(path: &Path) -> bool {
    EXTENSIONS.contains(&extension(path).as_str())
}

/// A hash of all bytes that the shape comes from: materials and textures do not count.
pub fn shape_hash(path: &Path) -> Result<[u8; 32]> {
    let mut hash = Sha256::new_with_prefix(fs::read(path).map_err(Error::io(path))?);
    if extension(path) == "gltf" {
        read_gltf_buffers(path)?.iter().for_each(|buffer| hash.update(buffer));
    }
    Ok(hash.finalize().into())
}

/// Follows a relative path from `folder`, which is itself relative to the model's folder, without
/// leaving the latter.
pub(super) fn resolve_inside(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.replace('\\', "/"); // Exporters on Windows write these.
    let mut resolved = folder.to_owned();
    for component in Path::new(&name).components() {
        match component {
            Component::Normal(part) => resolved.push(part),
            Component::ParentDir => resolved.pop().then_some(())?,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(resolved)
}

/// A PNG or JPEG picture.
pub(super) fn decode_texture(bytes: &[u8]) -> Result<RgbImage, String> {
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_TEXTURE);
    limits.max_image_height = Some(LARGEST_TEXTURE);
    let decode = || {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        reader.limits(limits);
        Ok(reader.decode()?.to_rgb8())
    };
    decode().map_err(|error: image::ImageError| error.to_string())
}

/// Texture coordinates, or the origin: unusable ones spoil the look of a triangle, not its shape.
pub(super) fn usable_uv(uv: [f32; 2]) -> [f32; 2] {
    if uv.iter().all(|x| x.abs() < LARGEST_UV) { uv } else { [0.0; 2] }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

#[cfg(test)]
mod tests;
