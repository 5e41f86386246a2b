//! Base colours and their textures.

use std::collections::HashMap;

use gltf::{Accessor, Primitive, Semantic, texture::Info};
use image::RgbImage;

use super::{File, accessors::slice};
use crate::data::{mesh::GREY, mesh_file::decode_texture};

/// A base colour, in light rather than as shown, times a texture if there is one.
#[derive(Clone, Copy)]
pub struct Material {
    color: [f32; 3],
    pub texture: Option<u32>,
}

impl Material {
    /// The colour as shown: textures are stored so, and colours of our meshes are meant so.
    ///
    /// Products of light are products of what is shown, as long as sRGB is close to a power.
    pub fn tinted(&self, tint: Option<[f32; 3]>) -> [f32; 3] {
        let tint = tint.unwrap_or([1.0; 3]);
        std::array::from_fn(|c| srgb(self.color[c] * tint[c]))
    }
}

/// How a primitive looks; colours and texture coordinates, if any, are as many as vertices.
pub struct Look {
    pub material: Material,
    pub colors: Option<Vec<[f32; 3]>>,
    pub uvs: Option<Vec<[f32; 2]>>,
}

/// The materials of one file. What is broken becomes a warning.
pub struct Materials<'a> {
    pub textures: Vec<RgbImage>,
    pub warnings: Vec<String>,
    file: &'a File<'a>,
    /// Textures by the index of their picture; `None` where it could not be read.
    decoded: HashMap<usize, Option<u32>>,
}

impl<'a> Materials<'a> {
    pub fn new(file: &'a File<'a>) -> Self {
        Self { textures: Vec::new(), warnings: Vec::new(), file, decoded: HashMap::new() }
    }

    /// How a primitive of `n_vertices` looks.
    pub fn look(&mut self, primitive: &Primitive, n_vertices: usize) -> Look {
        let colors = self.attribute(primitive.get(&Semantic::Colors(0)), n_vertices);
        let material = primitive.material();
        let base = material.pbr_metallic_roughness();
        if material.index().is_none() {
            let color = if colors.is_some() { [1.0; 3] } else { GREY.map(light) };
            return Look { material: Material { color, texture: None }, colors, uvs: None };
        }
        let [red, green, blue, _] = base.base_color_factor();
        let mut look = Look {
            material: Material { color: [red, green, blue], texture: None },
            colors,
            uvs: None,
        };
        if let Some(info) = base.base_color_texture() {
            let accessor = primitive.get(&Semantic::TexCoords(info.tex_coord()));
            look.uvs = self.attribute(accessor, n_vertices);
            look.material.texture = look.uvs.as_ref().and_then(|_| self.texture(&info));
        }
        look
    }

    fn attribute<const N: usize>(
        &mut self,
        accessor: Option<Accessor>,
        n_vertices: usize,
    ) -> Option<Vec<[f32; N]>> {
        let rows = self.file.rows(&accessor?);
        let rows = rows.and_then(|rows| match rows.len() == n_vertices {
            true => Ok(rows),
            false => Err(format!("{} values for {n_vertices} vertices", rows.len())),
        });
        rows.map_err(|reason| self.warnings.push(reason)).ok()
    }

    /// The place of a texture among `textures`; each picture is decoded once.
    fn texture(&mut self, info: &Info) -> Option<u32> {
        let picture = info.texture().source();
        if let Some(&texture) = self.decoded.get(&picture.index()) {
            return texture;
        }
        let image = self.picture_bytes(picture.index()).and_then(|bytes| decode_texture(&bytes));
        let texture = match image {
            Ok(image) => {
                self.textures.push(image);
                Some(self.textures.len() as u32 - 1)
            }
            Err(reason) => {
                self.warnings.push(format!("texture {}: {reason}", picture.index()));
                None
            }
        };
        self.decoded.insert(picture.index(), texture);
        texture
    }

    fn picture_bytes(&self, picture_idx: usize) -> Result<Vec<u8>, String> {
        // `Image::source` would panic where the document leaves out the type.
        let document = &self.file.gltf.document;
        let picture = &document.as_json().images[picture_idx];
        if let Some(uri) = &picture.uri {
            return self.file.fetch(uri);
        }
        let view = picture.buffer_view.and_then(|view| document.views().nth(view.value()));
        let view = view.ok_or("it has neither a URI nor a buffer")?;
        let buffer = self.file.buffers.get(view.buffer().index());
        let bytes = buffer.and_then(|buffer| slice(buffer, view.offset(), view.length()));
        bytes.map(<[u8]>::to_vec).ok_or("it leaves its buffer".into())
    }
}

/// sRGB as shown, of linear light.
fn srgb(light: f32) -> f32 {
    let light = if light > 0.0 { light.min(1.0) } else { 0.0 }; // Also where it is NaN.
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb`].
fn light(shown: f32) -> f32 {
    if shown <= 0.040_45 { shown / 12.92 } else { ((shown + 0.055) / 1.055).powf(2.4) }
}
