//! How far regressed poses are off.

use nalgebra::Isometry3;

use super::stage::Measurements;
use crate::metrics::rotation_error;

/// Rotation errors over pictures, in degrees.
#[derive(Default)]
pub(super) struct PoseErrors {
    likeliest: Vec<f64>,
    /// Of the better one of the two likeliest hypotheses.
    best_of_two: Vec<f64>,
}

impl PoseErrors {
    /// Judges one picture's hypotheses, best first.
    pub fn push(&mut self, hypotheses: &[(Isometry3<f32>, f32)], truth: &Isometry3<f32>) {
        let error = |(pose, _): &(Isometry3<f32>, f32)| rotation_error(pose, truth).to_degrees();
        let errors: Vec<f64> = hypotheses.iter().take(2).map(error).collect();
        self.likeliest.push(errors[0]);
        self.best_of_two.push(errors.into_iter().fold(f64::MAX, f64::min));
    }

    pub fn measurements(mut self) -> Measurements {
        let n = self.likeliest.len();
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / n as f64;
        self.likeliest.sort_by(f64::total_cmp);
        let flipped =
            |errors: &[f64]| errors.iter().filter(|&&error| error > 90.0).count() as f64 / n as f64;
        vec![
            ("mean_degrees", mean(&self.likeliest)),
            ("median_degrees", self.likeliest[n / 2]),
            ("share_over_90_degrees", flipped(&self.likeliest)),
            ("mean_degrees_best_of_two", mean(&self.best_of_two)),
            ("share_over_90_degrees_best_of_two", flipped(&self.best_of_two)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn a_flip_costs_the_likeliest_pose_and_not_the_better_of_two() {
        let turned = |degrees: f32| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
            (Isometry3::from_parts(Vector3::z().into(), turn), 0.5)
        };
        let mut errors = PoseErrors::default();
        errors.push(&[turned(180.0), turned(10.0), turned(0.0)], &turned(0.0).0);
        let values: Vec<f64> = errors.measurements().iter().map(|(_, value)| *value).collect();
        let close = |(a, b): (&f64, f64)| (a - b).abs() < 1e-3;
        assert!(values.iter().zip([180.0, 180.0, 1.0, 10.0, 0.0]).all(close), "{values:?}");
    }
}
