//! PLY files with faces, as text or binary. Point clouds are in `formats/ply.rs`.

use std::{fs::File, io::BufReader, path::Path};

use ply_rs_bw::{
    parser::Parser,
    ply::{Property, PropertyAccess, PropertyAccessResult},
};

use super::{
    mesh::{GREY, Mesh, Triangle, checked_vertex, mean_color},
    mesh_file::Loaded,
    polygon::triangles,
};
use crate::{Error, Result};

/// Reads the `vertex` and `face` elements with their colours. Textures are left out, with a warning.
pub fn read_ply(path: &Path) -> Result<Loaded> {
    let refuse = |reason| Error::Mesh { path: path.into(), reason };
    let mut file = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let mut ply = Parser::<Element>::new().read_ply(&mut file).map_err(|error| {
        let words = error.to_string();
        refuse(words.split_whitespace().collect::<Vec<_>>().join(" "))
    })?;
    let mut take = |name: &str| ply.payload.shift_remove(name).unwrap_or_default();
    let mesh = mesh(&take("vertex"), &take("face")).map_err(refuse)?;
    mesh.validate().map_err(refuse)?;

    let textures = ply.header.comments.iter().filter_map(|text| text.strip_prefix("TextureFile"));
    let warnings = textures.map(|name| format!("texture {:?} is not read", name.trim())).collect();
    Ok(Loaded { mesh, warnings })
}

fn mesh(vertices: &[Element], faces: &[Element]) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    for (idx, vertex) in vertices.iter().enumerate() {
        let point = checked_vertex(vertex.position);
        mesh.vertices.push(point.map_err(|reason| format!("vertex {idx}: {reason}"))?);
    }
    for (idx, face) in faces.iter().enumerate() {
        let corners = &face.corners;
        if corners.len() < 3 {
            return Err(format!("face {idx} needs three corners, not {}", corners.len()));
        }
        if let Some(corner) = corners.iter().find(|corner| **corner as usize >= vertices.len()) {
            let n = vertices.len();
            return Err(format!("face {idx} has a corner {corner}, and there are {n} vertices"));
        }
        let position = |corner: u32| mesh.vertices[corner as usize];
        mesh.triangles.extend(triangles(corners, position).map(|corners| {
            let color = |corner: u32| vertices[corner as usize].color().unwrap_or(GREY);
            Triangle::plain(corners, face.color().unwrap_or_else(|| mean_color(corners.map(color))))
        }));
    }
    Ok(mesh)
}

/// A vertex or a face. Coordinates that the file leaves out stay NaN, which no vertex may be.
struct Element {
    position: [f32; 3],
    channels: [Option<f32>; 3],
    corners: Vec<u32>,
}

impl Element {
    /// RGB in [0, 1], if the file has all three.
    fn color(&self) -> Option<[f32; 3]> {
        let [red, green, blue] = self.channels;
        Some([red?, green?, blue?])
    }
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { position: [f32::NAN; 3], channels: [None; 3], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let known = match name {
            "x" => property.to_f32_lossy().map(|value| self.position[0] = value),
            "y" => property.to_f32_lossy().map(|value| self.position[1] = value),
            "z" => property.to_f32_lossy().map(|value| self.position[2] = value),
            "red" => share(&property).map(|value| self.channels[0] = Some(value)),
            "green" => share(&property).map(|value| self.channels[1] = Some(value)),
            "blue" => share(&property).map(|value| self.channels[2] = Some(value)),
            "vertex_indices" | "vertex_index" => {
                property.to_u32_list().map(|corners| self.corners = corners)
            }
            _ => return PropertyAccessResult::Ignored,
        };
        known.map_or(PropertyAccessResult::UnsupportedType, |()| PropertyAccessResult::Set)
    }
}

