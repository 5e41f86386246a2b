use super::*;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A triangle in a .gltf: positions, a strip of indices, texture coordinates and colours.
fn document() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": "data.bin", "byteLength": 72}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 8},
            {"buffer": 0, "byteOffset": 56, "byteLength": 16},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4,
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3},
            {"bufferView": 2, "componentType": 5121, "type": "VEC4", "normalized": true, "count": 4},
        ],
    })
}

/// What `document` calls data.bin: a square, four indices and four colours.
fn data() -> Vec<u8> {
    let positions = [[0.0_f32, 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]];
    let mut bytes: Vec<u8> = positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend([255, 0, 0, 255].repeat(4));
    bytes
}

fn write(document: &Value) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.gltf");
    fs::write(&path, document.to_string()).expect("writable");
    fs::write(folder.path().join("data.bin"), data()).expect("writable");
    (folder, path)
}

fn loaded(document: &Value) -> Loaded {
    let (_folder, path) = write(document);
    read_gltf(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// Replaces the value at a JSON pointer.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = document();
    *document.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}")) = value;
    document
}

#[track_caller]
fn check_refused(document: &Value, reason: &str) {
    let (_folder, path) = write(document);
    let error = read_gltf(&path).expect_err("it is broken").to_string();
    assert!(error.contains("model.gltf") && error.contains(reason), "{error}");
    assert!(!error.contains('\n'), "{error:?}");
}

#[test]
fn lists_strips_and_fans_give_their_triangles() {
    let vertices = |mode: u32| {
        let mut document = with("/accessors/1/count", json!(4));
        document["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let triangles = loaded(&document).mesh.triangles;
        triangles.iter().map(|triangle| triangle.vertices).collect::<Vec<_>>()
    };
    assert_eq!(vertices(4), [[0, 1, 2]]);
    assert_eq!(vertices(5), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(vertices(6), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn points_and_lines_are_left_out() {
    let mut document = document();
    let line = json!({"attributes": {"POSITION": 0}, "mode": 1});
    document["meshes"][0]["primitives"].as_array_mut().expect("a list").push(line);
    assert_eq!(loaded(&document).mesh.triangles.len(), 1);
}

#[test]
fn nodes_are_placed_by_all_above_them() {
    // First twice as big, then a quarter turn about z, then up.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut document = with(
        "/nodes",
        json!([
            {"children": [1], "translation": [0, 0, 5]},
            {"children": [2], "rotation": [0, 0, half, half]},
            {"mesh": 0, "scale": [2, 2, 2]},
        ]),
    );
    let mesh = loaded(&document).mesh;
    let expected = [[0., 0., 5.], [0., 2., 5.], [-2., 0., 5.]].map(Point3::from);
    for (corner, expected) in mesh.corners(&mesh.triangles[0]).iter().zip(expected) {
        assert!((corner - expected).norm() < 1e-6, "{corner}");
    }

    document["nodes"][2]["children"] = json!([0]);
    check_refused(&document, "node 0 is reached twice");
}

#[test]
fn colours_are_light_and_shown_as_srgb() {
    let color = |document: &Value| loaded(document).mesh.triangles[0].color;
    assert!((color(&document())[0] - 0.7).abs() < 1e-6, "what has no material is grey");
    let mut document = document();
    document["materials"] =
        json!([{"pbrMetallicRoughness": {"baseColorFactor": [0.214, 0, 1, 1]}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    // 0.214 is the light of half the byte range.
    let [red, green, blue] = color(&document);
    assert!((red - 0.5).abs() < 1e-3 && green == 0.0 && (blue - 1.0).abs() < 1e-6);
    document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(2);
    let [red, green, blue] = color(&document);
    assert!((red - 0.5).abs() < 1e-3 && green == 0.0 && blue == 0.0);
}

#[test]
fn a_missing_texture_leaves_a_warning() {
    let mut document = document();
    document["images"] = json!([{"uri": "gone.png"}]);
    document["textures"] = json!([{"source": 0}]);
    document["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    document["accessors"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"bufferView": 0, "componentType": 5126, "type": "VEC2", "count": 4}));
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(3);
    let Loaded { mesh, warnings } = loaded(&document);
    assert_eq!(mesh.triangles[0].texture, None);
    assert!(warnings.len() == 1 && warnings[0].contains("gone.png"), "{warnings:?}");
}

#[test]
fn broken_documents_are_refused() {
    check_refused(&json!({}), "");
    check_refused(&with("/scenes", json!([])), "");
    check_refused(&with("/nodes/0/mesh", json!(7)), "");
    let positions = "/meshes/0/primitives/0/attributes/POSITION";
    check_refused(&with(positions, json!(7)), "an accessor that does not exist");
    check_refused(&with("/accessors/1/count", json!(0)), "");
    check_refused(&with("/accessors/1/count", json!(5)), "accessor 1 is empty, or leaves");
    check_refused(&with("/accessors/1/count", json!(u64::MAX)), "accessor 1");
    check_refused(&with("/bufferViews/0/byteOffset", json!(60)), "accessor 0");
    check_refused(&with("/bufferViews/0/byteLength", json!(u64::MAX)), "");
    check_refused(&with("/accessors/1/componentType", json!(5126)), "");
    check_refused(&with("/accessors/0/count", json!(2)), "index 2 is not below 2");
    check_refused(&with("/buffers/0/uri", json!("gone.bin")), "gone.bin");
    check_refused(&with("/buffers/0/uri", json!("../data.bin")), "outside");
    check_refused(&with("/buffers/0/uri", json!("data:;base64,!")), "data URI");
    let mut draco = document();
    draco["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    check_refused(&draco, "");
}

#[test]
fn broken_binary_files_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.glb");
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/formats/square.glb");
    let whole = fs::read(fixture).expect("the fixture");
    for len in (0..whole.len()).step_by(7) {
        fs::write(&path, &whole[..len]).expect("writable");
        assert!(matches!(read_gltf(&path), Err(Error::Mesh { .. })), "{len} bytes");
    }
    let mut short = whole;
    short[8..12].copy_from_slice(&3_u32.to_le_bytes());
    fs::write(&path, &short).expect("writable");
    let error = read_gltf(&path).unwrap_err().to_string();
    assert!(error.contains("header"), "{error}");
}

#[test]
fn escaped_names_are_decoded() {
    for (uri, name) in [("a%20b", "a b"), ("100%", "100%"), ("%C3%A9%zz", "é%zz"), ("%4", "%4")] {
        assert_eq!(percent_decoded(uri), name);
    }
}
