//! Classical photometric bundle adjustment: points that move on their own (Fig. 7).

use burn::tensor::Device;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, Outcome, Solver, bundle_adjust,
        shape_model::{FreePoints, ShapeModel},
    },
    data::sequence::Sequence,
    host::host_points,
    reconstruction::points,
};

/// Step size of a free point in world units, a tenth of the spacing of 6,144 points on a car.
const POINT_RATE: f64 = 2e-3;

/// Poses and points from where the prior's cloud starts, under the objective of `config`, by Adam: it
/// is the joint solver that suits so many unknowns. Panics without a hypothesis.
pub fn free_points(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    hypotheses: &[Hypothesis],
    config: &BundleAdjustmentConfig,
    device: &Device,
) -> Outcome {
    let cloud = host_points(&points(shape, &hypotheses[0].unknowns, device));
    let free = |start: &Hypothesis| Hypothesis {
        unknowns: start.unknowns.with_style(cloud.as_flattened()),
        confidence: start.confidence,
    };
    let hypotheses: Vec<Hypothesis> = hypotheses.iter().map(free).collect();
    let mut config = config.clone();
    config.solver = Solver::Adam;
    config.objective.style_weight = 0.0;
    config.adam.style_rate = POINT_RATE;
    bundle_adjust(sequence, &FreePoints, &hypotheses, &config, device, &mut |_, _| {})
}
