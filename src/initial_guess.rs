//! Where bundle adjustment starts: what the regressors make of the frames (Sec. 3.2).

use burn::tensor::{Tensor, TensorData};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    bundle_adjustment::{
        Hypothesis,
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

/// Share of the likeliest pose's confidence that another needs to be tried: front and back look alike
/// coarsely, and where the regressor is sure, it is more often right than a coarse fit.
const LEAST_CONFIDENCE: f32 = 0.2;

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
        let guess = prior.regressors.regress(&color, &mask, &crop);
        let to_camera = |(pose, confidence)| (crop.camera_from_world(&pose), confidence);
        let poses = guess.poses.into_iter().map(to_camera).collect();
        Some(Self { style: guess.style, poses })
    }

    /// Regresses the poses from the reference frame; `None` when its mask is empty.
    pub fn of_sequence(prior: &Prior, sequence: &Sequence, style: InitialStyle) -> Option<Self> {
        let (reference, others) = sequence.frames.split_first()?;
        let mut guess = Self::of_frame(prior, sequence, reference)?;
        let pool: fn(Vec<f32>) -> f32 = match style {
            InitialStyle::Reference => return Some(guess),
            InitialStyle::Mean => mean,
            InitialStyle::Median => median,
        };
        let others = others.iter().filter_map(|frame| Self::of_frame(prior, sequence, frame));
        let mut styles: Vec<_> = others.map(|guess| guess.style).collect();
        styles.push(guess.style);
        let direction = |i: usize| pool(styles.iter().map(|style| style[i]).collect());
        guess.style = (0..styles[0].len()).map(direction).collect();
        Some(guess)
    }

    /// What bundle adjustment tries: Δp_l = 0, and each pose that is not too unlikely.
    pub fn hypotheses(
        &self,
        n_frames: usize,
        parameterisation: Parameterisation,
    ) -> Vec<Hypothesis> {
        let start = |&(pose, confidence): &(Isometry3<f32>, f32)| Hypothesis {
            unknowns: Unknowns::new(pose, n_frames, &self.style, parameterisation),
            confidence,
        };
        let least = LEAST_CONFIDENCE * self.poses[0].1;
        self.poses.iter().filter(|(_, confidence)| *confidence >= least).map(start).collect()
    }
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

    #[test]
    fn a_median_ignores_what_lies_far_off() {
        assert_eq!(median(vec![3.0, 1.0, 100.0]), 3.0);
        assert_eq!(median(vec![3.0, 1.0, 100.0, 2.0]), 2.5);
        assert_eq!(median(vec![7.0]), 7.0);
    }

    #[test]
    fn only_poses_that_are_likely_enough_are_tried() {
        let poses = [0.6, 0.2, 0.1].map(|confidence| (Isometry3::identity(), confidence));
        let guess = InitialGuess { style: vec![0.0; 3], poses: poses.to_vec() };
        assert_eq!(guess.hypotheses(2, Parameterisation::default()).len(), 2);
    }
}
