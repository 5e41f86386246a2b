//! Collections of meshes: a tree of ShapeNetCore, or any folder.

mod axes;
mod pattern;
#[cfg(test)]
mod tests;

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

pub use self::axes::{Axes, SignedAxis};
use self::pattern::matches_pattern;
use super::{
    mesh_file::{Loaded, is_mesh_file, read_mesh},
    shapenet,
};
use crate::{Error, Result};

/// Models of a folder, sorted and not yet read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Collection {
    pub models: Vec<Model>,
}

/// A model, and how it is turned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Model {
    /// Its name among the others: ShapeNet's id, after `synset/` where there are several, or the
    /// file's path below the folder, without its extension.
    pub id: String,
    /// Its category in ShapeNet.
    pub synset: Option<String>,
    /// Its mesh.
    pub path: PathBuf,
    pub axes: Axes,
}

/// Which models to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// How models are turned. Where this is given, the folder is a plain one; where it is not, it
    /// may be ShapeNet's, and if it is not either, its models are turned like our world.
    pub axes: Option<Axes>,
    /// ShapeNet's categories; all, if empty.
    pub synsets: Vec<String>,
    /// A part of ShapeNet, by its `all.csv`.
    pub split: Option<Split>,
    /// Which ids to take (all, if empty) and which of these to leave. `*` stands for any text; a
    /// pattern fits an id or what follows its last `/`.
    pub include: Vec<String>,
    pub exclude: Vec<String>,
}

/// A part of ShapeNet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    Train,
    Val,
    Test,
}

impl Collection {
    /// Looks for models below `root`; an error if there are none.
    pub fn open(root: &Path, selection: &Selection) -> Result<Self> {
        let refuse = |reason: &str| Error::Collection { path: root.into(), reason: reason.into() };
        let mut models = if selection.axes.is_none() && shapenet::is_tree(root)? {
            shapenet::find_models(root, &selection.synsets, selection.split)?
        } else if selection.split.is_some() {
            return Err(refuse("only a tree of ShapeNet has splits"));
        } else {
            find_mesh_files(root, selection.axes.unwrap_or(Axes::WORLD))?
        };
        if models.is_empty() {
            return Err(refuse("it holds no models"));
        }
        models.retain(|model| selection.takes(&model.id));
        if models.is_empty() {
            return Err(refuse("none of its models is selected"));
        }
        models.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(Self { models })
    }
}

impl Selection {
    fn takes(&self, id: &str) -> bool {
        let name = id.rsplit('/').next().unwrap_or(id);
        let fits =
            |pattern: &String| matches_pattern(pattern, id) || matches_pattern(pattern, name);
        (self.include.is_empty() || self.include.iter().any(fits)) && !self.exclude.iter().any(fits)
    }
}

impl Model {
    /// Reads the mesh into the world frame: up +Y, front −Z, box centred, unit diagonal.
    pub fn load(&self) -> Result<Loaded> {
        let mut loaded = read_mesh(&self.path)?;
        let world_from_file = self.axes.world_from_file();
        for vertex in &mut loaded.mesh.vertices {
            *vertex = world_from_file * *vertex;
        }
        loaded.mesh.normalise();
        Ok(loaded)
    }
}

/// All meshes below a folder; names that start with a dot are hidden.
fn find_mesh_files(root: &Path, axes: Axes) -> Result<Vec<Model>> {
    let mut paths = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(Error::io(&folder))? {
            let entry = entry.map_err(Error::io(&folder))?;
            let path = entry.path();
            if entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            // Links to folders are not followed: they may lead back.
            if entry.file_type().map_err(Error::io(&path))?.is_dir() {
                folders.push(path);
            } else if is_mesh_file(&path) && path.is_file() {
                paths.push(path);
            }
        }
    }
    let name = |path: &Path| {
        let below = path.strip_prefix(root).unwrap_or(path);
        let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
        parts.join("/")
    };
    let mut counts = HashMap::new();
    for path in &paths {
        *counts.entry(path.with_extension("")).or_insert(0) += 1;
    }
    let models = paths.into_iter().map(|path| {
        let bare = path.with_extension("");
        // An extension stays where it alone tells two models apart.
        let id = name(if counts[&bare] == 1 { &bare } else { &path });
        Model { id, synset: None, path, axes }
    });
    Ok(models.collect())
}
