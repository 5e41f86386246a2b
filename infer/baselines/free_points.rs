//! Classical photometric bundle adjustment: points that move on their own (Fig. 7).

use burn::tensor::Device;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, Outcome, Solver, bundle_adjust,
        shape_model::{FreePoints, ShapeModel},
    },
    data::sequence::Sequence,
};

use crate::ablate::freed;

/// Poses and points from where the prior's clouds start, under the objective of `config`, by Adam: it
/// is the joint solver that suits so many unknowns. Panics without a hypothesis.
pub fn free_points(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    hypotheses: &[Hypothesis],
    config: &BundleAdjustmentConfig,
    device: &Device,
) -> Outcome {
    let (hypotheses, mut config) = freed(shape, hypotheses, config, device);
    config.solver = Solver::Adam;
    bundle_adjust(sequence, &FreePoints, &hypotheses, &config, device, &mut |_, _| {})
}
