//! Sequences as they come: exposures that vary, masks that are wrong or missing, a focal
//! length that is only about right. Shapes are known.

mod exposure;
mod focal;
mod masks;

use burn::tensor::{Tensor, TensorData};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Outcome, bundle_adjust,
        levenberg_marquardt::LevenbergMarquardtConfig, objective::ObjectiveConfig,
        shape_model::KnownPoints, unknowns::Unknowns,
    },
    data::{
        keyed_rng, procedural,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
};
use rand::Rng;

const N_FRAMES: usize = 6;
const N_POINTS: usize = 6144;

fn rendered(seed: u64) -> Sequence {
    let options =
        SequenceOptions { n_frames: N_FRAMES, n_true_points: N_POINTS, ..Default::default() };
    Sequence::render(&procedural::car(seed), &options, seed)
}

/// Silhouettes weigh little: where exposures or masks are wrong, both options and their lack show.
fn colors_lead() -> ObjectiveConfig {
    ObjectiveConfig { silhouette_weight: 40.0, style_weight: 1.0, ..Default::default() }
}

/// What is found from poses that are turned by 4° and 4 % nearer or farther.
fn adjusted(sequence: &Sequence, seed: u64, objective: ObjectiveConfig) -> Outcome {
    let truth = sequence.truth.as_ref().expect("rendered");
    let points = truth.points.as_ref().expect("asked for");
    let device = Backend::Flex.device();
    let values: Vec<f32> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let values = TensorData::new(values, [1, points.len(), 3]);
    let shape = KnownPoints(Tensor::from_data(values, &device));
    let lm = LevenbergMarquardtConfig { max_residuals: 2000, ..Default::default() };
    let config = BundleAdjustmentConfig { objective, lm, ..Default::default() };
    let mut rng = keyed_rng(seed, [7, 0]);
    let mut perturb = |pose: &Isometry3<f32>| {
        let axis = Vector3::from_fn(|_, _| rng.random_range(-1.0f32..1.0)).normalize();
        let turn = UnitQuaternion::from_scaled_axis(axis * 4.0f32.to_radians());
        let mut translation = pose.translation;
        translation.z *= if rng.random() { 1.04 } else { 0.96 };
        Isometry3::from_parts(translation, turn * pose.rotation)
    };
    let start: Vec<_> = truth.camera_from_world.iter().map(&mut perturb).collect();
    let start = Unknowns::with_poses(&start, &[], config.objective.parameterisation);
    bundle_adjust(sequence, &shape, &[start.into()], &config, &device, &mut |_, _| ())
}

/// Mean rotation error over the frames, in degrees.
fn rotation_error(sequence: &Sequence, outcome: &Outcome) -> f32 {
    let truth = &sequence.truth.as_ref().expect("rendered").camera_from_world;
    let found = outcome.unknowns.camera_from_world(&Backend::Flex.device());
    let errors = found.iter().zip(truth).map(|(a, b)| a.rotation.angle_to(&b.rotation));
    errors.sum::<f32>().to_degrees() / truth.len() as f32
}

fn mean(errors: &[f32]) -> f32 {
    errors.iter().sum::<f32>() / errors.len() as f32
}
