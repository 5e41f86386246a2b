//! One way to reconstruct, and what it comes to on a sequence.

use std::{collections::BTreeMap, path::Path, time::Instant};

use anyhow::{Result, bail};
use burn::tensor::Device;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, bundle_adjust,
        point_subset::PointSubset,
        shape_model::{FreePoints, ShapeModel},
    },
    checkpoint::Prior,
    data::{
        formats::{SequenceHints, read_sequence},
        sequence::Sequence,
    },
    host::host_points,
    reconstruction::{Scores, hypotheses, points, score},
};
use serde::{Deserialize, Serialize};

use crate::{run::NO_REFERENCE_MASK, side_by_side::guarded};

/// Step size or scale of a free point in world units, a tenth of the spacing of 6,144 points on a car.
pub const POINT_RATE: f64 = 2e-3;

/// What says where the points are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// The style, through the generator.
    Prior,
    /// Nothing else: each is an unknown.
    FreePoints,
}

/// One way to reconstruct. All of it but the name decides what comes out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Arm {
    #[serde(skip)]
    pub name: String,
    /// L, the first frames of a sequence; all of it where there is no number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_frames: Option<usize>,
    /// N, the points that are compared with the frames.
    pub n_points: usize,
    /// Points by which the outcome is judged. Eq. 3, 5 and 7 depend on how many there are, so all arms
    /// of a comparison have as many.
    pub n_judged_points: usize,
    pub shape: Shape,
    pub config: BundleAdjustmentConfig,
}

/// What an arm came to on a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub start: Scores,
    pub end: Scores,
    pub iterations: usize,
    pub seconds: f64,
    /// Why the solver stopped.
    pub status: String,
    /// Whether that says that its estimate is not to be used.
    pub fault: bool,
}

/// A prior, and its subsets that some arms ask for.
pub struct Reconstructor<'a> {
    prior: &'a Prior,
    subsets: BTreeMap<usize, PointSubset<'a>>,
    device: Device,
}

impl<'a> Reconstructor<'a> {
    /// `device` differentiates.
    pub fn new(prior: &'a Prior, arms: &[Arm], device: &Device) -> Self {
        let generator = &prior.shape.generator;
        let numbers = arms.iter().flat_map(|arm| [arm.n_points, arm.n_judged_points]);
        let subsets = numbers.filter(|&n| n != generator.n_points());
        let subsets = subsets.map(|n| (n, PointSubset::new(generator, n))).collect();
        Self { prior, subsets, device: device.clone() }
    }

    /// Reads a sequence and reconstructs it. A panic is an error like any other.
    pub fn run(&self, arm: &Arm, sequence: &Path) -> Result<Outcome> {
        let run = || {
            let sequence = read_sequence(sequence, &SequenceHints::default())?.sequence;
            self.reconstruct(arm, &first_frames(sequence, arm.n_frames)?)
        };
        guarded(run)
    }

    fn reconstruct(&self, arm: &Arm, sequence: &Sequence) -> Result<Outcome> {
        let begin = Instant::now();
        let mut starts = hypotheses(self.prior, sequence, &arm.config);
        if starts.is_empty() {
            bail!("{NO_REFERENCE_MASK}");
        }
        let (mut shape, mut judged) = (self.points(arm.n_points), self.points(arm.n_judged_points));
        let mut config = arm.config.clone();
        if arm.n_points != arm.n_judged_points {
            // A displacement is of the points that it was found for.
            config.displacement.n_modes = 0;
        }
        if arm.shape == Shape::FreePoints {
            (starts, config) = freed(shape, &starts, &config, &self.device);
            (shape, judged) = (&FreePoints, &FreePoints);
        }
        let outcome =
            bundle_adjust(sequence, shape, &starts, &config, &self.device, &mut |_, _| {});
        let seconds = begin.elapsed().as_secs_f64();
        let judged = outcome.shape(judged);
        let judge = |unknowns| score(sequence, &judged, unknowns, &self.device);
        let (start, end) = (judge(&outcome.stages[0].1), judge(&outcome.unknowns));
        if !end.photometric_loss.is_finite() || !end.silhouette_loss.is_finite() {
            bail!("its losses are not finite");
        }
        Ok(Outcome {
            start,
            end,
            iterations: outcome.iterations,
            seconds,
            status: format!("{:?}", outcome.status),
            fault: outcome.status.is_fault(),
        })
    }

    fn points(&self, n: usize) -> &dyn ShapeModel {
        match self.subsets.get(&n) {
            Some(subset) => subset,
            None => &self.prior.shape.generator,
        }
    }
}

/// The same starts, with the points themselves as unknowns, and nothing that asks for a style.
pub fn freed(
    shape: &dyn ShapeModel,
    starts: &[Hypothesis],
    config: &BundleAdjustmentConfig,
    device: &Device,
) -> (Vec<Hypothesis>, BundleAdjustmentConfig) {
    let free = |start: &Hypothesis| {
        let cloud = host_points(&points(shape, &start.unknowns, device));
        let unknowns = start.unknowns.with_style(cloud.as_flattened());
        Hypothesis { unknowns, confidence: start.confidence }
    };
    let mut config = config.clone();
    config.objective.style_weight = 0.0;
    config.adam.style_rate = POINT_RATE;
    config.lbfgs.style_scale = POINT_RATE;
    (starts.iter().map(free).collect(), config)
}

fn first_frames(sequence: Sequence, n_frames: Option<usize>) -> Result<Sequence> {
    let n = n_frames.unwrap_or(sequence.frames.len());
    if n > sequence.frames.len() {
        bail!("it has {} frames only", sequence.frames.len());
    }
    Ok(sequence.first_frames(n))
}
