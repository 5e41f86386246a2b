//! The first stage: the autoencoder learns to give back clouds, by their Chamfer distance (Eq. 7).

use std::path::Path;

use burn::{module::Module, tensor::Device};
use nalgebra::DMatrix;
use rand::Rng;

use super::{
    TrainingConfig,
    batches::cloud_tensor,
    sampled_chamfer::sampled_chamfer,
    seeded,
    shapes::{Shapes, Surface},
    stage::{Measurements, SCALE, Stage, Terms},
};
use crate::{
    Result, chamfer::chamfer_distance, data::keyed_rng, host::host_values, shape_prior::ShapePrior,
};

const NAME: &str = "prior";
/// Random streams of this stage: the first half of their keys.
const BATCH: u64 = 11 << 32;
const TEMPLATE: u64 = 12 << 32;
const ENCODING: u64 = 13 << 32;
/// Shapes that lend their points to the template.
const TEMPLATE_SHAPES: usize = 50;
/// Clouds that are encoded or compared at a time.
const CHUNK: usize = 16;

pub(super) struct ShapeStage<'a> {
    config: &'a TrainingConfig,
    stage: Stage<'a>,
    device: &'a Device,
    training: Vec<Surface>,
    held_out: Vec<HeldOut>,
    /// What a perfect generator would score: two samplings of one surface differ by this much.
    noise_floor: f64,
}

/// A shape to measure on: what the encoder sees, and what its reconstruction is compared to.
struct HeldOut {
    seen: Vec<[f32; 3]>,
    truth: Vec<[f32; 3]>,
}

impl<'a> ShapeStage<'a> {
    pub fn prepare(
        config: &'a TrainingConfig,
        shapes: &Shapes,
        out: &'a Path,
        device: &'a Device,
    ) -> Result<Self> {
        let network = &config.prior.network;
        let (n_seen, n) = (network.n_encoder_points, network.n_points());
        eprintln!("{NAME}: sampling surfaces");
        let training = shapes.surfaces(&shapes.training(), config.data.points_per_model)?;
        let surfaces = shapes.surfaces(&shapes.held_out(), n_seen + 2 * n)?;
        let noise_floor = mean(surfaces.iter().map(|Surface(points)| {
            let (one, other) = points[n_seen..].split_at(n);
            chamfer(&[one.to_vec()], &[other.to_vec()], device)
        }));
        let held_out = surfaces.into_iter().map(|Surface(points)| HeldOut {
            seen: points[..n_seen].to_vec(),
            truth: points[n_seen..n_seen + n].to_vec(),
        });
        let stage = Stage { name: NAME, schedule: &config.prior.schedule, out };
        Ok(Self { config, stage, device, training, held_out: held_out.collect(), noise_floor })
    }

    /// The trained autoencoder, its style whitened over the training shapes.
    pub fn train(&self) -> Result<ShapePrior> {
        let autodiff = self.device.clone().autodiff();
        let network = &self.config.prior.network;
        let init = || network.init(&self.template(), &autodiff);
        let prior = seeded(self.device, self.config.seed, init);
        let prior = self.stage.train(
            self.stage.resume(prior)?,
            |prior, step| Ok(self.loss(prior, step, &autodiff)),
            |prior| self.measure(&prior.valid()),
        )?;
        let prior = prior.valid();
        let latents = self.encode(&prior);
        Ok(prior.whiten(&latents, self.device))
    }

    /// Measures what was saved, and ends the stage.
    pub fn finish(&self, prior: &ShapePrior) -> Result<()> {
        let mut measurements = self.measure(prior);
        measurements.push(("n_style", prior.n_style() as f64));
        self.stage.finish(&measurements)
    }

    /// Points of several shapes: wherever some car has one, the template has some.
    fn template(&self) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(self.config.seed, [TEMPLATE, 0]);
        let n_shapes = self.training.len().min(TEMPLATE_SHAPES);
        let points = 0..self.config.prior.network.n_points();
        points
            .map(|i| {
                let Surface(points) = &self.training[i % n_shapes];
                points[rng.random_range(0..points.len())]
            })
            .collect()
    }

    fn loss(&self, prior: &ShapePrior, step: usize, device: &Device) -> Terms {
        let (network, schedule) = (&self.config.prior.network, &self.config.prior.schedule);
        let mut rng = keyed_rng(self.config.seed, [BATCH, step as u64]);
        let (seen, targets): (Vec<_>, Vec<_>) = (0..schedule.batch_size)
            .map(|_| {
                let surface = &self.training[rng.random_range(0..self.training.len())];
                let target = surface.draw(network.n_points(), &mut rng);
                (target[..network.n_encoder_points].to_vec(), target)
            })
            .unzip();
        let seen = cloud_tensor(&seen, device);
        let latent = match step < self.config.prior.batch_statistics {
            true => prior.encoder.forward(seen),
            false => prior.encoder.with_running_statistics().forward(seen),
        };
        let clouds = prior.generator.forward(latent);
        let n_queries = self.config.prior.chamfer_queries;
        vec![("chamfer", sampled_chamfer(clouds, &targets, n_queries, &mut rng) * SCALE)]
    }

    fn measure(&self, prior: &ShapePrior) -> Measurements {
        let chamfer = mean(self.held_out.chunks(CHUNK).flat_map(|chunk| {
            let seen: Vec<_> = chunk.iter().map(|shape| shape.seen.clone()).collect();
            let truth: Vec<_> = chunk.iter().map(|shape| shape.truth.clone()).collect();
            let style = prior.encode(cloud_tensor(&seen, self.device));
            let clouds = prior.generator.forward(style);
            let distances = chamfer_distance(clouds, cloud_tensor(&truth, self.device));
            host_values(&distances).into_iter().map(f64::from)
        }));
        vec![
            ("held_out_chamfer", SCALE * chamfer),
            ("noise_floor", SCALE * self.noise_floor),
            ("ratio", chamfer / self.noise_floor),
        ]
    }

    /// Latents of all training shapes, one a row.
    fn encode(&self, prior: &ShapePrior) -> DMatrix<f64> {
        let n_seen = self.config.prior.network.n_encoder_points;
        let clouds: Vec<_> = self
            .training
            .iter()
            .enumerate()
            .map(|(i, surface)| {
                surface.draw(n_seen, &mut keyed_rng(self.config.seed, [ENCODING, i as u64]))
            })
            .collect();
        let latents = clouds
            .chunks(CHUNK)
            .flat_map(|clouds| host_values(&prior.encode(cloud_tensor(clouds, self.device))));
        let latents: Vec<f64> = latents.map(f64::from).collect();
        DMatrix::from_row_slice(clouds.len(), latents.len() / clouds.len(), &latents)
    }
}

fn chamfer(one: &[Vec<[f32; 3]>], other: &[Vec<[f32; 3]>], device: &Device) -> f64 {
    let distance = chamfer_distance(cloud_tensor(one, device), cloud_tensor(other, device));
    f64::from(host_values(&distance)[0])
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
    sum / f64::from(n.max(1))
}
