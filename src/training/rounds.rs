//! Rounds of training crops: a few views of every shape at a time.

use rand::seq::SliceRandom;

use super::{TrainingConfig, crop_source::CropSource, crops::Crop, shapes::Shapes};
use crate::{Result, data::keyed_rng};

/// The random stream of a round's order: the first half of its key.
const ORDER: u64 = 32 << 32;

/// The order in which training crops are shown, which follows from the config alone.
///
/// A round shows some views of every shape, each once and shuffled. It ends with its last whole batch;
/// one that is smaller than a batch is a single step, which shows it more than once.
pub(super) struct Rounds<'a> {
    config: &'a TrainingConfig,
    source: CropSource<'a>,
    n_paints: usize,
    pub n_models: usize,
    pub batch_size: usize,
}

impl<'a> Rounds<'a> {
    pub fn open(config: &'a TrainingConfig, shapes: &'a Shapes) -> Result<Self> {
        Ok(Self {
            config,
            source: CropSource::open(config, shapes)?,
            n_paints: shapes.n_paints(),
            n_models: shapes.training().len(),
            batch_size: config.regressors.schedule.batch_size,
        })
    }

    pub fn steps_per_round(&self) -> usize {
        (self.n_models * self.n_shown() / self.batch_size).max(1)
    }

    /// A round's crops, shuffled. `go_on` is asked before each shape; once it says no, the rest is
    /// left out.
    pub fn crops(&self, round: usize, go_on: impl Fn() -> bool + Sync) -> Result<Vec<Crop>> {
        let mut crops = self.source.crops(&self.views(round), go_on)?;
        crops.shuffle(&mut keyed_rng(self.config.seed, [ORDER, round as u64]));
        Ok(crops)
    }

    /// The views in a round: each comes once before any comes again.
    ///
    /// They come paint by paint: a mesh takes longer to make than a view of it.
    fn views(&self, round: usize) -> Vec<usize> {
        let (n_views, n_shown) = (self.config.data.views_per_model, self.n_shown());
        let mut by_paint: Vec<_> = (0..n_views).collect();
        by_paint.sort_by_key(|view| (view % self.n_paints, *view));
        let shown = (0..n_shown).map(|i| by_paint[(round * n_shown + i) % n_views]);
        let mut views: Vec<_> = shown.collect();
        views.sort();
        views
    }

    /// Views of each shape in a round.
    fn n_shown(&self) -> usize {
        self.config.data.views_per_round.min(self.config.data.views_per_model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn config(views_per_model: usize, views_per_round: usize) -> TrainingConfig {
        let mut config = TrainingConfig::default();
        config.data.n_models = 3;
        config.data.paints_per_model = 2;
        (config.data.views_per_model, config.data.views_per_round) =
            (views_per_model, views_per_round);
        config.regressors.schedule.batch_size = 4;
        config.regressors.network.crop_size = 16;
        config
    }

    #[test]
    fn every_view_comes_once_before_any_comes_again() {
        let config = config(5, 2);
        let shapes = Shapes::open(&config.data, 0).expect("cars need no files");
        let rounds = Rounds::open(&config, &shapes).expect("cars need no files");
        let views: Vec<_> = (0..6).map(|round| rounds.views(round)).collect();
        // Views 0, 2 and 4 are of one paint, and come first.
        assert_eq!(views, [[0, 2], [1, 4], [0, 3], [2, 4], [1, 3], [0, 2]]);
        // Of six crops, one whole batch.
        assert_eq!(rounds.steps_per_round(), 1);
    }

    #[test]
    fn a_round_shows_each_crop_once_in_an_order_of_its_own() {
        // There are not as many views as a round has.
        let config = config(2, 3);
        let shapes = Shapes::open(&config.data, 0).expect("cars need no files");
        let rounds = Rounds::open(&config, &shapes).expect("cars need no files");
        let order = |round| -> Vec<_> {
            let crops = rounds.crops(round, || true).expect("cars need no files");
            crops.iter().map(|crop| (crop.shape_idx, crop.view)).collect()
        };
        let (first, second) = (order(0), order(1));
        assert_eq!(first.len(), 6);
        let set = |order: &[_]| BTreeSet::from_iter(order.to_vec());
        assert_eq!((set(&first).len(), set(&first)), (6, set(&second)));
        assert!(first != second && first == order(0));
    }
}
