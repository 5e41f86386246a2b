//! The car that all benches of the data layer look at.

use std::{
    fs,
    path::{Path, PathBuf},
};

use nalgebra::center;
use object_pba::data::{
    mesh::{Mesh, Triangle},
    procedural::car,
};

const N_TRIANGLES: usize = 20_000;

/// A procedural car whose triangles are cut in four, one after the other, until there are enough.
pub fn detailed_car() -> Mesh {
    let mut mesh = car(1);
    let mut next = 0;
    while mesh.triangles.len() < N_TRIANGLES {
        let triangle = mesh.triangles[next];
        let first_vertex = mesh.vertices.len() as u32;
        let corners = mesh.corners(&triangle);
        let [a, b, c] = triangle.vertices;
        let [ab, bc, ca] = [0, 1, 2].map(|side| first_vertex + side);
        mesh.vertices
            .extend([[0, 1], [1, 2], [2, 0]].map(|[i, j]| center(&corners[i], &corners[j])));

        let [u, v, w] = triangle.uvs;
        let middle = |from: [f32; 2], to: [f32; 2]| [0, 1].map(|k| (from[k] + to[k]) / 2.0);
        let [uv, vw, wu] = [middle(u, v), middle(v, w), middle(w, u)];
        let part = |vertices, uvs| Triangle { vertices, uvs, ..triangle };
        mesh.triangles[next] = part([ab, bc, ca], [uv, vw, wu]);
        mesh.triangles.push(part([a, ab, ca], [u, uv, wu]));
        mesh.triangles.push(part([ab, b, bc], [uv, v, vw]));
        mesh.triangles.push(part([ca, bc, c], [wu, vw, w]));
        next += 1;
    }
    mesh
}

/// Writes the car into a folder, in the format that `name`'s extension says, with its materials and
/// pictures where the format has such.
#[allow(dead_code, reason = "not every bench reads files")]
pub fn write_car(folder: &Path, name: &str) -> PathBuf {
    let mesh = detailed_car();
    let path = folder.join(name);
    let text = match path.extension().and_then(|extension| extension.to_str()) {
        Some("obj") => {
            write_materials(folder, &mesh);
            obj(&mesh)
        }
        Some("off") => off(&mesh),
        Some("ply") => ply(&mesh),
        _ => panic!("{name}: no such format"),
    };
    fs::write(&path, text).expect("the folder is writable");
    path
}

fn write_materials(folder: &Path, mesh: &Mesh) {
    let mut materials = String::from("newmtl plain\nKd 0.2 0.2 0.2\n");
    for (idx, texture) in mesh.textures.iter().enumerate() {
        texture.save(folder.join(format!("{idx}.png"))).expect("the folder is writable");
        materials += &format!("newmtl m{idx}\nKd 1 1 1\nmap_Kd {idx}.png\n");
    }
    fs::write(folder.join("car.mtl"), materials).expect("the folder is writable");
}

fn obj(mesh: &Mesh) -> String {
    let mut text = String::from("mtllib car.mtl\n");
    for [x, y, z] in mesh.vertices.iter().map(|v| [v.x, v.y, v.z]) {
        text += &format!("v {x} {y} {z}\n");
    }
    let mut material = None;
    for (triangle, first_uv) in mesh.triangles.iter().zip((1..).step_by(3)) {
        if material != Some(triangle.texture) {
            material = Some(triangle.texture);
            text +=
                &triangle.texture.map_or("usemtl plain\n".into(), |idx| format!("usemtl m{idx}\n"));
        }
        for [u, v] in triangle.uvs {
            text += &format!("vt {u} {v}\n");
        }
        let [a, b, c] = triangle.vertices.map(|vertex| vertex + 1);
        text += &format!("f {a}/{first_uv} {b}/{} {c}/{}\n", first_uv + 1, first_uv + 2);
    }
    text
}

fn off(mesh: &Mesh) -> String {
    let head = format!("OFF\n{} {} 0\n", mesh.vertices.len(), mesh.triangles.len());
    head + &vertices_and_faces(mesh)
}

fn ply(mesh: &Mesh) -> String {
    let (n_vertices, n_faces) = (mesh.vertices.len(), mesh.triangles.len());
    let vertex = "property float x\nproperty float y\nproperty float z\n";
    let face = "property list uchar int vertex_indices\n";
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {n_vertices}\n{vertex}element face {n_faces}\n{face}end_header\n"
    );
    head + &vertices_and_faces(mesh)
}

fn vertices_and_faces(mesh: &Mesh) -> String {
    let vertices = mesh.vertices.iter().map(|v| format!("{} {} {}\n", v.x, v.y, v.z));
    let faces = mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.vertices;
        format!("3 {a} {b} {c}\n")
    });
    vertices.chain(faces).collect()
}
