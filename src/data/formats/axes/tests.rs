use super::*;

/// A camera at (1, 2, 3) that looks along the world's −x, with the world's z up: its x is then
/// the world's y, its y the world's z, and it looks along its −z.
const EXAMPLE: TransformMatrix =
    [[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]];

fn example() -> Isometry3<f32> {
    from_opengl_matrix(&EXAMPLE).expect("it is rigid")
}

#[test]
fn points_land_where_computed_by_hand() {
    // Five ahead, half a unit to the right and a quarter up, that is −0.25 down.
    let point = example() * Point3::new(-4.0, 2.5, 3.25);
    assert!((point - Point3::new(0.5, -0.25, 5.0)).norm() < 1e-5, "{point}");
}

#[test]
fn opencv_matrices_differ_by_the_signs_of_two_columns() {
    let matrix = EXAMPLE.map(|[x, y, z, position]| [x, -y, -z, position]);
    let pose = from_opencv_matrix(&matrix).expect("it is rigid");
    assert!((pose.to_homogeneous() - example().to_homogeneous()).amax() < 1e-6);
}

#[test]
fn poses_round_trip_through_every_notation() {
    let back = to_opengl_matrix(&example());
    let difference = back.as_flattened().iter().zip(EXAMPLE.as_flattened());
    assert!(difference.clone().all(|(a, b)| (a - b).abs() < 1e-6), "{back:?}");

    let (quaternion, translation) = to_colmap(&example());
    let back = from_colmap(quaternion, translation).expect("it is rigid");
    assert!((back.to_homogeneous() - example().to_homogeneous()).amax() < 1e-6);

    let [x, y, z, ..] = to_tum(&example());
    assert!((Vector3::new(x, y, z) - Vector3::new(1.0, 2.0, 3.0)).amax() < 1e-6);
}

#[test]
fn what_is_not_rigid_is_refused() {
    let with = |row: usize, column: usize, value: f64| {
        let mut matrix = EXAMPLE;
        matrix[row][column] = value;
        from_opengl_matrix(&matrix).unwrap_err()
    };
    assert!(with(1, 3, f64::NAN).contains("finite"));
    assert!(with(0, 2, 2.0).contains("rotation"));
    assert!(with(0, 2, -1.0).contains("mirrors"));
    assert!(with(3, 3, 2.0).contains("last row"));
    assert!(from_colmap([1.0, 1.0, 0.0, 0.0], [0.0; 3]).unwrap_err().contains("length"));
    assert!(from_colmap([1.0, 0.0, 0.0, 0.0], [f64::NAN; 3]).unwrap_err().contains("finite"));
}

/// The projection of `ShapeNetRendering` as its users compute it, from a blender world with z up:
/// a turn by the azimuth about z, one by the elevation about y, then along x.
#[test]
fn orbits_are_those_of_3d_r2n2() {
    let [azimuth, elevation, distance] = [0.7_f32, 0.4, 1.5];
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -azimuth)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), -elevation);
    let eye_in_blender = turn * Vector3::new(distance, 0.0, 0.0);
    let right_in_blender = turn * Vector3::y();
    // Blender reads a ShapeNetCore v1 model's (x, y, z) as (x, −z, y); v2's axes are (z, y, −x).
    let canonical = |v: Vector3<f32>| Vector3::new(-v.y, v.z, -v.x);

    let world_from_camera = from_orbit(azimuth, elevation, distance).inverse();
    let eye = world_from_camera.translation.vector;
    assert!((eye - canonical(eye_in_blender)).norm() < 1e-5, "{eye}");
    let right = world_from_camera * Vector3::x();
    assert!((right - canonical(right_in_blender)).norm() < 1e-5, "{right}");
}
