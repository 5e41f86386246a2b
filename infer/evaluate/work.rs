//! One method on one sequence.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::Result;
use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::Isometry3;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Outcome,
        shape_model::{FreePoints, KnownPoints, ShapeModel},
        unknowns::Unknowns,
    },
    checkpoint::Prior,
    data::sequence::Sequence,
    device::Backend,
    host::host_points,
    initial_guess::Start,
    metrics::PoseErrors,
    reconstruction::{points, score},
};

use super::{
    estimates::Estimated,
    measured::Measured,
    methods::Method,
    store::{Estimate, MethodResult, peak_memory_mb},
};
use crate::{
    baselines, colmap,
    run::{Reconstruction, reconstruct_and_score},
};

/// What all methods share.
pub struct Context {
    pub prior: Prior,
    pub config: BundleAdjustmentConfig,
    pub backend: Backend,
    pub neighbours: baselines::Neighbours,
    /// The program that is COLMAP.
    pub colmap: PathBuf,
    /// Whether each sequence gets a report of its own.
    pub reports: bool,
}

/// What a method found, judged, and the poses and clouds that it was judged by.
pub struct Applied {
    pub result: MethodResult,
    pub initial: Option<Estimate>,
    pub last: Option<Estimate>,
    /// What a report shows, of bundle adjustment with the prior.
    pub reconstruction: Option<Reconstruction>,
}

impl Context {
    /// Applies a method to a sequence; other programs leave what they like in `folder`.
    pub fn apply(&self, method: Method, sequence: &Sequence, folder: &Path) -> Result<Applied> {
        let mut config = method.config(&self.config);
        match method {
            Method::Solver | Method::Photometric | Method::Silhouette | Method::Algorithm1 => {
                self.adjusted(sequence, &config)
            }
            Method::FromTruth => {
                config.start = Start::Truth;
                self.adjusted(sequence, &config)
            }
            Method::PerFrame => self.per_frame(sequence),
            Method::MeanShape | Method::Retrieval => self.another_shape(method, sequence),
            Method::FreePoints => self.free_points(sequence, &config),
            Method::Colmap => self.colmap(sequence, folder, true),
            Method::ColmapUnmasked => self.colmap(sequence, folder, false),
        }
    }

    /// The chosen solver on the first `n_views` frames; of one, the paper takes the initialisation.
    pub fn first_views(&self, n_views: usize, sequence: &Sequence) -> Result<Applied> {
        let sequence = sequence.clone().first_frames(n_views);
        if n_views > 1 {
            return self.adjusted(&sequence, &self.config);
        }
        let start = Instant::now();
        let unknowns = self.start(&sequence)?;
        let seconds = start.elapsed().as_secs_f64();
        Ok(self.judged(&sequence, &self.prior.shape.generator, &unknowns, seconds))
    }

    pub fn device(&self) -> Device {
        self.backend.device().autodiff()
    }

    fn adjusted(&self, sequence: &Sequence, config: &BundleAdjustmentConfig) -> Result<Applied> {
        let found =
            reconstruct_and_score(&self.prior, sequence, config, self.backend, &mut |_, _| {})?;
        let report = &found.report;
        let shape = found.outcome.shape(&self.prior.shape.generator);
        let estimate = |unknowns: &Unknowns| self.estimate(&shape, unknowns);
        Ok(Applied {
            initial: Some(estimate(&found.outcome.stages[0].1)),
            last: Some(estimate(&found.outcome.unknowns)),
            result: MethodResult {
                initial: Some(report.initial.clone().into()),
                last: report.last.clone().into(),
                seconds: Some(report.seconds),
                status: Some(report.status),
                report: Some(serde_json::to_value(report)?),
                ..self.found(sequence)
            },
            reconstruction: Some(found),
        })
    }

