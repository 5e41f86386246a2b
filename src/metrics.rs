//! How far an estimate is from the truth (Eq. 7, Fig. 3).

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::nearest_neighbours::mutual_neighbours;

/// The angle of the rotation from one pose to the other, in radians: the geodesic error.
pub fn rotation_error(a: &Isometry3<f32>, b: &Isometry3<f32>) -> f64 {
    angle(&a.rotation, &b.rotation)
}

/// Errors of a sequence's poses. Angles are in degrees, lengths in world units (diagonal 1).
///
/// Absolute errors need a truth in the canonical frame, and are `None` where its world is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseErrors {
    /// Of the reference frame, p_0.
    pub reference_rotation_error_deg: Option<f64>,
    /// Mean over all frames, the reference included: the paper's pose error.
    pub rotation_error_deg_mean: Option<f64>,
    /// Mean over target frames of the error in their rotation from the reference frame.
    pub relative_rotation_error_deg_mean: Option<f64>,
    /// Mean distance between estimated and true t.
    pub translation_error_mean: Option<f64>,
    /// Mean over frames after the similarity that best aligns the two sets of cameras.
    pub aligned_rotation_error_deg_mean: Option<f64>,
    /// Mean distance between camera centres after that similarity, in the truth's unit.
    pub aligned_center_error_mean: Option<f64>,
}

impl PoseErrors {
    /// Compares `camera_from_world` of every frame; `canonical` says that both share a world.
    pub fn new(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>], canonical: bool) -> Self {
        let angles = estimate.iter().zip(truth).map(|(a, b)| rotation_error(a, b));
        let shifts = estimate
            .iter()
            .zip(truth)
            .map(|(a, b)| f64::from((a.translation.vector - b.translation.vector).norm()));
        let from_reference = |poses: &[Isometry3<f32>]| -> Vec<UnitQuaternion<f32>> {
            let inverse = poses[0].rotation.inverse();
            poses[1..].iter().map(|pose| pose.rotation * inverse).collect()
        };
        let relative: Vec<f64> = from_reference(estimate)
            .iter()
            .zip(&from_reference(truth))
            .map(|(a, b)| angle(a, b))
            .collect();
        let (aligned_rotation, aligned_center) = aligned_errors(estimate, truth);
        let absolute = |error: f64| canonical.then_some(error);
        Self {
            reference_rotation_error_deg: absolute(
                rotation_error(&estimate[0], &truth[0]).to_degrees(),
            ),
            rotation_error_deg_mean: absolute(mean(angles).to_degrees()),
            relative_rotation_error_deg_mean: (!relative.is_empty())
                .then(|| mean(relative.iter().copied()).to_degrees()),
            translation_error_mean: absolute(mean(shifts)),
            aligned_rotation_error_deg_mean: Some(aligned_rotation.to_degrees()),
            aligned_center_error_mean: Some(aligned_center),
        }
    }
}

/// Eq. 7: mean squared distance from each point to the other cloud's nearest, both ways added up.
///
/// In squared world units (diagonal 1). Two samplings of one mesh at N = 24,576 score about 4.7e-5.
pub fn style_error(estimate: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    let [of_estimate, of_truth] = mutual_neighbours(estimate, truth);
    mean_squared_distance(estimate, truth, &of_estimate)
        + mean_squared_distance(truth, estimate, &of_truth)
}

fn mean_squared_distance(from: &[[f32; 3]], to: &[[f32; 3]], nearest: &[u32]) -> f64 {
    let distances = from.iter().zip(nearest).map(|(&from, &nearest)| {
        let offset = Point3::from(from) - Point3::from(to[nearest as usize]);
        f64::from(offset.norm_squared())
    });
    mean(distances)
}

/// Mean rotation error (radians) and centre error (the truth's unit), similarity taken out.
///
/// The estimate's world turns onto the truth's by the rotation that orientations agree on, which
/// stands firm where centres nearly lie on a line; scale and shift follow from the centres.
fn aligned_errors(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>]) -> (f64, f64) {
    let poses = estimate.iter().zip(truth);
    let votes = poses.clone().map(|(estimate, truth)| {
        let truth_from_estimate = truth.rotation.inverse() * estimate.rotation;
        truth_from_estimate.cast::<f64>().to_rotation_matrix().into_inner()
    });
    let turn = nearest_rotation(votes.sum());
    let angles = poses.map(|(estimate, truth)| {
        let estimate = estimate.rotation.cast::<f64>() * turn.inverse();
        estimate.angle_to(&truth.rotation.cast())
    });

    let center =
        |pose: &Isometry3<f32>| -(pose.rotation.inverse() * pose.translation.vector).cast::<f64>();
    let estimated: Vec<_> = estimate.iter().map(|pose| turn * center(pose)).collect();
    let true_centers: Vec<_> = truth.iter().map(center).collect();
    let (from, to) = (centroid(&estimated), centroid(&true_centers));
    let pairs = || estimated.iter().zip(&true_centers);
    let variance: f64 = estimated.iter().map(|c| (c - from).norm_squared()).sum();
    let covariance: f64 = pairs().map(|(a, b)| (a - from).dot(&(b - to))).sum();
    let scale = if variance > 0.0 { covariance / variance } else { 1.0 };
    let offsets = pairs().map(|(a, b)| ((a - from) * scale - (b - to)).norm());
    (mean(angles), mean(offsets))
}

/// The rotation nearest to a sum of rotation matrices (their chordal mean).
fn nearest_rotation(sum: Matrix3<f64>) -> UnitQuaternion<f64> {
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let mut signs = Matrix3::identity();
    signs[(2, 2)] = (u * v_t).determinant().signum();
    let rotation = Rotation3::from_matrix_unchecked(u * signs * v_t);
    UnitQuaternion::from_rotation_matrix(&rotation)
}

fn angle(a: &UnitQuaternion<f32>, b: &UnitQuaternion<f32>) -> f64 {
    a.cast::<f64>().angle_to(&b.cast())
}

fn centroid(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len() as f64
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
    sum / f64::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

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
        check_near(errors.reference_rotation_error_deg, 10.0);
        check_near(errors.relative_rotation_error_deg_mean, 0.0);
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
    }

    #[test]
    fn the_style_error_is_the_brute_force_one() {
        let mut rng = keyed_rng(1, [0, 0]);
        let mut cloud = |n: usize| -> Vec<[f32; 3]> { (0..n).map(|_| rng.random()).collect() };
        let (a, b) = (cloud(60), cloud(45));
        let one_way = |from: &[[f32; 3]], to: &[[f32; 3]]| {
            let nearest = |p: &[f32; 3]| {
                let distances =
                    to.iter().map(|q| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>());
                f64::from(distances.fold(f32::INFINITY, f32::min))
            };
            from.iter().map(nearest).sum::<f64>() / from.len() as f64
        };
        let expected = one_way(&a, &b) + one_way(&b, &a);
        assert!((style_error(&a, &b) - expected).abs() < 1e-9);
    }
}
