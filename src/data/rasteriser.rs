//! Draws a mesh in a scene: colour, coverage and depth of every pixel.
//!
//! A z-buffer with 2 × 2 samples a pixel decides which face each sample sees; each face is then
//! shaded once a pixel, in the middle of its samples. Colours are Lambertian and textures filtered,
//! so a surface point keeps its colour from frame to frame, as the photometric loss supposes.

mod face;
#[cfg(test)]
mod tests;

use image::{Luma, Rgb};
use nalgebra::{Isometry3, Point3, Vector3};

use super::{ColorImage, ScalarImage, lighting::Scene, mesh::Mesh, texture::Texture};
use crate::camera::Intrinsics;
use face::Face;

/// Samples along each side of a pixel.
const SAMPLES: usize = 2;
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
        let world_from_camera = camera_from_world.inverse();
        let faces = self.faces(camera_from_world, intrinsics, size);
        let samples = nearest_faces(&faces, size);
        let view = View { textures: &self.textures, scene, world_from_camera, intrinsics };
        view.resolve(&faces, &samples, size)
    }

    /// The faces that may cover a sample.
    fn faces(
        &self,
        camera_from_world: &Isometry3<f32>,
        intrinsics: &Intrinsics,
        size: [usize; 2],
    ) -> Vec<Face<'a>> {
        let n_samples = size.map(|side| side * SAMPLES);
        let vertices: Vec<_> =
            self.mesh.vertices.iter().map(|vertex| camera_from_world * vertex).collect();
        let faces = self.mesh.triangles.iter();
        faces.filter_map(|face| Face::new(face, &vertices, intrinsics, n_samples)).collect()
    }
}

/// The nearest face at a sample so far.
#[derive(Clone, Copy)]
struct Sample {
    inverse_depth: f32,
    face_idx: u32,
}

/// The z-buffer, row by row.
fn nearest_faces(faces: &[Face], [width, height]: [usize; 2]) -> Vec<Sample> {
    let stride = width * SAMPLES;
    let empty = Sample { inverse_depth: 0.0, face_idx: NO_FACE };
    let mut samples = vec![empty; stride * height * SAMPLES];
    for (face, face_idx) in faces.iter().zip(0..) {
        let [columns, rows] = face.bounds.clone();
        for y in rows {
            let row = &mut samples[y * stride..][columns.clone()];
            for (x, sample) in columns.clone().zip(row) {
                if let Some(inverse_depth) = face.inverse_depth_at(sample_pixel([x, y]))
                    && inverse_depth > sample.inverse_depth
                {
                    *sample = Sample { inverse_depth, face_idx };
                }
            }
        }
    }
    samples
}

/// Where a sample lies, in pixels.
fn sample_pixel(sample: [usize; 2]) -> [f32; 2] {
    sample.map(|index| (index as f32 + 0.5) / SAMPLES as f32)
}

/// Everything that decides the colour of a pixel.
struct View<'a> {
    textures: &'a [Texture],
    scene: &'a Scene,
    world_from_camera: Isometry3<f32>,
    intrinsics: &'a Intrinsics,
}