    fn per_frame(&self, sequence: &Sequence) -> Result<Applied> {
        let (prior, device) = (&self.prior, self.device());
        let start = Instant::now();
        let found = baselines::per_frame(prior, sequence)?;
        let seconds = start.elapsed().as_secs_f64();
        let truth = sequence.truth.as_ref();
        let poses = truth
            .map(|truth| PoseErrors::new(&found.poses, &truth.camera_from_world, truth.canonical));
        let true_points = truth.and_then(|truth| truth.points.as_ref());
        let cloud = true_points.map(|truth| {
            let truth: Vec<[f32; 3]> = truth.iter().map(|point| point.coords.into()).collect();
            found.cloud_errors(&truth, prior, &device)
        });
        let last = Measured {
            poses: poses.unwrap_or_default(),
            cloud,
            photometric_loss: None,
            silhouette_loss: found.silhouette_loss(prior, sequence, &device),
        };
        let reference = found.cloud(0, prior, &device);
        Ok(Applied {
            initial: None,
            last: Some(Estimate { camera_from_world: found.poses, points: Some(reference) }),
            reconstruction: None,
            result: MethodResult { last, seconds: Some(seconds), ..self.found(sequence) },
        })
    }

    /// A shape that was not adjusted, at the initial poses.
    fn another_shape(&self, method: Method, sequence: &Sequence) -> Result<Applied> {
        let start = Instant::now();
        let initial = self.start(sequence)?;
        let generator = &self.prior.shape.generator;
        if method == Method::MeanShape {
            let mean = initial.with_style(&vec![0.0; self.prior.shape.n_style()]);
            let seconds = start.elapsed().as_secs_f64();
            return Ok(self.judged(sequence, generator, &mean, seconds));
        }
        let cloud = host_points(&points(generator, &initial, &self.device()));
        let cloud = baselines::nearest_training_shape(&self.neighbours, &self.prior, cloud)?;
        let data = TensorData::new(cloud.concat(), [1, cloud.len(), 3]);
        let shape = KnownPoints(Tensor::from_data(data, &self.backend.device()));
        let seconds = start.elapsed().as_secs_f64();
        Ok(self.judged(sequence, &shape, &initial.with_style(&[]), seconds))
    }

    fn free_points(&self, sequence: &Sequence, config: &BundleAdjustmentConfig) -> Result<Applied> {
        let start = Instant::now();
        let hypotheses = baselines::hypotheses(&self.prior, sequence, config)?;
        let (generator, device) = (&self.prior.shape.generator, self.device());
        let Outcome { unknowns, status, .. } =
            baselines::free_points(sequence, generator, &hypotheses, config, &device);
        let seconds = start.elapsed().as_secs_f64();
        let mut applied = self.judged(sequence, &FreePoints, &unknowns, seconds);
        applied.result.status = Some(status);
        Ok(applied)
    }

    fn colmap(&self, sequence: &Sequence, folder: &Path, masked: bool) -> Result<Applied> {
        let start = Instant::now();
        let poses = colmap::poses(&self.colmap, sequence, folder, masked)?;
        let seconds = start.elapsed().as_secs_f64();
        let mut result = Estimated::in_its_own_world(poses).judge(sequence, &self.device())?;
        result.seconds = Some(seconds);
        Ok(Applied { result, initial: None, last: None, reconstruction: None })
    }

    fn start(&self, sequence: &Sequence) -> Result<Unknowns> {
        let hypotheses = baselines::hypotheses(&self.prior, sequence, &self.config)?;
        Ok(hypotheses[0].unknowns.clone())
    }

    fn judged(
        &self,
        sequence: &Sequence,
        shape: &dyn ShapeModel,
        unknowns: &Unknowns,
        seconds: f64,
    ) -> Applied {
        let last = score(sequence, shape, unknowns, &self.device()).into();
        let last_estimate = self.estimate(shape, unknowns);
        let result = MethodResult { last, seconds: Some(seconds), ..self.found(sequence) };
        Applied { result, initial: None, last: Some(last_estimate), reconstruction: None }
    }

    fn estimate(&self, shape: &dyn ShapeModel, unknowns: &Unknowns) -> Estimate {
        let device = self.device();
        let camera_from_world: Vec<Isometry3<f32>> = unknowns.camera_from_world(&device);
        let cloud = host_points(&points(shape, unknowns, &device));
        Estimate { camera_from_world, points: Some(cloud) }
    }

    /// A result of which nothing is known yet.
    fn found(&self, sequence: &Sequence) -> MethodResult {
        let n_frames = sequence.frames.len();
        MethodResult {
            initial: None,
            last: Measured::default(),
            seconds: None,
            status: None,
            n_posed: n_frames,
            n_frames,
            report: None,
            peak_memory_mb: peak_memory_mb(),
        }
    }
}
