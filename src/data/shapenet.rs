//! ShapeNetCore folders, versions 1 and 2.
//!
//! - v1: `synset/id/model.obj`, up +Y, front +X;
//! - v2: `synset/id/models/model_normalized.obj`, up +Y, front −Z, origin at the vertex mean.
//!
//! Models are loaded into the one world frame, whichever version they come from.

use std::{
    fs,
    path::{Path, PathBuf},
};

use nalgebra::Point3;

use super::mesh_file::{Loaded, read_mesh};
use crate::{Error, Result};

/// The synset of cars.
pub const CARS: &str = "02958343";

/// Where a model's mesh lies, and how it is oriented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    V1,
    V2,
}

/// A model of a repository, not yet loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Model {
    pub synset: String,
    pub id: String,
    /// Its OBJ file.
    pub path: PathBuf,
    pub layout: Layout,
}

/// Lists the models of a synset, sorted by id. `root` holds the synset's folder, or is it.
///
/// Folders without a mesh are passed over, for a few of ShapeNet's have none.
pub fn find_models(root: &Path, synset: &str) -> Result<Vec<Model>> {
    let below = root.join(synset);
    let folder = if below.is_dir() { below.as_path() } else { root };
    let mut models = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        let id = entry.file_name().to_string_lossy().into_owned();
        if let Some((path, layout)) = find_mesh(&entry.path()) {
            models.push(Model { synset: synset.to_owned(), id, path, layout });
        }
    }
    if models.is_empty() {
        let reason = format!("it holds no ShapeNetCore models of synset {synset}");
        return Err(Error::Mesh { path: root.into(), reason });
    }
    models.sort_by(|a, b| a.id.cmp(&b.id));
    Ok(models)
}

/// Keeps the models whose id matches a pattern of `include` and none of `exclude`.
///
/// In a pattern, `*` stands for any text. An empty `include` keeps all.
pub fn select_models(mut models: Vec<Model>, include: &[String], exclude: &[String]) -> Vec<Model> {
    let any = |patterns: &[String], id: &str| patterns.iter().any(|p| matches_pattern(p, id));
    models.retain(|model| {
        (include.is_empty() || any(include, &model.id)) && !any(exclude, &model.id)
    });
    models
}

impl Model {
    /// Reads the mesh into the world frame: up +Y, front −Z, box centred, unit diagonal.
    pub fn load(&self) -> Result<Loaded> {
        let mut loaded = read_mesh(&self.path)?;
        if self.layout == Layout::V1 {
            for vertex in &mut loaded.mesh.vertices {
                *vertex = v2_from_v1(*vertex);
            }
        }
        loaded.mesh.normalise();
        Ok(loaded)
    }
}

/// A quarter turn about +Y: the front goes from +X to −Z.
fn v2_from_v1(point: Point3<f32>) -> Point3<f32> {
    Point3::new(point.z, point.y, -point.x)
}

fn find_mesh(model_folder: &Path) -> Option<(PathBuf, Layout)> {
    let candidates = [("models/model_normalized.obj", Layout::V2), ("model.obj", Layout::V1)];
    candidates
        .into_iter()
        .map(|(name, layout)| (model_folder.join(name), layout))
        .find(|(path, _)| path.is_file())
}

/// Whether `text` is `pattern`, where each `*` stands for any text.
fn matches_pattern(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else { return pattern == text };
    let Some(mut remaining) = text.strip_prefix(start) else { return false };
    let Some((middles, end)) = rest.rsplit_once('*') else { return remaining.ends_with(rest) };
    // The first place where each piece fits leaves the most for the others.
    for piece in middles.split('*') {
        let Some(at) = remaining.find(piece) else { return false };
        remaining = &remaining[at + piece.len()..];
    }
    remaining.ends_with(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wedge whose single highest corner is at `nose`.
    fn write_wedge(path: &Path, nose: &str) {
        let obj = format!("v {nose}\nv -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nf 1 2 3\nf 1 4 5\n");
        fs::create_dir_all(path.parent().expect("it has a parent")).expect("writable");
        fs::write(path, obj).expect("writable");
    }

    fn fixtures() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/shapenet_v2")
    }

    #[test]
    fn models_of_both_layouts_are_found_in_order() {
        let root = tempfile::tempdir().expect("a temporary folder");
        write_wedge(&root.path().join("02958343/b/model.obj"), "2 1 0");
        write_wedge(&root.path().join("02958343/a/models/model_normalized.obj"), "0 1 -2");
        fs::create_dir_all(root.path().join("02958343/empty")).expect("writable");
        fs::write(root.path().join("02958343/all.csv"), "id").expect("writable");

        let models = find_models(root.path(), CARS).expect("two models");
        let found: Vec<_> = models.iter().map(|m| (m.id.as_str(), m.layout)).collect();
        assert_eq!(found, [("a", Layout::V2), ("b", Layout::V1)]);
        assert_eq!(find_models(&root.path().join(CARS), CARS).expect("the same"), models);
    }

    #[test]
    fn fronts_of_both_layouts_point_to_minus_z() {
        let root = tempfile::tempdir().expect("a temporary folder");
        write_wedge(&root.path().join("02958343/v1/model.obj"), "2 1 0");
        write_wedge(&root.path().join("02958343/v2/models/model_normalized.obj"), "0 1 -2");
        for model in find_models(root.path(), CARS).expect("two models") {
            let mesh = model.load().expect("a wedge").mesh;
            let nose = mesh.vertices[0];
            let diagonal = 33.0_f32.sqrt(); // of 4 × 1 × 4
            let expected = Point3::new(0.0, 0.5, -2.0) / diagonal;
            assert!((nose - expected).norm() < 1e-6, "{}: {nose}", model.id);
        }
    }

    #[test]
    fn a_real_car_loads_into_the_world_frame() {
        let models = find_models(&fixtures(), CARS).expect("the fixture");
        let Loaded { mesh, warnings } = models[0].load().expect("a car");
        assert!(warnings.is_empty(), "{warnings:?}");
        let bounds = mesh.bounds().expect("it has triangles");
        assert!(bounds.center().coords.norm() < 1e-6);
        assert!((bounds.diagonal() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_folder_without_models_is_refused() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let error = find_models(root.path(), CARS).expect_err("it is empty").to_string();
        assert!(error.contains(CARS), "{error}");
        assert!(find_models(&root.path().join("none"), CARS).is_err());
    }

    #[test]
    fn a_star_stands_for_any_text() {
        for (pattern, text) in [
            ("car", "car"),
            ("*", ""),
            ("c*", "car"),
            ("*r", "car"),
            ("c*r", "car"),
            ("*a*", "car"),
            ("a*b*c", "a1b2b3c"),
            ("a**b", "ab"),
        ] {
            assert!(matches_pattern(pattern, text), "{pattern} {text}");
        }
        for (pattern, text) in [
            ("car", "cart"),
            ("", "a"),
            ("c*", "acr"),
            ("ab*ba", "aba"),
            ("a*b*b", "ab"),
            ("*x*", "car"),
        ] {
            assert!(!matches_pattern(pattern, text), "{pattern} {text}");
        }
    }

    #[test]
    fn excluding_wins_over_including() {
        let model = |id: &str| Model {
            synset: CARS.into(),
            id: id.into(),
            path: PathBuf::new(),
            layout: Layout::V2,
        };
        let models = vec![model("suv_1"), model("suv_2"), model("van_1")];
        let kept = select_models(models.clone(), &["suv*".into()], &["*_2".into()]);
        assert_eq!(kept, [model("suv_1")]);
        assert_eq!(select_models(models.clone(), &[], &[]), models);
    }
}
