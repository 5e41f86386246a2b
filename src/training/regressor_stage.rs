//! The second stage: from pictures to the styles of the first stage, and to poses.

use std::{path::Path, thread};

use burn::{
    module::Module,
    tensor::{Device, Tensor},
};
use rayon::prelude::*;

use super::{
    TrainingConfig,
    batches::row_tensor,
    crops::Crop,
    held_out::HeldOut,
    prefetch::Batches,
    rounds::Rounds,
    seeded,
    shapes::Shapes,
    stage::{Stage, Terms},
    styles::Styles,
};
use crate::{
    Result,
    checkpoint::load_regressors,
    data::keyed_rng,
    regressor::{PoseTarget, Regressors},
    shape_prior::ShapePrior,
};

const NAME: &str = "regressors";
/// The random stream of this stage's batches: the first half of its key.
const BATCH: u64 = 31 << 32;

pub(super) struct RegressorStage<'a> {
    config: &'a TrainingConfig,
    stage: Stage<'a>,
    device: &'a Device,
    prior: &'a ShapePrior,
    rounds: Rounds<'a>,
    /// Of the training shapes.
    styles: Styles,
    held_out: HeldOut<'a>,
}

impl<'a> RegressorStage<'a> {
    pub fn prepare(
        config: &'a TrainingConfig,
        shapes: &'a Shapes,
        prior: &'a ShapePrior,
        out: &'a Path,
        device: &'a Device,
    ) -> Result<Self> {
        let rounds = Rounds::open(config, shapes)?;
        let n_seen = config.prior.network.n_encoder_points;
        let surfaces = shapes.surfaces(&shapes.training(), n_seen)?;
        Ok(Self {
            rounds,
            styles: Styles::encode(prior, &surfaces, device),
            held_out: HeldOut::prepare(config, shapes, prior, device)?,
            stage: Stage { name: NAME, schedule: &config.regressors.schedule, out },
            config,
            device,
            prior,
        })
    }

    pub fn train(&self) -> Result<Regressors> {
        let autodiff = self.device.clone().autodiff();
        let init = || self.config.regressors.network.init(self.prior.n_style(), &autodiff);
        let regressors = seeded(self.device, self.config.seed + 1, init);
        let deviations =
            Tensor::from_data(self.prior.generator.deviations().into_data(), &autodiff);
        let progress = self.stage.resume(regressors)?;
        thread::scope(|scope| {
            let steps = progress.step..self.stage.schedule.steps;
            let mut batches = Batches::start(&self.rounds, steps, scope)?;
            let loss = |regressors: &Regressors, step| {
                let crops = batches.batch(step)?;
                Ok(self.loss(regressors, step, &crops, deviations.clone(), &autodiff))
            };
            self.stage
                .train(progress, loss, |regressors| self.held_out.measure(&regressors.valid()))
        })
    }

    /// Measures what was saved, and ends the stage.
    pub fn finish(&self, path: &Path) -> Result<()> {
        let saved = load_regressors(self.config, self.prior.n_style(), path, self.device)?;
        let mut measurements = self.held_out.measure(&saved);
        measurements.extend(self.held_out.measure_clouds(&saved));
        self.stage.finish(&measurements)
    }

    fn loss(
        &self,
        regressors: &Regressors,
        step: usize,
        crops: &[&Crop],
        deviations: Tensor<1>,
        device: &Device,
    ) -> Terms {
        let (values, truths): (Vec<_>, Vec<_>) = crops
            .par_iter()
            .enumerate()
            .map(|(i, crop)| {
                let mut rng = keyed_rng(self.config.seed, [BATCH + i as u64, step as u64]);
                crop.augmented(self.config, &mut rng)
            })
            .unzip();
        let (styles, poses) = regress(regressors, &values, &truths, device);
        let style_targets = self.styles.of(&truths, device);
        let pose_targets: Vec<_> = truths
            .iter()
            .map(|crop| PoseTarget::new(&crop.crop_from_world, crop.focal_ratio))
            .collect();
        vec![
            ("pose", regressors.pose.loss(poses, &pose_targets)),
            ("style", regressors.style.loss(styles, style_targets, deviations)),
        ]
    }
}

/// Styles and poses of these crops, of which the network sees `values`.
pub(super) fn regress(
    regressors: &Regressors,
    values: &[Vec<f32>],
    crops: &[Crop],
    device: &Device,
) -> (Tensor<2>, Tensor<2>) {
    let size = regressors.crop_size();
    let values = row_tensor(values, device).reshape([crops.len(), size, size, 4]);
    let focal_ratios: Vec<_> = crops.iter().map(|crop| vec![crop.focal_ratio]).collect();
    regressors.forward(values, row_tensor(&focal_ratios, device))
}
