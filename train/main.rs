//! pba-train: the shape prior, then the regressors, into a folder that `pba-infer` reads.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Parser, Subcommand};
use coverage::CoverageArguments;
use inspect::InspectArguments;
use object_pba::{
    Error, Result,
    device::Backend,
    training::{TrainingConfig, train_regressors, train_shape_prior},
};
use psgn::PsgnArguments;
use render::RenderArguments;
use selection::SelectionArguments;
use shards::{MergeArguments, ShardArguments};

mod inspect;
mod coverage;
mod psgn;
mod render;
mod selection;
mod shards;

/// Large tensors come and go with every operation; the system's allocator returns each one's pages
/// to the kernel and faults them in again, which doubles a training step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Looks at meshes, trains a shape prior and its regressors on them, and renders sequences to try
/// these on.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Summarise a collection of meshes before hours are spent on it.
    Inspect(InspectArguments),
    /// Train the autoencoder of shapes.
    Prior(TrainArguments),
    /// Train the style and pose regressors, on a finished prior.
    Regressors(TrainArguments),
    /// Train both.
    All(TrainArguments),
    /// Train a network that regresses a point set from one picture, without a shape prior (Fan et al. 2017), and
    /// compare it with a prior's regressed style.
    Psgn(PsgnArguments),
    /// Render sequences with their ground truth.
    Render(RenderArguments),
    /// Measure how far real cars are from the procedural family.
    Coverage(CoverageArguments),
    /// Render the pictures that the regressors train on, as WebDataset tars.
    Shards(ShardArguments),
    /// Merge all shards of such pictures into one.
    Merge(MergeArguments),
}

/// Interrupt training whenever you like: the same command goes on from its last checkpoint.
#[derive(Args)]
struct TrainArguments {
    #[command(flatten)]
    arguments: Arguments,
    /// The pictures that `pba-train shards` wrote by this config: one tar, or a folder of all parts.
    /// Without it, they are rendered while training goes on.
    #[arg(long)]
    shards: Option<PathBuf>,
    #[arg(long, default_value_t)]
    device: Backend,
}

#[derive(Args)]
struct Arguments {
    /// What to train: a preset such as configs/car-small.toml.
    #[arg(long)]
    config: PathBuf,
    /// Folder for what is made, and the effective config.
    #[arg(long)]
    out: PathBuf,
    /// Replaces the config's seed.
    #[arg(long)]
    seed: Option<u64>,
    /// Folder of meshes: ShapeNetCore v1 or v2, or any; without it, shapes are procedural cars.
    #[arg(long, alias = "shapenet")]
    meshes: Option<PathBuf>,
    /// Folder that keeps the sampled points of meshes for later runs.
    #[arg(long)]
    cache: Option<PathBuf>,
    #[command(flatten)]
    selection: SelectionArguments,
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Inspect(arguments) => inspect::inspect(&arguments),
        Command::Prior(arguments) => train(&arguments, true, false),
        Command::Regressors(arguments) => train(&arguments, false, true),
        Command::All(arguments) => train(&arguments, true, true),
        Command::Psgn(arguments) => psgn::psgn(&arguments),
        Command::Render(arguments) => render::render(&arguments),
        Command::Coverage(arguments) => coverage::coverage(&arguments),
        Command::Shards(arguments) => shards::write(&arguments),
        Command::Merge(arguments) => shards::merge(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", error.to_string().trim_end().replace('\n', " "));
            ExitCode::FAILURE
        }
    }
}

fn train(arguments: &TrainArguments, prior: bool, regressors: bool) -> Result<()> {
    let TrainArguments { arguments, shards, device } = arguments;
    let mut config = arguments.config()?;
    config.data.shards = shards.clone().or(config.data.shards);
    let device = device.device();
    if prior {
        train_shape_prior(&config, &arguments.out, &device)?;
    }
    if regressors {
        train_regressors(&config, &arguments.out, &device)?;
    }
    Ok(())
}

impl Arguments {
    /// The preset, with what the command line says instead.
    fn config(&self) -> Result<TrainingConfig> {
        let mut config = TrainingConfig::read(&self.config)?;
        config.seed = self.seed.unwrap_or(config.seed);
        let (data, selection) = (&mut config.data, &self.selection);
        data.meshes = self.meshes.clone().or(data.meshes.take());
        data.cache = self.cache.clone().or(data.cache.take());
        if !selection.synset.is_empty() {
            data.synset = selection.synset.join(",");
        }
        data.split = selection.split.or(data.split);
        data.up = selection.up.or(data.up);
        data.front = selection.front.or(data.front);
        data.include.extend(selection.include.iter().cloned());
        data.exclude.extend(selection.exclude.iter().cloned());
        let invalid = |reason| Error::Config { path: self.config.clone(), reason };
        config.check().map_err(invalid)?;
        Ok(config)
    }
}
