//! Draws a mesh in a scene: colour, coverage and depth of every pixel.
//!
//! A z-buffer with 2 × 2 samples a pixel decides which face each sample sees; each face is then
//! shaded once a pixel, in the middle of its samples. Colours are Lambertian and textures filtered,
//! so a surface point keeps its colour from frame to frame, as the photometric loss supposes.
//!
//! Most triangles of a detailed mesh are about as small as a pixel, so what is done for each of them
//! is what a picture costs. Those that lie between samples are dropped before their edges are set
//! up; edges are then tested for all samples of a pixel at a time.

mod face;
mod shading;
#[cfg(test)]
mod tests;
mod z_buffer;

use std::cell::RefCell;

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    ColorImage, ScalarImage,
    lighting::Scene,
    mesh::{Mesh, Triangle},
    texture::Texture,
};
use crate::camera::Intrinsics;
use face::{Face, Projector, Vertex};
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
        CANVAS.with_borrow_mut(|canvas| {
            self.draw(canvas, camera_from_world, intrinsics, size);
            View::new(self, scene, camera_from_world, intrinsics, canvas).resolve(size)
        })
    }

    fn draw(
        &self,
        Canvas { vertices, faces, z_buffer }: &mut Canvas,
        camera_from_world: &Isometry3<f32>,
        intrinsics: &Intrinsics,
        size: [usize; 2],
    ) {
        z_buffer.clear(size);
        faces.clear();
        vertices.clear();
        let projector = Projector::new(camera_from_world, intrinsics, size);
        vertices.extend(self.vertices.iter().map(|point| projector.project(point)));
        for (surface, surface_idx) in self.surfaces.iter().zip(0..) {
            let [a, b, c] = surface.triangle.vertices;
            let corners = [&vertices[a as usize], &vertices[b as usize], &vertices[c as usize]];
            if let Some(bounds) = projector.bounds(corners)
                && let Some(face) = Face::new(corners, surface_idx)
                && z_buffer.draw(&face, faces.len() as u32, &bounds)
            {
                faces.push(face);
            }
        }
    }
}

/// What a view is drawn with.
#[derive(Default)]
struct Canvas {
    vertices: Vec<Vertex>,
    /// Those that were seen when they were drawn; the z-buffer refers to them.
    faces: Vec<Face>,
    z_buffer: ZBuffer,
}

thread_local! {
    /// Kept from view to view: fetching a megabyte from the system takes a quarter of the time.
    static CANVAS: RefCell<Canvas> = RefCell::default();
}
