//! L = L_ph + λ L_CD (Eq. 6), with what later work added to make it well behaved.

use burn::tensor::{Device, Tensor, TensorData, s};

pub use super::objective_config::{ObjectiveConfig, Reduction};
use super::{
    correspondences::Correspondences,
    evaluation::Evaluation,
    observations::Observations,
    shape_model::ShapeModel,
    unknowns::{Leaves, Unknowns, flatten},
};
use crate::{
    camera::Pose,
    host::index_tensor,
    loss::{SilhouettePair, silhouette_distances},
};

/// The objective of one sequence under one shape model.
pub struct Objective<'a> {
    pub observations: &'a Observations,
    pub shape: &'a dyn ShapeModel,
    pub config: &'a ObjectiveConfig,
    /// Where the graph lives; it differentiates.
    pub device: Device,
}

/// A cloud and the cameras that see it, on the graph.
pub(super) struct Scene {
    pub points: Tensor<3>, // [1, n, 3], in the world
    /// One for each frame.
    pub poses: Pose,
    /// Log of the factor on the focal length, where it is an unknown: `[1, 1]`.
    pub log_focal: Option<Tensor<2>>,
}

/// L_ph and L_CD on the graph, unweighted, and what they compare.
struct Terms {
    photometric: Tensor<1>,
    silhouette: Tensor<1>,
    matches: Correspondences,
}

impl Objective<'_> {
    /// The objective over the reference frame and all targets, on images of one blur level.
    pub fn evaluate(&self, unknowns: &Unknowns, level: usize) -> Evaluation {
        self.evaluate_targets(unknowns, &all_targets(unknowns), level)
    }

    /// The objective over the reference frame and some targets.
    pub fn evaluate_targets(
        &self,
        unknowns: &Unknowns,
        targets: &[usize],
        level: usize,
    ) -> Evaluation {
        self.compare(unknowns, targets, level).0
    }

    /// [`evaluate`](Self::evaluate) without the gradient, which is left empty, and what was compared
    /// with what: the objective is linearised around that.
    pub fn value(&self, unknowns: &Unknowns, level: usize) -> (Evaluation, Correspondences) {
        let device = self.device.clone().inner();
        Objective { device, ..*self }.compare(unknowns, &all_targets(unknowns), level)
    }

    fn compare(
        &self,
        unknowns: &Unknowns,
        targets: &[usize],
        level: usize,
    ) -> (Evaluation, Correspondences) {
        let leaves = unknowns.leaves(&self.device);
        let points = self.shape.points(leaves.style.clone());
        let terms = self.terms(unknowns, &leaves, points, targets, level);
        let scalar = |tensor: &Tensor<1>| tensor.clone().inner().into_scalar::<f64>();
        let (photometric, silhouette) = (scalar(&terms.photometric), scalar(&terms.silhouette));
        let mut objective = terms.photometric * self.config.photometric_weight
            + terms.silhouette * self.config.silhouette_weight;
        if self.config.style_weight > 0.0 && !unknowns.style().is_empty() {
            let likely = TensorData::new(unknowns.likely_style().to_vec(), leaves.style.dims());
            let likely = Tensor::from_data(likely, &leaves.style.device().inner());
            let deviation = (leaves.style.clone() - likely).square().mean();
            objective = objective + deviation * self.config.style_weight;
        }
        let values = [scalar(&objective), photometric, silhouette];
        let gradient = match objective.is_tracked() {
            true => flatten(&leaves, &objective.backward()),
            false => Vec::new(),
        };
        let evaluation = Evaluation::new(values, &terms.matches, gradient);
        (evaluation, terms.matches)
    }

    /// The terms over the reference frame and some targets, for a cloud `[1, n, 3]`.
    fn terms(
        &self,
        unknowns: &Unknowns,
        leaves: &Leaves,
        points_in_world: Tensor<3>,
        targets: &[usize],
        level: usize,
    ) -> Terms {
        let frames: Vec<usize> = std::iter::once(0).chain(targets.iter().copied()).collect();
        let frame_idx = frames.iter().map(|&frame| frame as i64).collect();
        let poses = unknowns.poses(leaves).select(index_tensor(frame_idx, &points_in_world));
        let intrinsics = unknowns.intrinsics(&self.observations.intrinsics);
        let cloud = (&points_in_world, &poses, &intrinsics);
        let mut matches =
            Correspondences::new(self.observations, frames, cloud, self.config, level);
        let scene = Scene { points: points_in_world, poses, log_focal: leaves.log_focal.clone() };
        let (photometric, exposures) = self.photometric(&matches, &scene, level);
        matches.exposures = exposures;
        Terms { photometric, silhouette: self.silhouette(&matches, &scene), matches }
    }

    /// L_CD (Eq. 5), over the frames that have a silhouette.
    fn silhouette(&self, matches: &Correspondences, scene: &Scene) -> Tensor<1> {
        let points = &scene.points;
        let of_frame = |(frame, pairs): &(usize, Vec<SilhouettePair>)| {
            let pose = scene.poses.clone().select(index_tensor(vec![*frame as i64], points));
            let point_idx = pairs.iter().map(|pair| i64::from(pair.point_idx)).collect();
            let pixels = self.pixels(scene, point_idx, &pose); // [1, pairs, 2]
            silhouette_distances(pixels.squeeze_dim(0), pairs, self.config.silhouette_loss())
        };
        let paired = matches.pairs.iter().filter(|(_, pairs)| !pairs.is_empty());
        let sum = paired.map(of_frame).reduce(|sum, distances| sum + distances);
        let sum = sum.unwrap_or_else(|| Tensor::zeros([1], &points.device()));
        sum / matches.pairs.len().max(1) as f32
    }

    /// Where some points land in each view, `[views, points, 2]`.
    pub(super) fn pixels(&self, scene: &Scene, point_idx: Vec<i64>, poses: &Pose) -> Tensor<3> {
        let points = scene.points.clone().select(1, index_tensor(point_idx, &scene.points));
        let mut in_camera = poses.camera_from_world(points);
        if let Some(log_focal) = &scene.log_focal {
            // To project with k f is to project [k x, k y, z] with f.
            let factor = log_focal.clone().exp().unsqueeze_dim::<3>(0); // [1, 1, 1]
            let [b, n, _] = in_camera.dims();
            let depth = in_camera.clone().slice(s![.., .., 2..3]);
            let sideways = in_camera.slice(s![.., .., 0..2]) * factor.expand([b, n, 2]);
            in_camera = Tensor::cat(vec![sideways, depth], 2);
        }
        self.observations.intrinsics.project(in_camera).pixels
    }
}

fn all_targets(unknowns: &Unknowns) -> Vec<usize> {
    (1..unknowns.n_frames()).collect()
}
