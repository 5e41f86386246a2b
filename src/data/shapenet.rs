//! Trees of ShapeNetCore, versions 1 and 2.
//!
//! - v1: `synset/id/model.obj`, up +Y, front +X;
//! - v2: `synset/id/models/model_normalized.obj`, up +Y, front −Z, origin at the vertex mean.
//!
//! `all.csv` says which split each model belongs to.

mod splits;

use std::{
    fs,
    path::{Path, PathBuf},
};

use self::splits::Splits;
use super::collection::{Axes, Model, Split};
use crate::{Error, Result};

/// The synset of cars.
pub const CARS: &str = "02958343";
/// Where the mesh of a model lies in its folder.
const V1_MESH: &str = "model.obj";
const V2_MESH: &str = "models/model_normalized.obj";

/// Whether a folder is such a tree: it holds synsets, or is one.
pub fn is_tree(root: &Path) -> Result<bool> {
    let folders = folders_in(root)?;
    let holds_mesh = |folder: &PathBuf| [V1_MESH, V2_MESH].iter().any(|m| folder.join(m).is_file());
    Ok(folders.iter().any(|(name, folder)| is_synset(name) || holds_mesh(folder)))
}

/// The models of some synsets, or of all if none is named, and of one split if it is.
///
/// A model's folder without a mesh counts, for reading it then says that it has none.
pub fn find_models(root: &Path, synsets: &[String], split: Option<Split>) -> Result<Vec<Model>> {
    let synset_folders = synset_folders(root, synsets)?;
    let splits = split.map(|_| Splits::read(root)).transpose()?;
    let several = synset_folders.len() > 1;
    let mut models = Vec::new();
    for (synset, folder) in synset_folders {
        for (id, folder) in folders_in(&folder)? {
            if splits.as_ref().is_some_and(|splits| splits.of(&synset, &id) != split) {
                continue;
            }
            let v1 = folder.join(V1_MESH);
            let (path, axes) = match v1.is_file() {
                true => (v1, Axes::SHAPENET_V1),
                false => (folder.join(V2_MESH), Axes::WORLD),
            };
            let id = if several { format!("{synset}/{id}") } else { id };
            models.push(Model { id, synset: Some(synset.clone()), path, axes });
        }
    }
    Ok(models)
}

/// The folders of the synsets, by name.
fn synset_folders(root: &Path, synsets: &[String]) -> Result<Vec<(String, PathBuf)>> {
    let mut all: Vec<_> =
        folders_in(root)?.into_iter().filter(|(name, _)| is_synset(name)).collect();
    if all.is_empty() {
        // It is a synset itself, whatever it is called; what it is not called, it is not.
        let name = root.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !is_synset(&name) {
            return Ok(vec![(name, root.into())]);
        }
        all.push((name, root.into()));
    }
    all.sort();
    if let Some(missing) = synsets.iter().find(|synset| all.iter().all(|(name, _)| name != *synset))
    {
        let names: Vec<_> = all.iter().map(|(name, _)| name.as_str()).collect();
        let reason = format!("it holds no synset {missing}, but {}", names.join(", "));
        return Err(Error::Collection { path: root.into(), reason });
    }
    all.retain(|(name, _)| synsets.is_empty() || synsets.contains(name));
    Ok(all)
}

/// Synsets are named by eight digits.
fn is_synset(name: &str) -> bool {
    name.len() == 8 && name.bytes().all(|byte| byte.is_ascii_digit())
}

/// The folders within a folder, and links to folders, by name. Hidden ones are left out.
fn folders_in(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() && !name.starts_with('.') {
            folders.push((name, entry.path()));
        }
    }
    Ok(folders)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A wedge whose single highest corner is at `nose`.
    fn write_wedge(path: &Path, nose: &str) {
        let obj = format!("v {nose}\nv -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nf 1 2 3\nf 1 4 5\n");
        fs::create_dir_all(path.parent().expect("it has a parent")).expect("writable");
        fs::write(path, obj).expect("writable");
    }

    fn ids(root: &Path, synsets: &[&str]) -> Vec<String> {
        let synsets: Vec<_> = synsets.iter().map(|synset| (*synset).to_owned()).collect();
        let models = find_models(root, &synsets, None).expect("a tree");
        let mut ids: Vec<_> = models.into_iter().map(|model| model.id).collect();
        ids.sort();
        ids
    }

    #[test]
    fn fronts_of_both_versions_point_to_minus_z() {
        let root = tempfile::tempdir().expect("a temporary folder");
        write_wedge(&root.path().join("02958343/v1/model.obj"), "2 1 0");
        write_wedge(&root.path().join("02958343/v2/models/model_normalized.obj"), "0 1 -2");
        let models = find_models(root.path(), &[], None).expect("two models");
        assert_eq!(models.len(), 2);
        for model in models {
            let nose = model.load().expect("a wedge").mesh.vertices[0];
            let diagonal = 33.0_f32.sqrt(); // of 4 × 1 × 4
            let expected = Point3::new(0.0, 0.5, -2.0) / diagonal;
            assert!((nose - expected).norm() < 1e-6, "{}: {nose}", model.id);
        }
    }

    #[test]
    fn a_real_car_loads_into_the_world_frame() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/shapenet_v2");
        assert!(is_tree(&root).expect("it is there"));
        let models = find_models(&root, &[CARS.into()], None).expect("the fixture");
        let loaded = models[0].load().expect("a car");
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        let bounds = loaded.mesh.bounds().expect("it has triangles");
        assert!(bounds.center().coords.norm() < 1e-6);
        assert!((bounds.diagonal() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn one_synset_several_or_all_are_found_from_the_tree_and_from_the_synset() {
        let root = tempfile::tempdir().expect("a temporary folder");
        for name in ["02958343/a", "02958343/b", "03001627/a", "02691156/c"] {
            write_wedge(&root.path().join(name).join(V2_MESH), "0 1 -2");
        }
        fs::write(root.path().join("taxonomy.json"), "{}").expect("writable");
        let synset = root.path().join(CARS);
        assert_eq!(ids(root.path(), &[CARS]), ["a", "b"]);
        assert_eq!(ids(&synset, &[CARS]), ["a", "b"]);
        assert_eq!(ids(&synset, &[]), ["a", "b"]);
        let two = ["02958343/a", "02958343/b", "03001627/a"];
        assert_eq!(ids(root.path(), &["03001627", CARS]), two);
        assert_eq!(ids(root.path(), &[]).len(), 4);
        for root in [root.path(), &synset] {
            let error = find_models(root, &["04256520".into()], None).unwrap_err().to_string();
            assert!(error.contains("04256520") && error.contains(CARS), "{error}");
        }
    }

    #[test]
    fn a_model_without_a_mesh_is_found_and_cannot_be_loaded() {
        let root = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir_all(root.path().join("02958343/empty")).expect("writable");
        let models = find_models(root.path(), &[], None).expect("one model");
        let error = models[0].load().expect_err("it has no mesh").to_string();
        assert!(error.contains("empty"), "{error}");
    }
}
