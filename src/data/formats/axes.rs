//! Between our cameras and those of `transforms.json`. The one place that knows both conventions.
//!
//! | | here | `transforms.json` |
//! | --- | --- | --- |
//! | transform | camera from world | world from camera |
//! | camera axes | x right, y down, z forward (OpenCV) | x right, y up, z backward (OpenGL) |
//! | centre of the top-left pixel | (0.5, 0.5) | (0.5, 0.5) |
//!
//! Pixels agree, so intrinsics are copied as they are.

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3};

/// How far a rotation's columns may be from orthonormal: files hold few digits.
const TOLERANCE: f64 = 1e-3;

/// Row by row.
pub type TransformMatrix = [[f64; 4]; 4];

/// `camera_from_world` of a file's world-from-camera matrix, or why it is none.
pub fn camera_from_world(transform: &TransformMatrix) -> Result<Isometry3<f32>, String> {
    let matrix = Matrix4::from_fn(|row, column| transform[row][column]);
    if matrix.iter().any(|value| !value.is_finite()) {
        return Err("its transform_matrix holds a value that is not finite".into());
    }
    if (matrix.row(3) - Matrix4::identity().row(3)).amax() > TOLERANCE {
        return Err("the last row of its transform_matrix is not 0 0 0 1".into());
    }
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
    if (rotation.transpose() * rotation - Matrix3::identity()).amax() > TOLERANCE {
        return Err("its transform_matrix does not hold a rotation".into());
    }
    if rotation.determinant() < 0.0 {
        return Err("its transform_matrix mirrors (determinant −1)".into());
    }
    let rotation = Rotation3::from_matrix_unchecked(rotation * opencv_from_opengl());
    let position: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into();
    let world_from_camera = Isometry3::from_parts(
        Translation3::from(position),
        UnitQuaternion::from_rotation_matrix(&rotation),
    );
    Ok(world_from_camera.inverse().cast())
}

/// The file's world-from-camera matrix of `camera_from_world`.
pub fn transform_matrix(camera_from_world: &Isometry3<f32>) -> TransformMatrix {
    let world_from_camera = camera_from_world.cast::<f64>().inverse().to_homogeneous();
    let matrix = world_from_camera * opencv_from_opengl().to_homogeneous();
    [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| matrix[(row, column)]))
}

/// A half turn about x. It is its own inverse.
fn opencv_from_opengl() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A camera at (1, 2, 3) that looks along the world's −x, with the world's z up: its x is then
    /// the world's y, its y the world's z, and it looks along its −z.
    const EXAMPLE: TransformMatrix =
        [[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]];

    #[test]
    fn points_land_where_computed_by_hand() {
        let pose = camera_from_world(&EXAMPLE).expect("it is rigid");
        // Five ahead, half a unit to the right and a quarter up, that is −0.25 down.
        let point = pose * Point3::new(-4.0, 2.5, 3.25);
        assert!((point - Point3::new(0.5, -0.25, 5.0)).norm() < 1e-5, "{point}");
    }

    #[test]
    fn matrices_round_trip() {
        let back = transform_matrix(&camera_from_world(&EXAMPLE).expect("it is rigid"));
        let difference = back.as_flattened().iter().zip(EXAMPLE.as_flattened());
        assert!(difference.clone().all(|(a, b)| (a - b).abs() < 1e-6), "{back:?}");
    }

    #[test]
    fn matrices_that_are_not_rigid_are_refused() {
        let with = |row: usize, column: usize, value: f64| {
            let mut matrix = EXAMPLE;
            matrix[row][column] = value;
            camera_from_world(&matrix).unwrap_err()
        };
        assert!(with(1, 3, f64::NAN).contains("finite"));
        assert!(with(0, 2, 2.0).contains("rotation"));
        assert!(with(0, 2, -1.0).contains("mirrors"));
        assert!(with(3, 3, 2.0).contains("last row"));
    }
}
