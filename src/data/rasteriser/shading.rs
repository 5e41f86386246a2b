//! The colour of what each sample sees.

use image::{Luma, Rgb};
use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Vector3};

use super::{
    Canvas, Renderer, Rendering, Surface,
    face::Face,
    z_buffer::{Pixel, Samples},
};
use crate::{
    camera::Intrinsics,
    data::{ColorImage, ScalarImage, lighting::Scene},
};

/// Everything that decides the colour of a pixel.
pub struct View<'a> {
    renderer: &'a Renderer<'a>,
    scene: &'a Scene,
    /// Where the camera stands in the world.
    eye: Point3<f32>,
    /// Rᵀ K⁻¹: takes a pixel (x, y, 1) to its ray, of which z times leads to camera depth z.
    ray_from_pixel: Matrix3<f32>,
    canvas: &'a Canvas,
}

impl<'a> View<'a> {
    pub fn new(
        renderer: &'a Renderer<'a>,
        scene: &'a Scene,
        camera_from_world: &Isometry3<f32>,
        Intrinsics { focal: [f_x, f_y], center: [c_x, c_y] }: &Intrinsics,
        canvas: &'a Canvas,
    ) -> Self {
        let world_from_camera = camera_from_world.inverse();
        let camera_from_pixel =
            Matrix3::new(1.0 / f_x, 0.0, -c_x / f_x, 0.0, 1.0 / f_y, -c_y / f_y, 0.0, 0.0, 1.0);
        Self {
            renderer,
            scene,
            eye: world_from_camera.translation.vector.into(),
            ray_from_pixel: world_from_camera.rotation.to_rotation_matrix() * camera_from_pixel,
            canvas,
        }
    }

    /// Gathers the samples of every pixel.
    pub fn resolve(&self, size: [usize; 2]) -> Rendering {
        let [columns, rows] = size.map(|side| side as u32);
        let mut rendering = Rendering {
            color: ColorImage::from_pixel(columns, rows, Rgb(self.scene.background)),
            coverage: ScalarImage::new(columns, rows),
            depth: ScalarImage::new(columns, rows),
        };
        let places = rendering.color.enumerate_pixels_mut().zip(&self.canvas.z_buffer.pixels);
        let surfaces = rendering.coverage.pixels_mut().zip(rendering.depth.pixels_mut());
        for (((x, y, color), pixel), (coverage, depth)) in places.zip(surfaces) {
            let covered = pixel.covered_samples();
            if covered.is_empty() && self.scene.ground.is_none() {
                continue;
            }
            *color = Rgb(self.pixel_color([x as f32, y as f32], pixel));
            if !covered.is_empty() {
                *coverage = Luma([covered.share()]);
                *depth = Luma([pixel.depth()]);
            }
        }
        rendering
    }

    /// The mean over the samples of the pixel with this corner. A face that several of them see is
    /// shaded once, in their middle.
    fn pixel_color(&self, [x, y]: [f32; 2], pixel: &Pixel) -> [f32; 3] {
        let mut sum = [0.0; 3];
        let mut remaining = Samples::ALL;
        while let Some(sample) = remaining.first() {
            let face_idx = pixel.face_indices[sample];
            let samples = pixel.samples_of(face_idx);
            let ([right, down], share) = (samples.middle(), samples.share());
            let color = self.color_at(face_idx, [x + right, y + down]);
            sum = std::array::from_fn(|c| sum[c] + color[c] * share);
            remaining = remaining.without(samples);
        }
        sum
    }

    fn color_at(&self, face_idx: u32, [x, y]: [f32; 2]) -> [f32; 3] {
        let pixel = Vector3::new(x, y, 1.0);
        match self.canvas.faces.get(face_idx as usize) {
            Some(face) => self.face_color(face, &pixel),
            None => self.backdrop_color(&pixel),
        }
    }

    fn face_color(&self, face: &Face, pixel: &Vector3<f32>) -> [f32; 3] {
        let Renderer { surfaces, textures, .. } = self.renderer;
        let Surface { triangle, normal } = &surfaces[face.surface_idx as usize];
        let mut albedo = triangle.color;
        if let Some(texture) = triangle.texture.and_then(|idx| textures.get(idx as usize)) {
            let (uv, uv_per_pixel) = face.uv_at(pixel, &triangle.uvs);
            let texel = texture.sample(uv, uv_per_pixel);
            albedo = std::array::from_fn(|c| albedo[c] * texel[c]);
        }
        let ray = self.ray_from_pixel * pixel;
        let point = self.eye + ray * face.depth_at(pixel);
        // Files wind their triangles as they like: what is seen is the outside.
        let outward = if normal.dot(&ray) > 0.0 { -normal } else { *normal };
        self.scene.shade(point, outward, albedo)
    }

    /// The carpet where the ray meets it, seen from above; the background elsewhere.
    fn backdrop_color(&self, pixel: &Vector3<f32>) -> [f32; 3] {
        let Some(ground) = &self.scene.ground else { return self.scene.background };
        let ray = self.ray_from_pixel * pixel;
        if ray.y >= 0.0 || self.eye.y <= ground.height {
            return self.scene.background;
        }
        let depth = (ground.height - self.eye.y) / ray.y;
        let point = self.eye + ray * depth;
        // Where the ray turns by `turn`, the point slides along the ground by this much.
        let slide = |turn: Vector3<f32>| (turn - ray * (turn.y / ray.y)) * (depth / ground.repeat);
        let slides = [0, 1].map(|axis| slide(self.ray_from_pixel.column(axis).into()).xz());

        let uv = point.coords.xz() / ground.repeat;
        let albedo = ground.texture.sample(uv, Matrix2::from_columns(&slides));
        self.scene.shade(point, Vector3::y(), albedo)
    }
}
