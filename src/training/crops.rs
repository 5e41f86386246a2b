//! Pictures to train the regressors on: crops rendered straight through their virtual cameras.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};
use rand::Rng;
use rayon::prelude::*;

use super::{RegressorStageConfig, TrainingConfig, shapes::Shapes};
use crate::{
    Result,
    data::{
        crop::{CropCamera, jitter},
        keyed_rng,
        lighting::Scene,
        rasteriser::Renderer,
        viewpoint::{Viewpoint, projected_box},
    },
    regressor::{PoseTarget, crop_values},
};

/// The random stream of a picture: the first half of its key, with the number of the view.
const VIEW: u64 = 21 << 32;
/// Side of the pictures, in pixels, that crops are cut from; only its ratio to the box matters.
const PICTURE: usize = 128;

/// A crop, how its camera was placed, and what it shows.
pub(super) struct Crop {
    /// `[size, size, 4]`: red, green, blue and mask, as bytes.
    pub pixels: Vec<u8>,
    pub crop_from_world: Isometry3<f32>,
    /// The focal length in units of the crop's side.
    pub focal_ratio: f32,
    /// Which of the shapes that were asked for.
    pub shape_idx: usize,
    /// Which view of that shape.
    pub view: usize,
}

/// The crops of all models, in their order. `go_on` is asked before each model; once it says no, the
/// rest is left out.
pub(super) fn crops_of_models(
    models: &[usize],
    crops_of_model: impl Fn(usize) -> Result<Vec<Crop>> + Sync,
    go_on: impl Fn() -> bool + Sync,
) -> Result<Vec<Crop>> {
    let crops: Result<Vec<Vec<Crop>>> = models
        .par_iter()
        .enumerate()
        .take_any_while(|_| go_on())
        .map(|(shape_idx, &model_idx)| {
            let crops = crops_of_model(model_idx)?.into_iter();
            Ok(crops.map(|crop| Crop { shape_idx, ..crop }).collect())
        })
        .collect();
    Ok(crops?.into_iter().flatten().collect())
}

/// Renders these views of a model, in ascending order; views take turns in its paints.
///
/// A crop follows from (seed, model, view) alone: neither the number of threads nor which other
/// models or views are asked for changes it.
pub(super) fn render_model(
    config: &TrainingConfig,
    shapes: &Shapes,
    model_idx: usize,
    views: &[usize],
) -> Result<Vec<Crop>> {
    let n_paints = shapes.n_paints();
    let mut crops = Vec::with_capacity(views.len());
    for paint in 0..n_paints {
        let mut views = views.iter().filter(|&view| view % n_paints == paint).peekable();
        if views.peek().is_none() {
            continue;
        }
        let mesh = shapes.mesh(model_idx, paint)?;
        let renderer = Renderer::new(&mesh);
        for &view in views {
            let mut rng = keyed_rng(config.seed, [VIEW + view as u64, model_idx as u64]);
            let crop = render_crop(config, &mesh.vertices, &renderer, &mut rng);
            crops.push(Crop { view, ..crop });
        }
    }
    crops.sort_by_key(|crop| crop.view);
    Ok(crops)
}

impl Crop {
    /// What the network sees in a training step, and where the camera then was.
    pub fn augmented(&self, config: &TrainingConfig, rng: &mut impl Rng) -> (Vec<f32>, Self) {
        let RegressorStageConfig { augmentation, network, .. } = &config.regressors;
        let mut values = self.values();
        augmentation.apply(&mut values, network.crop_size, rng);
        let mut truth = Self { pixels: Vec::new(), ..*self };
        if augmentation.mirror && rng.random() {
            mirror_columns(&mut values, network.crop_size);
            truth.crop_from_world = mirrored(&self.crop_from_world);
        }
        (values, truth)
    }

    /// What the pose regressor should say.
    pub fn pose_target(&self) -> PoseTarget {
        PoseTarget::new(&self.crop_from_world, self.focal_ratio)
    }

    /// What the network sees, untouched.
    pub fn values(&self) -> Vec<f32> {
        self.pixels.iter().map(|&byte| f32::from(byte) / 255.0).collect()
    }
}

