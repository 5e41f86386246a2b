//! The tables of an evaluation, the first of them after the paper's Table 1.

use super::{
    grid::Grid,
    measured::{METRICS, Measured, Metric},
    plan::Entry,
    states::{INITIAL, State, model_of},
    statistics::{Statistic, mean},
    summary::{Numbers, Summary},
};
use crate::output::significant;

/// The columns of the first table.
const COLUMNS: [&str; 8] = [
    "style_error",
    "rotation_error_deg_mean",
    "reference_rotation_error_deg",
    "relative_rotation_error_deg_mean",
    "translation_error_mean",
    "f_score",
    "photometric_loss",
    "silhouette_loss",
];
/// The columns of the table of models.
const OF_MODELS: [&str; 5] = [
    "rotation_error_deg_mean",
    "relative_rotation_error_deg_mean",
    "style_error",
    "photometric_loss",
    "silhouette_loss",
];
/// Table 1 of the paper, in its columns: Err_style, mean error, L_ph, L_CD.
const PAPER: [(&str, [&str; 4]); 3] = [
    ("paper: Zhu et al., frame by frame", ["3.43", "5.44", "–", "1.20e5"]),
    ("paper: initialisation", ["2.79", "14.17", "843.56", "1.12e5"]),
    ("paper: after optimisation", ["2.70", "4.24", "197.37", "7.64e3"]),
];

/// `table1.md`.
pub fn markdown(entries: &[Entry], states: &[State], summary: &Summary) -> String {
    let tables: Vec<String> = tables(entries, states, summary).iter().map(Grid::markdown).collect();
    format!("{}\n\n{}", headline(summary), tables.join("\n"))
}

/// How much was evaluated.
pub fn headline(summary: &Summary) -> String {
    let n_failed = summary.state("solver").map_or(0, |state| state.n_failed);
    format!("{} sequences, {n_failed} failed", summary.n_sequences)
}

pub fn tables(entries: &[Entry], states: &[State], summary: &Summary) -> Vec<Grid> {
    let mut tables = vec![methods(summary), shares(summary)];
    tables.extend(before_and_after(summary));
    tables.extend(models(entries, states));
    tables
}

fn methods(summary: &Summary) -> Grid {
    let metrics = COLUMNS.map(Metric::of);
    let mut headings: Vec<String> = metrics.iter().map(|metric| metric.heading()).collect();
    headings.extend(["seconds".into(), "failed".into()]);
    let title = format!("Means over sequences, medians in brackets; {} points", summary.n_points);
    let mut grid = Grid::new(&title, headings);
    let both = |metric: &Metric, of: Option<&Statistic>| match of {
        Some(of) if of.n > 0 => format!("{} ({})", metric.cell(of.mean), metric.cell(of.median)),
        _ => "–".into(),
    };
    for state in &summary.states {
        let cells = metrics.iter().map(|metric| both(metric, state.metrics.get(metric.key)));
        let more = [number(state.seconds.mean), state.n_failed.to_string()];
        grid.push(state.label.clone(), cells.chain(more));
    }
    let floors = [
        ("floor: true poses, encoded true shape", &summary.floors.at_truth),
        ("floor: true poses, true points", &summary.floors.true_points),
        ("floor: two samplings of one mesh", &summary.floors.sampling),
    ];
    for (label, numbers) in floors {
        let cells = metrics.iter().map(|metric| both(metric, numbers.get(metric.key)));
        grid.push(label, cells.chain(["".into(), "".into()]));
    }
    for (label, [style, pose, photometric, silhouette]) in PAPER {
        let cells = [style, pose, "", "", "", "", photometric, silhouette, "", ""];
        grid.push(label, cells.map(str::to_owned));
    }
    grid.note = "A failure has no numbers. Two samplings of one mesh are told from two halves of the true \
        cloud. The paper's numbers are of its own data, and it does not state its unit of the style error."
        .into();
    grid
}

