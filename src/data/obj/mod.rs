//! Wavefront OBJ files, as far as shape and diffuse colour go.

mod materials;

use std::{fs, path::Path};

use self::materials::{Library, Material};
use super::{
    mesh::{Mesh, Triangle, checked_vertex},
    mesh_file::{Loaded, usable_uv},
    polygon,
};
use crate::{Error, Result};

/// Reads a mesh in the frame of its file. Lines and points are left out.
///
/// Materials and textures are read from the model's folder only: the file's own, or the one above
/// when that is called `models`, as in ShapeNetCore v2.
pub fn read_obj(path: &Path) -> Result<Loaded> {
    let bytes = fs::read(path).map_err(Error::io(path))?;
    let refuse = |reason| Error::Mesh { path: path.into(), reason };

    let mut reader = Reader::new(path);
    // Only names, comments and a byte order mark can be anything but ASCII.
    let text = String::from_utf8_lossy(&bytes);
    for (idx, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        reader.read_line(line).map_err(|reason| refuse(format!("line {}: {reason}", idx + 1)))?;
    }
    let Reader { mut mesh, library, .. } = reader;
    mesh.textures = library.textures.images;
    mesh.validate().map_err(refuse)?;
    Ok(Loaded { mesh, warnings: library.textures.warnings })
}

struct Reader {
    mesh: Mesh,
    texture_coordinates: Vec<[f32; 2]>,
    library: Library,
    material: Material,
}

/// A corner of a face: a vertex, and texture coordinates where it has them.
#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    uv: Option<[f32; 2]>,
}

impl Reader {
    fn new(path: &Path) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        let model_folder = match folder.file_name() {
            Some(name) if name == "models" => folder.parent().unwrap_or(folder),
            _ => folder,
        };
        Self {
            mesh: Mesh::default(),
            texture_coordinates: Vec::new(),
            library: Library::new(model_folder, folder),
            material: Material::default(),
        }
    }

    fn read_line(&mut self, line: &str) -> Result<(), String> {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "v" => self.mesh.vertices.push(checked_vertex(numbers(rest)?)?),
            "vt" => {
                self.texture_coordinates.push(numbers(rest).map(usable_uv).unwrap_or_default());
            }
            "f" => self.read_face(rest)?,
            "mtllib" => self.library.read(rest.trim()),
            "usemtl" => self.material = self.library.material(rest.trim()),
            _ => {} // Normals, groups, lines, points, curves and comments.
        }
        Ok(())
    }

    fn read_face(&mut self, words: &str) -> Result<(), String> {
        let corners: Vec<_> =
            words.split_whitespace().map(|word| self.corner(word)).collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            return Err(format!("a face needs three corners, not {}", corners.len()));
        }
        let Material { color, texture } = self.material;
        let Mesh { vertices, triangles, .. } = &mut self.mesh;
        let position = |corner: Corner| vertices[corner.vertex as usize];
        triangles.extend(polygon::triangles(&corners, position).map(|corners| {
            let textured = corners.iter().all(|corner| corner.uv.is_some());
            Triangle {
                vertices: corners.map(|corner| corner.vertex),
                uvs: corners.map(|corner| corner.uv.unwrap_or_default()),
                color,
                texture: texture.filter(|_| textured),
            }
        }));
        Ok(())
    }

    /// Reads `vertex`, `vertex/uv`, `vertex/uv/normal` or `vertex//normal`.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut indices = word.split('/');
        let vertex = resolve(indices.next().unwrap_or(""), self.mesh.vertices.len())?;
        let uv = match indices.next() {
            None | Some("") => None,
            Some(index) => {
                let uv_idx = resolve(index, self.texture_coordinates.len())?;
                Some(self.texture_coordinates[uv_idx])
            }
        };
        Ok(Corner { vertex: vertex as u32, uv })
    }
}

/// The first numbers of a line; what follows them (weights, colours) has no use here.
fn numbers<const N: usize>(words: &str) -> Result<[f32; N], String> {
    let mut parsed = words.split_whitespace().map_while(|word| word.parse().ok());
    let mut values = [0.0; N];
    for value in &mut values {
        *value = parsed.next().ok_or_else(|| format!("expected {N} numbers in {words:?}"))?;
    }
    Ok(values)
}

/// Turns an index that counts from 1, or back from the end if negative, into a position.
fn resolve(index: &str, len: usize) -> Result<usize, String> {
    let number: i64 = index.parse().map_err(|_| format!("{index:?} is not an index"))?;
    let position = if number < 0 { number.checked_add(len as i64) } else { number.checked_sub(1) };
    position
        .and_then(|position| usize::try_from(position).ok())
        .filter(|&position| position < len)
        .ok_or_else(|| format!("index {index} is outside of the {len} that precede it"))
}

#[cfg(test)]
mod tests;
