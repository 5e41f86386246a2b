//! Estimates that no photometric bundle adjustment with a prior makes, to compare it with.

mod free_points;
mod per_frame;
mod retrieval;

pub use free_points::free_points;
pub use per_frame::per_frame;
pub use retrieval::{Neighbours, nearest_training_shape};

use anyhow::{Context, Result};
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Hypothesis},
    checkpoint::Prior,
    data::sequence::Sequence,
    initial_guess::InitialGuess,
};

use crate::run::NO_REFERENCE_MASK;

/// Where bundle adjustment would start, the likeliest first; never none.
pub fn hypotheses(
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
) -> Result<Vec<Hypothesis>> {
    let hypotheses = InitialGuess::hypotheses(prior, sequence, config);
    let some = (!hypotheses.is_empty()).then_some(hypotheses);
    some.with_context(|| format!("{}: {NO_REFERENCE_MASK}", sequence.name))
}
