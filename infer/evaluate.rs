//! Many sequences: errors before and after, each sequence and on average.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
    thread,
};

use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use object_pba::{
    bundle_adjustment::WithinTwoSigma,
    config::write_config,
    data::formats::{Layout, SequenceHints, read_sequence},
    reconstruction::Scores,
};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

use crate::{
    Options, output,
    run::{Report, reconstruct_and_score},
};

/// One line of `per_sequence.jsonl`; a failure is counted, not dropped.
#[derive(Serialize)]
struct Entry {
    sequence: String,
    #[serde(flatten)]
    report: Option<Report>,
    failure: Option<String>,
}

pub fn evaluate(dataset: &Path, out: &Path, options: &Options) -> Result<()> {
    let config = options.bundle_adjustment()?;
    let prior = options.load_prior(&options.device.device().autodiff())?;
    let sequences = sequences_below(dataset)?;
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    write_config(&out.join("config.toml"), &config)?;

    let reconstruct = |path: &PathBuf| -> Result<Report> {
        let sequence = read_sequence(path, &SequenceHints::default())?.sequence;
        Ok(reconstruct_and_score(&prior, &sequence, &config, options.device, &mut |_, _| {})?
            .report)
    };
    let entries = side_by_side(&sequences, |path| {
        let result = reconstruct(path);
        Entry {
            sequence: path.file_name().unwrap_or_default().to_string_lossy().into(),
            failure: result.as_ref().err().map(|error| format!("{error:#}")),
            report: result.ok(),
        }
    });

    let lines: Vec<String> = entries.iter().map(serde_json::to_string).collect::<Result<_, _>>()?;
    write(&out.join("per_sequence.jsonl"), &(lines.join("\n") + "\n"))?;
    let table = table(&entries);
    write(&out.join("table.md"), &table)?;
    println!("{table}");
    for entry in &entries {
        if let Some(failure) = &entry.failure {
            println!("failed: {}: {failure}", entry.sequence);
        }
    }
    Ok(())
}

/// Works on as many items as there are cores, each on its share of them, and keeps their order.
///
/// In one pool, a core that waits for its share of an item would take up another one meanwhile: more
/// and more would be under way, each with its memory, and none would be timed right.
fn side_by_side<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let style = "{bar:30} {pos}/{len} {elapsed_precise} (ETA {eta})";
    let style = ProgressStyle::with_template(style).expect("a valid template");
    let bar = ProgressBar::new(items.len() as u64).with_style(style);
    let n_cores = rayon::current_num_threads();
    let n_workers = n_cores.min(items.len());
    let next = AtomicUsize::new(0);
    let work_alone = || {
        let pool = ThreadPoolBuilder::new().num_threads(n_cores / n_workers).build();
        let pool = pool.expect("threads can start");
        let mut done = Vec::new();
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(idx) else { break done };
            done.push((idx, pool.install(|| work(item))));
            bar.inc(1);
        }
    };
    let mut done: Vec<(usize, R)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..n_workers).map(|_| scope.spawn(work_alone)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no work panics")).collect()
    });
    bar.finish_and_clear();
    done.sort_by_key(|(idx, _)| *idx);
    done.into_iter().map(|(_, result)| result).collect()
}

/// The folders below `dataset` that hold a sequence with its camera, in order of their names.
fn sequences_below(dataset: &Path) -> Result<Vec<PathBuf>> {
    let entries =
        fs::read_dir(dataset).with_context(|| format!("cannot read {}", dataset.display()))?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir() && states_its_camera(path))
        .collect();
    folders.sort();
    if folders.is_empty() {
        bail!("{}: no folder below it holds a sequence", dataset.display());
    }
    Ok(folders)
}

fn states_its_camera(folder: &Path) -> bool {
    Layout::detect(folder).is_ok_and(|layout| !matches!(layout, Layout::Plain(_)))
}

/// Mean and median before and after, over all sequences and over those of each model.
///
/// Sequences of one model are named `model-0`, `model-1`, and so on.
fn table(entries: &[Entry]) -> String {
    let done: Vec<(&str, &Report)> = entries
        .iter()
        .filter_map(|entry| Some((model_of(&entry.sequence), entry.report.as_ref()?)))
        .collect();
    let reports: Vec<&Report> = done.iter().map(|(_, report)| *report).collect();
    let mut text =
        format!("{} sequences, {} failed\n\n", entries.len(), entries.len() - done.len());
    text += "| | initial mean | median | final mean | median |\n| --- | --- | --- | --- | --- |\n";
    for (name, value) in output::ROWS {
        let initial: Vec<f64> = reports.iter().filter_map(|r| value(&r.initial)).collect();
        let last: Vec<f64> = reports.iter().filter_map(|r| value(&r.last)).collect();
        let cells = [mean(&initial), median(&initial), mean(&last), median(&last)].map(cell);
        text += &format!("| {name} | {} |\n", cells.join(" | "));
    }
    let seconds: Vec<f64> = reports.iter().map(|report| report.seconds).collect();
    text += &format!("| seconds | | | {} | {} |\n", cell(mean(&seconds)), cell(median(&seconds)));

    let within: Vec<_> = reports
        .iter()
        .filter_map(|report| report.uncertainty.as_ref()?.within_two_sigma.as_ref())
        .collect();
    type Share = fn(&WithinTwoSigma) -> f64;
    let shares: [(&str, Share); 3] = [
        ("rotation", |within| within.rotation),
        ("translation", |within| within.translation),
        ("relative rotation", |within| within.relative_rotation),
    ];
    for (name, share) in shares {
        let values: Vec<f64> = within.iter().map(|&within| share(within)).collect();
        let cells = [mean(&values), median(&values)].map(cell).join(" | ");
        text += &format!("| {name} errors within 2σ (share of components) | | | {cells} |\n");
    }

    let mut models: Vec<&str> = done.iter().map(|(model, _)| *model).collect();
    models.dedup();
    if models.len() == reports.len() {
        return text;
    }
    text += "\n| model | sequences | pose error (deg) | relative (deg) | style error (1e-3) | L_ph | L_CD |\n";
    text += "| --- | --- | --- | --- | --- | --- | --- |\n";
    for model in models {
        let of_model: Vec<&Report> =
            done.iter().filter(|(name, _)| *name == model).map(|(_, report)| *report).collect();
        let arrow = |value: output::Figure| {
            let of = |scores: fn(&Report) -> &Scores| {
                let values = of_model.iter().filter_map(|&report| value(scores(report)));
                cell(mean(&values.collect::<Vec<f64>>()))
            };
            format!("{} → {}", of(|r| &r.initial), of(|r| &r.last))
        };
        let columns = [1, 2, 5, 6, 7].map(|row| arrow(output::ROWS[row].1)).join(" | ");
        text += &format!("| {model} | {} | {columns} |\n", of_model.len());
    }
    text
}

fn model_of(sequence: &str) -> &str {
    sequence.rsplit_once('-').map_or(sequence, |(model, _)| model)
}

fn cell(value: Option<f64>) -> String {
    value.map_or("–".into(), output::significant)
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn median(values: &[f64]) -> Option<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
