//! `per_sequence.csv` and `per_sequence.jsonl`: every number of every sequence.

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::{
    measured::{METRICS, Measured},
    plan::Entry,
    states::{State, model_of},
};

/// A line for each sequence and state, floors among them, in the units of summary.json.
pub fn csv(entries: &[Entry], states: &[State]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let own = ["sequence", "model", "state", "failure", "n_posed", "n_frames", "seconds"];
    writer.write_record(own.into_iter().chain(METRICS.iter().map(|metric| metric.key)))?;
    for (idx, entry) in entries.iter().enumerate() {
        let mut write =
            |state: &str, [failure, posed, frames, seconds]: [String; 4], measured: &Measured| {
                let own = [
                    &entry.sequence,
                    model_of(&entry.sequence),
                    state,
                    &failure,
                    &posed,
                    &frames,
                    &seconds,
                ];
                let values = METRICS.iter().map(|metric| cell((metric.value)(measured)));
                writer.write_record(own.into_iter().map(str::to_owned).chain(values))
            };
        for state in states {
            match &state.scored[idx] {
                Ok(scored) => {
                    let counts = [scored.n_posed, scored.n_frames].map(|n| n.to_string());
                    let [posed, frames] = counts;
                    let own = [String::new(), posed, frames, cell(scored.seconds)];
                    write(&state.key, own, &scored.measured)?;
                }
                Err(failure) => {
                    let own = [failure.clone(), String::new(), String::new(), String::new()];
                    write(&state.key, own, &Measured::default())?;
                }
            }
        }
        let Ok(floors) = &entry.floors else { continue };
        let sampling = floors.sampling.clone();
        let sampling = sampling.map(|cloud| Measured { cloud: Some(cloud), ..Measured::default() });
        for (name, floor) in [
            ("floor-at-truth", &floors.at_truth),
            ("floor-true-points", &floors.true_points),
            ("floor-sampling", &sampling),
        ] {
            if let Some(floor) = floor {
                write(name, Default::default(), floor)?;
            }
        }
    }
    let bytes = writer.into_inner().context("a table in memory")?;
    Ok(String::from_utf8(bytes)?)
}

/// What `run` writes of each sequence, one line each; a failure is counted, not dropped.
pub fn jsonl(entries: &[Entry]) -> String {
    let line = |entry: &Entry| {
        let (mut line, failure) = match &entry.results["solver"] {
            Ok(result) => (result.report.clone().unwrap_or(json!({})), Value::Null),
            Err(failure) => (json!({}), json!(failure)),
        };
        line["sequence"] = json!(entry.sequence);
        line["failure"] = failure;
        format!("{line}\n")
    };
    entries.iter().map(line).collect()
}

fn cell(value: Option<f64>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}
