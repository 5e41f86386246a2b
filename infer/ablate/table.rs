//! A study as a table, in Markdown.

use super::{
    arm::Arm,
    results::{METRICS, Metric, Results, failures, outcomes, quartiles},
    store::Entry,
};
use crate::output::significant;

/// Pose error, in degrees, below which a sequence counts as solved.
const SOLVED: f64 = 5.0;

impl Results<'_> {
    pub fn markdown(&self) -> String {
        let arms = &self.comparison.arms;
        let names = METRICS.iter().map(|metric| metric.name);
        let headings: Vec<&str> =
            [self.comparison.axis, "failed"].into_iter().chain(names).collect();
        let mut text = format!(
            "## {}\n\n{} sequences, N = {}; medians [quartiles]; Eq. 3, 5 and 7 at {} points\n\n",
            self.comparison.title,
            self.entries[0].len(),
            points(arms),
            arms[0].n_judged_points
        );
        text += &format!("| {} | under {SOLVED}° | seconds |\n", headings.join(" | "));
        text += &format!("|{}\n", " --- |".repeat(headings.len() + 2));
        for (idx, arm) in arms.iter().enumerate() {
            let cells: Vec<_> = METRICS.iter().map(|metric| self.cell(idx, metric)).collect();
            let (n, entries) = (self.entries[idx].len(), &self.entries[idx]);
            let solved = entries.iter().filter(|entry| is_solved(entry)).count();
            let seconds = quartiles(outcomes(entries).map(|outcome| outcome.seconds).collect());
            text += &format!(
                "| {} | {} | {} | {solved} of {n} | {} |\n",
                arm.name,
                failures(entries),
                cells.join(" | "),
                seconds.map_or("–".into(), |[_, median, _]| figure(median))
            );
        }
        for (arm, entry) in arms
            .iter()
            .zip(self.entries)
            .flat_map(|(arm, entries)| entries.iter().map(move |entry| (arm, entry)))
        {
            if let Some(failure) = &entry.failure {
                text += &format!("\nfailed: {}, {}: {failure}\n", arm.name, entry.sequence);
            }
        }
        text
    }

    /// "start → end [quartiles]".
    fn cell(&self, arm: usize, metric: &Metric) -> String {
        let start = self.quartiles(arm, metric, |outcome| &outcome.start);
        let end = self.quartiles(arm, metric, |outcome| &outcome.end);
        let Some([low, median, high]) = end.map(|end| end.map(figure)) else {
            return "–".into();
        };
        match start.filter(|_| metric.tells_start) {
            Some([_, start, _]) => {
                format!("{} → {median} [{low}, {high}]", figure(start))
            }
            None => format!("{median} [{low}, {high}]"),
        }
    }
}

fn is_solved(entry: &Entry) -> bool {
    let error = entry.outcome.as_ref().and_then(|o| o.end.poses.rotation_error_deg_mean);
    error.is_some_and(|error| error < SOLVED)
}

/// The N of all arms, or each one's.
fn points(arms: &[Arm]) -> String {
    let mut numbers: Vec<_> = arms.iter().map(|arm| arm.n_points.to_string()).collect();
    numbers.dedup();
    numbers.join(", ")
}

fn figure(value: f64) -> String {
    if value == 0.0 { "0".into() } else { significant(value) }
}
