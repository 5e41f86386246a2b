//! Where bundle adjustment starts: what the regressors make of the frames (Sec. 3.2).

use burn::tensor::{Tensor, TensorData};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis,
        unknowns::{Parameterisation, Unknowns},
    },
    checkpoint::Prior,
    data::{
        crop::CropCamera,
        sequence::{Frame, Sequence},
    },
    host::host_values,
    silhouette::MASK_THRESHOLD,
};

/// Share of the likeliest pose's confidence, tempered as the config has it, that another needs to be tried:
/// front and back look alike coarsely.
const LEAST_CONFIDENCE: f32 = 0.2;
/// Turn from one frame to the next, in radians, beyond which a regressed pose is not believed.
const LARGEST_TURN: f32 = 0.5;

/// Which frames the initial style is regressed from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialStyle {
    /// The reference frame, as in the paper.
    #[default]
    Reference,
    /// All frames whose masks are not empty (the paper's footnote 2), direction by direction.
    Mean,
    Median,
}

/// Where the frames after the reference start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialMotion {
    /// At the reference pose, Δp_l = 0, as in the paper.
    Still,
    /// At the regressed pose that is nearest to that of the frame before.
    #[default]
    Regressed,
}

/// Where bundle adjustment starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// At what the regressors make of the frames.
    #[default]
    Regressors,
    /// At the true poses and the encoded true shape: what is then still wrong in the end is neither the
    /// initialisation's fault nor that of a solver which does not find its way.
    Truth,
}

/// R_s(I) and R_p(I_0): a style, and poses of the reference frame.
pub struct InitialGuess {
    pub style: Vec<f32>,
    /// `camera_from_world`, likeliest first, with the regressor's confidences.
    pub poses: Vec<(Isometry3<f32>, f32)>,
}

impl InitialGuess {
    /// Regresses from one frame; `None` when its mask is empty.
    pub fn of_frame(prior: &Prior, sequence: &Sequence, frame: &Frame) -> Option<Self> {
        let (size, margin) = (prior.regressors.crop_size(), prior.regressors.crop_margin());
        let (mask, intrinsics) = (&frame.mask, &sequence.intrinsics);
        let crop = CropCamera::around_silhouette(mask, MASK_THRESHOLD, intrinsics, size, margin)?;
        let (color, mask) = crop.warp(&frame.color, &frame.mask);
        let guess = prior.regressors.regress(&color, &mask, &crop, prior.config.looks());
        let to_camera = |(pose, confidence)| (crop.camera_from_world(&pose), confidence);
        let poses = guess.poses.into_iter().map(to_camera).collect();
        Some(Self { style: guess.style, poses })
    }

    /// What bundle adjustment tries: each pose of the reference frame that is not too unlikely. None
    /// where its mask is empty.
    pub fn hypotheses(
        prior: &Prior,
        sequence: &Sequence,
        config: &BundleAdjustmentConfig,
    ) -> Vec<Hypothesis> {
        let regress = |frame| Self::of_frame(prior, sequence, frame);
        let alone = config.initial_style == InitialStyle::Reference
            && config.initial_motion == InitialMotion::Still;
        let n_seen = if alone { 1 } else { sequence.frames.len() };
        let guesses: Vec<_> = sequence.frames[..n_seen].iter().map(regress).collect();
        let Some(Some(reference)) = guesses.first() else { return Vec::new() };
        let style = pooled_style(&guesses, config.initial_style);

        let parameterisation = config.objective.parameterisation;
        let unknowns = |pose: Isometry3<f32>| match config.initial_motion {
            InitialMotion::Still => {
                Unknowns::new(pose, sequence.frames.len(), &style, parameterisation)
            }
            InitialMotion::Regressed => {
                Unknowns::with_poses(&followed(pose, &guesses[1..]), &style, parameterisation)
            }
        };
        let hypothesis = |(pose, confidence)| Hypothesis { unknowns: unknowns(pose), confidence };
        reference.likely_poses(config.confidence_exponent).map(hypothesis).collect()
    }

    /// Those of the poses that are not too unlikely, with confidences raised to a power.
    fn likely_poses(&self, exponent: f32) -> impl Iterator<Item = (Isometry3<f32>, f32)> {
        let tempered =
            self.poses.iter().map(move |(pose, confidence)| (*pose, confidence.powf(exponent)));
        let least = LEAST_CONFIDENCE * self.poses[0].1.powf(exponent);
        tempered.filter(move |(_, confidence)| *confidence >= least)
    }
}

