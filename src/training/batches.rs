//! Host numbers to tensors.

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

/// Clouds of one size as `[b, n, 3]`.
pub(super) fn cloud_tensor(clouds: &[Vec<[f32; 3]>], device: &Device) -> Tensor<3> {
    let shape = [clouds.len(), clouds[0].len(), 3];
    Tensor::from_data(TensorData::new(clouds.concat().into_flattened(), shape), device)
}

/// Rows of one length as `[b, n]`.
pub(super) fn row_tensor(rows: &[Vec<f32>], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(rows.concat(), [rows.len(), rows[0].len()]), device)
}

/// A standard normal number, by Box and Muller.
pub(super) fn normal(rng: &mut impl Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
    radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
}
