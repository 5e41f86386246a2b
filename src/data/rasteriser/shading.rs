//! The colour of what each sample sees.

use image::{Luma, Rgb};
use nalgebra::{Point3, Rotation3, Vector3};

use super::{NO_FACE, Renderer, Rendering, SAMPLES, Sample, face::Face, sample_pixel};
use crate::{
    camera::Intrinsics,
    data::{ColorImage, ScalarImage, lighting::Scene},
};

/// Samples in a pixel.
const N: usize = (SAMPLES * SAMPLES) as usize;

/// Everything that decides the colour of a pixel.
pub struct View<'a> {
    pub renderer: &'a Renderer<'a>,
    pub scene: &'a Scene,
    pub world_from_camera: Rotation3<f32>,
    /// Where the camera stands in the world.
    pub eye: Point3<f32>,
    pub intrinsics: &'a Intrinsics,
    pub faces: &'a [Face<'a>],
}

impl View<'_> {
    /// Gathers the samples of every pixel.
    pub fn resolve(&self, samples: &[Sample], [width, height]: [usize; 2]) -> Rendering {
        let [columns, rows] = [width as u32, height as u32];
        let stride = width * SAMPLES as usize;
        let mut rendering = Rendering {
            color: ColorImage::new(columns, rows),
            coverage: ScalarImage::new(columns, rows),
            depth: ScalarImage::new(columns, rows),
        };
        let pixels = rendering.color.enumerate_pixels_mut().zip(rendering.coverage.pixels_mut());
        for (((x, y, color), coverage), depth) in pixels.zip(rendering.depth.pixels_mut()) {
            let places = std::array::from_fn(|k| {
                [x * SAMPLES + k as u32 % SAMPLES, y * SAMPLES + k as u32 / SAMPLES]
            });
            let seen = places.map(|[x, y]| samples[y as usize * stride + x as usize]);
            let face_indices = seen.map(|sample| sample.face_idx);
            *color = Rgb(if face_indices == [face_indices[0]; N] {
                self.color_at(face_indices[0], [x as f32 + 0.5, y as f32 + 0.5])
            } else {
                self.pixel_color(places.map(sample_pixel), face_indices)
            });
            let covered = seen.iter().filter(|sample| sample.face_idx != NO_FACE).count();
            if covered > 0 {
                let nearest = seen.iter().map(|sample| sample.inverse_depth).fold(0.0, f32::max);
                *coverage = Luma([covered as f32 / N as f32]);
                *depth = Luma([1.0 / nearest]);
            }
        }
        rendering
    }

    /// The mean over a pixel's samples. A face that several of them see is shaded once, in their
    /// middle.
    fn pixel_color(&self, pixels: [[f32; 2]; N], face_indices: [u32; N]) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (k, face_idx) in face_indices.iter().enumerate() {
            if face_indices[..k].contains(face_idx) {
                continue;
            }
            let mut middle = [0.0; 2];
            let mut count = 0.0;
            for (pixel, _) in pixels.iter().zip(face_indices).filter(|(_, idx)| idx == face_idx) {
                middle = [middle[0] + pixel[0], middle[1] + pixel[1]];
                count += 1.0;
            }
            let color = self.color_at(*face_idx, middle.map(|total| total / count));
            for (total, channel) in sum.iter_mut().zip(color) {
                *total += channel * (count / N as f32);
            }
        }
        sum
    }

    fn color_at(&self, face_idx: u32, pixel: [f32; 2]) -> [f32; 3] {
        match self.faces.get(face_idx as usize) {
            Some(face) => self.face_color(face, pixel),
            None => self.backdrop_color(pixel),
        }
    }

    fn face_color(&self, face: &Face, pixel: [f32; 2]) -> [f32; 3] {
        let Renderer { mesh, textures } = self.renderer;
        let mut albedo = face.triangle.color;
        if let Some(texture) = face.triangle.texture.and_then(|idx| textures.get(idx as usize)) {
            let (uv, uv_per_pixel) = face.uv_at(pixel);
            let texel = texture.sample(uv, uv_per_pixel);
            albedo = std::array::from_fn(|c| albedo[c] * texel[c]);
        }
        let ray = self.ray(pixel);
        let point = self.eye + ray * face.depth_at(pixel);
        let normal = mesh.area_vector(face.triangle).normalize();
        // Files wind their triangles as they like: what is seen is the outside.
        let outward = if normal.dot(&ray) > 0.0 { -normal } else { normal };
        self.scene.shade(point, outward, albedo)
    }

    /// The carpet where the ray meets it, seen from above; the background elsewhere.
    fn backdrop_color(&self, pixel: [f32; 2]) -> [f32; 3] {
        let Some(ground) = &self.scene.ground else { return self.scene.background };
        let [eye, ray] = [self.eye.coords, self.ray(pixel)];
        if ray.y >= 0.0 || eye.y <= ground.height {
            return self.scene.background;
        }
        let depth = (ground.height - eye.y) / ray.y;
        let point = Point3::from(eye + ray * depth);
        // Where the ray turns by `turn`, the point slides along the ground by this much.
        let slide = |turn: Vector3<f32>| (turn - ray * (turn.y / ray.y)) * (depth / ground.repeat);
        let [f_x, f_y] = self.intrinsics.focal;
        let slides = [Vector3::x() / f_x, Vector3::y() / f_y]
            .map(|turn| slide(self.world_from_camera * turn));

        let uv = [point.x / ground.repeat, point.z / ground.repeat];
        let albedo = ground.texture.sample(uv, slides.map(|slide| [slide.x, slide.z]));
        self.scene.shade(point, Vector3::y(), albedo)
    }

    /// The direction through a pixel, in the world frame; a point at camera depth z is z times it
    /// away from the eye.
    fn ray(&self, pixel: [f32; 2]) -> Vector3<f32> {
        let Intrinsics { focal, center } = self.intrinsics;
        let slopes = [0, 1].map(|axis| (pixel[axis] - center[axis]) / focal[axis]);
        self.world_from_camera * Vector3::new(slopes[0], slopes[1], 1.0)
    }
}
