//! L = L_ph + λ L_CD (Eq. 6), with what later work added to make it well behaved.

use burn::tensor::{Device, Tensor, s};
use serde::{Deserialize, Serialize};

use super::{
    correspondences::Correspondences,
    evaluation::Evaluation,
    observations::Observations,
    shape_model::ShapeModel,
    unknowns::{Leaves, Parameterisation, Unknowns, flatten},
};
use crate::{
    camera::Pose,
    host::index_tensor,
    loss::{SilhouetteLoss, SilhouetteNorm, SilhouettePair, silhouette_distances},
    pseudo_render::{Footprint, PseudoRenderConfig},
};

/// How terms add up over points, pixels and frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reduction {
    /// Sums, as Eq. 3 and 5 print them.
    Sum,
    /// Means, so that the cost does not fall when points turn away.
    #[default]
    Mean,
}

/// What is minimised. The defaults are ours; [`ObjectiveConfig::paper`] is Eq. 6.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectiveConfig {
    /// How Δp_l acts on p_0 (Eq. 4).
    pub parameterisation: Parameterisation,
    pub reduction: Reduction,
    /// Weight of L_ph.
    pub photometric_weight: f32,
    /// Charbonnier scale of a colour difference, RGB in [0, 1]; 0 takes plain squares.
    pub robust_scale: f32,
    /// Find the focal length, too: one factor on those given. Perspective alone tells it from distance:
    /// even a known shape holds it only to some per cent, unless it is near.
    pub refine_focal: bool,
    /// Take each target frame to be exposed anew, and find the one gain and bias, shared by its channels,
    /// with which its colours agree best with the reference's.
    pub solve_exposure: bool,
    /// Compare colours only where both points fall inside their frames' masks, where there are any.
    pub within_masks: bool,
    /// Compare colours only where the target frame, too, sees the point.
    pub target_occlusion: bool,
    /// λ, the weight of L_CD.
    pub silhouette_weight: f32,
    /// Distance below which a silhouette's outline counts as reached by a point, in units of
    /// √(image area / N), the spacing if the points filled the image.
    pub coverage_tolerance: f32,
    /// Distance below which a silhouette's pixel counts as covered by a point, and along the outline
    /// below which a point reaches it, in the same units.
    pub hole_tolerance: f32,
    /// Distance in pixels below which a point counts as inside the silhouette.
    pub containment_tolerance: f32,
    /// How much all three tolerances grow with each pixel of blur, in pixels: what is seen coarsely need
    /// only fit coarsely.
    pub tolerance_per_blur: f32,
    /// Measure to the silhouette's outline, to a fraction of a pixel, instead of to pixels' centres.
    pub silhouette_outline: bool,
    /// What a distance beyond its tolerance costs.
    pub silhouette_norm: SilhouetteNorm,
    /// Distance in pixels around which a norm that is no square turns from one.
    pub silhouette_scale: f32,
    /// Share of each frame's pixels, of the samples of its outline and of its points whose distances,
    /// the largest of each, are left out: masks may be wrong in parts.
    pub silhouette_trim: f32,
    /// Let the reference frame's silhouette count, and average over L frames instead of L − 1.
    pub silhouette_of_reference: bool,
    /// Let hidden points count in the silhouette, too: they lie inside it as well, and close the
    /// gaps between the visible ones.
    pub silhouette_of_hidden_points: bool,
    /// Weight of the mean squared style: the whitened style is a unit Gaussian.
    pub style_weight: f32,
    pub pseudo_render: PseudoRenderConfig,
}

impl Default for ObjectiveConfig {
    fn default() -> Self {
        Self {
            parameterisation: Parameterisation::ObjectCentred,
            reduction: Reduction::Mean,
            photometric_weight: 1000.0,
            robust_scale: 0.05,
            refine_focal: false,
            solve_exposure: false,
            within_masks: true,
            target_occlusion: true,
            silhouette_weight: 1000.0,
            coverage_tolerance: 0.0,
            hole_tolerance: 1.2,
            containment_tolerance: 0.0,
            tolerance_per_blur: 0.3,
            silhouette_outline: true,
            silhouette_norm: SilhouetteNorm::Squared,
            silhouette_scale: 1.0,
            silhouette_trim: 0.0,
            silhouette_of_reference: true,
            silhouette_of_hidden_points: true,
            style_weight: 0.2,
            pseudo_render: PseudoRenderConfig::default(),
        }
    }
}

impl ObjectiveConfig {
    pub(super) fn silhouette_loss(&self) -> SilhouetteLoss {
        SilhouetteLoss { norm: self.silhouette_norm, scale: self.silhouette_scale }
    }

    /// Eq. 6 as printed: sums of squares, λ = 0.01, Δp_l about the camera.
    pub fn paper() -> Self {
        Self {
            parameterisation: Parameterisation::CameraCentred,
            reduction: Reduction::Sum,
            photometric_weight: 1.0,
            robust_scale: 0.0,
            refine_focal: false,
            solve_exposure: false,
            within_masks: false,
            target_occlusion: false,
            silhouette_weight: 0.01,
            coverage_tolerance: 0.0,
            hole_tolerance: 0.0,
            containment_tolerance: 0.0,
            tolerance_per_blur: 0.0,
            silhouette_outline: false,
            silhouette_norm: SilhouetteNorm::Squared,
            silhouette_scale: 1.0,
            silhouette_trim: 0.0,
            silhouette_of_reference: false,
            silhouette_of_hidden_points: false,
            style_weight: 0.0,
            pseudo_render: PseudoRenderConfig {
                footprint: Footprint::Cell,
                ..PseudoRenderConfig::default()
            },
        }
    }
}

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
            let deviation = leaves.style.clone().square().mean();
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
