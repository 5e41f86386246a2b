//! Where the training crops come from: the renderer, or shards that it once wrote.

use super::{
    TrainingConfig,
    crop_sample::crop_of_sample,
    crops::{Crop, crops_of_models, render_model},
    shapes::Shapes,
    shards::fingerprint,
};
use crate::{Result, data::formats::webdataset::ShardReader};

/// Makes training crops. Each follows from (seed, model, view), whichever source it comes from.
pub(super) struct CropSource<'a> {
    config: &'a TrainingConfig,
    shapes: &'a Shapes,
    /// Without them, crops are rendered.
    shards: Option<ShardReader>,
}

impl<'a> CropSource<'a> {
    /// The source that the config names; shards of any other crops are refused.
    pub fn open(config: &'a TrainingConfig, shapes: &'a Shapes) -> Result<Self> {
        let n_models = shapes.training().len();
        let (dataset, total) =
            (fingerprint(config, n_models), n_models * config.data.views_per_model);
        let shards = config.data.shards.as_deref();
        let shards = shards.map(|path| ShardReader::open(path, &dataset, total)).transpose()?;
        Ok(Self { config, shapes, shards })
    }

    /// These views, in ascending order, of all models, which `go_on` is asked for one by one: once it
    /// says no, the rest is left out.
    pub fn crops(&self, views: &[usize], go_on: impl Fn() -> bool + Sync) -> Result<Vec<Crop>> {
        let models = self.shapes.training();
        let crops_of_model = |model_idx: usize| match &self.shards {
            None => render_model(self.config, self.shapes, model_idx, views),
            Some(shards) => views
                .iter()
                .map(|view| {
                    let sample_idx = model_idx * self.config.data.views_per_model + view;
                    Ok(crop_of_sample(&shards.read(sample_idx)?))
                })
                .collect(),
        };
        crops_of_models(&models, crops_of_model, go_on)
    }
}
