use super::*;
use std::fs;

fn cloud() -> PointCloud {
    PointCloud {
        points: vec![Point3::new(0.5, -1.25, 3.0), Point3::new(1e-7, 0.0, -2.0)],
        colors: Some(vec![[255, 0, 7], [1, 2, 3]]),
        visible: Some(vec![true, false]),
    }
}

#[test]
fn clouds_round_trip() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("points.ply");
    let bare = PointCloud { colors: None, visible: None, ..cloud() };
    for cloud in [cloud(), bare] {
        write_points(&path, &cloud).expect("it is writable");
        assert_eq!(read_cloud(&path).expect("it is a cloud"), cloud);
    }
}

#[test]
fn the_bytes_are_those_of_the_format() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("points.ply");
    write_points(&path, &cloud()).expect("it is writable");
    let bytes = fs::read(&path).expect("it is there");
    let end = b"end_header\n";
    let header = bytes.windows(end.len()).position(|window| window == end).expect("a header");
    let body = &bytes[header + end.len()..];
    assert_eq!(body.len(), 2 * 16);
    assert_eq!(body[..4], 0.5_f32.to_le_bytes());
    assert_eq!(body[12..16], [255, 0, 7, 1]);
    let header = String::from_utf8_lossy(&bytes[..header]);
    assert!(header.contains("format binary_little_endian 1.0"), "{header}");
    assert!(header.contains("element vertex 2"), "{header}");
    assert!(header.contains("property uchar visible"), "{header}");
}

#[test]
fn ascii_files_with_faces_and_doubles_are_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("mesh.ply");
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty float y\n\
        property double z\nproperty int label\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n1 2 3 9\n3 0 0 0\n";
    fs::write(&path, text).expect("it is writable");
    assert_eq!(read_points(&path).expect("it is a cloud"), [Point3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn broken_files_are_refused_by_name() {
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n";
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("broken.ply");
    let broken = [
        String::new(),
        "not a ply".into(),
        format!("{header}end_header\n1 2\n"),
        format!("{header}property float z\nend_header\n1 2 nan\n"),
        format!("{header}property float z\nend_header\n1 2\n"),
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n".into(),
        "ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\n\
         property float x\nend_header\n"
            .into(),
    ];
    for text in broken {
        fs::write(&path, &text).expect("it is writable");
        let error = read_points(&path).unwrap_err().to_string();
        assert!(error.contains("broken.ply"), "{error}");
    }
    assert!(matches!(read_points(&folder.path().join("missing.ply")), Err(Error::Io { .. })));
}
