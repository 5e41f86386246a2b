//! The shapes to train on and those held out: procedural cars, or a category of ShapeNet.

use nalgebra::Point3;
use rand::{Rng, seq::SliceRandom};
use rayon::prelude::*;

use super::DataConfig;
use crate::{
    Error, Result,
    data::{
        keyed_rng,
        mesh::Mesh,
        procedural::CarParameters,
        shapenet::{Model, find_models, select_models},
        surface::sample_surface,
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
    ProceduralCars,
    ShapeNet(Vec<Model>),
}

impl Shapes {
    /// Looks for models, without reading them yet.
    pub fn open(config: &DataConfig, seed: u64) -> Result<Self> {
        let Some(root) = &config.shapenet else {
            let (n_training, n_validation) = (config.n_models, config.n_validation);
            return Ok(Self { source: Source::ProceduralCars, seed, n_training, n_validation });
        };
        let models = find_models(root, &config.synset)?;
        let mut models = select_models(models, &config.include, &config.exclude);
        if models.len() <= config.n_validation {
            let (found, held_out) = (models.len(), config.n_validation);
            let reason = format!("{found} models match, of which {held_out} are to be held out");
            return Err(Error::Config { path: root.clone(), reason });
        }
        // The order of ids says something about who made a model.
        models.shuffle(&mut keyed_rng(seed, [ORDER, 0]));
        let n_training = config.n_models.min(models.len() - config.n_validation);
        let n_validation = config.n_validation;
        Ok(Self { source: Source::ShapeNet(models), seed, n_training, n_validation })
    }

    /// Numbers of the shapes to train on.
    pub fn training(&self) -> Vec<usize> {
        (0..self.n_training).collect()
    }

    /// Numbers of the shapes that are held out.
    pub fn held_out(&self) -> Vec<usize> {
        (self.n_training..self.n_training + self.n_validation).collect()
    }

    /// A shape in one of its paints; what was scanned or modelled has but one.
    pub fn mesh(&self, model_idx: usize, paint: usize) -> Result<Mesh> {
        match &self.source {
            Source::ProceduralCars => {
                let car =
                    CarParameters::random(&mut keyed_rng(self.seed, [SHAPE, model_idx as u64]));
                Ok(car.mesh(&mut keyed_rng(self.seed, [PAINT + paint as u64, model_idx as u64])))
            }
            Source::ShapeNet(models) => Ok(models[model_idx].load()?.mesh),
        }
    }

    /// Each shape's own surface points. Shapes that cannot be read are an error: exclude them.
    pub fn surfaces(&self, models: &[usize], n_points: usize) -> Result<Vec<Surface>> {
        let sample = |&model_idx: &usize| {
            let mut rng = keyed_rng(self.seed, [SURFACE, model_idx as u64]);
            let points = sample_surface(&self.mesh(model_idx, 0)?, n_points, &mut rng);
            Ok(Surface(points.into_iter().map(|point: Point3<f32>| point.coords.into()).collect()))
        };
        models.par_iter().map(sample).collect()
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
