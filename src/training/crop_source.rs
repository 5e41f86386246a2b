//! Where the training crops come from.

use super::{
    TrainingConfig,
    crops::{Crop, crops_of_models, render_model},
    shapes::Shapes,
};
use crate::Result;

/// Makes training crops. Each follows from (seed, model, view).
pub(super) struct CropSource<'a> {
    config: &'a TrainingConfig,
    shapes: &'a Shapes,
}

impl<'a> CropSource<'a> {
    pub fn open(config: &'a TrainingConfig, shapes: &'a Shapes) -> Result<Self> {
        Ok(Self { config, shapes })
    }

    /// These views, in ascending order, of all models, which `go_on` is asked for one by one: once it
    /// says no, the rest is left out.
    pub fn crops(&self, views: &[usize], go_on: impl Fn() -> bool + Sync) -> Result<Vec<Crop>> {
        let models = self.shapes.training();
        let render = |model_idx| render_model(self.config, self.shapes, model_idx, views);
        crops_of_models(&models, render, go_on)
    }
}
