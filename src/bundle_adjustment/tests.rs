//! Bad input: every solver says what is wrong, and never calls it a success.

use burn::tensor::{Tensor, TensorData};
use nalgebra::{Isometry3, Translation3};

use super::{
    BundleAdjustmentConfig, Outcome, Solver, Status, adam::AdamConfig,
    alternating::AlternatingConfig, bundle_adjust, joint_lbfgs::JointLbfgsConfig,
    lbfgs::LbfgsConfig, shape_model::KnownPoints, unknowns::Unknowns,
};
use crate::{
    data::{
        procedural,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
};

const SOLVERS: [Solver; 4] = [Solver::Lm, Solver::Adam, Solver::Lbfgs, Solver::AlternatingLbfgs];

/// Runs each solver on its own objective from the true poses, each of them changed.
fn adjusted(change: impl Fn(&mut Sequence, &mut Isometry3<f32>)) -> Vec<Outcome> {
    let options =
        SequenceOptions { n_frames: 3, size: [48, 48], n_true_points: 1500, ..Default::default() };
    let mut sequence = Sequence::render(&procedural::car(2), &options, 2);
    let truth = sequence.truth.clone().expect("rendered");
    let points: Vec<f32> =
        truth.points.expect("asked for").iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let device = Backend::Flex.device().autodiff();
    let points = TensorData::new(points, [1, options.n_true_points, 3]);
    let shape = KnownPoints(Tensor::from_data(points, &device.clone().inner()));
    let mut poses = truth.camera_from_world;
    poses.iter_mut().for_each(|pose| change(&mut sequence, pose));
    let adjust = |solver| {
        let config = BundleAdjustmentConfig {
            adam: AdamConfig { iterations: 5, ..Default::default() },
            lbfgs: JointLbfgsConfig { evaluations: 5, ..Default::default() },
            alternating: AlternatingConfig {
                max_rounds: 1,
                lbfgs: LbfgsConfig { max_evaluations: 3, ..Default::default() },
                ..Default::default()
            },
            ..BundleAdjustmentConfig::preset(solver)
        };
        let start = Unknowns::with_poses(&poses, &[], config.objective.parameterisation);
        bundle_adjust(&sequence, &shape, &[start.into()], &config, &device, &mut |_, _| ())
    };
    SOLVERS.map(adjust).into()
}

#[track_caller]
fn check_status(outcomes: &[Outcome], expected: Status) {
    for (outcome, solver) in outcomes.iter().zip(SOLVERS) {
        assert_eq!(outcome.status, expected, "{solver:?}");
        assert_eq!(outcome.hypotheses[0].status, expected, "{solver:?}");
        assert!(outcome.uncertainty.is_none(), "{solver:?}");
    }
}

#[test]
fn good_input_is_no_fault() {
    for outcome in adjusted(|_, _| ()) {
        assert!(!outcome.status.is_fault(), "{:?}", outcome.status);
    }
}

#[test]
fn poses_that_are_not_numbers_are_not_finite() {
    let not_a_number = |_: &mut Sequence, pose: &mut Isometry3<f32>| {
        pose.translation.z = f32::NAN;
    };
    check_status(&adjusted(not_a_number), Status::NotFinite);
}

#[test]
fn pictures_that_are_not_numbers_are_not_finite() {
    let not_numbers = |sequence: &mut Sequence, _: &mut Isometry3<f32>| {
        let colors = sequence.frames.iter_mut().flat_map(|frame| frame.color.iter_mut());
        colors.for_each(|channel| *channel = f32::NAN);
    };
    check_status(&adjusted(not_numbers), Status::NotFinite);
}

#[test]
fn a_cloud_behind_the_camera_is_not_a_result() {
    let behind = |_: &mut Sequence, pose: &mut Isometry3<f32>| pose.translation.z *= -1.0;
    check_status(&adjusted(behind), Status::BehindCamera);
}

#[test]
fn a_cloud_out_of_the_frames_that_nothing_calls_back_is_not_a_result() {
    let gone = |sequence: &mut Sequence, pose: &mut Isometry3<f32>| {
        sequence.frames.iter_mut().for_each(|frame| frame.mask.fill(0.0));
        *pose = Translation3::new(9.0, 0.0, 0.0) * *pose;
    };
    check_status(&adjusted(gone), Status::OutOfFrame);
}
