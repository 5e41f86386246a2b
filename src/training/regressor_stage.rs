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
    stage::{SCALE, Stage, Terms},
    styles::Styles,
};
use crate::{
    Result,
    checkpoint::load_regressors,
    data::keyed_rng,
    regressor::Regressors,
    shape_prior::{Generator, ShapePrior},
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
        let generator = self.prior.generator.clone().fork(&autodiff).freeze();
        let target = StyleTarget { deviations, generator };
        let progress = self.stage.resume(regressors)?;
        thread::scope(|scope| {
            let steps = progress.step..self.stage.schedule.steps;
            let mut batches = Batches::start(&self.rounds, steps, scope)?;
            let loss = |regressors: &Regressors, step| {
                let crops = batches.batch(step)?;
                Ok(self.loss(regressors, step, &crops, &target, &autodiff))
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
        target: &StyleTarget,
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
        let pose_targets: Vec<_> = truths.iter().map(Crop::pose_target).collect();
        let n_decoded = self.config.regressors.decoded_shapes.min(truths.len());
        let mut terms = vec![("pose", regressors.pose.loss(poses, &pose_targets))];
        if n_decoded > 0 {
            terms.push(("shape", target.shape_distance(&styles, &style_targets, n_decoded)));
        }
        let style_loss = regressors.style.loss(styles, style_targets, target.deviations.clone());
        terms.push(("style", style_loss));
        terms
    }
}

/// What regressed styles are held against, besides the encoder's.
struct StyleTarget {
    /// Of the latent along each style direction, `[k]`.
    deviations: Tensor<1>,
    generator: Generator,
}

impl StyleTarget {
    /// Mean squared distance between the points that the first `n` of two batches of styles decode
    /// to, in thousandths of squared world units. Points of one generator correspond: no neighbours
    /// are needed.
    fn shape_distance(&self, styles: &Tensor<2>, targets: &Tensor<2>, n: usize) -> Tensor<1> {
        let decode = |styles: &Tensor<2>| self.generator.forward(styles.clone().slice(0..n));
        let offsets = decode(styles) - decode(targets).detach();
        offsets.square().sum_dim(2).mean() * SCALE
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
