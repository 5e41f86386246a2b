//! pba-train: the shape prior, then the regressors, into a folder that `pba-infer` reads.

use std::{path::PathBuf, process::ExitCode};

use clap::{Parser, ValueEnum};
use object_pba::{
    Result,
    device::Backend,
    training::{TrainingConfig, train_regressors, train_shape_prior},
};

/// Trains a shape prior and its regressors. Interrupt it whenever you like: the same command goes
/// on from its last checkpoint.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    stage: Stage,
    /// What to train: a preset such as configs/car-small.toml.
    #[arg(long)]
    config: PathBuf,
    /// Folder for the weights, the effective config and metrics.jsonl.
    #[arg(long)]
    out: PathBuf,
    #[arg(long, default_value_t)]
    device: Backend,
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

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Stage {
    /// The autoencoder of shapes.
    Prior,
    /// The style and pose regressors, on a finished prior.
    Regressors,
    /// Both.
    All,
}

fn main() -> ExitCode {
    match train(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", error.to_string().trim_end().replace('\n', " "));
            ExitCode::FAILURE
        }
    }
}

fn train(arguments: &Arguments) -> Result<()> {
    let config = arguments.config()?;
    let device = arguments.device.device();
    if arguments.stage != Stage::Regressors {
        train_shape_prior(&config, &arguments.out, &device)?;
    }
    if arguments.stage != Stage::Prior {
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
