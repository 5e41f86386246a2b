//! The training shape that is nearest to the regressed one, instead of a generated shape.

use std::sync::OnceLock;

use anyhow::{Result, anyhow};
use object_pba::{
    checkpoint::Prior,
    data::keyed_rng,
    training::{TrainingConfig, TrainingShapes},
};
use rand::seq::SliceRandom;

/// The shapes that the prior was trained on, made anew when they are first asked for.
#[derive(Default)]
pub struct Neighbours(OnceLock<Result<TrainingShapes, String>>);

impl Neighbours {
    fn shapes(&self, config: &TrainingConfig) -> Result<&TrainingShapes> {
        let open = || TrainingShapes::open(config).map_err(|error| error.to_string());
        let shapes = self.0.get_or_init(open).as_ref();
        shapes.map_err(|error| anyhow!("the training shapes are not at hand: {error}"))
    }
}

/// The nearest to a cloud by Eq. 7, with as many points.
pub fn nearest_training_shape(
    neighbours: &Neighbours,
    prior: &Prior,
    mut cloud: Vec<[f32; 3]>,
) -> Result<Vec<[f32; 3]>> {
    // A generator's points follow its surface, and only some are compared at first.
    cloud.shuffle(&mut keyed_rng(0, [0, 0]));
    Ok(neighbours.shapes(&prior.config)?.nearest(&cloud)?.0)
}
