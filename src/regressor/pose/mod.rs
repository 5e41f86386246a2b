//! R_p: the pose of the object in a crop.
//!
//! Translation is (u, v, ρ): where the object's centre is, in units of the crop's side from its
//! centre, and the logarithm of its depth over the focal length in the same unit. An object that
//! fills its crop has ρ near a constant, whatever the field of view.

use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{
        Device, Tensor, TensorData,
        activation::{log_softmax, relu},
        s,
    },
};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::SAME_POSE;
use crate::{data::viewpoint::orbit_rotation, host::index_tensor, layers::rectified_linear};

/// Directions around the object that the anchors look from.
const N_ANCHORS: usize = 16;
/// Radians above the object's equator that they look from: about the middle of the views.
const ANCHOR_ELEVATION: f32 = 0.35;
/// An object's depth in focal lengths of the crop, where its diagonal of 1 just fits.
const TYPICAL_DEPTH: f32 = 1.1;

/// Weights of the terms, which start out at about 3, 2 and 0.02. The classes only rank hypotheses.
const ANCHOR_WEIGHT: f32 = 0.5;
const SECOND_ANCHOR_WEIGHT: f32 = 0.5;
const TRANSLATION_WEIGHT: f32 = 10.0;

/// What a pose head predicts besides the translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PoseHead {
    /// Which anchor is nearest, and a rotation from each. Several hypotheses: cars look alike from
    /// the front and the back.
    #[default]
    Anchors,
    /// φn, the paper's own. One hypothesis, and between two likely poses it predicts their mean.
    Twist,
}

/// R_p on the trunk's features.
#[derive(Module, Debug)]
pub struct PoseRegressor {
    hidden: Linear,
    output: Linear,
    #[module(skip)]
    head: PoseHead,
}

/// A true pose, as it is trained on.
#[derive(Clone, Copy, Debug)]
pub struct PoseTarget {
    pub rotation: Rotation3<f32>,
    /// (u, v, ρ), see the module.
    pub coordinates: [f32; 3],
}

impl PoseTarget {
    /// `focal_ratio` is the focal length in units of the crop's side.
    pub fn new(crop_from_world: &Isometry3<f32>, focal_ratio: f32) -> Self {
        let t = crop_from_world.translation.vector;
        let [u, v] = [t.x, t.y].map(|x| focal_ratio * x / t.z);
        Self {
            rotation: crop_from_world.rotation.to_rotation_matrix(),
            coordinates: [u, v, (t.z / (TYPICAL_DEPTH * focal_ratio)).ln()],
        }
    }
}

impl PoseRegressor {
    pub(super) fn new(head: PoseHead, feature_width: usize, device: &Device) -> Self {
        let n_outputs = match head {
            PoseHead::Anchors => 3 + N_ANCHORS * (1 + 6),
            PoseHead::Twist => 3 + 3,
        };
        Self {
            hidden: rectified_linear(feature_width, feature_width, device),
            output: LinearConfig::new(feature_width, n_outputs).init(device),
            head,
        }
    }

    /// Outputs `[b, m]` from the trunk's features `[b, width]`: (u, v, ρ), then what the head says.
    pub fn forward(&self, features: Tensor<2>) -> Tensor<2> {
        self.output.forward(relu(self.hidden.forward(features)))
    }

    /// The error of these outputs `[b, m]`, averaged over the batch.
    pub fn loss(&self, outputs: Tensor<2>, targets: &[PoseTarget]) -> Tensor<1> {
        let coordinates = rows(targets.iter().map(|target| target.coordinates), &outputs);
        let translation = (outputs.clone().slice(s![.., 0..3]) - coordinates).square();
        let rotation = outputs.slice(s![.., 3..]);
        let rotation = match self.head {
            PoseHead::Anchors => anchor_loss(rotation, targets),
            PoseHead::Twist => {
                let twists = targets.iter().map(|target| target.rotation.scaled_axis().into());
                let twists = rows::<3>(twists, &rotation);
                (rotation - twists).square().sum_dim(1).mean()
            }
        };
        rotation + translation.sum_dim(1).mean() * TRANSLATION_WEIGHT
    }

    /// The poses `crop_from_world` that one crop's outputs mean, with confidences, best first.
    pub fn hypotheses(&self, outputs: &[f32], focal_ratio: f32) -> Vec<(Isometry3<f32>, f32)> {
        let (coordinates, outputs) = outputs.split_at(3);
        let z = TYPICAL_DEPTH * focal_ratio * coordinates[2].exp();
        let [x, y] = [coordinates[0], coordinates[1]].map(|u| u * z / focal_ratio);
        let rotations = match self.head {
            PoseHead::Anchors => distinct(anchored_rotations(outputs)),
            PoseHead::Twist => {
                let twist = Vector3::new(outputs[0], outputs[1], outputs[2]);
                vec![(Rotation3::from_scaled_axis(twist), 1.0)]
            }
        };
        let pose = |rotation: Rotation3<f32>| {
            let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
            Isometry3::from_parts(Translation3::new(x, y, z), rotation)
        };
        rotations.into_iter().map(|(rotation, confidence)| (pose(rotation), confidence)).collect()
    }
}

