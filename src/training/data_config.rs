//! What a run trains on.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::data::{
    collection::{Axes, Selection, SignedAxis, Split},
    shapenet::CARS,
    viewpoint::ViewpointRange,
};

/// The shapes, and the pictures of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// Shapes to train on.
    pub n_models: usize,
    /// Shapes held out, to measure on.
    pub n_validation: usize,
    /// Points sampled from each surface, once.
    pub points_per_model: usize,
    /// Pictures of each training shape, and how many paints they are spread over.
    pub views_per_model: usize,
    pub paints_per_model: usize,
    /// Pictures of each training shape in a round: what is in memory, twice. The next round is made
    /// while one is trained on, and every view comes once before any comes again.
    pub views_per_round: usize,
    /// Pictures of each held-out shape.
    pub views_per_validation: usize,
    pub viewpoints: ViewpointRange,
    /// A folder of meshes: ShapeNet (version 1 or 2), or any; without it, shapes are procedural
    /// cars.
    #[serde(alias = "shapenet")]
    pub meshes: Option<PathBuf>,
    /// Categories of ShapeNet, with commas between them (all, if empty); 02958343 are cars.
    pub synset: String,
    /// Only this part of ShapeNet, by its all.csv.
    pub split: Option<Split>,
    /// How meshes are turned in a plain folder; ours are up y and front -z.
    pub up: Option<SignedAxis>,
    pub front: Option<SignedAxis>,
    /// Which model ids to take (all, if empty) and which of these to leave; `*` is anything.
    pub include: Vec<String>,
    pub exclude: Vec<String>,
    /// Where the points of meshes are kept, so that no run samples them again.
    pub cache: Option<PathBuf>,
    /// Where the training pictures are kept, as `pba-train shards` writes them: one tar of all, or a
    /// folder of all parts. Without it, they are rendered while training goes on: the same ones.
    pub shards: Option<PathBuf>,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            n_models: 1500,
            n_validation: 60,
            points_per_model: 24_576,
            views_per_model: 24,
            paints_per_model: 3,
            views_per_round: 4,
            views_per_validation: 8,
            viewpoints: ViewpointRange::default(),
            meshes: None,
            synset: CARS.into(),
            split: None,
            up: None,
            front: None,
            include: Vec::new(),
            exclude: Vec::new(),
            cache: None,
            shards: None,
        }
    }
}

impl DataConfig {
    /// Which of the meshes to take, or why that makes no sense.
    pub fn selection(&self) -> Result<Selection, String> {
        let synsets = self.synset.split(',').map(str::trim).filter(|synset| !synset.is_empty());
        Ok(Selection {
            axes: Axes::given(self.up, self.front)?,
            synsets: synsets.map(str::to_owned).collect(),
            split: self.split,
            include: self.include.clone(),
            exclude: self.exclude.clone(),
        })
    }

    /// The same shapes and pictures, wherever they are kept.
    pub fn without_stores(&self) -> Self {
        Self { cache: None, shards: None, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::TrainingConfig;
    use std::path::Path;

    #[test]
    fn meshes_are_selected_as_the_config_says() {
        let text = "[data]\nshapenet = 'tree'\nsynset = '02958343, 03001627'\nsplit = 'val'\n";
        let config = TrainingConfig::parse(text, Path::new("a.toml")).expect("a valid config");
        let selection = config.data.selection().expect("a valid selection");
        assert_eq!(config.data.meshes, Some("tree".into()));
        assert_eq!(selection.synsets, ["02958343", "03001627"]);
        assert_eq!((selection.split, selection.axes), (Some(Split::Val), None));

        let text = "[data]\nup = 'z'\nfront = '-z'\n";
        let error = TrainingConfig::parse(text, Path::new("a.toml")).unwrap_err().to_string();
        assert!(error.contains("up is z"), "{error}");
    }
}
