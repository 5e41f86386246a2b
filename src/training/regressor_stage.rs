//! The second stage: from pictures to the styles of the first stage, and to poses.

use std::{path::Path, thread};

use burn::{
    module::Module,
    tensor::{Device, Tensor},
};
use indicatif::ProgressBar;
use rayon::prelude::*;

use super::{
    TrainingConfig,
    batches::{cloud_tensor, row_tensor},
    crops::{Crop, crops_of_models, render_model},
    pose_errors::PoseErrors,
    prefetch::Batches,
    rounds::Rounds,
    seeded,
    shapes::{Shapes, Surface},
    stage::{Measurements, Stage, Terms},
};
use crate::{
    Result,
    chamfer::chamfer_distance,
    checkpoint::load_regressors,
    data::keyed_rng,
    host::host_values,
    regressor::{PoseTarget, Regressors},
    shape_prior::ShapePrior,
};

const NAME: &str = "regressors";
/// The random stream of this stage's batches: the first half of its key.
const BATCH: u64 = 31 << 32;
/// Crops that are measured at a time.
const CHUNK: usize = 64;

pub(super) struct RegressorStage<'a> {
    config: &'a TrainingConfig,
    stage: Stage<'a>,
    device: &'a Device,
    prior: &'a ShapePrior,
    rounds: Rounds<'a>,
    /// Of the training shapes.
    styles: Styles,
    held_out: Pictures,
    /// Clouds of the held-out shapes.
    truth: Vec<Vec<[f32; 3]>>,
}

/// Crops of shapes, and the shapes' styles.
struct Pictures {
    crops: Vec<Crop>,
    styles: Styles,
}

struct Styles(Vec<Vec<f32>>);

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
        let styles = |models: &[usize]| -> Result<Styles> {
            Ok(encode(prior, &shapes.surfaces(models, n_seen)?, device))
        };
        let held_out = shapes.held_out();
        let truth = shapes.surfaces(&held_out, config.prior.network.n_points())?;
        Ok(Self {
            rounds,
            styles: styles(&shapes.training())?,
            held_out: Pictures {
                crops: render_held_out(config, shapes)?,
                styles: styles(&held_out)?,
            },
            truth: truth.into_iter().map(|Surface(points)| points).collect(),
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
            self.stage.train(progress, loss, |regressors| self.measure(&regressors.valid()))
        })
    }

    /// Measures what was saved, and ends the stage.
    pub fn finish(&self, path: &Path) -> Result<()> {
        let saved = load_regressors(self.config, self.prior.n_style(), path, self.device)?;
        let mut measurements = self.measure(&saved);
        measurements.extend(self.measure_clouds(&saved));
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
        let (styles, poses) = self.forward(regressors, &values, &truths, device);
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

    /// Errors on the held-out pictures.
    fn measure(&self, regressors: &Regressors) -> Measurements {
        let deviations = self.prior.generator.deviations();
        let (mut style_loss, mut pose_errors) = (0.0, PoseErrors::default());
        for crops in self.held_out.crops.chunks(CHUNK) {
            let values: Vec<_> = crops.iter().map(Crop::values).collect();
            let (styles, poses) = self.forward(regressors, &values, crops, self.device);
            let targets = self.held_out.styles.of(crops, self.device);
            let loss = regressors.style.loss(styles, targets, deviations.clone());
            let share = crops.len() as f64 / self.held_out.crops.len() as f64;
            style_loss += share * f64::from(host_values(&loss)[0]);

            let [_, n_outputs] = poses.dims();
            for (crop, outputs) in crops.iter().zip(host_values(&poses).chunks(n_outputs)) {
                let hypotheses = regressors.pose.hypotheses(outputs, crop.focal_ratio);
                pose_errors.push(&hypotheses, &crop.crop_from_world);
            }
        }
        let mut measurements = pose_errors.measurements();
        measurements.push(("style_loss", style_loss));
        measurements
    }

    /// Eq. 7 of the clouds that the regressed styles stand for, and of what the encoder knows.
    fn measure_clouds(&self, regressors: &Regressors) -> Measurements {
        let n_views = self.held_out.crops.len() / self.truth.len();
        let crops = self.held_out.crops.chunks(n_views).map(|crops| &crops[0]);
        let chamfer = |style: Tensor<2>, truth: &Vec<[f32; 3]>| {
            let truth = cloud_tensor(std::slice::from_ref(truth), self.device);
            let distance = chamfer_distance(self.prior.generator.forward(style), truth);
            f64::from(host_values(&distance)[0]) * 1e3 / self.truth.len() as f64
        };
        let (mut regressed, mut encoded) = (0.0, 0.0);
        for (crop, truth) in crops.zip(&self.truth) {
            let crop = std::slice::from_ref(crop);
            let (style, _) = self.forward(regressors, &[crop[0].values()], crop, self.device);
            let known = &self.held_out.styles.0[crop[0].shape_idx];
            regressed += chamfer(style, truth);
            encoded += chamfer(row_tensor(std::slice::from_ref(known), self.device), truth);
        }
        vec![("regressed_chamfer", regressed), ("encoded_chamfer", encoded)]
    }

    fn forward(
        &self,
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
}

impl Styles {
    /// The styles of what these crops show, `[b, k]`.
    fn of(&self, crops: &[Crop], device: &Device) -> Tensor<2> {
        let styles: Vec<_> = crops.iter().map(|crop| self.0[crop.shape_idx].clone()).collect();
        row_tensor(&styles, device)
    }
}

fn render_held_out(config: &TrainingConfig, shapes: &Shapes) -> Result<Vec<Crop>> {
    let models = shapes.held_out();
    let views: Vec<_> = (0..config.data.views_per_validation).collect();
    let bar = ProgressBar::new(models.len() as u64).with_message("rendering");
    let render = |model_idx| {
        bar.inc(1);
        render_model(config, shapes, model_idx, &views)
    };
    let crops = crops_of_models(&models, render, || true)?;
    bar.finish_and_clear();
    Ok(crops)
}

/// Styles of these surfaces.
fn encode(prior: &ShapePrior, surfaces: &[Surface], device: &Device) -> Styles {
    let chunks = surfaces.chunks(CHUNK).map(|chunk| {
        let clouds: Vec<_> = chunk.iter().map(|Surface(points)| points.clone()).collect();
        host_values(&prior.encode(cloud_tensor(&clouds, device)))
    });
    let styles = chunks
        .flat_map(|styles| styles.chunks(prior.n_style()).map(<[_]>::to_vec).collect::<Vec<_>>());
    Styles(styles.collect())
}