/// Outputs `[b, 16 + 16 · 6]`: which anchor is nearest, and the rotations from it and the next.
fn anchor_loss(outputs: Tensor<2>, targets: &[PoseTarget]) -> Tensor<1> {
    let b = targets.len();
    let nearest: Vec<[usize; 2]> = targets.iter().map(|t| nearest_anchors(&t.rotation)).collect();

    let log_likelihoods = log_softmax(outputs.clone().slice(s![.., 0..N_ANCHORS]), 1);
    let residuals = outputs.slice(s![.., N_ANCHORS..]).reshape([b * N_ANCHORS, 6]);
    let flat = |rank: usize| -> Vec<i64> {
        nearest
            .iter()
            .enumerate()
            .map(|(i, anchors)| (i * N_ANCHORS + anchors[rank]) as i64)
            .collect()
    };
    // ‖D A − R‖ = ‖D − R Aᵀ‖.
    let rotation_loss = |rank: usize| {
        let predicted = residuals.clone().select(0, index_tensor(flat(rank), &residuals));
        let from_anchor = targets.iter().zip(&nearest).map(|(target, anchors)| {
            let delta = target.rotation * anchor(anchors[rank]).inverse();
            std::array::from_fn::<f32, 9, _>(|i| delta.matrix()[(i / 3, i % 3)])
        });
        let predicted = rotation_rows(predicted);
        let from_anchor = rows(from_anchor, &predicted);
        (predicted - from_anchor).square().sum_dim(1).mean()
    };
    let likelihoods: Tensor<1> = log_likelihoods.reshape([b * N_ANCHORS]);
    let class_loss = -likelihoods.clone().select(0, index_tensor(flat(0), &likelihoods)).mean();
    class_loss * ANCHOR_WEIGHT + rotation_loss(0) + rotation_loss(1) * SECOND_ANCHOR_WEIGHT
}

/// Gram–Schmidt: `[b, 6]` to rotation matrices, row by row, `[b, 9]`. Zero is the identity.
fn rotation_rows(residuals: Tensor<2>) -> Tensor<2> {
    let identity = Tensor::<2>::from_floats([[1., 0., 0., 0., 1., 0.]], &residuals.device());
    let residuals = residuals + identity;
    let first = normalised(residuals.clone().slice(s![.., 0..3]));
    let second = residuals.slice(s![.., 3..6]);
    let along = (first.clone() * second.clone()).sum_dim(1);
    let second = normalised(second - first.clone() * along);
    let third = first.clone().cross(second.clone(), 1);
    Tensor::cat(vec![first, second, third], 1)
}

fn normalised(vectors: Tensor<2>) -> Tensor<2> {
    let lengths = (vectors.clone().square().sum_dim(1) + 1e-12).sqrt();
    vectors / lengths
}

/// Every anchor's rotation and probability.
fn anchored_rotations(outputs: &[f32]) -> Vec<(Rotation3<f32>, f32)> {
    let (logits, residuals) = outputs.split_at(N_ANCHORS);
    let highest = logits.iter().copied().fold(f32::MIN, f32::max);
    let total: f32 = logits.iter().map(|logit| (logit - highest).exp()).sum();
    let rotations = residuals.as_chunks::<6>().0.iter().enumerate().map(|(k, r)| {
        let first = Vector3::new(r[0] + 1.0, r[1], r[2]).normalize();
        let second = Vector3::new(r[3], r[4] + 1.0, r[5]);
        let second = (second - first * first.dot(&second)).normalize();
        let rows = [first, second, first.cross(&second)].map(|row| row.transpose());
        Rotation3::from_matrix_unchecked(Matrix3::from_rows(&rows)) * anchor(k)
    });
    rotations.zip(logits).map(|(r, logit)| (r, (logit - highest).exp() / total)).collect()
}

/// Neighbouring anchors mostly agree on the pose between them: the surer one speaks for both.
fn distinct(mut rotations: Vec<(Rotation3<f32>, f32)>) -> Vec<(Rotation3<f32>, f32)> {
    let surest_first = |a: &(_, f32), b: &(_, f32)| b.1.total_cmp(&a.1);
    rotations.sort_by(surest_first);
    let mut kept: Vec<(Rotation3<f32>, f32)> = Vec::new();
    for (rotation, confidence) in rotations {
        match kept.iter_mut().find(|(other, _)| other.angle_to(&rotation) < SAME_POSE) {
            Some((_, sum)) => *sum += confidence,
            None => kept.push((rotation, confidence)),
        }
    }
    kept.sort_by(surest_first);
    kept
}

fn nearest_anchors(rotation: &Rotation3<f32>) -> [usize; 2] {
    let mut order: Vec<usize> = (0..N_ANCHORS).collect();
    let angle = |k: &usize| anchor(*k).angle_to(rotation);
    order.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    [order[0], order[1]]
}

/// `camera_from_world` of the k-th anchor.
fn anchor(k: usize) -> Rotation3<f32> {
    let azimuth = k as f32 / N_ANCHORS as f32 * std::f32::consts::TAU;
    orbit_rotation(azimuth, ANCHOR_ELEVATION, 0.0).to_rotation_matrix()
}

/// Host rows as a tensor `[b, n]` beside `like`.
fn rows<const N: usize>(rows: impl Iterator<Item = [f32; N]>, like: &Tensor<2>) -> Tensor<2> {
    let values: Vec<f32> = rows.flatten().collect();
    let b = values.len() / N;
    Tensor::from_data(TensorData::new(values, [b, N]), &like.device())
}

#[cfg(test)]
mod tests;
