//! pba-train: the shape prior, then the regressors, into a folder that `pba-infer` reads.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Parser, Subcommand};
use object_pba::{
    Result,
    device::Backend,
    training::{TrainingConfig, train_regressors, train_shape_prior},
};
use render::RenderArguments;
use shards::{MergeArguments, ShardArguments};

mod render;
mod shards;

/// Large tensors come and go with every operation; the system's allocator returns each one's pages
/// to the kernel and faults them in again, which doubles a training step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Trains a shape prior and its regressors, and renders sequences to try them on.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train the autoencoder of shapes.
    Prior(TrainArguments),
    /// Train the style and pose regressors, on a finished prior.
    Regressors(TrainArguments),
    /// Train both.
    All(TrainArguments),
    /// Render sequences with their ground truth.
    Render(RenderArguments),
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
    /// Folder of ShapeNetCore, v1 or v2; without it, shapes are procedural cars.
    #[arg(long)]
    shapenet: Option<PathBuf>,
    /// Category within it.
    #[arg(long)]
    synset: Option<String>,
    /// Take only model ids like this, `*` standing for anything; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    include: Vec<String>,
    /// Leave out model ids like this; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    exclude: Vec<String>,
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Prior(arguments) => train(&arguments, true, false),
        Command::Regressors(arguments) => train(&arguments, false, true),
        Command::All(arguments) => train(&arguments, true, true),
        Command::Render(arguments) => render::render(&arguments),
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
    let TrainArguments { arguments, device } = arguments;
    let config = arguments.config()?;
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
        let data = &mut config.data;
        data.shapenet = self.shapenet.clone().or(data.shapenet.take());
        data.synset = self.synset.clone().unwrap_or_else(|| data.synset.clone());
        data.include.extend(self.include.iter().cloned());
        data.exclude.extend(self.exclude.iter().cloned());
        Ok(config)
    }
}
