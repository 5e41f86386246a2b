//! PLY files with faces, as text or binary. Point clouds are in `formats/ply.rs`.

mod element;

use std::{fs::File, io::BufReader, path::Path};

use ply_rs_bw::parser::Parser;

use self::element::Element;
use super::{
    mesh::{GREY, Mesh, Triangle, checked_vertex, mean_color},
    mesh_file::{Loaded, Textures},
    polygon::triangles,
};
use crate::{Error, Result};

/// Reads the `vertex` and `face` elements with their colours, and the textures that comments name as
/// MeshLab does: `comment TextureFile NAME`, in the folder of the file.
pub fn read_ply(path: &Path) -> Result<Loaded> {
    let refuse = |reason| Error::Mesh { path: path.into(), reason };
    let mut file = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let mut ply = Parser::<Element>::new().read_ply(&mut file).map_err(|error| {
        let words = error.to_string();
        refuse(words.split_whitespace().collect::<Vec<_>>().join(" "))
    })?;
    let mut take = |name: &str| ply.payload.shift_remove(name).unwrap_or_default();
    let (vertices, faces) = (take("vertex"), take("face"));

    let mut files = Textures::new(path.parent().unwrap_or(Path::new("")));
    let names = ply.header.comments.iter().filter_map(|text| text.strip_prefix("TextureFile"));
    let textures: Vec<_> = names.map(|name| files.read(Path::new(""), name.trim())).collect();
    let mut mesh = mesh(&vertices, &faces, &textures).map_err(refuse)?;
    if !files.images.is_empty() && mesh.triangles.iter().all(|t| t.texture.is_none()) {
        files.warnings.push("it names a texture and says for no face where that lies".into());
    }
    mesh.textures = files.images;
    mesh.validate().map_err(refuse)?;
    Ok(Loaded { mesh, warnings: files.warnings })
}

/// A corner of a face: a vertex, and texture coordinates where it has them.
#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    uv: Option<[f32; 2]>,
}

/// `textures` are in the file's order; `None` where they could not be read.
fn mesh(vertices: &[Element], faces: &[Element], textures: &[Option<u32>]) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    for (idx, vertex) in vertices.iter().enumerate() {
        let point = checked_vertex(vertex.position);
        mesh.vertices.push(point.map_err(|reason| format!("vertex {idx}: {reason}"))?);
    }
    for (idx, face) in faces.iter().enumerate() {
        let corners = corners(face, vertices).map_err(|reason| format!("face {idx} {reason}"))?;
        let named = face.texture.and_then(|number| *textures.get(number)?);
        let position = |corner: Corner| mesh.vertices[corner.vertex as usize];
        mesh.triangles.extend(triangles(&corners, position).map(|corners| {
            let texture = named.filter(|_| corners.iter().all(|corner| corner.uv.is_some()));
            Triangle {
                vertices: corners.map(|corner| corner.vertex),
                uvs: corners.map(|corner| corner.uv.unwrap_or_default()),
                // Whoever wrote a texture as well meant that to be seen as it is.
                color: if texture.is_some() { [1.0; 3] } else { color(face, vertices, corners) },
                texture,
            }
        }));
    }
    Ok(mesh)
}

/// The corners of a face; its own texture coordinates come before those of the vertices.
fn corners(face: &Element, vertices: &[Element]) -> Result<Vec<Corner>, String> {
    if face.corners.len() < 3 {
        return Err(format!("needs three corners, not {}", face.corners.len()));
    }
    let corner = |(idx, &vertex): (usize, &u32)| {
        let n = vertices.len();
        let at = vertices.get(vertex as usize);
        let at = at.ok_or_else(|| format!("has a corner {vertex}, and there are {n} vertices"))?;
        Ok(Corner { vertex, uv: face.corner_uv(idx).or(at.uv()) })
    };
    face.corners.iter().enumerate().map(corner).collect()
}

/// The face's colour, or the mean of its vertices'.
fn color(face: &Element, vertices: &[Element], corners: [Corner; 3]) -> [f32; 3] {
    let of = |corner: Corner| vertices[corner.vertex as usize].color().unwrap_or(GREY);
    face.color().unwrap_or_else(|| mean_color(corners.map(of)))
}

#[cfg(test)]
mod tests;