/// A crop whose shape and view are still to be told.
fn render_crop(
    config: &TrainingConfig,
    vertices: &[Point3<f32>],
    renderer: &Renderer,
    rng: &mut impl Rng,
) -> Crop {
    let network = &config.regressors.network;
    let view = Viewpoint::random(vertices, [PICTURE; 2], &config.data.viewpoints, rng);
    // Viewpoints have the object in view. Should one not, the crop is the picture.
    let whole = [0.0, 0.0, PICTURE as f32, PICTURE as f32];
    let object = projected_box(vertices, &view.camera_from_world, &view.intrinsics);
    let object = object.unwrap_or(whole);
    let object = jitter(object, config.regressors.box_jitter, rng);
    let size = network.crop_size;
    let camera = CropCamera::around(object, &view.intrinsics, size, network.crop_margin);
    let crop_from_world = camera.crop_from_world(&view.camera_from_world);

    let scene = Scene::random(rng, None);
    let picture = renderer.render(&scene, &crop_from_world, &camera.intrinsics, [size; 2]);
    let values = crop_values(&picture.color, &picture.coverage);
    Crop {
        pixels: values.into_iter().map(|value| (value * 255.0).round() as u8).collect(),
        crop_from_world,
        focal_ratio: camera.intrinsics.focal[0] / size as f32,
        shape_idx: 0,
        view: 0,
    }
}

/// F R F and F t, where F flips x: the pose at which the mirrored shape looks mirrored.
fn mirrored(pose: &Isometry3<f32>) -> Isometry3<f32> {
    let flip = Matrix3::from_diagonal(&[-1.0, 1.0, 1.0].into());
    let rotation = flip * pose.rotation.to_rotation_matrix().matrix() * flip;
    let rotation = Rotation3::from_matrix_unchecked(rotation);
    let translation = Translation3::from(flip * pose.translation.vector);
    Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
}

fn mirror_columns(values: &mut [f32], size: usize) {
    for row in values.chunks_mut(4 * size) {
        row.as_chunks_mut::<4>().0.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Intrinsics;
    use crate::data::viewpoint::{orbit_rotation, project};
    use rayon::ThreadPoolBuilder;

    /// Crops of these procedural cars, rendered on so many threads.
    fn crops_of(models: &[usize], n_threads: usize) -> Vec<Crop> {
        let mut config = TrainingConfig::default();
        config.data.paints_per_model = 2;
        config.regressors.network.crop_size = 32;
        let shapes = Shapes::open(&config.data, config.seed).expect("cars need no files");
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads start");
        let render = |model_idx| render_model(&config, &shapes, model_idx, &[0, 1, 2]);
        pool.install(|| crops_of_models(models, render, || true)).expect("cars need no files")
    }

    #[track_caller]
    fn check_same(crops: &[Crop], others: &[Crop]) {
        let data = |crop: &Crop| (crop.view, crop.crop_from_world, crop.pixels.clone());
        assert_eq!(crops.len(), others.len());
        assert!(crops.iter().zip(others).all(|(crop, other)| data(crop) == data(other)));
    }

    #[test]
    fn any_number_of_workers_makes_the_same_crops() {
        let crops = crops_of(&[0, 1, 2, 3], 1);
        assert_eq!(crops.len(), 12);
        check_same(&crops, &crops_of(&[0, 1, 2, 3], 2));
    }

    #[test]
    fn a_model_has_its_own_crops_whichever_others_are_asked_for() {
        check_same(&crops_of(&[1, 2], 1)[3..], &crops_of(&[2], 1));
    }

    #[test]
    fn a_view_is_the_same_whichever_others_are_asked_for() {
        let config = TrainingConfig::default();
        let shapes = Shapes::open(&config.data, config.seed).expect("cars need no files");
        let render =
            |views: &[usize]| render_model(&config, &shapes, 1, views).expect("cars need no files");
        check_same(&render(&[5]), &render(&[2, 3, 5])[2..]);
    }

    #[test]
    fn a_mirrored_pose_shows_the_mirrored_point_in_the_mirrored_column() {
        let pose = Isometry3::from_parts(
            Translation3::new(0.1, -0.05, 2.0),
            orbit_rotation(0.7, 0.3, 0.1),
        );
        let camera = Intrinsics { focal: [50.0; 2], center: [32.0; 2] };
        let (point, mirror_point) = (Point3::new(0.2, 0.1, -0.3), Point3::new(-0.2, 0.1, -0.3));
        let [u, v] = project(&(pose * point), &camera);
        let [mirror_u, mirror_v] = project(&(mirrored(&pose) * mirror_point), &camera);
        assert!((mirror_u - (64.0 - u)).abs() < 1e-4 && (mirror_v - v).abs() < 1e-4);
    }

    #[test]
    fn mirroring_reverses_the_pixels_of_each_row() {
        let mut values: Vec<f32> = (0..16).map(|i| i as f32).collect();
        mirror_columns(&mut values, 2);
        assert_eq!(values, [4., 5., 6., 7., 0., 1., 2., 3., 12., 13., 14., 15., 8., 9., 10., 11.]);
    }
}