impl View<'_> {
    /// Gathers the samples of every pixel.
    fn resolve(
        &self,
        faces: &[Face],
        samples: &[Sample],
        [width, height]: [usize; 2],
    ) -> Rendering {
        const N: usize = SAMPLES * SAMPLES;
        let [columns, rows] = [width as u32, height as u32];
        let mut color = ColorImage::new(columns, rows);
        let mut coverage = ScalarImage::new(columns, rows);
        let mut depth = ScalarImage::new(columns, rows);

        for (pixel_idx, value) in color.pixels_mut().enumerate() {
            let [x, y] = [pixel_idx % width * SAMPLES, pixel_idx / width * SAMPLES];
            let places: [_; N] = std::array::from_fn(|k| [x + k % SAMPLES, y + k / SAMPLES]);
            let seen = places.map(|[x, y]| samples[y * width * SAMPLES + x]);

            *value = Rgb(self.pixel_color(faces, places.map(sample_pixel), seen));
            let covered = seen.iter().filter(|sample| sample.face_idx != NO_FACE).count();
            if covered > 0 {
                let nearest = seen.iter().map(|sample| sample.inverse_depth).fold(0.0, f32::max);
                let [x, y] = [(pixel_idx % width) as u32, (pixel_idx / width) as u32];
                coverage.put_pixel(x, y, Luma([covered as f32 / N as f32]));
                depth.put_pixel(x, y, Luma([1.0 / nearest]));
            }
        }
        Rendering { color, coverage, depth }
    }

    /// The mean over a pixel's samples; a face that several of them see is shaded once.
    fn pixel_color<const N: usize>(
        &self,
        faces: &[Face],
        pixels: [[f32; 2]; N],
        seen: [Sample; N],
    ) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (k, sample) in seen.iter().enumerate() {
            let same_face = |other: &Sample| other.face_idx == sample.face_idx;
            if seen[..k].iter().any(same_face) {
                continue;
            }
            let mut middle = [0.0; 2];
            let mut share = 0.0;
            for (pixel, _) in pixels.iter().zip(&seen).filter(|(_, other)| same_face(other)) {
                middle = [middle[0] + pixel[0], middle[1] + pixel[1]];
                share += 1.0;
            }
            let middle = middle.map(|coordinate| coordinate / share);
            let color = match faces.get(sample.face_idx as usize) {
                Some(face) => self.face_color(face, middle),
                None => self.backdrop_color(middle),
            };
            for (total, channel) in sum.iter_mut().zip(color) {
                *total += channel * share / N as f32;
            }
        }
        sum
    }

    fn face_color(&self, face: &Face, pixel: [f32; 2]) -> [f32; 3] {
        let mut albedo = face.triangle.color;
        if let Some(texture) = face.triangle.texture.and_then(|idx| self.textures.get(idx as usize))
        {
            let (uv, uv_per_pixel) = face.uv_at(pixel);
            let texel = texture.sample(uv, uv_per_pixel);
            albedo = std::array::from_fn(|c| albedo[c] * texel[c]);
        }
        let point = Point3::from(self.ray(pixel) * face.depth_at(pixel));
        let normal = self.world_from_camera.rotation * face.normal;
        self.scene.shade(self.world_from_camera * point, normal, albedo)
    }

    /// The carpet where the ray meets it, seen from above; the background elsewhere.
    fn backdrop_color(&self, pixel: [f32; 2]) -> [f32; 3] {
        let rotation = self.world_from_camera.rotation;
        let eye = Point3::from(self.world_from_camera.translation.vector);
        let ray = rotation * self.ray(pixel);
        let Some(ground) = &self.scene.ground else { return self.scene.background };
        if ray.y >= 0.0 || eye.y <= ground.height {
            return self.scene.background;
        }
        let depth = (ground.height - eye.y) / ray.y;
        let point = eye + ray * depth;
        // Where the ray turns by `turn`, the point slides along the ground by this much.
        let slide = |turn: Vector3<f32>| (turn - ray * (turn.y / ray.y)) * (depth / ground.repeat);
        let [f_x, f_y] = self.intrinsics.focal;
        let slides = [slide(rotation * Vector3::x() / f_x), slide(rotation * Vector3::y() / f_y)];

        let uv = [point.x / ground.repeat, point.z / ground.repeat];
        let albedo = ground.texture.sample(uv, slides.map(|slide| [slide.x, slide.z]));
        self.scene.shade(point, Vector3::y(), albedo)
    }

    /// The direction through a pixel in the camera frame, with z = 1.
    fn ray(&self, pixel: [f32; 2]) -> Vector3<f32> {
        let Intrinsics { focal, center } = self.intrinsics;
        Vector3::new((pixel[0] - center[0]) / focal[0], (pixel[1] - center[1]) / focal[1], 1.0)
    }
}
