use super::*;
use crate::data::{
    keyed_rng,
    mesh::Triangle,
    polygon::tests::{L_SHAPE, is_inside, shoelace, star},
};
use rand::Rng;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn read(name: &str) -> Loaded {
    read_mesh(&fixture(name)).expect("the fixture is a mesh")
}

/// Every triangle of the car has a triangle of the file with the same corners, and the colour that
/// `color` makes of its own.
#[track_caller]
fn check_is_the_car(name: &str, color: fn(f32) -> f32) {
    let car = read("shapenet_v2/02958343/smarts_simple_car/models/model_normalized.obj").mesh;
    let Loaded { mesh, warnings } = read(name);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(mesh.triangles.len(), car.triangles.len());

    let near = |a: f32, b: f32, tolerance: f32| (a - b).abs() < tolerance;
    for triangle in &car.triangles {
        let expected = car.corners(triangle);
        let is_same = |other: &&Triangle| {
            let corners = mesh.corners(other);
            let placed = (0..3)
                .any(|turn| (0..3).all(|i| (corners[(i + turn) % 3] - expected[i]).amax() < 2e-6));
            // Colours were written as bytes.
            placed && (0..3).all(|c| near(other.color[c], color(triangle.color[c]), 0.01))
        };
        assert!(mesh.triangles.iter().any(|other| is_same(&other)), "{expected:?}");
    }
}

#[test]
fn a_car_is_the_same_in_every_format() {
    check_is_the_car("formats/car.ply", |channel| channel);
    // This one has no colours.
    check_is_the_car("formats/car.off", |_| 0.7);
    // This one was written as light.
    check_is_the_car("formats/car.glb", |channel| match channel <= 0.003_130_8 {
        true => 12.92 * channel,
        false => 1.055 * channel.powf(1.0 / 2.4) - 0.055,
    });
}

/// The file has the triangles of another, with their pictures where those lie.
#[track_caller]
fn check_is_textured_as(name: &str, expected: &str) {
    let expected = read(expected).mesh;
    let Loaded { mesh, warnings } = read(name);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(mesh.textures, expected.textures);
    assert_eq!(mesh.triangles.len(), expected.triangles.len());
    for (triangle, of) in mesh.triangles.iter().zip(&expected.triangles) {
        assert_eq!(mesh.corners(triangle), expected.corners(of));
        assert_eq!((triangle.uvs, triangle.texture), (of.uvs, of.texture));
        assert!(triangle.texture.is_some());
        assert!(triangle.color.iter().all(|channel| (channel - 1.0).abs() < 1e-6));
    }
}

#[test]
fn a_texture_lies_the_same_in_every_format() {
    for name in ["square.glb", "square.gltf", "square.ply", "square_by_vertex.ply"] {
        check_is_textured_as(&format!("formats/{name}"), "formats/square.obj");
    }
    check_is_textured_as("formats/squares.ply", "formats/squares.obj");
}

/// One face with these corners, in every format that has polygons.
fn polygon_files(corners: &[[f32; 2]]) -> [(&'static str, String); 3] {
    let n = corners.len();
    let points = |start: &str| -> String {
        corners.iter().map(|[x, y]| format!("{start}{x} {y} {}\n", x + 2.0 * y)).collect()
    };
    let indices =
        |first: usize| (first..first + n).map(|idx| format!(" {idx}")).collect::<String>();
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
         {}{n}{}\n",
        points(""),
        indices(0)
    );
    [
        ("face.obj", format!("{}f{}\n", points("v "), indices(1))),
        ("face.off", format!("OFF\n{n} 1 0\n{}{n}{}\n", points(""), indices(0))),
        ("face.ply", ply),
    ]
}

#[test]
fn concave_faces_are_filled_in_every_format() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for corners in [&L_SHAPE[..], &star()] {
        for (name, text) in polygon_files(corners) {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("writable");
            let mesh = read_mesh(&path).expect("it has area").mesh;
            let area = |triangle: &Triangle| mesh.area_vector(triangle).z / 2.0;
            let covered: f32 = mesh.triangles.iter().map(area).sum();
            assert!((covered - shoelace(corners)).abs() < 1e-5, "{name}: {covered}");
            for triangle in &mesh.triangles {
                let [x, y] = [0, 1].map(|axis| mesh.corners(triangle).map(|corner| corner[axis]));
                let centroid = [x, y].map(|values| values.iter().sum::<f32>() / 3.0);
                assert!(is_inside(corners, centroid) && area(triangle) > 0.0, "{name}");
            }
        }
    }
}

#[test]
fn a_face_that_crosses_itself_is_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in polygon_files(&[[0., 0.], [1., 1.], [1., 0.5], [0., 1.]]) {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("writable");
        read_mesh(&path).expect("it has area");
    }
}

#[test]
fn damaged_files_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for entry in fs::read_dir(fixture("formats")).expect("the fixtures") {
        let path = entry.expect("a fixture").path();
        fs::copy(&path, folder.path().join(path.file_name().expect("a name"))).expect("writable");
    }
    for name in
        ["square.obj", "square.gltf", "square.glb", "squares.ply", "car.glb", "car.ply", "car.off"]
    {
        let path = folder.path().join(name);
        let whole = fs::read(&path).expect("readable");
        for damage in 0..100 {
            let mut rng = keyed_rng(damage, [0, 0]);
            let mut bytes = whole.clone();
            // Headers hold what everything else depends on.
            let reach = if rng.random() { bytes.len() } else { bytes.len().min(1000) };
            for _ in 0..rng.random_range(1..4) {
                bytes[rng.random_range(0..reach)] = rng.random();
            }
            fs::write(&path, &bytes).expect("writable");
            // What is read was found usable; all that could go wrong is a panic.
            let _ = read_mesh(&path);
        }
    }
}

#[test]
fn an_unknown_extension_is_refused() {
    for name in ["car.fbx", "car", "car.OBJ.bak"] {
        let error = read_mesh(Path::new(name)).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("obj, glb, gltf"), "{error}");
        assert!(!is_mesh_file(Path::new(name)));
    }
    assert!(is_mesh_file(Path::new("CAR.GLB")));
}

#[test]
fn the_hash_follows_the_shape_wherever_it_lies() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = ["square.gltf", "square_indices.bin", "square_positions.bin", "square.png"];
    for name in files.into_iter().chain(["texture coordinates.bin"]) {
        let bytes = fs::read(fixture("formats").join(name)).expect("the fixture");
        fs::write(folder.path().join(name), bytes).expect("writable");
    }
    let hash = |name: &str| shape_hash(&folder.path().join(name)).expect("readable");
    let before = hash("square.gltf");
    fs::remove_file(folder.path().join("square.png")).expect("it is there");
    assert_eq!(hash("square.gltf"), before);
    let mut positions = fs::read(folder.path().join("square_positions.bin")).expect("readable");
    positions[3] ^= 1;
    fs::write(folder.path().join("square_positions.bin"), positions).expect("writable");
    assert_ne!(hash("square.gltf"), before);
}
