//! What each part of the method is worth: Fig. 4, 6 and 7, and the choices that the paper leaves open.

mod arm;
mod chart;
mod csv_files;
mod digest;
mod fig7;
mod results;
mod store;
mod studies;
mod summary;
mod table;
mod variants;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use clap::Args;
use object_pba::{
    checkpoint::Prior,
    config::write_config,
    data::formats::{SequenceHints, read_sequence},
    device::Backend,
};

pub use self::arm::freed;
use self::{arm::Reconstructor, results::Results, store::Store, studies::Study};
use crate::{
    Options,
    dataset::{sequences_below, states_its_camera},
    side_by_side::side_by_side,
};

/// What to compare, and on what.
#[derive(Args)]
pub struct AblateArguments {
    /// A folder of sequences for studies; or sequences, each for a picture of the shape prior against
    /// points that move freely (Fig. 7).
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// What to compare; all of it when left out.
    #[arg(long = "study", value_enum, value_delimiter = ',')]
    studies: Vec<Study>,
    /// Sequences to compare on: the first ones of the folder, the same for all arms.
    #[arg(long, default_value_t = 20)]
    max_sequences: usize,
    /// N, the points of the cloud: so many of the prior's.
    #[arg(long, default_value_t = 6144)]
    points: usize,
    /// All sequences, and all points of the prior.
    #[arg(long, conflicts_with_all = ["max_sequences", "points"])]
    full: bool,
    /// Folder for tables, figures, and what each arm came to on each sequence. Where some of that is
    /// there already, the rest is done.
    #[arg(long, default_value = "runs/ablate")]
    out: PathBuf,
    #[command(flatten)]
    options: Options,
}

pub fn ablate(arguments: &AblateArguments) -> Result<()> {
    let AblateArguments { paths, studies, out, options, .. } = arguments;
    if studies.is_empty() && paths.iter().all(|path| states_its_camera(path)) {
        return fig7::compare_all(paths, out, options);
    }
    let [dataset] = &paths[..] else { bail!("a study takes one folder of sequences") };
    study(dataset, arguments)
}

/// A sequence, and what its results are kept under.
struct Subject {
    name: String,
    path: PathBuf,
    /// Of its pictures, cameras and truth; or why it cannot be read.
    digest: Result<String, String>,
}

fn study(dataset: &Path, arguments: &AblateArguments) -> Result<()> {
    let AblateArguments { max_sequences, points, full, out, options, .. } = arguments;
    let base = options.bundle_adjustment()?;
    let prior = options.load_prior(&options.device.device().autodiff())?;
    let n_prior = prior.shape.generator.n_points();
    let n_points = if *full { n_prior } else { *points };
    if !(1..=n_prior).contains(&n_points) {
        bail!("--points {n_points}: this prior has {n_prior}");
    }
    let subjects = subjects(dataset, if *full { usize::MAX } else { *max_sequences })?;
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    write_config(&out.join("config.toml"), &base)?;

    let chosen = match &arguments.studies[..] {
        [] => Study::ALL.to_vec(),
        chosen => Study::chosen(chosen),
    };
    let store = Store::open(&out.join("results"), &prior)?;
    let mut report = String::new();
    for (idx, study) in chosen.iter().enumerate() {
        let comparison = study.comparison(&base, n_points, n_prior);
        eprintln!("{} of {}: {}", idx + 1, chosen.len(), comparison.title);
        let entries = run(&comparison.arms, &subjects, &prior, options.device, &store)?;
        let results = Results { study: *study, comparison: &comparison, entries: &entries };
        let text = summary::write(&out.join(study.name()), &results)?;
        println!("{text}");
        report += &format!("{text}\n");
    }
    let path = out.join("table.md");
    fs::write(&path, report).with_context(|| format!("cannot write {}", path.display()))?;
    println!("Tables and figures are in {}.", out.display());
    Ok(())
}

fn subjects(dataset: &Path, most: usize) -> Result<Vec<Subject>> {
    let paths = match states_its_camera(dataset) {
        true => vec![dataset.to_path_buf()],
        false => sequences_below(dataset)?,
    };
    let subject = |path: PathBuf| Subject {
        name: path.file_name().unwrap_or_default().to_string_lossy().into(),
        digest: match read_sequence(&path, &SequenceHints::default()) {
            Ok(reading) => Ok(digest::of_sequence(&reading.sequence)),
            Err(error) => Err(error.to_string()),
        },
        path,
    };
    Ok(paths.into_iter().take(most.max(1)).map(subject).collect())
}

/// Every arm on every sequence, in this order; what is in the store is not done again.
fn run(
    arms: &[arm::Arm],
    subjects: &[Subject],
    prior: &Prior,
    backend: Backend,
    store: &Store,
) -> Result<Vec<Vec<store::Entry>>> {
    let reconstructor = Reconstructor::new(prior, arms, &backend.device().autodiff());
    let pairs: Vec<_> =
        arms.iter().flat_map(|arm| subjects.iter().map(move |subject| (arm, subject))).collect();
    // What failed is tried again.
    let is_done =
        |arm: &_, subject: &_| store.get(arm, subject).is_some_and(|e| e.outcome.is_some());
    let missing: Vec<_> = pairs.iter().filter(|(arm, subject)| !is_done(arm, subject)).collect();
    let n_done = pairs.len() - missing.len();
    eprintln!("{} reconstructions, of which {n_done} are done", pairs.len());
    let written = side_by_side(&missing, |(arm, subject)| {
        store.put(arm, subject, reconstructor.run(arm, &subject.path))
    });
    written.into_iter().collect::<Result<Vec<_>>>()?;
    let entry = |arm, subject| store.get(arm, subject).expect("it was put there");
    Ok(arms.iter().map(|arm| subjects.iter().map(|s| entry(arm, s)).collect()).collect())
}
