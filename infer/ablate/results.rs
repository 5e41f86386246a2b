//! What a study came to, as numbers: medians and quartiles over sequences.

use object_pba::reconstruction::Scores;

use super::{
    arm::Outcome,
    store::Entry,
    studies::{Comparison, Study},
};

/// One figure of a state.
pub struct Metric {
    /// With its unit.
    pub name: &'static str,
    pub value: fn(&Scores) -> Option<f64>,
    /// Whether tables tell where it started.
    pub tells_start: bool,
}

/// What arms are compared by, the first ones in figures, too.
pub const METRICS: [Metric; 7] = [
    metric("pose error (deg)", |s| s.poses.rotation_error_deg_mean, true),
    metric("relative rotation error (deg)", |s| s.poses.relative_rotation_error_deg_mean, false),
    metric("style error, Eq. 7 (1e-3)", |s| s.style_error.map(|error| 1e3 * error), true),
    metric("reference rotation error (deg)", |s| s.poses.reference_rotation_error_deg, false),
    metric("translation error (diagonals)", |s| s.poses.translation_error_mean, false),
    metric("L_ph, Eq. 3", |s| Some(s.photometric_loss), false),
    metric("L_CD, Eq. 5 (px²)", |s| Some(s.silhouette_loss), false),
];

const fn metric(
    name: &'static str,
    value: fn(&Scores) -> Option<f64>,
    tells_start: bool,
) -> Metric {
    Metric { name, value, tells_start }
}

/// What a study came to: for each arm, an entry for each sequence.
pub struct Results<'a> {
    pub study: Study,
    pub comparison: &'a Comparison,
    pub entries: &'a [Vec<Entry>],
}

/// Reads one of the two states of an outcome.
pub type State = fn(&Outcome) -> &Scores;

impl Results<'_> {
    /// First quartile, median and third quartile of an arm's metric at its start or end; `None` where
    /// no sequence has it.
    pub fn quartiles(&self, arm: usize, metric: &Metric, state: State) -> Option<[f64; 3]> {
        quartiles(outcomes(&self.entries[arm]).filter_map(|o| (metric.value)(state(o))).collect())
    }
}

pub fn outcomes(entries: &[Entry]) -> impl Iterator<Item = &Outcome> {
    entries.iter().filter_map(|entry| entry.outcome.as_ref())
}

/// Sequences without an estimate, or with one that its solver says is not to be used.
pub fn failures(entries: &[Entry]) -> usize {
    entries
        .iter()
        .filter(|entry| entry.outcome.as_ref().is_none_or(|outcome| outcome.fault))
        .count()
}

/// First quartile, median and third quartile; between two values, in proportion.
pub fn quartiles(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some([0.25, 0.5, 0.75].map(|share| {
        let place = share * last as f64;
        let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
        below + place.fract() * (above - below)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_lie_between_values_in_proportion() {
        assert_eq!(quartiles(vec![]), None);
        assert_eq!(quartiles(vec![7.0]), Some([7.0; 3]));
        assert_eq!(quartiles(vec![5.0, 1.0, 2.0, 4.0, 3.0]), Some([2.0, 3.0, 4.0]));
        // As numpy.percentile has them.
        assert_eq!(quartiles(vec![4.0, 1.0, 3.0, 2.0]), Some([1.75, 2.5, 3.25]));
    }
}
