//! Sec. 2.3 on rendered sequences whose shape is known: perturbed poses are found again.

use burn::tensor::{Tensor, TensorData};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Solver, adam::AdamConfig, bundle_adjust,
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
use rayon::prelude::*;

const N_SEQUENCES: u64 = 6;

/// How far every frame's pose starts from the truth: an angle, and a share of the depth.
const PERTURBATION: (f32, f32) = (5.0, 0.05);

/// A frame alone sees the pose through its silhouette only, and all frames together can turn by a
/// degree before their colours disagree by more than pixels do: hence the weight.
fn config(solver: Solver) -> BundleAdjustmentConfig {
    BundleAdjustmentConfig {
        solver,
        blurs: vec![3.0, 0.7],
        objective: ObjectiveConfig {
            silhouette_weight: 100.0,
            coverage_tolerance: 0.1,
            containment_tolerance: 0.5,
            ..Default::default()
        },
        adam: AdamConfig { iterations: 60, ..Default::default() },
        lm: LevenbergMarquardtConfig {
            iterations: 20,
            relative_tolerance: 1e-5,
            ..Default::default()
        },
        ..Default::default()
    }
}

#[test]
fn adam_recovers_perturbed_poses() {
    check_recovery(Solver::Adam);
}

#[test]
fn levenberg_marquardt_recovers_perturbed_poses() {
    check_recovery(Solver::Lm);
}

/// Of 5° of error in every frame, less than 2.2° are left in any sequence, and 1.6° in the mean.
#[track_caller]
fn check_recovery(solver: Solver) {
    let errors: Vec<f32> =
        (0..N_SEQUENCES).into_par_iter().map(|seed| remaining_error(seed, solver)).collect();
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    assert!(mean < 1.6, "mean of {errors:.2?}");
    assert!(errors.iter().all(|&error| error < 2.2), "{errors:.2?}");
}

/// Mean rotation error over the frames of one sequence, in degrees.
fn remaining_error(seed: u64, solver: Solver) -> f32 {
    let options = SequenceOptions { n_true_points: 6144, ..Default::default() };
    let sequence = Sequence::render(&procedural::car(seed), &options, seed);
    let truth = sequence.truth.as_ref().expect("rendered");
    let points = truth.points.as_ref().expect("asked for");

    let device = Backend::Flex.device().autodiff();
    let values: Vec<f32> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let values = TensorData::new(values, [1, points.len(), 3]);
    let shape = KnownPoints(Tensor::from_data(values, &device.clone().inner()));

    let config = config(solver);
    let start = perturbed(&truth.camera_from_world, seed);
    let start = Unknowns::with_poses(&start, &[], config.objective.parameterisation);
    let outcome = bundle_adjust(&sequence, &shape, &[start], &config, &device, &mut |_, _| ());
    let found = outcome.unknowns.camera_from_world(&device);
    let errors = found.iter().zip(&truth.camera_from_world);
    let errors = errors.map(|(found, truth)| found.rotation.angle_to(&truth.rotation));
    errors.sum::<f32>().to_degrees() / found.len() as f32
}

/// Every pose turned about an axis of its own, and nearer or farther.
fn perturbed(camera_from_world: &[Isometry3<f32>], seed: u64) -> Vec<Isometry3<f32>> {
    let mut rng = keyed_rng(seed, [7, 0]);
    let (degrees, share) = PERTURBATION;
    let mut perturb = |pose: &Isometry3<f32>| {
        let axis = Vector3::from_fn(|_, _| rng.random_range(-1.0f32..1.0)).normalize();
        let mut pose = *pose;
        pose.rotation =
            UnitQuaternion::from_scaled_axis(axis * degrees.to_radians()) * pose.rotation;
        pose.translation.vector.z *= if rng.random() { 1.0 + share } else { 1.0 - share };
        pose
    };
    camera_from_world.iter().map(&mut perturb).collect()
}
