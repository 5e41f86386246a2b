//! What is minimised, and how its terms add up.

use serde::{Deserialize, Serialize};

use super::unknowns::Parameterisation;
use crate::{
    loss::{SilhouetteLoss, SilhouetteNorm},
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
    /// Weight of the mean squared difference between the style and the likely one, in standard deviations.
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
            style_weight: 6.0,
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
