//! How far an estimate is from the truth (Eq. 7, Fig. 3).

mod alignment;
mod clouds;
mod poses;
mod sampling_noise;

pub use clouds::{CloudErrors, F_SCORE_DISTANCE, style_error};
pub use poses::{PoseErrors, rotation_error};
pub use sampling_noise::SamplingNoise;

/// The mean; NaN of nothing.
fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
    sum / f64::from(count)
}

/// The middle value, or the mean of the two in the middle; NaN of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}
