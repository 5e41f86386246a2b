//! A study as CSV: its summary, and each sequence of each arm.

use anyhow::Result;

use super::{
    results::{METRICS, Results, State, failures},
    store::Entry,
};

impl Results<'_> {
    /// A line for each arm, metric and state.
    pub fn csv(&self) -> Result<String> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        let head = ["study", "arm", "sequences", "failed", "metric", "state"];
        csv.write_record(head.into_iter().chain(["first_quartile", "median", "third_quartile"]))?;
        for (idx, arm) in self.comparison.arms.iter().enumerate() {
            let entries = &self.entries[idx];
            let [n, failed] = [entries.len(), failures(entries)].map(|n| n.to_string());
            let states: [(&str, State); 2] =
                [("start", |outcome| &outcome.start), ("end", |outcome| &outcome.end)];
            for (metric, (state, of)) in METRICS.iter().flat_map(|m| states.map(|s| (m, s))) {
                let values = self.quartiles(idx, metric, of).map(|values| values.map(exact));
                let values = values.unwrap_or_default();
                let head = [&self.study.name(), &arm.name, &n, &failed, metric.name, state];
                csv.write_record(head.into_iter().chain(values.iter().map(String::as_str)))?;
            }
        }
        Ok(String::from_utf8(csv.into_inner()?)?)
    }

    /// A line for each arm and sequence.
    pub fn sequences_csv(&self) -> Result<String> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        let mut head: Vec<String> =
            ["study", "arm", "sequence", "status", "failure", "iterations", "seconds"]
                .map(String::from)
                .into();
        head.extend(
            METRICS.iter().flat_map(|metric| {
                ["start", "end"].map(|state| format!("{}, {state}", metric.name))
            }),
        );
        csv.write_record(head)?;
        for (arm, entries) in self.comparison.arms.iter().zip(self.entries) {
            for entry in entries {
                csv.write_record(self.record(&arm.name, entry))?;
            }
        }
        Ok(String::from_utf8(csv.into_inner()?)?)
    }

    fn record(&self, arm: &str, entry: &Entry) -> Vec<String> {
        let of = |value: fn(&super::arm::Outcome) -> String| {
            entry.outcome.as_ref().map_or("".into(), value)
        };
        let mut record = vec![
            self.study.name(),
            arm.into(),
            entry.sequence.clone(),
            of(|outcome| outcome.status.clone()),
            entry.failure.clone().unwrap_or_default(),
            of(|outcome| outcome.iterations.to_string()),
            of(|outcome| exact(outcome.seconds)),
        ];
        record.extend(METRICS.iter().flat_map(|metric| {
            let states = entry.outcome.as_ref().map(|outcome| [&outcome.start, &outcome.end]);
            let value = |scores| (metric.value)(scores).map_or(String::new(), exact);
            states.map_or_else(Default::default, |states| states.map(value))
        }));
        record
    }
}

fn exact(value: f64) -> String {
    value.to_string()
}
