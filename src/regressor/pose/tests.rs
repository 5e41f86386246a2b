use super::*;
use crate::{data::keyed_rng, host::host_values};
use rand::Rng;
use std::f32::consts::TAU;

fn random_pose(i: u64) -> Isometry3<f32> {
    let mut rng = keyed_rng(7, [i, 0]);
    let mut between = |low: f32, high: f32| rng.random_range(low..high);
    let rotation = orbit_rotation(between(0.0, TAU), between(-0.1, 0.8), between(-0.2, 0.2));
    let translation = [between(-0.1, 0.1), between(-0.1, 0.1), between(1.0, 2.0)];
    Isometry3::from_parts(translation.into(), rotation)
}

/// The outputs of a regressor that knows the answer.
fn perfect_outputs(target: &PoseTarget) -> Vec<f32> {
    let nearest = nearest_anchors(&target.rotation);
    let logits = (0..N_ANCHORS).map(|k| match nearest.iter().position(|&n| n == k) {
        Some(0) => 20.0,
        Some(_) => 10.0,
        None => -20.0,
    });
    let residuals = (0..N_ANCHORS).flat_map(|k| {
        let delta = *(target.rotation * anchor(k).inverse()).matrix();
        [delta.m11 - 1.0, delta.m12, delta.m13, delta.m21, delta.m22 - 1.0, delta.m23]
    });
    target.coordinates.into_iter().chain(logits).chain(residuals).collect()
}

fn regressor(head: PoseHead) -> PoseRegressor {
    PoseRegressor::new(head, 4, &Device::flex())
}

#[track_caller]
fn check_close(a: &Isometry3<f32>, b: &Isometry3<f32>) {
    let rotation = a.rotation.angle_to(&b.rotation);
    let translation = (a.translation.vector - b.translation.vector).norm();
    assert!(rotation < 1e-3 && translation < 1e-4, "{rotation} rad, {translation}");
}

#[test]
fn hypotheses_undo_the_targets() {
    for i in 0..20 {
        let pose = random_pose(i);
        let target = PoseTarget::new(&pose, 1.3);
        let hypotheses = regressor(PoseHead::Anchors).hypotheses(&perfect_outputs(&target), 1.3);
        check_close(&hypotheses[0].0, &pose);
    }
}

#[test]
fn a_twist_is_read_as_axis_and_angle() {
    let pose = random_pose(0);
    let target = PoseTarget::new(&pose, 0.8);
    let outputs = [target.coordinates, target.rotation.scaled_axis().into()].concat();
    check_close(&regressor(PoseHead::Twist).hypotheses(&outputs, 0.8)[0].0, &pose);
}

#[test]
fn the_truth_costs_nothing_and_any_other_pose_something() {
    let device = Device::flex();
    let loss = |outputs: Vec<f32>, target: &PoseTarget| {
        let m = outputs.len();
        let outputs = Tensor::from_data(TensorData::new(outputs, [1, m]), &device);
        regressor(PoseHead::Anchors).loss(outputs, &[*target]).into_scalar::<f32>()
    };
    let [target, other] = [0, 1].map(|i| PoseTarget::new(&random_pose(i), 1.3));
    assert!(loss(perfect_outputs(&target), &target) < 1e-3);
    assert!(loss(perfect_outputs(&other), &target) > 0.1);
}

#[test]
fn rotations_on_the_graph_are_those_on_the_host() {
    let mut rng = keyed_rng(3, [0, 0]);
    let outputs: Vec<f32> = (0..N_ANCHORS * 7).map(|_| rng.random_range(-0.5..0.5)).collect();
    let residuals = TensorData::new(outputs[N_ANCHORS..].to_vec(), [N_ANCHORS, 6]);
    let on_graph = host_values(&rotation_rows(Tensor::from_data(residuals, &Device::flex())));
    for (k, (rotation, _)) in anchored_rotations(&outputs).into_iter().enumerate() {
        let expected = *(rotation * anchor(k).inverse()).matrix();
        let actual = Matrix3::from_row_slice(&on_graph[9 * k..9 * k + 9]);
        assert!((expected - actual).norm() < 1e-5);
    }
}

#[test]
fn agreeing_anchors_are_one_hypothesis_and_a_flip_is_another() {
    let rotation = anchor(3);
    let nearby = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.1) * rotation;
    let flipped = anchor(3 + N_ANCHORS / 2);
    let kept = distinct(vec![(rotation, 0.3), (flipped, 0.4), (nearby, 0.3)]);
    assert_eq!(kept.iter().map(|(_, c)| *c).collect::<Vec<_>>(), [0.6, 0.4]);
}

#[test]
fn the_field_of_view_does_not_change_the_depth_coordinate() {
    let near = Isometry3::translation(0.0, 0.0, 1.0);
    let far = Isometry3::translation(0.0, 0.0, 3.0);
    let coordinate = |pose, focal| PoseTarget::new(pose, focal).coordinates[2];
    assert!((coordinate(&near, 1.0) - coordinate(&far, 3.0)).abs() < 1e-6);
}
