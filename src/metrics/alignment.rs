//! Errors after the similarity that best aligns two sets of cameras.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::mean;

/// Mean rotation error (radians) and centre error (the truth's unit), similarity taken out.
///
/// The estimate's world turns onto the truth's by the rotation that orientations agree on, which
/// stands firm where centres nearly lie on a line; scale and shift follow from the centres.
pub(super) fn aligned_errors(estimate: &[Isometry3<f32>], truth: &[Isometry3<f32>]) -> (f64, f64) {
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

fn centroid(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len() as f64
}
