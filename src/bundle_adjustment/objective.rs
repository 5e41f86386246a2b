//! L = L_ph + λ L_CD (Eq. 6), with what later work added to make it well behaved.

use burn::tensor::{Device, Tensor, TensorData, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    observations::Observations,
    shape_model::ShapeModel,
    unknowns::{Leaves, Parameterisation, Unknowns, flatten},
};
use crate::{
    host::{host_pixels, index_tensor},
    loss::{charbonnier, silhouette_distances, silhouette_pairs},
    pseudo_render::{PseudoRenderConfig, visible_points},
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
    /// Compare colours only where both points fall inside their frames' masks.
    pub within_masks: bool,
    /// Compare colours only where the target frame, too, sees the point.
    pub target_occlusion: bool,
    /// λ, the weight of L_CD.
    pub silhouette_weight: f32,
    /// Distance in pixels below which points and silhouette count as matched.
    pub silhouette_tolerance: f32,
    /// Let the reference frame's silhouette count, and average over L frames instead of L − 1.
    pub silhouette_of_reference: bool,
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
            robust_scale: 0.1,
            within_masks: true,
            target_occlusion: true,
            silhouette_weight: 10.0,
            silhouette_tolerance: 0.7,
            silhouette_of_reference: true,
            style_weight: 1.0,
            pseudo_render: PseudoRenderConfig::default(),
        }
    }
}

