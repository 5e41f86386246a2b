//! Errors of camera poses.

use nalgebra::{Isometry3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::{alignment::aligned_errors, mean, median};

/// Where the area under curves over rotation errors ends, in degrees.
const AUC_END: f64 = 30.0;

/// The angle of the rotation from one pose to the other, in radians: the geodesic error.
pub fn rotation_error(a: &Isometry3<f32>, b: &Isometry3<f32>) -> f64 {
    angle(&a.rotation, &b.rotation)
}

/// Errors of a sequence's poses. Angles are in degrees, lengths in world units (diagonal 1).
///
/// Absolute errors need a truth in the canonical frame, and are `None` where its world is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PoseErrors {
    /// Of the reference frame, p_0.
    pub reference_rotation_error_deg: Option<f64>,
    /// Mean over all frames, the reference included: the paper's pose error.
    pub rotation_error_deg_mean: Option<f64>,
    pub rotation_error_deg_median: Option<f64>,
    /// Area under the share of frames that err by less than an angle, from 0° to 30°; 1 is perfect.
    pub rotation_auc_30: Option<f64>,
    /// Mean over target frames of the error in their rotation from the reference frame.
    pub relative_rotation_error_deg_mean: Option<f64>,
    /// Relative rotation accuracy: the share of pairs of frames whose rotation from one to the other
    /// errs by less than 5°, 15° and 30°.
    pub rra_5: Option<f64>,
    pub rra_15: Option<f64>,
    pub rra_30: Option<f64>,
    /// Area under the share of these pairs, from 0° to 30°.
    pub rra_auc_30: Option<f64>,
    /// Mean distance between estimated and true t.
    pub translation_error_mean: Option<f64>,
    /// The same after the one factor on all estimated t that brings them nearest to the true ones.
    pub scaled_translation_error_mean: Option<f64>,
    /// Mean over frames after the similarity that best aligns the two sets of cameras.
    pub aligned_rotation_error_deg_mean: Option<f64>,
    /// Mean distance between camera centres after that similarity, in the truth's unit.
    pub aligned_center_error_mean: Option<f64>,
}

impl PoseErrors {
    /// Compares `camera_from_world` of every frame; `canonical` says that both share a world.
    ///
    /// Panics without a frame, or where the two differ in their number.
    pub fn new(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>], canonical: bool) -> Self {
        assert_eq!(estimate.len(), truth.len(), "a pose a frame");
        let errors = Self::between_frames(estimate, truth);
        if !canonical {
            return errors;
        }
        let frames = || estimate.iter().zip(truth);
        let angles: Vec<f64> = frames().map(|(a, b)| rotation_error(a, b).to_degrees()).collect();
        let shift = |scale: f64| {
            mean(frames().map(|(a, b)| (translation(a) * scale - translation(b)).norm()))
        };
        Self {
            reference_rotation_error_deg: Some(angles[0]),
            rotation_error_deg_mean: Some(mean(angles.iter().copied())),
            rotation_error_deg_median: Some(median(angles.clone())),
            rotation_auc_30: Some(area_under_curve(&angles)),
            translation_error_mean: Some(shift(1.0)),
            scaled_translation_error_mean: Some(shift(best_scale(estimate, truth))),
            ..errors
        }
    }

    /// What needs no common world.
    fn between_frames(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>]) -> Self {
        let relative = |from: usize, to: usize| {
            let turn =
                |poses: &[Isometry3<f32>]| poses[to].rotation * poses[from].rotation.inverse();
            angle(&turn(estimate), &turn(truth)).to_degrees()
        };
        let n_frames = estimate.len();
        let of_reference = (1..n_frames).map(|to| relative(0, to));
        let pairs: Vec<f64> =
            (1..n_frames).flat_map(|to| (0..to).map(move |from| relative(from, to))).collect();
        let of_pairs = |value: f64| (n_frames > 1).then_some(value);
        let (aligned_rotation, aligned_center) = aligned_errors(estimate, truth);
        Self {
            relative_rotation_error_deg_mean: of_pairs(mean(of_reference)),
            rra_5: of_pairs(share_below(&pairs, 5.0)),
            rra_15: of_pairs(share_below(&pairs, 15.0)),
            rra_30: of_pairs(share_below(&pairs, 30.0)),
            rra_auc_30: of_pairs(area_under_curve(&pairs)),
            aligned_rotation_error_deg_mean: Some(aligned_rotation.to_degrees()),
            aligned_center_error_mean: Some(aligned_center),
            ..Self::default()
        }
    }
}

fn share_below(errors: &[f64], most: f64) -> f64 {
    mean(errors.iter().map(|&error| f64::from(u8::from(error < most))))
}

/// An error of e degrees is below each angle from e on.
fn area_under_curve(errors: &[f64]) -> f64 {
    mean(errors.iter().map(|error| (1.0 - error / AUC_END).max(0.0)))
}

