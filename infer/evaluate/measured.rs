//! How good one state of one sequence is, and which numbers are read off it.

use object_pba::{
    metrics::{CloudErrors, PoseErrors},
    reconstruction::Scores,
};
use serde::{Deserialize, Serialize};

use crate::output::significant;

/// Printed numbers below this are rounding errors.
const NEARLY_ZERO: f64 = 5e-5;

/// Everything that a state is judged by; `None` where the truth, or the method, does not tell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Measured {
    pub poses: PoseErrors,
    pub cloud: Option<CloudErrors>,
    /// Eq. 3 as printed.
    pub photometric_loss: Option<f64>,
    /// Eq. 5 as printed, in pixels².
    pub silhouette_loss: Option<f64>,
}

impl From<Scores> for Measured {
    fn from(scores: Scores) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            poses: scores.poses,
            cloud: scores.cloud,
            photometric_loss: finite(scores.photometric_loss),
            silhouette_loss: finite(scores.silhouette_loss),
        }
    }
}

/// One number of a state: its name in files, what pages call it, its unit in files, and how many times
/// as large the number is that pages print.
pub struct Metric {
    pub key: &'static str,
    pub label: &'static str,
    pub unit: &'static str,
    factor: f64,
    pub value: fn(&Measured) -> Option<f64>,
}

const fn error(
    key: &'static str,
    label: &'static str,
    unit: &'static str,
    factor: f64,
    value: fn(&Measured) -> Option<f64>,
) -> Metric {
    Metric { key, label, unit, factor, value }
}

const fn share(
    key: &'static str,
    label: &'static str,
    value: fn(&Measured) -> Option<f64>,
) -> Metric {
    Metric { key, label, unit: "share, 1 is best", factor: 1.0, value }
}

fn of_cloud(measured: &Measured, value: fn(&CloudErrors) -> f64) -> Option<f64> {
    measured.cloud.as_ref().map(value)
}

/// All numbers, in the order in which tables list them.
#[rustfmt::skip]
pub const METRICS: [Metric; 22] = [
    error("rotation_error_deg_mean", "mean pose error", "deg", 1.0, |m| m.poses.rotation_error_deg_mean),
    error("rotation_error_deg_median", "median pose error over frames", "deg", 1.0, |m| m.poses.rotation_error_deg_median),
    error("reference_rotation_error_deg", "reference rotation error", "deg", 1.0, |m| m.poses.reference_rotation_error_deg),
    error("relative_rotation_error_deg_mean", "relative rotation error", "deg", 1.0, |m| m.poses.relative_rotation_error_deg_mean),
    error("aligned_rotation_error_deg_mean", "aligned rotation error", "deg", 1.0, |m| m.poses.aligned_rotation_error_deg_mean),
    share("rra_5", "RRA@5, pairs of frames", |m| m.poses.rra_5),
    share("rra_15", "RRA@15, pairs of frames", |m| m.poses.rra_15),
    share("rra_30", "RRA@30, pairs of frames", |m| m.poses.rra_30),
    share("rra_auc_30", "RRA, area up to 30°", |m| m.poses.rra_auc_30),
    share("rotation_auc_30", "pose error, area up to 30°", |m| m.poses.rotation_auc_30),
    error("translation_error_mean", "translation error", "diagonals", 1.0, |m| m.poses.translation_error_mean),
    error("scaled_translation_error_mean", "translation error, scale taken out", "diagonals", 1.0, |m| m.poses.scaled_translation_error_mean),
    error("aligned_center_error_mean", "camera centres, aligned", "the truth's unit", 1.0, |m| m.poses.aligned_center_error_mean),
    error("style_error", "style error, Eq. 7", "diagonals²", 1e3, |m| of_cloud(m, CloudErrors::style_error)),
    error("squared_to_truth", "Chamfer, estimate to truth", "diagonals²", 1e3, |m| of_cloud(m, |c| c.squared_to_truth)),
    error("squared_from_truth", "Chamfer, truth to estimate", "diagonals²", 1e3, |m| of_cloud(m, |c| c.squared_from_truth)),
    error("distance_to_truth", "distance, estimate to truth", "diagonals", 1e3, |m| of_cloud(m, |c| c.distance_to_truth)),
    error("distance_from_truth", "distance, truth to estimate", "diagonals", 1e3, |m| of_cloud(m, |c| c.distance_from_truth)),
    error("distance", "distance, both ways added up", "diagonals", 1e3, |m| of_cloud(m, CloudErrors::distance)),
    share("f_score", "F-score at 1 % of the diagonal", |m| of_cloud(m, CloudErrors::f_score)),
    error("photometric_loss", "L_ph, Eq. 3", "squared RGB, summed", 1.0, |m| m.photometric_loss),
    error("silhouette_loss", "L_CD, Eq. 5", "px²", 1.0, |m| m.silhouette_loss),
];

impl Metric {
    /// The metric of a key.
    pub fn of(key: &str) -> &'static Self {
        METRICS.iter().find(|metric| metric.key == key).expect("a metric of this key")
    }

    /// A value as pages print it.
    pub fn cell(&self, value: Option<f64>) -> String {
        value.map_or("–".into(), |value| match value * self.factor {
            value if value.abs() < NEARLY_ZERO => "0".into(),
            value => significant(value),
        })
    }

    /// A value as figures draw it.
    pub fn drawn(&self, value: f64) -> f64 {
        value * self.factor
    }

    /// What it is called, and the unit that pages print it in.
    pub fn heading(&self) -> String {
        let scale = if self.factor == 1.0 { "" } else { "1e-3 " };
        format!("{} ({scale}{})", self.label, self.unit)
    }
}
