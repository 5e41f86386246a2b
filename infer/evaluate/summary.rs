//! `summary.json`: what an evaluation says, over all sequences.

use std::collections::BTreeMap;

use object_pba::metrics::CloudErrors;
use serde::Serialize;

use super::{
    floors::Floors,
    measured::{METRICS, Measured, Metric},
    plan::{Entry, Plan},
    states::{INITIAL, State},
    statistics::{Statistic, mean},
};

/// Mean rotation error below which a sequence counts as solved, in degrees.
const SOLVED: f64 = 5.0;
/// Reference rotation error beyond which the object is turned round, in degrees.
const TURNED_ROUND: f64 = 90.0;

pub type Numbers = BTreeMap<&'static str, Statistic>;

#[derive(Serialize)]
pub struct Summary {
    pub dataset: String,
    pub n_sequences: usize,
    pub n_points: usize,
    /// Of the numbers below, in this file and in per_sequence.csv.
    pub units: BTreeMap<&'static str, &'static str>,
    /// In the order of table1.md.
    pub states: Vec<StateSummary>,
    pub floors: FloorSummary,
    /// Shares of the components of errors that lie within two of the solver's standard deviations;
    /// 0.954 if these were right.
    pub within_two_sigma: BTreeMap<&'static str, Statistic>,
    /// Peak memory of the process, with as many sequences side by side as it has cores.
    pub peak_memory_mb: Option<f64>,
}

#[derive(Serialize)]
pub struct StateSummary {
    pub name: String,
    pub label: String,
    pub n_views: Option<usize>,
    /// Sequences without a result, and those whose solver ended in a fault.
    pub n_failed: usize,
    pub n_faulty: usize,
    pub metrics: Numbers,
    pub seconds: Statistic,
    /// Shares of all sequences, failures among them: mean pose error under 5°, and reference frame
    /// turned round by more than 90°. `None` without a truth.
    pub share_below_5_deg: Option<f64>,
    pub share_turned_round: Option<f64>,
    /// How much of the way from the initial style error to that of the encoded true shape is gone, by
    /// their means.
    pub style_gap_closed: Option<f64>,
    /// Losses over their values at the true poses and the encoded true shape, sequence by sequence.
    pub photometric_over_truth: Statistic,
    pub silhouette_over_truth: Statistic,
}

/// What even a perfect estimate scores.
#[derive(Serialize)]
pub struct FloorSummary {
    /// At the true poses and the encoded true shape.
    pub at_truth: Numbers,
    /// L_ph and L_CD of the true points at the true poses.
    pub true_points: Numbers,
    /// Two samplings of the true surface, told from two halves of one.
    pub sampling: Numbers,
}

impl Summary {
    pub fn new(dataset: String, plan: &Plan, entries: &[Entry], states: &[State]) -> Self {
        let floors: Vec<Option<&Floors>> =
            entries.iter().map(|entry| entry.floors.as_ref().ok()).collect();
        let at_truth: Vec<Option<&Measured>> =
            floors.iter().map(|floors| floors.as_ref()?.at_truth.as_ref()).collect();
        let initial = states.iter().find(|state| state.key == INITIAL).expect("all plans start");
        let solved = entries.iter().flat_map(|entry| entry.results.values().flatten());
        Self {
            dataset,
            n_sequences: entries.len(),
            n_points: plan.context.prior.shape.generator.n_points(),
            units: METRICS.iter().map(|metric| (metric.key, metric.unit)).collect(),
            states: states.iter().map(|state| summary(state, initial, &at_truth)).collect(),
            floors: floor_summary(&floors),
            within_two_sigma: within_two_sigma(entries),
            peak_memory_mb: solved.filter_map(|result| result.peak_memory_mb).reduce(f64::max),
        }
    }

    pub fn state(&self, name: &str) -> Option<&StateSummary> {
        self.states.iter().find(|state| state.name == name)
    }
}

