//! pba-infer: reconstruct sequences, judge them, ablate the prior, and export results.

mod ablate;
mod assets;
mod baselines;
mod colmap;
mod dataset;
mod evaluate;
mod export;
mod figures;
mod input;
mod output;
mod report;
mod run;
mod side_by_side;

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result};
use burn::tensor::Device;
use clap::{Args, Parser, Subcommand};
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Solver},
    checkpoint::Prior,
    config::read_config,
    device::Backend,
    initial_guess::Start,
};

use ablate::AblateArguments;
use evaluate::Evaluation;
use export::Format;
use input::Input;

/// Large tensors come and go with every operation; the system's allocator returns each one's pages
/// to the kernel and faults them in again, which doubles a training step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[derive(Parser)]
#[command(version, about = "Camera poses and a full point cloud from pictures of an object.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Reconstruct the bundled sequence with the bundled prior.
    Demo {
        /// Folder for the pictures, the cloud and the cameras.
        #[arg(long, default_value = "runs/demo")]
        out: PathBuf,
        /// Leave out report/index.html.
        #[arg(long)]
        no_report: bool,
        #[command(flatten)]
        options: Options,
    },
    /// Reconstruct a sequence: a transforms.json, COLMAP model, SRN folder, 3D-R2N2 rendering, folder of
    /// pictures and masks, or video.
    Run {
        sequence: PathBuf,
        /// Folder for the results.
        #[arg(long)]
        out: PathBuf,
        /// Leave out report/index.html.
        #[arg(long)]
        no_report: bool,
        #[command(flatten)]
        input: Input,
        #[command(flatten)]
        options: Options,
    },
    /// Reconstruct every sequence below a folder and tabulate errors before and after.
    Evaluate {
        dataset: PathBuf,
        /// Folder for the tables.
        #[arg(long)]
        out: PathBuf,
        #[command(flatten)]
        evaluation: Evaluation,
        #[command(flatten)]
        options: Options,
    },
    /// Compare ways to reconstruct, in tables and figures: the shape prior and free points, losses, views,
    /// solvers, λ, parameterisation, pyramid, hypotheses and N. The same start and sequences for all.
    Ablate(AblateArguments),
    /// Write the results of a run in the formats of other programs.
    Export {
        /// The folder that `run` or `demo` wrote.
        run: PathBuf,
        #[arg(
            long = "format",
            value_enum,
            value_delimiter = ',',
            default_value = "colmap,tum,glb,npz"
        )]
        formats: Vec<Format>,
    },
}

/// What every command that reconstructs understands.
#[derive(Args)]
struct Options {
    /// Folder of a trained prior; the bundled car prior when left out.
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Backend to compute on.
    #[arg(long, value_enum, default_value_t)]
    device: Backend,
    /// Preset of this solver; overrides the config's when both are given.
    #[arg(long, value_enum)]
    solver: Option<Solver>,
    /// Where to start; the truth, where it is known, shows what the prior and the objective cost.
    #[arg(long, value_enum)]
    start: Option<Start>,
    /// TOML file with what differs from the defaults, such as configs/infer-joint.toml.
    #[arg(long)]
    config: Option<PathBuf>,
}

impl Options {
    fn load_prior(&self, device: &Device) -> Result<Prior> {
        match &self.prior {
            Some(folder) => Prior::load(folder, device)
                .with_context(|| format!("cannot load the prior in {}", folder.display())),
            None => assets::car_prior(device).context("cannot load the bundled prior"),
        }
    }

    fn bundle_adjustment(&self) -> Result<BundleAdjustmentConfig> {
        let mut config = match &self.config {
            Some(path) => read_config(path)?,
            None => BundleAdjustmentConfig::preset(self.solver.unwrap_or_default()),
        };
        config.solver = self.solver.unwrap_or(config.solver);
        config.start = self.start.unwrap_or(config.start);
        Ok(config)
    }
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo { out, no_report, options } => run::demo(&out, !no_report, &options),
        Command::Run { sequence, out, no_report, input, options } => {
            run::run(&sequence, &out, !no_report, &input, &options)
        }
        Command::Evaluate { dataset, out, evaluation, options } => {
            evaluate::evaluate(&dataset, &out, &evaluation, &options)
        }
        Command::Ablate(arguments) => ablate::ablate(&arguments),
        Command::Export { run, formats } => export::export(&run, &formats),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// The chain of causes, each said once.
fn one_line(error: &anyhow::Error) -> String {
    let mut causes: Vec<String> = Vec::new();
    for cause in error.chain().map(|cause| cause.to_string().replace('\n', " ")) {
        if !causes.last().is_some_and(|last| last.ends_with(&cause)) {
            causes.push(cause);
        }
    }
    causes.join(": ")
}
