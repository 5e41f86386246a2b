use super::*;
use std::path::PathBuf;

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

/// A model folder with `models/model.obj`, and other files by name.
fn model(obj: &str, files: &[(&str, &[u8])]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("models/model.obj");
    for (name, bytes) in [("models/model.obj", obj.as_bytes())].iter().chain(files) {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("it has a parent")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    (folder, path)
}

fn read(obj: &str, files: &[(&str, &[u8])]) -> Result<Loaded> {
    let (_folder, path) = model(obj, files);
    read_obj(&path)
}

fn loaded(obj: &str, files: &[(&str, &[u8])]) -> Loaded {
    read(obj, files).expect("it is a mesh")
}

#[track_caller]
fn check_refused(obj: &str, reason: &str) {
    let error = read(obj, &[]).expect_err("it is broken").to_string();
    assert!(error.contains("model.obj") && error.contains(reason), "{error}");
}

fn png(color: [u8; 3]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_pixel(2, 2, image::Rgb(color));
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("memory is writable");
    bytes.into_inner()
}

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/shapenet_v2/02958343/smarts_simple_car/models/model_normalized.obj")
}

#[test]
fn polygons_become_fans() {
    let mesh = loaded(&format!("{QUAD}v 0 0 1\nf 1 2 3 4\nf 1 2 3 4 5\n"), &[]).mesh;
    let vertices: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.vertices).collect();
    assert_eq!(vertices, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 4]]);
}

#[test]
fn negative_indices_count_from_the_end() {
    let mesh = loaded(&format!("{QUAD}f -4/-4 -3/-3 -2/-2\nv 5 5 5\n"), &[]).mesh;
    assert_eq!(mesh.triangles[0].vertices, [0, 1, 2]);
    assert_eq!(mesh.triangles[0].uvs, [[0., 0.], [1., 0.], [1., 1.]]);
}

#[test]
fn windows_line_ends_and_odd_spacing_are_read() {
    let obj = format!("  # a\u{e9}\r\n{QUAD}f   1//1\t2//1 3//1  \r\n").replace('\n', "\r\n");
    assert_eq!(loaded(&obj, &[]).mesh.triangles[0].vertices, [0, 1, 2]);
}

#[test]
fn lines_points_and_groups_are_left_out() {
    let obj = format!("{QUAD}g a b\ns 1\nl 1 2 3 4\np 1 2 3\nvn 0 0 1\nf 1 2 3\n");
    assert_eq!(loaded(&obj, &[]).mesh.triangles.len(), 1);
}

#[test]
fn colours_and_textures_follow_the_materials() {
    let obj = format!(
        "mtllib model.mtl\n{QUAD}usemtl red paint\nf 1 2 3\nusemtl wood\nf 1/1 2/2 3/3\nusemtl oak\nf 1/1 2/2 3/3\n"
    );
    let mtl = b"newmtl red paint\r\nKd 1 0 0\r\nnewmtl wood\nKd 0.5 0.5 0.5\nmap_Kd ../images/a.png\nnewmtl oak\nmap_Kd -s 1 1 1 ..\\images\\a.png\n";
    let files: [(&str, &[u8]); 2] = [("models/model.mtl", mtl), ("images/a.png", &png([9, 8, 7]))];
    let Loaded { mesh, warnings } = loaded(&obj, &files);

    assert!(warnings.is_empty(), "{warnings:?}");
    let look: Vec<_> = mesh.triangles.iter().map(|t| (t.color, t.texture)).collect();
    assert_eq!(look, [([1., 0., 0.], None), ([0.5; 3], Some(0)), ([1.0; 3], Some(0))]);
    assert_eq!(mesh.textures.len(), 1, "each file is decoded once");
    assert_eq!(mesh.textures[0].get_pixel(0, 0).0, [9, 8, 7]);
}

#[test]
fn missing_materials_and_textures_leave_plain_colours_and_warnings() {
    let grey = loaded(&format!("mtllib none.mtl\n{QUAD}usemtl red\nf 1 2 3\n"), &[]);
    assert_eq!(grey.mesh.triangles[0].color, [0.7; 3]);
    assert_eq!(grey.warnings.len(), 2, "{:?}", grey.warnings);

    let obj = format!("mtllib model.mtl\n{QUAD}usemtl red\nf 1/1 2/2 3/3\n");
    let mtl = b"newmtl red\nKd 1 0 0\nmap_Kd gone.png\n";
    let plain = loaded(&obj, &[("models/model.mtl", mtl)]);
    assert_eq!(
        (plain.mesh.triangles[0].color, plain.mesh.triangles[0].texture),
        ([1., 0., 0.], None)
    );
    assert!(plain.warnings[0].contains("gone.png"), "{:?}", plain.warnings);
}

#[test]
fn broken_materials_and_textures_leave_warnings() {
    let obj = format!("mtllib model.mtl\n{QUAD}usemtl red\nf 1/1 2/2 3/3\n");
    let mtl = b"Kd\nnewmtl red\nKd 1 1\nKd nan 0 0\nmap_Kd\nmap_Kd a.png\nmap_Kd a.png\n";
    let files: [(&str, &[u8]); 2] = [("models/model.mtl", mtl), ("models/a.png", b"no picture")];
    let Loaded { mesh, warnings } = loaded(&obj, &files);
    assert_eq!((mesh.triangles[0].color, mesh.triangles[0].texture), ([0.7; 3], None));
    assert_eq!(warnings.len(), 5, "{warnings:?}");
}