impl ObjectiveConfig {
    /// Eq. 6 as printed: sums of squares, λ = 0.01, Δp_l about the camera.
    pub fn paper() -> Self {
        Self {
            parameterisation: Parameterisation::CameraCentred,
            reduction: Reduction::Sum,
            photometric_weight: 1.0,
            robust_scale: 0.0,
            within_masks: false,
            target_occlusion: false,
            silhouette_weight: 0.01,
            silhouette_tolerance: 0.0,
            silhouette_of_reference: false,
            style_weight: 0.0,
            pseudo_render: PseudoRenderConfig::default(),
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

/// L_ph and L_CD on the graph, unweighted, and the number of points that the reference sees.
pub struct Terms {
    pub photometric: Tensor<1>,
    pub silhouette: Tensor<1>,
    pub n_visible: usize,
}

/// The objective and its gradient at some unknowns, on the host.
#[derive(Clone, Debug)]
pub struct Evaluation {
    pub objective: f64,
    pub photometric: f64,
    pub silhouette: f64,
    pub n_visible: usize,
    /// In the order of [`Unknowns::values`].
    pub gradient: Vec<f64>,
}

impl Objective<'_> {
    /// The objective over the reference frame and all targets, on images of one blur level.
    pub fn evaluate(&self, unknowns: &Unknowns, level: usize) -> Evaluation {
        let targets: Vec<usize> = (1..unknowns.n_frames()).collect();
        self.evaluate_targets(unknowns, &targets, level)
    }

    /// The objective over the reference frame and some targets.
    pub fn evaluate_targets(
        &self,
        unknowns: &Unknowns,
        targets: &[usize],
        level: usize,
    ) -> Evaluation {
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
        Evaluation {
            objective: scalar(&objective),
            photometric,
            silhouette,
            n_visible: terms.n_visible,
            gradient: match objective.is_tracked() {
                true => flatten(&leaves, &objective.backward()),
                false => vec![0.0; unknowns.values.len()],
            },
        }
    }

    /// The terms over the reference frame and some targets, for a cloud `[1, n, 3]`.
    pub fn terms(
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
        let points_in_camera = poses.camera_from_world(points_in_world);
        let projection = self.observations.intrinsics.project(points_in_camera);
        let visible =
            visible_points(&projection, self.observations.size, &self.config.pseudo_render);
        let host_pixels = host_pixels(&projection.pixels);
        let pixels = projection.pixels; // [1 + t, n, 2]
        Terms {
            photometric: self.photometric(&frames, pixels.clone(), &host_pixels, &visible, level),
            silhouette: self.silhouette(&frames, pixels, &host_pixels, &visible),
            n_visible: visible[0].len(),
        }
    }

    /// L_ph (Eq. 3), over the points that the reference frame sees.
    fn photometric(
        &self,
        frames: &[usize],
        pixels: Tensor<3>,
        host_pixels: &[Vec<[f32; 2]>],
        visible: &[Vec<u32>],
        level: usize,
    ) -> Tensor<1> {
        let [_, n, _] = pixels.dims();
        let n_targets = frames.len() - 1;
        let seen = &visible[0];
        if n_targets == 0 || seen.is_empty() {
            // Nothing to compare is the worst that can be, not the best: every channel of every
            // point is as wrong as colours can be.
            let worst = 3.0 * n_targets as f32;
            let worst =
                if self.config.reduction == Reduction::Sum { worst * n as f32 } else { 3.0 };
            let worst = if n_targets == 0 { 0.0 } else { worst };
            return Tensor::from_floats([worst], &pixels.device());
        }

        let seen_idx = index_tensor(seen.iter().map(|&i| i64::from(i)).collect(), &pixels);
        let colors =
            self.observations.images[level].sample_bilinear(frames, pixels.select(1, seen_idx));
        let residuals = colors.clone().slice(s![0..1]) - colors.slice(s![1..]); // [t, m, 3]
        let mut squared = residuals.square().sum_dim(2).squeeze_dim::<2>(2);
        if self.config.robust_scale > 0.0 {
            squared = charbonnier(squared, self.config.robust_scale);
        }
        let mut n_compared = (n_targets * seen.len()) as f32;
        if self.config.within_masks || self.config.target_occlusion {
            let weights = self.comparable(frames, host_pixels, visible);
            n_compared = weights.iter().sum::<f32>().max(1.0);
            let weights = TensorData::new(weights, [n_targets, seen.len()]);
            squared = squared * Tensor::from_data(weights, &self.device.clone().inner());
        }
        match self.config.reduction {
            Reduction::Sum => squared.sum(),
            Reduction::Mean => squared.sum() / n_compared,
        }
    }

    /// 1 where a target's colour may be compared with the reference's, else 0: `[t · m]`.
    fn comparable(
        &self,
        frames: &[usize],
        host_pixels: &[Vec<[f32; 2]>],
        visible: &[Vec<u32>],
    ) -> Vec<f32> {
        let of_target = |t: usize| {
            let mut occluded = vec![self.config.target_occlusion; host_pixels[t].len()];
            visible[t].iter().for_each(|&i| occluded[i as usize] = false);
            let in_masks = move |i: usize| {
                let inside = |f: usize| self.observations.in_mask(frames[f], host_pixels[f][i]);
                !self.config.within_masks || (inside(0) && inside(t))
            };
            visible[0]
                .iter()
                .map(move |&i| i as usize)
                .map(move |i| if !occluded[i] && in_masks(i) { 1.0 } else { 0.0 })
        };
        (1..frames.len()).flat_map(of_target).collect()
    }

    /// L_CD (Eq. 5), averaged over the frames that have a silhouette.
    fn silhouette(
        &self,
        frames: &[usize],
        pixels: Tensor<3>,
        host_pixels: &[Vec<[f32; 2]>],
        visible: &[Vec<u32>],
    ) -> Tensor<1> {
        // One frame alone has nothing but its own silhouette.
        let first = usize::from(!self.config.silhouette_of_reference && frames.len() > 1);
        let everything: Vec<u32> = (0..host_pixels[0].len() as u32).collect();
        let pairs: Vec<_> = (first..frames.len())
            .into_par_iter()
            .filter_map(|f| {
                let silhouette = self.observations.silhouettes[frames[f]].as_ref()?;
                // Where nothing is seen, every point is called back.
                let visible = if visible[f].is_empty() { &everything } else { &visible[f] };
                let weights = match self.config.reduction {
                    Reduction::Sum => [1.0; 2],
                    Reduction::Mean => {
                        [silhouette.pixels.len(), visible.len()].map(|count| 1.0 / count as f32)
                    }
                };
                let tolerance = self.config.silhouette_tolerance;
                let pixels = &host_pixels[f];
                Some((f, silhouette_pairs(silhouette, pixels, visible, weights, tolerance)))
            })
            .collect();
        let n_frames = pairs.len().max(1) as f32;
        silhouette_distances(pixels, &pairs) / n_frames
    }
}
