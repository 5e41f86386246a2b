//! Many sequences: every number of every one, tables, success curves, and a page to look at them.

mod curves;
mod estimates;
mod floors;
mod grid;
mod index;
mod measured;
mod methods;
mod plan;
mod rows;
mod states;
mod statistics;
mod store;
mod summary;
mod table;
mod work;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, Result, bail};
use clap::Args;
use object_pba::{config::write_config, data::formats::write_atomically};

use self::{
    measured::Metric,
    methods::{Method, Methods},
    plan::{Entry, Plan, Task},
    states::{State, states},
    summary::Summary,
    work::Context,
};
use crate::{Options, baselines::Neighbours, dataset::sequences_below, side_by_side::side_by_side};

/// What to evaluate, beside the chosen solver.
#[derive(Args)]
pub struct Evaluation {
    /// Other methods to evaluate beside the solver, with commas between them: `paper` (Table 1 and Fig. 3:
    /// Algorithm 1 on L_ph, on L_CD and on both, and every frame by itself), `baselines` (per-frame,
    /// mean-shape, retrieval, free-points), `all` of these and the solver from the truth, or any by
    /// name, colmap and colmap-unmasked too. Each arm of Algorithm 1, from-truth and free-points cost
    /// about as much as the solver or more, retrieval makes the training shapes anew once, the others
    /// cost next to nothing.
    #[arg(long, default_value = "solver", value_name = "LIST")]
    methods: Methods,
    /// Run the solver on the first frames alone, too: so many (Fig. 4), as in 1,2,5,10,15, which costs
    /// about as much again as all 15 do.
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    views: Vec<usize>,
    /// Folder of another program's estimates: below it, a folder of each sequence's name with a
    /// transforms.json or a COLMAP model, and a points.ply if there is one. May be repeated.
    #[arg(long, value_name = "DIR")]
    estimates: Vec<PathBuf>,
    /// Write each sequence's own report, which the page links to: some MB each.
    #[arg(long)]
    reports: bool,
    /// The program to run as COLMAP.
    #[arg(long, value_name = "PATH", default_value = "colmap")]
    colmap: PathBuf,
}

impl Evaluation {
    fn tasks(&self) -> Vec<Task> {
        let methods = self.methods.0.iter().map(|&method| Task::Method(method));
        let views = self.views.iter().filter(|&&n_views| n_views > 0);
        let estimates = self.estimates.iter().map(|folder| Task::Estimates(folder.clone()));
        let mut tasks: Vec<Task> =
            methods.chain(views.map(|&n_views| Task::Views(n_views))).chain(estimates).collect();
        tasks.dedup();
        tasks
    }
}

pub fn evaluate(
    dataset: &Path,
    out: &Path,
    evaluation: &Evaluation,
    options: &Options,
) -> Result<()> {
    let config = options.bundle_adjustment()?;
    let prior = options.load_prior(&options.device.device().autodiff())?;
    let sequences = sequences_below(dataset)?;
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    write_config(&out.join("config.toml"), &config)?;
    let plan = Plan {
        tasks: evaluation.tasks(),
        out: out.into(),
        program: store::program_digest()?,
        prior: store::prior_digest(options.prior.as_ref())?,
        context: Context {
            prior,
            config,
            backend: options.device,
            neighbours: Neighbours::default(),
            colmap: evaluation.colmap.clone(),
            reports: evaluation.reports,
        },
    };
    let entries = side_by_side(&sequences, |path| plan.work_on(path));
    say_what_was_kept(&entries);

    let states = states(&plan, &entries);
    let name = dataset.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let summary = Summary::new(name, &plan, &entries, &states);
    let table = table::markdown(&entries, &states, &summary);
    write(out, "per_sequence.jsonl", &rows::jsonl(&entries))?;
    write(out, "per_sequence.csv", &rows::csv(&entries, &states)?)?;
    write(out, "summary.json", &serde_json::to_string_pretty(&summary)?)?;
    write(out, "table1.md", &table)?;
    let figures = write_figures(out, &states)?;
    let tables = table::tables(&entries, &states, &summary);
    write(out, "index.html", &index::page(&plan, &entries, &states, &summary, &tables, &figures))?;
    println!("{table}");
    println!("Every sequence, and the figures: {}", out.join("index.html").display());
    say_what_failed(&entries)
}

/// Draws the figures that there is something to draw of, and says what they show.
fn write_figures(out: &Path, states: &[State]) -> Result<Vec<(&'static str, String)>> {
    let mut figures = Vec::new();
    for (file, key, caption) in [
        (
            "success_pose.svg",
            "rotation_error_deg_mean",
            "Share of sequences under a mean pose error (Fig. 3).",
        ),
        ("success_style.svg", "style_error", "Share of sequences under a style error (Fig. 3)."),
    ] {
        let svg = curves::success(Metric::of(key), states)?;
        write(out, file, &svg)?;
        figures.push((caption, svg));
    }
    if let Some(svg) = curves::views(states)? {
        write(out, "views.svg", &svg)?;
        let caption = "Errors over the number of views, the band between quartiles (Fig. 4). One view is the initialisation.";
        figures.push((caption, svg));
    }
    Ok(figures)
}

fn say_what_was_kept(entries: &[Entry]) {
    let n_kept: usize = entries.iter().map(|entry| entry.n_kept).sum();
    if n_kept > 0 {
        eprintln!("{n_kept} results were there already, and are kept");
    }
    let outdated: Vec<&Entry> = entries.iter().filter(|entry| !entry.outdated.is_empty()).collect();
    if !outdated.is_empty() {
        let mut what: Vec<&str> =
            outdated.iter().flat_map(|entry| entry.outdated.clone()).collect();
        what.sort();
        what.dedup();
        eprintln!(
            "{} sequences had results of another {}: computed anew",
            outdated.len(),
            what.join(", ")
        );
    }
}

/// One line a failure; an error, where the solver failed on all.
fn say_what_failed(entries: &[Entry]) -> Result<()> {
    for entry in entries {
        for (task, result) in &entry.results {
            if let Err(failure) = result {
                println!("failed: {}: {task}: {failure}", entry.sequence);
            }
        }
    }
    let failures: Vec<&String> = entries
        .iter()
        .filter_map(|entry| entry.results[&Method::Solver.name()].as_ref().err())
        .collect();
    if failures.len() == entries.len() {
        bail!("all {} sequences failed; the first: {}", entries.len(), failures[0]);
    }
    Ok(())
}

fn write(out: &Path, name: &str, text: &str) -> Result<()> {
    Ok(write_atomically(&out.join(name), text.as_bytes())?)
}