/// What hand-counting would tell.
fn shares(summary: &Summary) -> Grid {
    let headings = [
        "pose error under 5°",
        "turned round (> 90°)",
        "style gap closed",
        "L_ph over its value at the truth",
        "L_CD over its value at the truth",
        "ended in a fault",
    ];
    let mut grid =
        Grid::new("Shares of sequences, failures among them", headings.map(str::to_owned).into());
    let ratio = |of: &Statistic| match of.n {
        0 => "–".into(),
        _ => format!("{} ({})", number(of.mean), number(of.median)),
    };
    for state in &summary.states {
        let shares = [state.share_below_5_deg, state.share_turned_round, state.style_gap_closed]
            .map(percent);
        let ratios = [&state.photometric_over_truth, &state.silhouette_over_truth].map(ratio);
        let faulty = state.n_faulty.to_string();
        grid.push(state.label.clone(), shares.into_iter().chain(ratios).chain([faulty]));
    }
    let within = summary.within_two_sigma.iter().filter(|(_, of)| of.n > 0);
    let within: Vec<String> = within
        .map(|(name, of)| format!("{} {}", name.replace('_', " "), percent(of.mean)))
        .collect();
    grid.note = "The style gap goes from the initial style error to that of the encoded true shape. The truth \
        of L_ph and L_CD is that of the true poses and the encoded true shape."
        .into();
    if !within.is_empty() {
        grid.note += &format!(
            " Components of errors within two reported standard deviations (95.4 % if these were right): {}.",
            within.join(", ")
        );
    }
    if let Some(memory) = summary.peak_memory_mb {
        grid.note += &format!(" Peak memory of the process: {memory:.0} MB.");
    }
    grid
}

/// Every number of the chosen solver, and its floor.
fn before_and_after(summary: &Summary) -> Option<Grid> {
    let (initial, last) = (summary.state(INITIAL)?, summary.state("solver")?);
    let headings = [
        "initial mean",
        "median",
        "final mean",
        "median",
        "floor: encoded true shape",
        "floor: two samplings",
    ];
    let title = format!("Every number of {}, and its noise floor", last.label);
    let mut grid = Grid::new(&title, headings.map(str::to_owned).into());
    for metric in &METRICS {
        let of = |numbers: &Numbers| {
            let of = numbers.get(metric.key);
            [of.and_then(|of| of.mean), of.and_then(|of| of.median)].map(|value| metric.cell(value))
        };
        let [at_truth, _] = of(&summary.floors.at_truth);
        let [sampling, _] = of(&summary.floors.sampling);
        let cells = of(&initial.metrics).into_iter().chain(of(&last.metrics));
        grid.push(metric.heading(), cells.chain([at_truth, sampling]));
    }
    let none = || String::new();
    let seconds = [none(), none(), number(last.seconds.mean), number(last.seconds.median)];
    grid.push("seconds", seconds.into_iter().chain([none(), none()]));
    Some(grid)
}

/// Means before and after for each model, where some have several sequences.
fn models(entries: &[Entry], states: &[State]) -> Option<Grid> {
    let find = |key: &str| states.iter().find(|state| state.key == key);
    let (initial, last) = (find(INITIAL)?, find("solver")?);
    let mut models: Vec<&str> = entries.iter().map(|entry| model_of(&entry.sequence)).collect();
    models.dedup();
    if models.len() == entries.len() {
        return None;
    }
    let metrics = OF_MODELS.map(Metric::of);
    let headings = metrics.iter().map(|metric| metric.heading());
    let headings = ["sequences".into()].into_iter().chain(headings).collect();
    let mut grid = Grid::new("Means of each model, initial → final", headings);
    for model in models {
        let own: Vec<usize> =
            (0..entries.len()).filter(|&idx| model_of(&entries[idx].sequence) == model).collect();
        let of = |state: &State, value: fn(&Measured) -> Option<f64>| {
            let values = state.values(value);
            mean(&own.iter().filter_map(|&idx| values[idx]).collect::<Vec<_>>())
        };
        let arrows = metrics.iter().map(|metric| {
            let [from, to] = [initial, last].map(|state| metric.cell(of(state, metric.value)));
            format!("{from} → {to}")
        });
        grid.push(model, [own.len().to_string()].into_iter().chain(arrows));
    }
    Some(grid)
}

pub fn percent(share: Option<f64>) -> String {
    share.map_or("–".into(), |share| format!("{:.1} %", 100.0 * share))
}

pub fn number(value: Option<f64>) -> String {
    value.map_or("–".into(), significant)
}
