//! Textured triangle meshes.

use nalgebra::Point3;

/// A triangle mesh in the canonical world frame, unless a reader says otherwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<Point3<f32>>,
    pub triangles: Vec<Triangle>,
    pub textures: Vec<image::RgbImage>,
}

/// A triangle and its material: `color`, times `textures[texture]` at the interpolated `uvs`.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub vertices: [u32; 3],
    /// Texture coordinates, v upwards as in OBJ; they repeat beyond [0, 1].
    pub uvs: [[f32; 2]; 3],
    /// Diffuse albedo, RGB in [0, 1].
    pub color: [f32; 3],
    pub texture: Option<u32>,
}
