//! Pictures of shapes that training does not see, to measure the regressors on.

use burn::tensor::{Device, Tensor};
use indicatif::ProgressBar;

use super::{
    TrainingConfig,
    batches::{cloud_tensor, row_tensor},
    crops::{Crop, crops_of_models, render_model},
    pose_errors::PoseErrors,
    regressor_stage::regress,
    shapes::{Shapes, Surface},
    stage::Measurements,
    styles::Styles,
};
use crate::{
    Result,
    chamfer::chamfer_distance,
    host::host_values,
    regressor::{Guess, Looks, Regressors},
    shape_prior::ShapePrior,
};

/// Crops that are measured at a time.
const CHUNK: usize = 64;

pub(super) struct HeldOut<'a> {
    prior: &'a ShapePrior,
    device: &'a Device,
    looks: Looks,
    crops: Vec<Crop>,
    styles: Styles,
    /// Clouds of the shapes.
    truth: Vec<Vec<[f32; 3]>>,
}

impl<'a> HeldOut<'a> {
    pub fn prepare(
        config: &TrainingConfig,
        shapes: &Shapes,
        prior: &'a ShapePrior,
        device: &'a Device,
    ) -> Result<Self> {
        let (models, network) = (shapes.held_out(), &config.prior.network);
        let seen = shapes.surfaces(&models, network.n_encoder_points)?;
        let truth = shapes.surfaces(&models, network.n_points())?;
        Ok(Self {
            prior,
            device,
            looks: config.looks(),
            crops: render(config, shapes, &models)?,
            styles: Styles::encode(prior, &seen, device),
            truth: truth.into_iter().map(|Surface(points)| points).collect(),
        })
    }

    /// Errors of the regressed poses and styles. The first, the sum of both losses, tells which of two
    /// sets of weights is better.
    pub fn measure(&self, regressors: &Regressors) -> Measurements {
        let deviations = self.prior.generator.deviations();
        let (mut pose_loss, mut style_loss) = (0.0, 0.0);
        let mut pose_errors = PoseErrors::default();
        for crops in self.crops.chunks(CHUNK) {
            let (styles, poses) = self.regress(regressors, crops);
            let targets = self.styles.of(crops, self.device);
            let share = crops.len() as f64 / self.crops.len() as f64;
            let share_of = |loss: Tensor<1>| share * f64::from(host_values(&loss)[0]);
            style_loss += share_of(regressors.style.loss(styles, targets, deviations.clone()));
            let targets: Vec<_> = crops.iter().map(Crop::pose_target).collect();
            pose_loss += share_of(regressors.pose.loss(poses, &targets));
            for (crop, guess) in crops.iter().zip(self.guesses(regressors, crops)) {
                pose_errors.push(&guess.poses, &crop.crop_from_world);
            }
        }
        let mut measurements = vec![("held_out_loss", pose_loss + style_loss)];
        measurements.extend(pose_errors.measurements());
        measurements.push(("style_loss", style_loss));
        measurements
    }

    /// Eq. 7 of the clouds that the regressed styles stand for, and of what the encoder knows.
    pub fn measure_clouds(&self, regressors: &Regressors) -> Measurements {
        let n_views = self.crops.len() / self.truth.len();
        let chamfer = |style: Tensor<2>, truth: &Vec<[f32; 3]>| {
            let truth = cloud_tensor(std::slice::from_ref(truth), self.device);
            let distance = chamfer_distance(self.prior.generator.forward(style), truth);
            f64::from(host_values(&distance)[0]) * 1e3 / self.truth.len() as f64
        };
        let (mut regressed, mut encoded) = (0.0, 0.0);
        for (crops, truth) in self.crops.chunks(n_views).zip(&self.truth) {
            let guess = self.guesses(regressors, &crops[..1]).remove(0);
            regressed += chamfer(row_tensor(&[guess.style], self.device), truth);
            encoded += chamfer(self.styles.of(&crops[..1], self.device), truth);
        }
        vec![("regressed_chamfer", regressed), ("encoded_chamfer", encoded)]
    }

    /// What [`InitialGuess`](crate::initial_guess::InitialGuess) would start from.
    fn guesses(&self, regressors: &Regressors, crops: &[Crop]) -> Vec<Guess> {
        let values: Vec<_> = crops.iter().map(Crop::values).collect();
        let size = regressors.crop_size();
        let values = row_tensor(&values, self.device).reshape([crops.len(), size, size, 4]);
        let focal_ratios: Vec<_> = crops.iter().map(|crop| crop.focal_ratio).collect();
        regressors.guesses(values, &focal_ratios, self.looks)
    }

    fn regress(&self, regressors: &Regressors, crops: &[Crop]) -> (Tensor<2>, Tensor<2>) {
        let values: Vec<_> = crops.iter().map(Crop::values).collect();
        regress(regressors, &values, crops, self.device)
    }
}

pub(super) fn render(
    config: &TrainingConfig,
    shapes: &Shapes,
    models: &[usize],
) -> Result<Vec<Crop>> {
    let views: Vec<_> = (0..config.data.views_per_validation).collect();
    let bar = ProgressBar::new(models.len() as u64).with_message("rendering");
    let render = |model_idx| {
        bar.inc(1);
        render_model(config, shapes, model_idx, &views)
    };
    let crops = crops_of_models(models, render, || true)?;
    bar.finish_and_clear();
    Ok(crops)
}
