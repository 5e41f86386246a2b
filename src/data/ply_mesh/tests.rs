use super::*;
use std::fs;

const VERTICES: &str = "property float x\nproperty float y\nproperty double z\n";
const FACES: &str = "property list uchar int vertex_indices\n";

/// A square of four vertices, then `faces`.
fn square(face_header: &str, n_faces: usize, faces: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\n{VERTICES}element face {n_faces}\n\
         {face_header}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n{faces}"
    )
}

fn read(bytes: &[u8]) -> Result<Loaded> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.ply");
    fs::write(&path, bytes).expect("writable");
    read_ply(&path)
}

#[track_caller]
fn check_refused(text: &str, reason: &str) {
    let error = read(text.as_bytes()).expect_err("it is broken").to_string();
    assert!(error.contains("model.ply") && error.contains(reason), "{error}");
    assert!(!error.contains('\n'), "{error:?}");
}

#[test]
fn polygons_become_fans() {
    let mesh = read(square(FACES, 1, "4 0 1 2 3\n").as_bytes()).expect("a square").mesh;
    let triangles: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.vertices).collect();
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn a_face_has_its_own_colour_or_the_mean_of_its_vertices() {
    let header = format!("{FACES}property uchar red\nproperty uchar green\nproperty uchar blue\n");
    let own = read(square(&header, 1, "3 0 1 2 255 51 0\n").as_bytes()).expect("a triangle");
    assert_eq!(own.mesh.triangles[0].color, [1.0, 0.2, 0.0]);

    let colors = "property float red\nproperty float green\nproperty float blue\n";
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\n{VERTICES}{colors}element face 1\n{FACES}\
         end_header\n0 0 0 1 0 0\n1 0 0 1 0.5 0\n0 1 0 1 1 0\n3 0 1 2\n"
    );
    let mean = read(text.as_bytes()).expect("a triangle").mesh;
    assert_eq!(mean.triangles[0].color, [1.0, 0.5, 0.0]);
}

#[test]
fn big_endian_files_with_short_indices_are_read() {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uint8 uint16 vertex_index\nend_header\n"
        .to_vec();
    let corners = [[0.0_f32, 0., 0.], [2., 0., 0.], [0., 3., 0.]];
    bytes.extend(corners.iter().flatten().flat_map(|value| value.to_be_bytes()));
    bytes.extend([3, 0, 0, 0, 1, 0, 2]);
    let mesh = read(&bytes).expect("a triangle").mesh;
    assert_eq!(mesh.corners(&mesh.triangles[0]).map(<[f32; 3]>::from), corners);
}

#[test]
fn a_texture_that_cannot_be_shown_leaves_the_colour_and_a_warning() {
    let named = |name: &str| format!("1.0\ncomment TextureFile {name}\n");
    let header = format!(
        "{FACES}property list uchar float texcoord\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    );
    for name in ["my car.png", "../a.png"] {
        let text =
            square(&header, 1, "3 0 1 2 6 0 0 1 0 1 1 255 51 0\n").replace("1.0\n", &named(name));
        let Loaded { mesh, warnings } = read(text.as_bytes()).expect("a triangle");
        assert_eq!((mesh.triangles[0].color, mesh.triangles[0].texture), ([1.0, 0.2, 0.0], None));
        assert!(warnings.len() == 1 && warnings[0].contains(name), "{warnings:?}");
    }
}

/// The square with the picture of a fixture.
fn textured(face_header: &str, faces: &str) -> Loaded {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/formats/square.png");
    fs::copy(picture, folder.path().join("a b.png")).expect("it is there");
    let text = square(&format!("{FACES}{face_header}"), faces.lines().count(), faces);
    let path = folder.path().join("model.ply");
    fs::write(&path, text.replace("1.0\n", "1.0\ncomment TextureFile a b.png\n"))
        .expect("writable");
    read_ply(&path).expect("it has area")
}

#[test]
fn faces_without_usable_coordinates_or_texture_stay_plain() {
    let header = "property list uchar double texcoord\nproperty int texnumber\n";
    let faces = "4 0 1 2 3 8 0 0 1 0 1 1 0 1 0\n3 0 1 2 0 0\n3 0 1 2 4 0 0 1 0 0\n\
                 3 0 1 2 6 0 0 1 0 1 1 -1\n3 0 1 2 6 0 0 1 0 1 1 7\n";
    let Loaded { mesh, warnings } = textured(header, faces);
    assert!(warnings.is_empty(), "{warnings:?}");
    let textures: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.texture).collect();
    assert_eq!(textures, [Some(0), Some(0), None, None, None, None]);
    assert_eq!(mesh.triangles[1].uvs, [[0., 0.], [1., 1.], [0., 1.]]);

    let Loaded { mesh, warnings } = textured("", "3 0 1 2\n");
    assert_eq!((mesh.triangles[0].color, mesh.triangles[0].texture), (GREY, None));
    assert!(warnings[0].contains("where that lies"), "{warnings:?}");
}

#[test]
fn broken_files_are_refused() {
    check_refused("", "");
    check_refused("not a ply\n", "Line 1");
    check_refused(&square(FACES, 1, "3 0 1 x\n"), "Line 14");
    check_refused(&square(FACES, 1, "3 0 1\n"), "Line 14");
    check_refused(&square(FACES, 1, "3 0 1 -1\n"), "Line 14");
    check_refused(&square(FACES, 2, "3 0 1 2\n"), "Line 15");
    check_refused(&square(FACES, 1, "3 0 1 4\n"), "face 0 has a corner 4");
    check_refused(&square(FACES, 1, "2 0 1\n"), "face 0 needs three corners");
    check_refused(&square(FACES, 1, "3 1 1 1\n"), "no area");
    check_refused(&square(FACES, 0, ""), "no triangles");
    check_refused(
        &square("property list uchar float vertex_indices\n", 1, "3 0 1 2\n"),
        "vertex_indices",
    );
    let huge = square(FACES, 1, "3 0 1 2\n").replace("1 1 0\n", "1 1e30 0\n");
    check_refused(&huge, "vertex 2: coordinate");
    let flat = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n";
    check_refused(flat, "vertex 0: coordinate NaN");
}
