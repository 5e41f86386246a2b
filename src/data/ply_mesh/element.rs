//! What a line of a PLY file holds, be it a vertex or a face.

use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use crate::data::mesh_file::usable_uv;

/// A vertex or a face. Coordinates that the file leaves out stay NaN, which no vertex may be.
pub struct Element {
    pub position: [f32; 3],
    pub corners: Vec<u32>,
    /// Which of the file's textures a face shows; `None` for none.
    pub texture: Option<usize>,
    channels: [Option<f32>; 3],
    uv: [Option<f32>; 2],
    /// u and v of each corner in turn.
    corner_uvs: Vec<f32>,
}

impl Element {
    /// RGB in [0, 1], if the file has all three.
    pub fn color(&self) -> Option<[f32; 3]> {
        let [red, green, blue] = self.channels;
        Some([red?, green?, blue?])
    }

    /// A vertex's texture coordinates.
    pub fn uv(&self) -> Option<[f32; 2]> {
        let [u, v] = self.uv;
        Some(usable_uv([u?, v?]))
    }

    /// The texture coordinates of a face's corner.
    pub fn corner_uv(&self, corner_idx: usize) -> Option<[f32; 2]> {
        let (uvs, _) = self.corner_uvs.as_chunks::<2>();
        uvs.get(corner_idx).copied().map(usable_uv)
    }
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self {
            position: [f32::NAN; 3],
            corners: Vec::new(),
            texture: Some(0),
            channels: [None; 3],
            uv: [None; 2],
            corner_uvs: Vec::new(),
        }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let known = match name {
            "x" => property.to_f32_lossy().map(|value| self.position[0] = value),
            "y" => property.to_f32_lossy().map(|value| self.position[1] = value),
            "z" => property.to_f32_lossy().map(|value| self.position[2] = value),
            "vertex_indices" | "vertex_index" => {
                property.to_u32_list().map(|corners| self.corners = corners)
            }
            "red" => share(&property).map(|value| self.channels[0] = Some(value)),
            "green" => share(&property).map(|value| self.channels[1] = Some(value)),
            "blue" => share(&property).map(|value| self.channels[2] = Some(value)),
            _ => {
                self.set_texture(name, property);
                return PropertyAccessResult::Ignored;
            }
        };
        known.map_or(PropertyAccessResult::UnsupportedType, |()| PropertyAccessResult::Set)
    }
}

impl Element {
    /// Texture coordinates under the names of Blender (s, t), of others (u, v) and of MeshLab.
    fn set_texture(&mut self, name: &str, property: Property) {
        match (name, property) {
            ("s" | "u" | "texture_u", property) => self.uv[0] = property.to_f32_lossy(),
            ("t" | "v" | "texture_v", property) => self.uv[1] = property.to_f32_lossy(),
            ("texcoord", Property::ListFloat(uvs)) => self.corner_uvs = uvs,
            ("texcoord", Property::ListDouble(uvs)) => {
                self.corner_uvs = uvs.into_iter().map(|value| value as f32).collect();
            }
            // MeshLab writes -1 where a face has none.
            ("texnumber", property) => {
                let number = property.to_f32_lossy().filter(|number| *number >= 0.0);
                self.texture = number.map(|number| number as usize);
            }
            _ => {}
        }
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