/// The factor by which estimated translations are nearest to the true ones, in squares.
fn best_scale(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>]) -> f64 {
    let pairs = estimate.iter().zip(truth).map(|(a, b)| (translation(a), translation(b)));
    let (along, squared) = pairs.fold((0.0, 0.0), |(along, squared), (a, b)| {
        (along + a.dot(&b), squared + a.norm_squared())
    });
    if squared > 0.0 { along / squared } else { 1.0 }
}

fn translation(pose: &Isometry3<f32>) -> nalgebra::Vector3<f64> {
    pose.translation.vector.cast()
}

fn angle(a: &UnitQuaternion<f32>, b: &UnitQuaternion<f32>) -> f64 {
    a.cast::<f64>().angle_to(&b.cast())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(axis_angle: [f32; 3], translation: [f32; 3]) -> Isometry3<f32> {
        Isometry3::new(translation.into(), axis_angle.into())
    }

    fn orbit() -> Vec<Isometry3<f32>> {
        (0..5).map(|l| pose([0.1 * l as f32, 0.3, 0.0], [0.01 * l as f32, 0.0, 2.0])).collect()
    }

    #[track_caller]
    fn check_near(actual: Option<f64>, expected: f64) {
        let actual = actual.expect("scored");
        assert!((actual - expected).abs() < 2e-3, "{actual} is not {expected}");
    }

    #[test]
    fn a_turn_of_the_whole_estimate_is_no_relative_error() {
        let turn = pose([0.0, 10f32.to_radians(), 0.0], [0.0; 3]);
        let turned: Vec<_> = orbit().iter().map(|pose| pose * turn).collect();
        let errors = PoseErrors::new(&turned, &orbit(), true);
        check_near(errors.rotation_error_deg_mean, 10.0);
        check_near(errors.rotation_error_deg_median, 10.0);
        check_near(errors.reference_rotation_error_deg, 10.0);
        check_near(errors.rotation_auc_30, 2.0 / 3.0);
        check_near(errors.relative_rotation_error_deg_mean, 0.0);
        check_near(errors.rra_5, 1.0);
        check_near(errors.aligned_rotation_error_deg_mean, 0.0);
    }

    #[test]
    fn a_similarity_of_the_world_is_aligned_away() {
        let world = pose([0.5, -0.2, 0.9], [0.3, 1.0, -2.0]);
        let moved = orbit().into_iter().map(|mut pose| {
            pose.translation.vector *= 3.0;
            pose * world
        });
        let errors = PoseErrors::new(&moved.collect::<Vec<_>>(), &orbit(), false);
        assert_eq!(errors.rotation_error_deg_mean, None);
        assert_eq!(errors.scaled_translation_error_mean, None);
        check_near(errors.aligned_rotation_error_deg_mean, 0.0);
        check_near(errors.aligned_center_error_mean, 0.0);
    }

    #[test]
    fn standing_still_on_a_15_frame_2_degree_sequence_scores_14_degrees() {
        let truth: Vec<_> = (0..15)
            .map(|l| pose([0.0, (2.0 * l as f32).to_radians(), 0.0], [0.0, 0.0, 2.0]))
            .collect();
        let errors = PoseErrors::new(&[truth[0]; 15], &truth, true);
        check_near(errors.rotation_error_deg_mean, 14.0);
        check_near(errors.relative_rotation_error_deg_mean, 15.0);
        check_near(errors.reference_rotation_error_deg, 0.0);
        // Of 105 pairs, 14 + 13 are 2° and 4° apart, and 15 − k are 2k° apart.
        check_near(errors.rra_5, 27.0 / 105.0);
        check_near(errors.rra_15, (1..=7).map(|k| 15.0 - f64::from(k)).sum::<f64>() / 105.0);
        check_near(errors.rra_30, 1.0);
    }

    #[test]
    fn one_frame_that_is_turned_round_spoils_the_mean_and_not_the_median() {
        let mut poses = orbit();
        poses[4] *= pose([0.0, 3.0, 0.0], [0.0; 3]);
        let errors = PoseErrors::new(&poses, &orbit(), true);
        check_near(errors.rotation_error_deg_mean, 3f64.to_degrees() / 5.0);
        check_near(errors.rotation_error_deg_median, 0.0);
        check_near(errors.rra_30, 0.6);
    }

    #[test]
    fn twice_the_depth_is_a_matter_of_scale() {
        let doubled = orbit().into_iter().map(|mut pose| {
            pose.translation.vector *= 2.0;
            pose
        });
        let errors = PoseErrors::new(&doubled.collect::<Vec<_>>(), &orbit(), true);
        check_near(errors.translation_error_mean, 2.0);
        check_near(errors.scaled_translation_error_mean, 0.0);
    }

    #[test]
    fn one_frame_has_no_pairs() {
        let errors = PoseErrors::new(&orbit()[..1], &orbit()[..1], true);
        assert_eq!((errors.relative_rotation_error_deg_mean, errors.rra_5), (None, None));
        check_near(errors.rotation_error_deg_mean, 0.0);
    }
}
