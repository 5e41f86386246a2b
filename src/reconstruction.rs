//! From a sequence to poses and a cloud: initialise, adjust, score.

use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use crate::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, Outcome, Step, bundle_adjust,
        objective::{Objective, ObjectiveConfig},
        observations::Observations,
        shape_model::ShapeModel,
        unknowns::Unknowns,
    },
    checkpoint::Prior,
    data::sequence::Sequence,
    host::{host_pixels, host_points},
    initial_guess::{InitialGuess, Start, true_unknowns},
    metrics::{CloudErrors, PoseErrors},
    pseudo_render::{PseudoRenderConfig, visible_points},
};

/// Initialises and adjusts. `None` when there is nothing to start from: the reference frame's mask is
/// empty, or the truth is asked for and not known.
pub fn reconstruct(
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    device: &Device,
    observe: &mut dyn FnMut(&Step, &Unknowns),
) -> Option<Outcome> {
    let hypotheses = hypotheses(prior, sequence, config);
    if hypotheses.is_empty() {
        return None;
    }
    let generator = &prior.shape.generator;
    Some(bundle_adjust(sequence, generator, &hypotheses, config, device, observe))
}

/// Where to start, likeliest first; nowhere, if what the config asks for is not known.
pub fn hypotheses(
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
) -> Vec<Hypothesis> {
    match config.start {
        Start::Regressors => InitialGuess::hypotheses(prior, sequence, config),
        Start::Truth => {
            let unknowns = true_unknowns(prior, sequence, config.objective.parameterisation);
            let regressed = InitialGuess::hypotheses(prior, sequence, config);
            let expecting = |truth: Unknowns| match regressed.first() {
                Some(guess) => truth.expecting(guess.unknowns.likely_style().to_vec()),
                None => truth,
            };
            unknowns.map(expecting).map(Hypothesis::from).into_iter().collect()
        }
    }
}

/// One state of a reconstruction, judged: `null` where there is no ground truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    #[serde(flatten)]
    pub poses: PoseErrors,
    /// Eq. 7, raw, in squared world units (diagonal 1).
    pub style_error: Option<f64>,
    /// Its two parts, unsquared distances and the shares within 1 % of the diagonal.
    pub cloud: Option<CloudErrors>,
    /// Eq. 3 as printed: on sharp frames, RGB in [0, 1], at full N.
    pub photometric_loss: f64,
    /// Eq. 5 as printed, in pixels².
    pub silhouette_loss: f64,
}

/// Judges a state by the bare Eq. 3, 5 and 7, on the points that the default pseudo-renderer sees,
/// whatever the solver minimised and however it saw.
pub fn score(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    unknowns: &Unknowns,
    device: &Device,
) -> Scores {
    let device = device.clone().inner();
    let observations = Observations::new(sequence, &[0.0], &device);
    let config = ObjectiveConfig {
        pseudo_render: PseudoRenderConfig::default(),
        ..ObjectiveConfig::paper()
    };
    let objective =
        Objective { observations: &observations, shape, config: &config, device: device.clone() };
    let bare = objective.evaluate(unknowns, 0);

    let truth = sequence.truth.as_ref();
    let poses = truth.map(|truth| {
        let estimate = unknowns.camera_from_world(&device);
        PoseErrors::new(&estimate, &truth.camera_from_world, truth.canonical)
    });
    let true_points = truth.and_then(|truth| truth.points.as_ref());
    let cloud = true_points.map(|truth| {
        let truth: Vec<[f32; 3]> = truth.iter().map(|point| point.coords.into()).collect();
        CloudErrors::new(&host_points(&points(shape, unknowns, &device)), &truth)
    });
    Scores {
        poses: poses.unwrap_or_default(),
        style_error: cloud.as_ref().map(CloudErrors::style_error),
        cloud,
        photometric_loss: bare.photometric,
        silhouette_loss: bare.silhouette,
    }
}

/// The cloud of some unknowns, `[1, n, 3]`.
pub fn points(shape: &dyn ShapeModel, unknowns: &Unknowns, device: &Device) -> Tensor<3> {
    shape.points(unknowns.leaves(&device.clone().inner()).style).inner()
}

/// Where every point lands in every frame, and which points each frame sees.
pub struct Views {
    /// L lists of n locations, in pixels.
    pub pixels: Vec<Vec<[f32; 2]>>,
    /// L lists of point indices.
    pub visible: Vec<Vec<u32>>,
}

/// Projects the cloud of some unknowns into all frames.
pub fn views(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    unknowns: &Unknowns,
    pseudo_render: &PseudoRenderConfig,
    device: &Device,
) -> Views {
    let device = device.clone().inner();
    let poses = unknowns.poses(&unknowns.leaves(&device));
    let (intrinsics, size) = (unknowns.intrinsics(&sequence.intrinsics), sequence.size);
    let points = points(shape, unknowns, &device);
    let projection = intrinsics.project(poses.camera_from_world(points.clone()));
    Views {
        pixels: host_pixels(&projection.pixels),
        visible: visible_points(points, &poses, &intrinsics, size, pseudo_render),
    }
}
