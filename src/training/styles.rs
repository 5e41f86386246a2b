//! What the style regressor aims at: the encoder's styles.

use burn::tensor::{Device, Tensor};

use super::{
    batches::{cloud_tensor, row_tensor},
    crops::Crop,
    shapes::Surface,
};
use crate::{host::host_values, shape_prior::ShapePrior};

/// Surfaces that are encoded at a time.
const CHUNK: usize = 64;

/// One style a shape.
pub(super) struct Styles(Vec<Vec<f32>>);

impl Styles {
    pub fn encode(prior: &ShapePrior, surfaces: &[Surface], device: &Device) -> Self {
        let mut styles = Vec::with_capacity(surfaces.len());
        for chunk in surfaces.chunks(CHUNK) {
            let clouds: Vec<_> = chunk.iter().map(|Surface(points)| points.clone()).collect();
            let values = host_values(&prior.encode(cloud_tensor(&clouds, device)));
            styles.extend(values.chunks(prior.n_style()).map(<[_]>::to_vec));
        }
        Self(styles)
    }

    /// The styles of what these crops show, `[b, k]`.
    pub fn of(&self, crops: &[Crop], device: &Device) -> Tensor<2> {
        let styles: Vec<_> = crops.iter().map(|crop| self.0[crop.shape_idx].clone()).collect();
        row_tensor(&styles, device)
    }
}