/// A pose for each frame, from the reference's on: the one of its own that is nearest to that of the
/// frame before, so that all are turned round or none is.
fn followed(reference: Isometry3<f32>, others: &[Option<InitialGuess>]) -> Vec<Isometry3<f32>> {
    let mut poses = vec![reference];
    for guess in others {
        let last = poses[poses.len() - 1];
        let turn = |pose: &Isometry3<f32>| last.rotation.angle_to(&pose.rotation);
        let own = guess.iter().flat_map(|guess| &guess.poses).map(|(pose, _)| *pose);
        let nearest = own.min_by(|a, b| turn(a).total_cmp(&turn(b)));
        poses.push(nearest.filter(|pose| turn(pose) < LARGEST_TURN).unwrap_or(last));
    }
    poses
}

/// The first frame's style, or that of all frames, direction by direction.
fn pooled_style(guesses: &[Option<InitialGuess>], style: InitialStyle) -> Vec<f32> {
    let styles: Vec<_> = guesses.iter().flatten().map(|guess| &guess.style).collect();
    let pool: fn(Vec<f32>) -> f32 = match style {
        InitialStyle::Reference => return styles[0].clone(),
        InitialStyle::Mean => mean,
        InitialStyle::Median => median,
    };
    let direction = |i: usize| pool(styles.iter().map(|style| style[i]).collect());
    (0..styles[0].len()).map(direction).collect()
}

/// The true poses, and the style of the true shape; `None` where either is unknown.
pub fn true_unknowns(
    prior: &Prior,
    sequence: &Sequence,
    parameterisation: Parameterisation,
) -> Option<Unknowns> {
    let truth = sequence.truth.as_ref().filter(|truth| truth.canonical)?;
    let points = truth.points.as_ref()?.iter().map(|point| point.coords.into());
    let seen: Vec<[f32; 3]> = points.take(prior.config.prior.network.n_encoder_points).collect();
    let data = TensorData::new(seen.concat(), [1, seen.len(), 3]);
    let style =
        prior.shape.encode(Tensor::from_data(data, &prior.shape.generator.deviations().device()));
    Some(Unknowns::with_poses(&truth.camera_from_world, &host_values(&style), parameterisation))
}

fn mean(values: Vec<f32>) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

/// The middle value, or the mean of the two in the middle.
fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    let half = values.len() / 2;
    mean(values[(values.len() - 1) / 2..=half].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_median_ignores_what_lies_far_off() {
        assert_eq!(median(vec![3.0, 1.0, 100.0]), 3.0);
        assert_eq!(median(vec![3.0, 1.0, 100.0, 2.0]), 2.5);
        assert_eq!(median(vec![7.0]), 7.0);
    }

    fn turned(degrees: f32) -> Isometry3<f32> {
        Isometry3::new(Vector3::z() * 2.0, Vector3::y() * degrees.to_radians())
    }

    fn guess(poses: &[f32]) -> Option<InitialGuess> {
        let poses = poses.iter().map(|&degrees| (turned(degrees), 0.5)).collect();
        Some(InitialGuess { style: vec![0.0], poses })
    }

    #[test]
    fn only_poses_that_are_likely_enough_are_tried() {
        let poses = [0.6, 0.2, 0.1].map(|confidence| (Isometry3::identity(), confidence));
        let guess = InitialGuess { style: vec![0.0; 3], poses: poses.to_vec() };
        assert_eq!(guess.likely_poses(1.0).count(), 2);
        // Of the square root, a tenth is a third.
        let tempered: Vec<f32> =
            guess.likely_poses(0.5).map(|(_, confidence)| confidence).collect();
        assert_eq!(tempered, [0.6f32, 0.2, 0.1].map(f32::sqrt));
    }

    #[test]
    fn frames_follow_the_reference_whichever_way_round_it_is() {
        let others = [guess(&[5.0, 183.0]), None, guess(&[196.0, 8.0]), guess(&[90.0])];
        for (start, expected) in
            [(0.0, [0.0, 5.0, 5.0, 8.0, 8.0]), (180.0, [180.0, 183.0, 183.0, 196.0, 196.0])]
        {
            let poses = followed(turned(start), &others);
            for (pose, degrees) in poses.iter().zip(expected) {
                assert!(pose.rotation.angle_to(&turned(degrees).rotation) < 1e-3, "{poses:?}");
            }
        }
    }

    #[test]
    fn a_style_is_the_reference_s_or_pooled_over_what_was_seen() {
        let of_style = |value: f32| Some(InitialGuess { style: vec![value], poses: Vec::new() });
        let guesses = [of_style(1.0), None, of_style(2.0), of_style(6.0)];
        let pooled = |style| pooled_style(&guesses, style)[0];
        assert_eq!(
            [InitialStyle::Reference, InitialStyle::Mean, InitialStyle::Median].map(pooled),
            [1.0, 3.0, 2.0]
        );
    }
}
