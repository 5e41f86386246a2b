//! `pba-train render`: test sequences with their ground truth.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ParallelProgressIterator, ProgressStyle};
use object_pba::{
    Error, Result,
    config::{read_config, write_config},
    data::{
        collection::{Collection, Model},
        formats::nerfstudio::write_sequence,
        mesh::Mesh,
        procedural,
        sequence::{Sequence, SequenceOptions},
        shapenet::CARS,
    },
};
use rayon::prelude::*;

use crate::selection::SelectionArguments;

/// What to render, and where to.
#[derive(Args)]
pub struct RenderArguments {
    /// Folder of the dataset: one folder a sequence, named `model-0`, `model-1`, and so on.
    #[arg(long)]
    out: PathBuf,
    /// Folder of meshes: ShapeNetCore v1 or v2, or any; without it, shapes are procedural cars.
    #[arg(long, alias = "shapenet")]
    meshes: Option<PathBuf>,
    #[command(flatten)]
    selection: SelectionArguments,
    /// How many procedural cars; they are none of those that training draws.
    #[arg(long, default_value_t = 20)]
    models: u64,
    /// How many sequences of each model.
    #[arg(long, default_value_t = 1)]
    sequences: u64,
    /// Draws shapes, cameras and lights.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// TOML file with what differs from 15 frames of 128 × 128, 2° apart.
    #[arg(long)]
    config: Option<PathBuf>,
}

enum Shape {
    Procedural(u64),
    Model(Model),
}

pub fn render(arguments: &RenderArguments) -> Result<()> {
    let options = match &arguments.config {
        Some(path) => read_config(path)?,
        None => SequenceOptions::default(),
    };
    let shapes = shapes(arguments)?;
    std::fs::create_dir_all(&arguments.out).map_err(Error::io(&arguments.out))?;
    write_config(&arguments.out.join("config.toml"), &options)?;
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} models (ETA {eta})");
    let skipped: Vec<Option<Error>> = shapes
        .par_iter()
        .enumerate()
        .progress_with_style(style.expect("a valid template"))
        .map(|(idx, shape)| match shape.load() {
            Ok((id, mesh)) => {
                write_sequences(&id, &mesh, idx as u64, arguments, &options).map(|()| None)
            }
            Err(error) => Ok(Some(error)),
        })
        .collect::<Result<_>>()?;
    let n_models = skipped.iter().filter(|error| error.is_none()).count();
    let skipped: Vec<_> = skipped.into_iter().flatten().collect();
    skipped.iter().for_each(|error| eprintln!("skipped: {error}"));
    if let Some(error) = skipped.into_iter().next().filter(|_| n_models == 0) {
        return Err(error);
    }
    println!("{n_models} models, {} sequences of each", arguments.sequences);
    Ok(())
}

fn shapes(arguments: &RenderArguments) -> Result<Vec<Shape>> {
    let Some(root) = &arguments.meshes else {
        let seeds = (0..arguments.models).map(|idx| arguments.seed * 1_000_000 + idx);
        return Ok(seeds.map(Shape::Procedural).collect());
    };
    let selection = arguments.selection.selection(&[CARS]);
    let selection = selection.map_err(|reason| Error::Config { path: root.clone(), reason })?;
    Ok(Collection::open(root, &selection)?.models.into_iter().map(Shape::Model).collect())
}

impl Shape {
    fn load(&self) -> Result<(String, Mesh)> {
        match self {
            Self::Procedural(seed) => Ok((format!("car_{seed:06}"), procedural::car(*seed))),
            // Datasets have one folder a sequence, side by side.
            Self::Model(model) => Ok((model.id.replace('/', "_"), model.load()?.mesh)),
        }
    }
}

fn write_sequences(
    id: &str,
    mesh: &Mesh,
    model_idx: u64,
    arguments: &RenderArguments,
    options: &SequenceOptions,
) -> Result<()> {
    for idx in 0..arguments.sequences {
        let seed = (arguments.seed << 40) + (model_idx << 16) + idx;
        let sequence = Sequence::render(mesh, options, seed);
        write_sequence(&sequence, &folder(&arguments.out, id, idx))?;
    }
    Ok(())
}

fn folder(out: &Path, id: &str, idx: u64) -> PathBuf {
    out.join(format!("{id}-{idx}"))
}