#[test]
fn nothing_outside_of_the_model_folder_is_read() {
    let outside = tempfile::tempdir().expect("a temporary folder");
    let secret = outside.path().join("a.png");
    fs::write(&secret, png([1, 2, 3])).expect("writable");
    for name in [secret.to_str().expect("plain name"), "../../a.png", "x/../../../a.png"] {
        let obj = format!("mtllib model.mtl\n{QUAD}usemtl red\nf 1/1 2/2 3/3\n");
        let mtl = format!("newmtl red\nmap_Kd {name}\n");
        let Loaded { mesh, warnings } = loaded(&obj, &[("models/model.mtl", mtl.as_bytes())]);
        assert!(mesh.textures.is_empty());
        assert!(warnings[0].contains("outside"), "{warnings:?}");
    }
}

#[test]
fn several_material_files_are_read_and_names_may_hold_spaces() {
    let files: [(&str, &[u8]); 3] = [
        ("models/a.mtl", b"newmtl red\nKd 1 0 0\n"),
        ("models/b.mtl", b"newmtl blue\nKd 0 0 1\n"),
        ("models/my car.mtl", b"newmtl green\nKd 0 1 0\n"),
    ];
    let obj = format!(
        "mtllib a.mtl b.mtl\nmtllib my car.mtl\n{QUAD}usemtl red\nf 1 2 3\nusemtl blue\nf 1 2 3\nusemtl green\nf 1 2 3\n"
    );
    let Loaded { mesh, warnings } = loaded(&obj, &files);
    let colors: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.color).collect();
    assert_eq!(colors, [[1., 0., 0.], [0., 0., 1.], [0., 1., 0.]]);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn a_byte_order_mark_hides_no_vertex() {
    let obj = format!("\u{feff}{QUAD}f 1 2 3\n");
    assert_eq!(loaded(&obj, &[]).mesh.vertices.len(), 4);
}

#[test]
fn interiors_repeated_and_zero_area_faces_load() {
    // Three faces on the edge 1 2, one of them twice, and one that is a line.
    let obj = format!("{QUAD}v 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 2 5\nf 5 2 1\nf 1 2 2\n");
    assert_eq!(loaded(&obj, &[]).mesh.triangles.len(), 5);
}

#[test]
fn unusable_texture_coordinates_do_not_cost_the_mesh() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan nan\nvt\nvt 1 1 0\nf 1/1 2/2 3/3\n";
    assert_eq!(loaded(obj, &[]).mesh.triangles[0].uvs, [[0., 0.], [0., 0.], [1., 1.]]);
}

#[test]
fn broken_geometry_is_refused_with_its_line() {
    check_refused("", "no triangles");
    check_refused(QUAD, "no triangles");
    check_refused("v 0 0\n", "line 1");
    check_refused("v 0 0 x\n", "line 1");
    check_refused(&format!("{QUAD}f 1 2\n"), "line 9: a face needs three corners");
    check_refused(&format!("{QUAD}f 1 2 5\n"), "line 9: index 5");
    check_refused(&format!("{QUAD}f 0 1 2\n"), "line 9: index 0");
    check_refused(&format!("{QUAD}f 1 2 -9\n"), "line 9: index -9");
    check_refused(&format!("{QUAD}f 1/1 2/-9 3/1\n"), "line 9: index -9");
    check_refused(&format!("{QUAD}f 1 2 {}\n", i64::MIN), "line 9");
    check_refused(&format!("{QUAD}f a b c\n"), "line 9: \"a\"");
    check_refused(&format!("{QUAD}f 1 1 1\n"), "no area");
    check_refused("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1: coordinate NaN");
    check_refused("v 0 0 0\nv 1e400 0 0\nv 0 1 0\nf 1 2 3\n", "line 2: coordinate inf");
    check_refused("v 0 0 0\nv 1 0 0\nv 0 1e9 0\nf 1 2 3\n", "line 3: coordinate 1000000000");
    check_refused("\u{0}\u{1}\u{2}binary", "no triangles");
}

#[test]
fn a_missing_file_is_named() {
    let error = read_obj(Path::new("nowhere/car.obj")).expect_err("it does not exist");
    assert!(error.to_string().contains("nowhere/car.obj"), "{error}");
}

#[test]
fn a_real_car_reads_as_tobj_reads_it() {
    let ours = read_obj(&fixture()).expect("the fixture is a mesh").mesh;
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, materials) = tobj::load_obj(fixture(), &options).expect("the fixture is a mesh");
    let materials = materials.expect("it has materials");

    let theirs = models.iter().flat_map(|model| {
        let corner = |&index: &u32| -> [f32; 3] {
            let start = 3 * index as usize;
            model.mesh.positions[start..start + 3].try_into().expect("three coordinates")
        };
        let color = model.mesh.material_id.and_then(|material| materials[material].diffuse);
        let triangles = model.mesh.indices.chunks(3);
        triangles.map(move |t| ([corner(&t[0]), corner(&t[1]), corner(&t[2])], color))
    });
    let ours =
        ours.triangles.iter().map(|t| (ours.corners(t).map(<[f32; 3]>::from), Some(t.color)));
    assert!(ours.eq(theirs));
}
