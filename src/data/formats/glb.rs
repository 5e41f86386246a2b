//! Cloud and cameras as binary glTF 2.0, which every 3D viewer opens.

use std::{borrow::Cow, path::Path};

use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::{Trajectory, axes, ply::PointCloud, write_atomically};
use crate::{Error, Result};

// The numbers by which glTF calls things.
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const POINTS: u32 = 0;
/// Nearest depth that viewers show, in world units.
const NEAR: f32 = 0.01;

/// Writes the points, coloured where colours are known, and a node for each camera.
///
/// Our world is up +Y, as glTF's. glTF has no principal point: its cameras show the picture's middle.
pub fn write(path: &Path, trajectory: &Trajectory, cloud: &PointCloud) -> Result<()> {
    let mut bin: Vec<u8> = vec![];
    for point in &cloud.points {
        bin.extend([point.x, point.y, point.z].into_iter().flat_map(f32::to_le_bytes));
    }
    if cloud.colors.is_some() {
        for idx in 0..cloud.points.len() {
            bin.extend(cloud.color(idx).into_iter().map(linear).flat_map(f32::to_le_bytes));
        }
    }
    let document = document(trajectory, cloud, bin.len());
    let json = serde_json::to_vec(&document).expect("it is plain JSON");
    let header = Header { magic: *b"glTF", version: 2, length: 0 };
    let glb = Glb { header, json: json.into(), bin: Some(Cow::from(bin)) };
    let bytes = glb.to_vec().map_err(|error| Error::Points {
        path: path.into(),
        reason: format!("it does not go into a GLB: {error}"),
    })?;
    write_atomically(path, &bytes)
}

/// The JSON part: one mesh of points, and one camera at each of its poses.
fn document(trajectory: &Trajectory, cloud: &PointCloud, n_bytes: usize) -> Value {
    let n_points = cloud.points.len();
    // Of three floats.
    let view = |idx: usize| json!({"buffer": 0, "byteOffset": idx * n_points * 12, "byteLength": n_points * 12, "target": ARRAY_BUFFER});
    let accessor = |idx: usize| json!({"bufferView": idx, "componentType": FLOAT, "count": n_points, "type": "VEC3"});
    let extreme = |pick: fn(f32, f32) -> f32| {
        let coordinates = cloud.points.iter().map(|point| [point.x, point.y, point.z]);
        let extreme = coordinates.reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis])));
        json!(extreme.unwrap_or_default())
    };
    let mut attributes = json!({"POSITION": 0});
    let mut accessors = vec![accessor(0)];
    accessors[0]["min"] = extreme(f32::min);
    accessors[0]["max"] = extreme(f32::max);
    let mut views = vec![view(0)];
    if cloud.colors.is_some() {
        attributes["COLOR_0"] = json!(1);
        accessors.push(accessor(1));
        views.push(view(1));
    }

    let [width, height] = trajectory.size.map(|side| side as f32);
    let field_of_view = 2.0 * (0.5 * height / trajectory.intrinsics.focal[1]).atan();
    let aspect_ratio =
        width / trajectory.intrinsics.focal[0] * trajectory.intrinsics.focal[1] / height;
    let camera = json!({"type": "perspective", "perspective": {"yfov": field_of_view, "aspectRatio": aspect_ratio, "znear": NEAR}});
    let mut nodes = vec![json!({"name": "points", "mesh": 0})];
    for (pose, picture) in trajectory.camera_from_world.iter().zip(&trajectory.pictures) {
        let rows = axes::to_opengl_matrix(pose);
        let columns = [0, 1, 2, 3].map(|column| rows.map(|row| row[column] as f32));
        nodes.push(json!({"name": picture, "camera": 0, "matrix": columns.as_flattened()}));
    }
    json!({
        "asset": {"version": "2.0", "generator": "object-pba"},
        "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes,
        "cameras": [camera],
        "meshes": [{"primitives": [{"mode": POINTS, "attributes": attributes}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": n_bytes}],
    })
}

/// glTF's colours are linear, and those of pictures sRGB.
fn linear(channel: u8) -> f32 {
    let channel = f32::from(channel) / 255.0;
    if channel <= 0.04045 { channel / 12.92 } else { ((channel + 0.055) / 1.055).powf(2.4) }
}
