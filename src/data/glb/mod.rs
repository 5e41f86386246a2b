//! glTF 2.0: one binary file (.glb), or JSON with its buffers and pictures beside it (.gltf).
//!
//! The `gltf` crate checks the document; bytes are read here, for it trusts the numbers in there.

mod accessors;
mod materials;
#[cfg(test)]
mod tests;

use std::{fs, path::Path};

use gltf::{Document, Gltf, Node, Primitive, Semantic, buffer, mesh::Mode};
use nalgebra::{Matrix4, Point3};

use self::materials::Materials;
use super::{
    mesh::{Mesh, Triangle, checked_vertex, mean_color},
    mesh_file::{Loaded, resolve_inside, usable_uv},
};
use crate::{Error, Result};

/// Reads the default scene in its world frame, at rest: without morphs, skins and animations.
///
/// Points and lines are left out. Colours come from the base colour, its texture and the vertices.
pub fn read_gltf(path: &Path) -> Result<Loaded> {
    let refuse = |reason| Error::Mesh { path: path.into(), reason };
    let bytes = fs::read(path).map_err(Error::io(path))?;
    let file = File::parse(&bytes, path).map_err(refuse)?;
    let mut reader =
        Reader { mesh: Mesh::default(), materials: Materials::new(&file), file: &file };
    reader.read_scene().map_err(refuse)?;

    let Reader { mut mesh, materials: Materials { textures, warnings, .. }, .. } = reader;
    mesh.textures = textures;
    mesh.validate().map_err(refuse)?;
    Ok(Loaded { mesh, warnings })
}

/// The bytes of all buffers.
pub fn read_gltf_buffers(path: &Path) -> Result<Vec<Vec<u8>>> {
    let bytes = fs::read(path).map_err(Error::io(path))?;
    let file = File::parse(&bytes, path);
    Ok(file.map_err(|reason| Error::Mesh { path: path.into(), reason })?.buffers)
}

/// A document and its buffers.
struct File<'a> {
    gltf: Gltf,
    buffers: Vec<Vec<u8>>,
    /// Where everything else lies that the document names.
    folder: &'a Path,
}

impl<'a> File<'a> {
    fn parse(bytes: &[u8], path: &'a Path) -> Result<Self, String> {
        // The crate subtracts the header's twelve bytes from the length that the header states.
        let stated = bytes.get(8..12).and_then(|bytes| bytes.try_into().ok());
        if bytes.starts_with(b"glTF") && stated.map_or(0, u32::from_le_bytes) < 12 {
            return Err("its header is broken".into());
        }
        let Gltf { document, blob } =
            Gltf::from_slice_without_validation(bytes).map_err(|error| error.to_string())?;
        let root = document.into_json();
        // The crate's validation looks up positions before it checks that they are there.
        let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let mut accessors = primitives.flat_map(|primitive| primitive.attributes.values());
        if accessors.any(|accessor| accessor.value() >= root.accessors.len()) {
            return Err("a primitive names an accessor that does not exist".into());
        }
        let document = Document::from_json(root).map_err(|error| error.to_string())?;
        let gltf = Gltf { document, blob };
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut file = Self { gltf, buffers: Vec::new(), folder };
        for buffer in file.gltf.buffers() {
            let bytes = match buffer.source() {
                buffer::Source::Uri(uri) => file.fetch(uri)?,
                buffer::Source::Bin => file.gltf.blob.clone().ok_or("it has no binary part")?,
            };
            file.buffers.push(bytes);
        }
        Ok(file)
    }

    /// What lies at a URI: data within it, or a file in the document's folder.
    fn fetch(&self, uri: &str) -> Result<Vec<u8>, String> {
        if uri.starts_with("data:") {
            let data = buffer::Data::from_source(buffer::Source::Uri(uri), None);
            return Ok(data.map_err(|error| format!("a data URI: {error}"))?.0);
        }
        let path = resolve_inside(Path::new(""), &percent_decoded(uri))
            .ok_or_else(|| format!("{uri:?} lies outside of the model's folder"))?;
        fs::read(self.folder.join(path)).map_err(|error| format!("{uri:?}: {error}"))
    }
}

struct Reader<'a> {
    file: &'a File<'a>,
    mesh: Mesh,
    materials: Materials<'a>,
}

impl Reader<'_> {
    fn read_scene(&mut self) -> Result<(), String> {
        let gltf = &self.file.gltf;
        let scene = gltf.default_scene().or(gltf.scenes().next()).ok_or("it has no scene")?;
        let mut visited = vec![false; gltf.nodes().len()];
        let mut to_visit: Vec<(Node, Matrix4<f32>)> =
            scene.nodes().map(|node| (node, Matrix4::identity())).collect();
        while let Some((node, world_from_parent)) = to_visit.pop() {
            if std::mem::replace(&mut visited[node.index()], true) {
                return Err(format!("node {} is reached twice", node.index()));
            }
            let world_from_node = world_from_parent * Matrix4::from(node.transform().matrix());
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                self.read_primitive(&primitive, &world_from_node).map_err(|reason| {
                    format!("node {}, primitive {}: {reason}", node.index(), primitive.index())
                })?;
            }
            to_visit.extend(node.children().map(|child| (child, world_from_node)));
        }
        Ok(())
    }

    fn read_primitive(
        &mut self,
        primitive: &Primitive,
        world_from_node: &Matrix4<f32>,
    ) -> Result<(), String> {
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip)
        {
            return Ok(());
        }
        let positions = primitive.get(&Semantic::Positions).ok_or("it has no positions")?;
        let positions: Vec<[f32; 3]> = self.file.rows(&positions)?;
        let corners = match primitive.indices() {
            Some(indices) => self.file.indices(&indices)?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(corner) = corners.iter().find(|corner| **corner as usize >= positions.len()) {
            return Err(format!("index {corner} is not below {}", positions.len()));
        }

        let look = self.materials.look(primitive, positions.len());
        let first = self.mesh.vertices.len() as u32;
        for position in positions {
            let point = world_from_node.transform_point(&Point3::from(position));
            self.mesh.vertices.push(checked_vertex(point.into())?);
        }
        self.mesh.triangles.extend(triangles(primitive.mode(), &corners).into_iter().map(
            |corners| {
                let corner_idx = corners.map(|corner| corner as usize);
                let tint =
                    look.colors.as_ref().map(|colors| mean_color(corner_idx.map(|i| colors[i])));
                let uvs = look.uvs.as_ref().map(|uvs| corner_idx.map(|i| uvs[i]));
                Triangle {
                    vertices: corners.map(|corner| first + corner),
                    // There, v goes down.
                    uvs: uvs.map_or([[0.0; 2]; 3], |uvs| uvs.map(|[u, v]| usable_uv([u, 1.0 - v]))),
                    color: look.material.tinted(tint),
                    texture: look.material.texture,
                }
            },
        ));
        Ok(())
    }
}

/// The triangles of a list, a strip or a fan.
fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
        // Every other triangle of a strip is wound the other way round.
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
        Mode::TriangleFan => super::polygon::fan(corners).collect(),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    }
}

/// Replaces `%20` and its like.
fn percent_decoded(uri: &str) -> String {
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let escaped = part.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(escaped.unwrap_or(b'%'));
        bytes.extend(&part.as_bytes()[if escaped.is_some() { 2 } else { 0 }..]);
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
