//! `pba-train render`: test sequences with their ground truth.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ParallelProgressIterator, ProgressStyle};
use object_pba::{
    Error, Result,
    config::{read_config, write_config},
    data::{
        formats::nerfstudio::write_sequence,
        mesh::Mesh,
        procedural,
        sequence::{Sequence, SequenceOptions},
        shapenet::{CARS, Model, find_models, select_models},
    },
};
use rayon::prelude::*;

/// What to render, and where to.
#[derive(Args)]
pub struct RenderArguments {
    /// Folder of the dataset: one folder a sequence, named `model-0`, `model-1`, and so on.
    #[arg(long)]
    out: PathBuf,
    /// Folder of ShapeNetCore, v1 or v2; without it, shapes are procedural cars.
    #[arg(long)]
    shapenet: Option<PathBuf>,
    /// Category within it.
    #[arg(long, default_value = CARS)]
    synset: String,
    /// Take only model ids like this, `*` standing for anything; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    include: Vec<String>,
    /// Leave out model ids like this; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    exclude: Vec<String>,
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
    ShapeNet(Model),
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
    shapes
        .par_iter()
        .enumerate()
        .progress_with_style(style.expect("a valid template"))
        .try_for_each(|(idx, shape)| {
            let (id, mesh) = shape.load()?;
            write_sequences(&id, &mesh, idx as u64, arguments, &options)
        })?;
    println!("{} models, {} sequences of each", shapes.len(), arguments.sequences);
    Ok(())
}

fn shapes(arguments: &RenderArguments) -> Result<Vec<Shape>> {
    let Some(root) = &arguments.shapenet else {
        let seeds = (0..arguments.models).map(|idx| arguments.seed * 1_000_000 + idx);
        return Ok(seeds.map(Shape::Procedural).collect());
    };
    let models = find_models(root, &arguments.synset)?;
    let models = select_models(models, &arguments.include, &arguments.exclude);
    if models.is_empty() {
        let reason = "no model id matches --include and --exclude".into();
        return Err(Error::Config { path: root.clone(), reason });
    }
    Ok(models.into_iter().map(Shape::ShapeNet).collect())
}

impl Shape {
    fn load(&self) -> Result<(String, Mesh)> {
        match self {
            Self::Procedural(seed) => Ok((format!("car_{seed:06}"), procedural::car(*seed))),
            Self::ShapeNet(model) => Ok((model.id.clone(), model.load()?.mesh)),
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
