//! Draws a mesh in a scene: colour, coverage and depth of every pixel.
//!
//! A z-buffer with 2 × 2 samples a pixel decides which face each sample sees; each face is then
//! shaded once a pixel, in the middle of its samples. Colours are Lambertian and textures filtered,
//! so a surface point keeps its colour from frame to frame, as the photometric loss supposes.

mod face;
mod shading;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Point3};

use super::{
    ColorImage, ScalarImage,
    lighting::Scene,
    mesh::{Mesh, Triangle},
    texture::Texture,
};
use crate::camera::Intrinsics;
use face::{Face, Vertex};
use shading::View;

/// Samples along each side of a pixel.
const SAMPLES: u32 = 2;
/// The face index of a sample that sees none.
const NO_FACE: u32 = u32::MAX;

/// What a camera sees, three pictures of one size.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The object in its surroundings.
    pub color: ColorImage,
    /// How much of each pixel the object covers, in quarters.
    pub coverage: ScalarImage,
    /// Camera z of the object's nearest surface in the pixel, in world units; 0 where it is not.
    pub depth: ScalarImage,
}

/// Draws one view. To draw several of one mesh, keep a [`Renderer`]: it prepares textures once.
pub fn render(
    mesh: &Mesh,
    scene: &Scene,
    camera_from_world: &Isometry3<f32>,
    intrinsics: &Intrinsics,
    size: [usize; 2],
) -> Rendering {
    Renderer::new(mesh).render(scene, camera_from_world, intrinsics, size)
}

/// A mesh whose textures are ready for drawing.
#[derive(Clone, Debug)]
pub struct Renderer<'a> {
    mesh: &'a Mesh,
    textures: Vec<Texture>,
}

impl<'a> Renderer<'a> {
    pub fn new(mesh: &'a Mesh) -> Self {
        Self { mesh, textures: mesh.textures.iter().cloned().map(Texture::new).collect() }
    }

    /// Draws a view of `size` = `[width, height]` pixels. Whatever is nearer than a thousandth of
    /// the object is cut away.
    pub fn render(
        &self,
        scene: &Scene,
        camera_from_world: &Isometry3<f32>,
        intrinsics: &Intrinsics,
        size: [usize; 2],
    ) -> Rendering {
        let vertices: Vec<_> = self
            .mesh
            .vertices
            .iter()
            .map(|vertex| Vertex::new(vertex, camera_from_world, intrinsics))
            .collect();
        let (faces, samples) = draw(&self.mesh.triangles, &vertices, size);
        let view = View {
            renderer: self,
            scene,
            world_from_camera: camera_from_world.rotation.inverse().to_rotation_matrix(),
            eye: camera_from_world.inverse_transform_point(&Point3::origin()),
            intrinsics,
            faces: &faces,
        };
        view.resolve(&samples, size)
    }
}

/// The nearest face at a sample so far.
#[derive(Clone, Copy)]
struct Sample {
    inverse_depth: f32,
    face_idx: u32,
}

/// The z-buffer, row by row, and the faces that it refers to.
fn draw<'a>(
    triangles: &'a [Triangle],
    vertices: &[Vertex],
    [width, height]: [usize; 2],
) -> (Vec<Face<'a>>, Vec<Sample>) {
    let n_samples @ [columns, rows] = [width, height].map(|side| side as u32 * SAMPLES);
    let empty = Sample { inverse_depth: 0.0, face_idx: NO_FACE };
    let mut samples = vec![empty; columns as usize * rows as usize];
    let mut faces = vec![];
    for triangle in triangles {
        let Some((face, [across, down])) = Face::new(triangle, vertices, n_samples) else {
            continue;
        };
        let face_idx = faces.len() as u32;
        let mut seen = false;
        for y in down {
            let first = y as usize * columns as usize + across.start as usize;
            for (x, sample) in across.clone().zip(&mut samples[first..]) {
                if let Some(inverse_depth) = face.inverse_depth_at(sample_pixel([x, y]))
                    && inverse_depth > sample.inverse_depth
                {
                    *sample = Sample { inverse_depth, face_idx };
                    seen = true;
                }
            }
        }
        if seen {
            faces.push(face);
        }
    }
    (faces, samples)
}

/// Where a sample lies, in pixels.
fn sample_pixel(sample: [u32; 2]) -> [f32; 2] {
    sample.map(|index| (index as f32 + 0.5) / SAMPLES as f32)
}
