//! The shapes to train on and those held out: procedural cars, or a collection of meshes.

use std::path::Path;

use nalgebra::Point3;
use rand::{Rng, seq::SliceRandom};
use rayon::prelude::*;

use super::DataConfig;
use crate::{
    Error, Result,
    data::{
        collection::{Collection, Model},
        keyed_rng,
        mesh::Mesh,
        procedural::CarParameters,
        surface::sample_surface,
        surface_cache::SurfaceSampler,
    },
};

/// What random streams are for: the first half of their keys.
const SHAPE: u64 = 1 << 32;
const PAINT: u64 = 2 << 32;
const SURFACE: u64 = 3 << 32;
const ORDER: u64 = 4 << 32;

/// Shapes by number; of these, training takes the first and validation the last.
pub(super) struct Shapes {
    source: Source,
    seed: u64,
    n_training: usize,
    n_validation: usize,
}

enum Source {
    ProceduralCars {
        n_paints: usize,
    },
    /// Each with `n_points` on its surface, and more where more are asked for.
    Meshes {
        models: Vec<Model>,
        sampler: SurfaceSampler,
        n_points: usize,
    },
}

impl Shapes {
    /// Looks for as many models as are wanted. Each is read once: one that cannot be is listed, and
    /// another takes its place.
    pub fn open(config: &DataConfig, seed: u64) -> Result<Self> {
        let Some(root) = &config.meshes else {
            let (n_training, n_validation) = (config.n_models, config.n_validation);
            let source = Source::ProceduralCars { n_paints: config.paints_per_model };
            return Ok(Self { source, seed, n_training, n_validation });
        };
        let invalid = |reason| Error::Config { path: root.clone(), reason };
        let mut models = Collection::open(root, &config.selection().map_err(invalid)?)?.models;
        // The order of ids says something about who made a model.
        models.shuffle(&mut keyed_rng(seed, [ORDER, 0]));
        let sampler = SurfaceSampler::new(seed, config.cache.clone())?;
        let (n_points, n_validation) = (config.points_per_model, config.n_validation);
        let n_wanted = config.n_models.saturating_add(n_validation);
        eprintln!("meshes: reading {} of {}", n_wanted.min(models.len()), models.len());
        let check = |model: &Model| sampler.sample(model, n_points).map(|_| ());
        let models = take_usable(root, models, n_wanted, check)?;
        if models.len() <= n_validation {
            let n_usable = models.len();
            return Err(invalid(format!(
                "{n_usable} models are usable, of which {n_validation} are to be held out"
            )));
        }
        let n_training = models.len() - n_validation;
        let source = Source::Meshes { models, sampler, n_points };
        Ok(Self { source, seed, n_training, n_validation })
    }

    /// Numbers of the shapes to train on.
    pub fn training(&self) -> Vec<usize> {
        (0..self.n_training).collect()
    }

    /// Numbers of the shapes that are held out.
    pub fn held_out(&self) -> Vec<usize> {
        (self.n_training..self.n_training + self.n_validation).collect()
    }

    /// Paints that each shape has; what was scanned or modelled has but one.
    pub fn n_paints(&self) -> usize {
        match self.source {
            Source::ProceduralCars { n_paints } => n_paints,
            Source::Meshes { .. } => 1,
        }
    }

    /// A shape in one of its paints.
    pub fn mesh(&self, model_idx: usize, paint: usize) -> Result<Mesh> {
        match &self.source {
            Source::ProceduralCars { .. } => {
                let car = self.procedural_car(model_idx);
                Ok(car.mesh(&mut keyed_rng(self.seed, [PAINT + paint as u64, model_idx as u64])))
            }
            Source::Meshes { models, .. } => Ok(models[model_idx].load()?.mesh),
        }
    }

    fn procedural_car(&self, model_idx: usize) -> CarParameters {
        CarParameters::random(&mut keyed_rng(self.seed, [SHAPE, model_idx as u64]))
    }

    /// Each shape's own surface points.
    pub fn surfaces(&self, models: &[usize], n_points: usize) -> Result<Vec<Surface>> {
        let sample = |&model_idx: &usize| -> Result<Surface> {
            let points: Vec<Point3<f32>> = match &self.source {
                Source::ProceduralCars { .. } => {
                    let mut rng = keyed_rng(self.seed, [SURFACE, model_idx as u64]);
                    let mesh = self.procedural_car(model_idx).unpainted_mesh();
                    sample_surface(&mesh, n_points, &mut rng)
                }
                // Up to `points_per_model`, fewer points are the first of those that are kept.
                Source::Meshes { models, sampler, n_points: n_kept } => {
                    sampler.sample(&models[model_idx], n_points.max(*n_kept))?
                }
            };
            Ok(Surface(points.iter().take(n_points).map(|point| point.coords.into()).collect()))
        };
        models.par_iter().map(sample).collect()
    }
}

/// The first `n_wanted` models that pass a check. Those that do not are listed on stderr.
fn take_usable(
    root: &Path,
    models: Vec<Model>,
    n_wanted: usize,
    check: impl Fn(&Model) -> Result<()> + Sync,
) -> Result<Vec<Model>> {
    let mut usable = Vec::new();
    let mut first_error = None;
    let mut models = models.into_iter();
    while usable.len() < n_wanted && models.len() > 0 {
        let batch: Vec<_> = models.by_ref().take(n_wanted - usable.len()).collect();
        let results: Vec<_> =
            batch.into_par_iter().map(|model| check(&model).map(|()| model)).collect();
        for result in results {
            match result {
                Ok(model) => usable.push(model),
                Err(error @ Error::Cache { .. }) => return Err(error),
                Err(error) => {
                    eprintln!("skipped: {error}");
                    first_error.get_or_insert(error);
                }
            }
        }
    }
    match first_error {
        Some(error) if usable.is_empty() => {
            let reason = format!("none of its models is usable; the first: {error}");
            Err(Error::Collection { path: root.into(), reason })
        }
        _ => Ok(usable),
    }
}

/// Points of one surface, from which clouds are drawn.
pub(super) struct Surface(pub Vec<[f32; 3]>);

impl Surface {
    /// n of the points, none twice.
    pub fn draw(&self, n: usize, rng: &mut impl Rng) -> Vec<[f32; 3]> {
        let point_idx = rand::seq::index::sample(rng, self.0.len(), n);
        point_idx.into_iter().map(|i| self.0[i]).collect()
    }
}
