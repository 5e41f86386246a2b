//! Between our cameras and those of other programs. The one place that knows their conventions.
//!
//! | | transform | camera axes | centre of the top-left pixel |
//! | --- | --- | --- | --- |
//! | here | camera from world | x right, y down, z forward (OpenCV) | (0.5, 0.5) |
//! | `transforms.json` | world from camera | x right, y up, z backward (OpenGL) | (0.5, 0.5) |
//! | COLMAP | camera from world, `qw qx qy qz`, `tx ty tz` | OpenCV | (0.5, 0.5) |
//! | SRN | world from camera | OpenCV | (0.5, 0.5) |
//! | 3D-R2N2 | azimuth, elevation and distance | looks at the origin, up is up | (0.5, 0.5) |
//! | TUM | world from camera, `tx ty tz`, `qx qy qz qw` | OpenCV | – |
//! | glTF | world from camera, column by column | OpenGL | – |
//!
//! All who count pixels agree, so intrinsics are copied as they are. Worlds are taken as they come; of
//! ours, up +Y is glTF's up as well.

use nalgebra::{
    Isometry3, Matrix3, Matrix4, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion,
    Vector3,
};

use crate::data::viewpoint::look_at;

/// Where a pixel's centre lies in it, from its top-left corner.
pub const PIXEL_CENTRE: [f32; 2] = [0.5; 2];
/// How far a rotation's columns may be from orthonormal: files hold few digits.
const TOLERANCE: f64 = 1e-3;

/// Row by row.
pub type TransformMatrix = [[f64; 4]; 4];

/// `camera_from_world` of the world-from-camera matrix of a `transforms.json`, or why it is none.
pub fn from_opengl_matrix(transform: &TransformMatrix) -> Result<Isometry3<f32>, String> {
    let world_from_camera = rigid(transform)? * half_turn_about_x();
    Ok(world_from_camera.inverse().cast())
}

/// The world-from-camera matrix for a `transforms.json`.
pub fn to_opengl_matrix(camera_from_world: &Isometry3<f32>) -> TransformMatrix {
    let world_from_camera = double(camera_from_world).inverse() * half_turn_about_x();
    let matrix = world_from_camera.to_homogeneous();
    [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| matrix[(row, column)]))
}

/// `camera_from_world` of SRN's world-from-camera matrix, or why it is none.
pub fn from_opencv_matrix(transform: &TransformMatrix) -> Result<Isometry3<f32>, String> {
    Ok(rigid(transform)?.inverse().cast())
}

/// `camera_from_world` of COLMAP's `[qw, qx, qy, qz]` and `[tx, ty, tz]`, or why it is none.
pub fn from_colmap([w, i, j, k]: [f64; 4], t: [f64; 3]) -> Result<Isometry3<f32>, String> {
    let quaternion = Quaternion::new(w, i, j, k);
    if !t.into_iter().chain([quaternion.norm()]).all(f64::is_finite) {
        return Err("its pose holds a value that is not finite".into());
    }
    if (quaternion.norm() - 1.0).abs() > TOLERANCE {
        return Err(format!("its quaternion has the length {}, not 1", quaternion.norm()));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    Ok(Isometry3::from_parts(Translation3::from(t), rotation).cast())
}

/// COLMAP's `[qw, qx, qy, qz]` and `[tx, ty, tz]`.
pub fn to_colmap(camera_from_world: &Isometry3<f32>) -> ([f64; 4], [f64; 3]) {
    let pose = double(camera_from_world);
    let imaginary = pose.rotation.imag();
    let quaternion = [pose.rotation.w, imaginary.x, imaginary.y, imaginary.z];
    (quaternion, pose.translation.vector.into())
}

/// TUM's `[tx, ty, tz, qx, qy, qz, qw]`.
pub fn to_tum(camera_from_world: &Isometry3<f32>) -> [f64; 7] {
    let pose = double(camera_from_world).inverse();
    let [t, q] = [pose.translation.vector, pose.rotation.imag()];
    [t.x, t.y, t.z, q.x, q.y, q.z, pose.rotation.w]
}

/// `camera_from_world` of a 3D-R2N2 view, angles in radians. The model's axes are turned from those of
/// ShapeNetCore v1, in which it was rendered, to v2's: azimuth 0 looks at the front, a quarter at +X.
pub fn from_orbit(azimuth: f32, elevation: f32, distance: f32) -> Isometry3<f32> {
    let [sine, cosine] = [azimuth.sin(), -azimuth.cos()].map(|part| part * elevation.cos());
    look_at(Point3::new(sine, elevation.sin(), cosine) * distance, Point3::origin())
}

/// The rigid transform that a matrix holds, or why it holds none.
fn rigid(transform: &TransformMatrix) -> Result<Isometry3<f64>, String> {
    let matrix = Matrix4::from_fn(|row, column| transform[row][column]);
    if matrix.iter().any(|value| !value.is_finite()) {
        return Err("its matrix holds a value that is not finite".into());
    }
    if (matrix.row(3) - Matrix4::identity().row(3)).amax() > TOLERANCE {
        return Err("the last row of its matrix is not 0 0 0 1".into());
    }
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
    if (rotation.transpose() * rotation - Matrix3::identity()).amax() > TOLERANCE {
        return Err("its matrix does not hold a rotation".into());
    }
    if rotation.determinant() < 0.0 {
        return Err("its matrix mirrors (determinant −1)".into());
    }
    let rotation = Rotation3::from_matrix_unchecked(rotation);
    let position: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into();
    Ok(Isometry3::from_parts(
        Translation3::from(position),
        UnitQuaternion::from_rotation_matrix(&rotation),
    ))
}

/// In double precision, in which a quaternion of f32 is not of length 1: inverting it would cost a bit
/// of the translation.
fn double(pose: &Isometry3<f32>) -> Isometry3<f64> {
    let pose = pose.cast();
    let rotation = UnitQuaternion::new_normalize(pose.rotation.into_inner());
    Isometry3::from_parts(pose.translation, rotation)
}

/// Between OpenCV's camera axes and OpenGL's. It is its own inverse.
fn half_turn_about_x() -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

#[cfg(test)]
mod tests;
