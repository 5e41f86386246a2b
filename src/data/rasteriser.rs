//! Draws a mesh in a scene: colour, coverage and depth of every pixel.
//!
//! A z-buffer with 2 × 2 samples a pixel decides which face each sample sees; each face is then
//! shaded once a pixel, in the middle of its samples. Colours are Lambertian and textures filtered,
//! so a surface point keeps its colour from frame to frame, as the photometric loss supposes.
//!
//! Most triangles of a detailed mesh are smaller than a pixel: what is done for each of them is the
//! cost of a picture, so those between samples are dropped by comparing integers, before any edge
//! is set up.

mod face;
mod shading;
#[cfg(test)]
mod tests;
mod z_buffer;

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    ColorImage, ScalarImage,
    lighting::Scene,
    mesh::{Mesh, Triangle},
    texture::Texture,
};
use crate::camera::Intrinsics;
use face::{Face, Projector};
use shading::View;
use z_buffer::ZBuffer;

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

/// Draws one view. To draw several of one mesh, keep a [`Renderer`]: it prepares the mesh once.
pub fn render(
    mesh: &Mesh,
    scene: &Scene,
    camera_from_world: &Isometry3<f32>,
    intrinsics: &Intrinsics,
    size: [usize; 2],
) -> Rendering {
    Renderer::new(mesh).render(scene, camera_from_world, intrinsics, size)
}

/// A mesh that is ready for drawing.
#[derive(Clone, Debug)]
pub struct Renderer<'a> {
    vertices: &'a [Point3<f32>],
    surfaces: Vec<Surface<'a>>,
    textures: Vec<Texture>,
}

/// A triangle whose vertices exist, and its unit normal by the right-hand rule.
#[derive(Clone, Copy, Debug)]
struct Surface<'a> {
    triangle: &'a Triangle,
    normal: Vector3<f32>,
}

impl<'a> Renderer<'a> {
    pub fn new(mesh: &'a Mesh) -> Self {
        let exists = |vertex: &u32| (*vertex as usize) < mesh.vertices.len();
        let drawable = mesh.triangles.iter().filter(|t| t.vertices.iter().all(exists));
        let surface = |triangle: &'a Triangle| Surface {
            triangle,
            normal: mesh.area_vector(triangle).normalize(),
        };
        Self {
            vertices: &mesh.vertices,
            surfaces: drawable.map(surface).collect(),
            textures: mesh.textures.iter().map(Texture::new).collect(),
        }
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
        let (faces, z_buffer) = self.draw(camera_from_world, intrinsics, size);
        View::new(self, scene, camera_from_world, intrinsics, &faces).resolve(&z_buffer, size)
    }

    /// The z-buffer, and the faces that it refers to.
    fn draw(
        &self,
        camera_from_world: &Isometry3<f32>,
        intrinsics: &Intrinsics,
        size: [usize; 2],
    ) -> (Vec<Face>, ZBuffer) {
        let mut z_buffer = ZBuffer::new(size);
        let projector = Projector::new(camera_from_world, intrinsics, size);
        let vertices: Vec<_> = self.vertices.iter().map(|p| projector.project(p)).collect();
        let mut faces = vec![];
        for (surface, surface_idx) in self.surfaces.iter().zip(0..) {
            let [a, b, c] = surface.triangle.vertices;
            let corners = [&vertices[a as usize], &vertices[b as usize], &vertices[c as usize]];
            if let Some(bounds) = projector.pixel_bounds(corners)
                && let Some(face) = Face::new(corners, surface_idx)
                && z_buffer.draw(&face, faces.len() as u32, bounds)
            {
                faces.push(face);
            }
        }
        (faces, z_buffer)
    }
}
