//! What results depend on, as short texts.

use burn::{
    module::{Module, ModuleVisitor, Param},
    tensor::Tensor,
};
use object_pba::{checkpoint::Prior, data::sequence::Sequence, host::host_values};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Of all weights of a prior, and of how they are used.
pub fn of_prior(prior: &Prior) -> String {
    let mut weights = Weights(Sha256::new());
    prior.shape.visit(&mut weights);
    prior.regressors.visit(&mut weights);
    weights.0.update(text(&(&prior.config.prior.network, &prior.config.regressors.network)));
    hex(weights.0)
}

/// Of a sequence's pictures, cameras and truth; not of its name.
pub fn of_sequence(sequence: &Sequence) -> String {
    let mut hasher = Sha256::new();
    for frame in &sequence.frames {
        update(&mut hasher, frame.color.as_raw());
        update(&mut hasher, frame.mask.as_raw());
    }
    update(&mut hasher, &sequence.intrinsics.focal);
    update(&mut hasher, &sequence.intrinsics.center);
    hasher.update(text(&sequence.size));
    if let Some(truth) = &sequence.truth {
        let points = truth.points.as_deref().unwrap_or_default();
        update(
            &mut hasher,
            &points.iter().flat_map(|point| point.coords.data.0[0]).collect::<Vec<_>>(),
        );
        hasher.update(text(&(truth.canonical, &truth.camera_from_world)));
    }
    hex(hasher)
}

/// Of anything that can be written down.
pub fn of(value: &impl Serialize) -> String {
    hex(Sha256::new_with_prefix(text(value)))
}

struct Weights(Sha256);

impl ModuleVisitor for Weights {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        update(&mut self.0, &host_values(&param.val()));
    }
}

fn update(hasher: &mut Sha256, values: &[f32]) {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    hasher.update(bytes);
}

fn text(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plain data")
}

fn hex(hasher: Sha256) -> String {
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
