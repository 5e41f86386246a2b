//! Two looks at one picture: as it is, and in the mirror, where a symmetric object is itself again.
//!
//! What the regressors get wrong about the two is partly independent, so that their mean is better than
//! either.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::SAME_POSE;

/// `camera_from_world` of the picture in the mirror, x ↦ −x in the camera and in the world: S R S and S t
/// with S = diag(−1, 1, 1).
pub fn mirrored(pose: &Isometry3<f32>) -> Isometry3<f32> {
    // A mirror keeps the part of a rotation's axis along its normal, and turns the other two round.
    let Quaternion { coords: q } = *pose.rotation.quaternion();
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, -q.y, -q.z));
    let t = pose.translation.vector;
    Isometry3::from_parts(Translation3::new(-t.x, t.y, t.z), rotation)
}

/// The poses of two looks, with their confidences, as one list, best first: those that mean one pose are
/// averaged, each as sure as it is.
pub fn agreed(
    one: &[(Isometry3<f32>, f32)],
    other: &[(Isometry3<f32>, f32)],
) -> Vec<(Isometry3<f32>, f32)> {
    let mut surest_first: Vec<_> = one.iter().chain(other).copied().collect();
    surest_first.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut groups: Vec<Vec<(Isometry3<f32>, f32)>> = Vec::new();
    for (pose, confidence) in surest_first {
        let same = |group: &&mut Vec<(Isometry3<f32>, f32)>| {
            group[0].0.rotation.angle_to(&pose.rotation) < SAME_POSE
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.push((pose, confidence)),
            None => groups.push(vec![(pose, confidence)]),
        }
    }
    let mut poses: Vec<_> = groups.iter().map(|group| mean(group)).collect();
    poses.sort_by(|a, b| b.1.total_cmp(&a.1));
    poses
}

/// The weighted mean of poses that are close, and the mean over two looks of their confidences.
fn mean(group: &[(Isometry3<f32>, f32)]) -> (Isometry3<f32>, f32) {
    let first = group[0].0.rotation;
    let total: f32 = group.iter().map(|(_, confidence)| confidence).sum();
    let average = |of: &dyn Fn(&Isometry3<f32>) -> Vector3<f32>| -> Vector3<f32> {
        group.iter().map(|(pose, confidence)| of(pose) * (confidence / total)).sum()
    };
    let turn = average(&|pose| (pose.rotation * first.inverse()).scaled_axis());
    let translation = average(&|pose| pose.translation.vector);
    let rotation = UnitQuaternion::from_scaled_axis(turn) * first;
    (Isometry3::from_parts(translation.into(), rotation), total / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Intrinsics;
    use nalgebra::Point3;

    const CAMERA: Intrinsics = Intrinsics { focal: [80.0; 2], center: [32.0; 2] };

    fn project(pose: &Isometry3<f32>, point: Point3<f32>) -> [f32; 2] {
        let seen = pose * point;
        [0, 1].map(|i| CAMERA.focal[i] * seen[i] / seen.z + CAMERA.center[i])
    }

    /// The mirrored point lands in the mirrored picture, 64 pixels wide.
    #[test]
    fn a_mirrored_pose_takes_the_mirrored_picture() {
        let pose = Isometry3::new(Vector3::new(0.2, -0.1, 2.0), Vector3::new(0.3, -0.8, 0.2));
        for point in [[0.3, 0.1, -0.2], [-0.1, 0.4, 0.5], [0.2, -0.3, 0.1]].map(Point3::from) {
            let [u, v] = project(&pose, point);
            let [x, y, z] = point.coords.into();
            let [mirrored_u, mirrored_v] = project(&mirrored(&pose), Point3::new(-x, y, z));
            assert!((64.0 - u - mirrored_u).abs() < 1e-4 && (v - mirrored_v).abs() < 1e-4);
        }
    }

    fn turned(degrees: f32, z: f32) -> Isometry3<f32> {
        Isometry3::new(Vector3::z() * z, Vector3::y() * degrees.to_radians())
    }

    #[test]
    fn looks_that_mean_one_pose_are_averaged_by_their_confidence() {
        let one = [(turned(10.0, 2.0), 0.6), (turned(190.0, 2.0), 0.4)];
        let other = [(turned(186.0, 2.4), 0.8), (turned(16.0, 2.3), 0.2)];
        let expected =
            [(turned(188.0 - 2.0 / 3.0, 2.0 + 0.8 / 3.0), 0.6), (turned(11.5, 2.075), 0.4)];
        let found = agreed(&one, &other);
        assert_eq!(found.len(), 2);
        for ((pose, confidence), (expected, sure)) in found.iter().zip(expected) {
            assert!(pose.rotation.angle_to(&expected.rotation) < 1e-4, "{pose} is not {expected}");
            assert!((pose.translation.z - expected.translation.z).abs() < 1e-5, "{pose}");
            assert!((confidence - sure).abs() < 1e-6, "{confidence} is not {sure}");
        }
    }

    #[test]
    fn a_pose_that_one_look_alone_sees_is_half_as_sure() {
        let found = agreed(&[(turned(0.0, 2.0), 1.0)], &[(turned(90.0, 2.0), 1.0)]);
        assert_eq!(found.iter().map(|(_, confidence)| *confidence).collect::<Vec<_>>(), [0.5, 0.5]);
    }
}