/// A colour channel: whole numbers are out of the largest of their type.
fn share(property: &Property) -> Option<f32> {
    let largest = match property {
        Property::UShort(_) => f32::from(u16::MAX),
        Property::Float(_) | Property::Double(_) => 1.0,
        _ => f32::from(u8::MAX),
    };
    property.to_f32_lossy().map(|value| (value / largest).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const VERTICES: &str = "property float x\nproperty float y\nproperty double z\n";
    const FACES: &str = "property list uchar int vertex_indices\n";

    /// A square of four vertices, then `faces`.
    fn square(face_header: &str, n_faces: usize, faces: &str) -> String {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{VERTICES}element face {n_faces}\n\
             {face_header}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n{faces}"
        )
    }

    fn read(bytes: &[u8]) -> Result<Loaded> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("model.ply");
        fs::write(&path, bytes).expect("writable");
        read_ply(&path)
    }

    #[track_caller]
    fn check_refused(text: &str, reason: &str) {
        let error = read(text.as_bytes()).expect_err("it is broken").to_string();
        assert!(error.contains("model.ply") && error.contains(reason), "{error}");
        assert!(!error.contains('\n'), "{error:?}");
    }

    #[test]
    fn polygons_become_fans() {
        let mesh = read(square(FACES, 1, "4 0 1 2 3\n").as_bytes()).expect("a square").mesh;
        let triangles: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.vertices).collect();
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_face_has_its_own_colour_or_the_mean_of_its_vertices() {
        let header =
            format!("{FACES}property uchar red\nproperty uchar green\nproperty uchar blue\n");
        let own = read(square(&header, 1, "3 0 1 2 255 51 0\n").as_bytes()).expect("a triangle");
        assert_eq!(own.mesh.triangles[0].color, [1.0, 0.2, 0.0]);

        let colors = "property float red\nproperty float green\nproperty float blue\n";
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\n{VERTICES}{colors}element face 1\n{FACES}\
             end_header\n0 0 0 1 0 0\n1 0 0 1 0.5 0\n0 1 0 1 1 0\n3 0 1 2\n"
        );
        let mean = read(text.as_bytes()).expect("a triangle").mesh;
        assert_eq!(mean.triangles[0].color, [1.0, 0.5, 0.0]);
    }

    #[test]
    fn big_endian_files_with_short_indices_are_read() {
        let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\n\
            property float y\nproperty float z\nelement face 1\n\
            property list uint8 uint16 vertex_index\nend_header\n"
            .to_vec();
        let corners = [[0.0_f32, 0., 0.], [2., 0., 0.], [0., 3., 0.]];
        bytes.extend(corners.iter().flatten().flat_map(|value| value.to_be_bytes()));
        bytes.extend([3, 0, 0, 0, 1, 0, 2]);
        let mesh = read(&bytes).expect("a triangle").mesh;
        assert_eq!(mesh.corners(&mesh.triangles[0]).map(<[f32; 3]>::from), corners);
    }

    #[test]
    fn a_texture_leaves_a_warning() {
        let text =
            square(FACES, 1, "3 0 1 2\n").replace("1.0\n", "1.0\ncomment TextureFile a.png\n");
        let warnings = read(text.as_bytes()).expect("a triangle").warnings;
        assert!(warnings[0].contains("a.png"), "{warnings:?}");
    }

    #[test]
    fn broken_files_are_refused() {
        check_refused("", "");
        check_refused("not a ply\n", "Line 1");
        check_refused(&square(FACES, 1, "3 0 1 x\n"), "Line 14");
        check_refused(&square(FACES, 1, "3 0 1\n"), "Line 14");
        check_refused(&square(FACES, 1, "3 0 1 -1\n"), "Line 14");
        check_refused(&square(FACES, 2, "3 0 1 2\n"), "Line 15");
        check_refused(&square(FACES, 1, "3 0 1 4\n"), "face 0 has a corner 4");
        check_refused(&square(FACES, 1, "2 0 1\n"), "face 0 needs three corners");
        check_refused(&square(FACES, 1, "3 1 1 1\n"), "no area");
        check_refused(&square(FACES, 0, ""), "no triangles");
        check_refused(
            &square("property list uchar float vertex_indices\n", 1, "3 0 1 2\n"),
            "vertex_indices",
        );
        let huge = square(FACES, 1, "3 0 1 2\n").replace("1 1 0\n", "1 1e30 0\n");
        check_refused(&huge, "vertex 2: coordinate");
        let flat = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n";
        check_refused(flat, "vertex 0: coordinate NaN");
    }
}
