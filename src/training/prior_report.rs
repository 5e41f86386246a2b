//! How well a shape prior gives back shapes that it has not seen, beside what needs no network: the
//! nearest shape that it was trained on, and the mean of them all.

use burn::tensor::{Device, Tensor};
use indicatif::{ParallelProgressIterator, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;

use super::{
    TrainingConfig,
    batches::cloud_tensor,
    shapes::{Shapes, Surface},
};
use crate::{
    Result,
    data::{collection::Model, surface_cache::SurfaceSampler},
    host::host_points,
    metrics::style_error,
    shape_prior::ShapePrior,
};

/// Points by which training shapes are first compared with a shape.
const N_COARSE: usize = 1024;
/// Training shapes that are then compared at full N.
const N_CANDIDATES: usize = 12;
/// Iterations that a style is fitted by.
const FIT_ITERATIONS: usize = 40;

/// A shape, and the clouds that stand for it, in world units (diagonal 1).
pub struct Reconstruction {
    pub errors: ReconstructionErrors,
    pub truth: Vec<[f32; 3]>,
    pub decoded: Vec<[f32; 3]>,
    pub fitted: Vec<[f32; 3]>,
    /// The best-matching training shape.
    pub retrieved: Vec<[f32; 3]>,
}

/// Eq. 7 between a shape and each cloud, in squared world units at the prior's N.
#[derive(Clone, Debug, Serialize)]
pub struct ReconstructionErrors {
    pub id: String,
    /// The shape, encoded and decoded.
    pub decoded: f64,
    /// The same, its style fitted to another sampling of the surface first.
    pub fitted: f64,
    /// Another sampling of the same surface: what a perfect prior would score.
    pub noise_floor: f64,
    pub retrieved: f64,
    pub mean_shape: f64,
}

/// Shapes to reconstruct.
pub enum ReportedShapes {
    /// Those that training held out.
    HeldOut,
    /// Others.
    Models(Vec<Model>),
}

/// Encodes and decodes each shape, fits a style to it, and looks for its like among the training shapes.
pub fn report_prior(
    config: &TrainingConfig,
    prior: &ShapePrior,
    shapes: ReportedShapes,
    device: &Device,
) -> Result<Vec<Reconstruction>> {
    let n = prior.generator.n_points();
    let n_seen = config.prior.network.n_encoder_points;
    let training = TrainingShapes::open(config)?;
    let known = &training.shapes;
    let (ids, surfaces) = match shapes {
        ReportedShapes::HeldOut => {
            let held_out = known.held_out();
            let ids = held_out.iter().map(|idx| format!("held-out {idx}")).collect();
            (ids, known.surfaces(&held_out, n_seen + 2 * n)?)
        }
        ReportedShapes::Models(models) => sample(&models, config.seed, n_seen + 2 * n)?,
    };
    let mean_shape = decode(prior, Tensor::zeros([1, prior.n_style()], device));
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} shapes (ETA {eta})");
    let cloud = |points: &[[f32; 3]]| cloud_tensor(&[points.to_vec()], device);
    ids.into_par_iter()
        .zip(surfaces)
        .progress_with_style(style.expect("a valid template"))
        .map(|(id, Surface(points))| {
            let (truth, again) = points[n_seen..].split_at(n);
            let encoded = prior.encode(cloud(&points[..n_seen]));
            let fitted = prior.fit(cloud(again), encoded.clone(), FIT_ITERATIONS);
            let [decoded, fitted] = [encoded, fitted].map(|style| decode(prior, style));
            let (retrieved, retrieved_error) = training.nearest(truth)?;
            let errors = ReconstructionErrors {
                id,
                decoded: style_error(&decoded, truth),
                fitted: style_error(&fitted, truth),
                noise_floor: style_error(again, truth),
                retrieved: retrieved_error,
                mean_shape: style_error(&mean_shape, truth),
            };
            Ok(Reconstruction { errors, truth: truth.to_vec(), decoded, fitted, retrieved })
        })
        .collect()
}

/// The cloud of one style, `[1, k]`.
fn decode(prior: &ShapePrior, style: Tensor<2>) -> Vec<[f32; 3]> {
    host_points(&prior.generator.forward(style))
}

fn sample(models: &[Model], seed: u64, n_points: usize) -> Result<(Vec<String>, Vec<Surface>)> {
    let sampler = SurfaceSampler::new(seed, None)?;
    let surface = |model: &Model| -> Result<_> {
        let points = sampler.sample(model, n_points)?;
        let points = points.iter().map(|point| point.coords.into()).collect();
        Ok((model.id.clone(), Surface(points)))
    };
    Ok(models.par_iter().map(surface).collect::<Result<Vec<_>>>()?.into_iter().unzip())
}

/// The shapes that a prior was trained on, made anew from its config.
pub struct TrainingShapes {
    shapes: Shapes,
    coarse: Vec<Surface>,
}

impl TrainingShapes {
    pub fn open(config: &TrainingConfig) -> Result<Self> {
        let shapes = Shapes::open(&config.data, config.seed)?;
        let coarse = shapes.surfaces(&shapes.training(), N_COARSE)?;
        Ok(Self { shapes, coarse })
    }

    /// The cloud that is nearest to `truth` by Eq. 7, as large, and how near. The order of its points is
    /// to say nothing of where they lie.
    pub fn nearest(&self, truth: &[[f32; 3]]) -> Result<(Vec<[f32; 3]>, f64)> {
        let some = &truth[..N_COARSE.min(truth.len())];
        let coarse = self.coarse.iter().map(|Surface(points)| style_error(points, some));
        let mut ranked: Vec<_> = coarse.zip(self.shapes.training()).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let candidates: Vec<_> = ranked.iter().take(N_CANDIDATES).map(|&(_, idx)| idx).collect();
        let clouds = self.shapes.surfaces(&candidates, truth.len())?;
        let errors = clouds.into_iter().map(|Surface(points)| {
            let error = style_error(&points, truth);
            (points, error)
        });
        let nearest = errors.min_by(|a, b| a.1.total_cmp(&b.1));
        Ok(nearest.expect("training has shapes"))
    }
}