fn summary(state: &State, initial: &State, at_truth: &[Option<&Measured>]) -> StateSummary {
    let share = |key: &str, counts: &dyn Fn(f64) -> bool| {
        let values = state.values(Metric::of(key).value);
        let known = values.iter().any(Option::is_some);
        let n = values.iter().flatten().filter(|&&value| counts(value)).count();
        known.then(|| n as f64 / values.len() as f64)
    };
    let over_truth = |value: fn(&Measured) -> Option<f64>| {
        let values = state.values(value);
        let pairs = values.iter().zip(at_truth);
        Statistic::of(pairs.filter_map(|(found, truth)| Some((*found)? / value((*truth)?)?)))
    };
    StateSummary {
        name: state.key.clone(),
        label: state.label.clone(),
        n_views: state.n_views,
        n_failed: state.n_failed(),
        n_faulty: state.scored.iter().flatten().filter(|scored| scored.faulty).count(),
        metrics: METRICS
            .iter()
            .map(|metric| (metric.key, state.values(metric.value)))
            .map(|(key, values)| (key, Statistic::of(values.into_iter().flatten())))
            .collect(),
        seconds: Statistic::of(state.scored.iter().flatten().filter_map(|scored| scored.seconds)),
        share_below_5_deg: share("rotation_error_deg_mean", &|error| error < SOLVED),
        share_turned_round: share("reference_rotation_error_deg", &|error| error > TURNED_ROUND),
        style_gap_closed: style_gap_closed(state, initial, at_truth),
        photometric_over_truth: over_truth(|measured| measured.photometric_loss),
        silhouette_over_truth: over_truth(|measured| measured.silhouette_loss),
    }
}

fn style_gap_closed(state: &State, initial: &State, at_truth: &[Option<&Measured>]) -> Option<f64> {
    let value = Metric::of("style_error").value;
    let (found, initial) = (state.values(value), initial.values(value));
    let all: Vec<[f64; 3]> = (0..found.len())
        .filter_map(|idx| Some([initial[idx]?, found[idx]?, value(at_truth[idx]?)?]))
        .collect();
    let mean = |which: usize| mean(&all.iter().map(|errors| errors[which]).collect::<Vec<_>>());
    let [initial, found, encoded] = [mean(0)?, mean(1)?, mean(2)?];
    Some((initial - found) / (initial - encoded)).filter(|share| share.is_finite())
}

fn floor_summary(floors: &[Option<&Floors>]) -> FloorSummary {
    let floors = || floors.iter().flatten();
    let sampling: Vec<Measured> = floors()
        .filter_map(|floors| floors.sampling.clone())
        .map(|cloud: CloudErrors| Measured { cloud: Some(cloud), ..Measured::default() })
        .collect();
    FloorSummary {
        at_truth: numbers(floors().filter_map(|floors| floors.at_truth.as_ref())),
        true_points: numbers(floors().filter_map(|floors| floors.true_points.as_ref())),
        sampling: numbers(sampling.iter()),
    }
}

fn numbers<'a>(measured: impl Iterator<Item = &'a Measured>) -> Numbers {
    let measured: Vec<&Measured> = measured.collect();
    let of = |metric: &Metric| Statistic::of(measured.iter().filter_map(|m| (metric.value)(m)));
    METRICS.iter().map(|metric| (metric.key, of(metric))).filter(|(_, of)| of.n > 0).collect()
}

/// As the reports of the chosen solver tell it.
fn within_two_sigma(entries: &[Entry]) -> BTreeMap<&'static str, Statistic> {
    let reports = || {
        let of = |entry: &Entry| entry.results.get("solver")?.as_ref().ok()?.report.clone();
        entries.iter().filter_map(of)
    };
    let share = |name: &'static str| {
        let shares =
            reports().filter_map(|report| report["uncertainty"]["within_two_sigma"][name].as_f64());
        (name, Statistic::of(shares))
    };
    ["rotation", "translation", "relative_rotation"].map(share).into_iter().collect()
}
