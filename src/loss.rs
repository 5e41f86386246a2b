//! What the reconstruction is judged by (Eq. 3, 5): colours that agree, silhouettes that match.

use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

use crate::{
    pixel_grid::PixelGrid,
    silhouette::{Silhouette, Target},
};

/// Charbonnier's loss of a squared residual, 2σ²(√(1 + r²/σ²) − 1): r² near zero, 2σ|r| far out.
pub fn charbonnier<const D: usize>(squared: Tensor<D>, scale: f32) -> Tensor<D> {
    let scale_squared = f64::from(scale * scale);
    ((squared / scale_squared + 1.0).sqrt() - 1.0) * (2.0 * scale_squared)
}

/// What a silhouette's distance d costs, in pixels².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SilhouetteNorm {
    /// d², as Eq. 5 prints it.
    #[default]
    Squared,
    /// Charbonnier's loss, 2 s d from some pixels on.
    Unsquared,
    /// Geman and McClure's, s² d² / (d² + s²), at most s²: what is far off does not pull at all.
    Saturating,
}

/// A norm and its scale s in pixels, around which it turns from squares.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteLoss {
    pub norm: SilhouetteNorm,
    pub scale: f32,
}

impl SilhouetteLoss {
    /// Of squared distances in pixels².
    pub fn of<const D: usize>(&self, squared: Tensor<D>) -> Tensor<D> {
        let scale_squared = f64::from(self.scale * self.scale);
        match self.norm {
            SilhouetteNorm::Squared => squared,
            SilhouetteNorm::Unsquared => charbonnier(squared, self.scale),
            SilhouetteNorm::Saturating => {
                squared.clone() / (squared + scale_squared) * scale_squared
            }
        }
    }

    /// The derivative by the squared distance: the weight of its square in reweighted least squares.
    pub fn weight(&self, squared: f64) -> f64 {
        let relative = 1.0 + squared / f64::from(self.scale * self.scale);
        match self.norm {
            SilhouetteNorm::Squared => 1.0,
            SilhouetteNorm::Unsquared => relative.sqrt().recip(),
            SilhouetteNorm::Saturating => relative.powi(2).recip(),
        }
    }
}

/// A projected point, and the location of the silhouette that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct SilhouettePair {
    pub point_idx: u32,
    /// A pixel's centre, or of the outline.
    pub target: Target,
    pub weight: f32,
    /// Distance in pixels from which on the pair counts.
    pub tolerance: f32,
}

impl SilhouettePair {
    /// Squared distance in pixels from where its point is projected.
    fn squared(&self, projected: &[[f32; 2]]) -> f32 {
        self.target.squared(projected[self.point_idx as usize])
    }
}

/// What of a silhouette is matched, and how strictly.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteMatching {
    /// Measure to the outline at half coverage, a fraction of a pixel, where Eq. 5 only knows pixels.
    pub to_outline: bool,
    /// Weights of a pixel's distance to its point, and of a point's to its pixel.
    pub weights: [f32; 2],
    pub tolerances: SilhouetteTolerances,
    /// Share of the pixels, of the outline's samples and of the points whose distances, the largest of
    /// each, are left out.
    pub trim: f32,
}

/// Distances in pixels up to which something counts as matched. Eq. 5 has none, and then asks for points
/// exactly at the centres of pixels, and for as many of them as there are pixels.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteTolerances {
    /// From a sample of the outline to the point that reaches it.
    pub coverage: f32,
    /// From a pixel's centre to the point that covers it, and how far along the outline a point reaches
    /// it. Where the outline is matched, pixels inside only tell holes: one below the spacing of the
    /// points would hold each to a pixel, while the cloud may slide along under all of them, and solvers
    /// would hardly move.
    pub hole: f32,
    /// From a point to the inside.
    pub containment: f32,
}

/// Pairs each silhouette pixel with its nearest projected point, and each point with its nearest
/// pixel. `visible` are indices into `projected`, and not empty.
pub fn silhouette_pairs(
    silhouette: &Silhouette,
    projected: &[[f32; 2]],
    visible: &[u32],
    matching: &SilhouetteMatching,
) -> Vec<SilhouettePair> {
    let ([of_pixel, of_point], tolerances) = (matching.weights, matching.tolerances);
    let grid = PixelGrid::new(silhouette.size(), visible.iter().map(|&i| projected[i as usize]));
    let cover = |&pixel: &[f32; 2]| {
        let (point_idx, target) = (visible[grid.nearest(pixel) as usize], pixel.into());
        SilhouettePair { point_idx, target, weight: of_pixel, tolerance: tolerances.hole }
    };
    let reach = |sample: usize| {
        let segment = silhouette.segment(sample, tolerances.hole);
        let point_idx = visible[grid.nearest_to(&segment) as usize];
        let target = segment.nearest(projected[point_idx as usize]);
        let weight = of_pixel * Silhouette::OUTLINE_WEIGHT;
        SilhouettePair { point_idx, target, weight, tolerance: tolerances.coverage }
    };
    let contain = |&point_idx: &u32| {
        let at = projected[point_idx as usize];
        let target = match matching.to_outline {
            true => silhouette.nearest_inside(at),
            false => silhouette.nearest_pixel(at).into(),
        };
        SilhouettePair { point_idx, target, weight: of_point, tolerance: tolerances.containment }
    };
    let counted = |pairs: &mut dyn ExactSizeIterator<Item = SilhouettePair>| {
        let n_pairs = pairs.len();
        let beyond = pairs.filter(|pair| pair.squared(projected) > pair.tolerance * pair.tolerance);
        trimmed(beyond.collect(), (matching.trim * n_pairs as f32) as usize, projected)
    };
    let mut pairs = counted(&mut silhouette.pixels.iter().map(cover));
    if matching.to_outline {
        pairs.extend(counted(&mut (0..silhouette.outline.len()).map(reach)));
    }
    pairs.extend(counted(&mut visible.iter().map(contain)));
    pairs
}

/// All but the `n_left_out` pairs that lie farthest apart, in their order.
fn trimmed(
    mut pairs: Vec<SilhouettePair>,
    n_left_out: usize,
    projected: &[[f32; 2]],
) -> Vec<SilhouettePair> {
    if n_left_out >= pairs.len() {
        return Vec::new();
    }
    if n_left_out > 0 {
        let mut distances: Vec<f32> = pairs.iter().map(|pair| pair.squared(projected)).collect();
        let last = distances.len() - n_left_out - 1;
        let (_, &mut largest, _) = distances.select_nth_unstable_by(last, f32::total_cmp);
        pairs.retain(|pair| pair.squared(projected) <= largest);
    }
    pairs
}

/// The weighted losses of what distances exceed their tolerance by, over all pairs, in pixels², on the
/// graph: `[1]`.
///
/// `pixels` `[pairs, 2]` is where each pair's point lands.
pub fn silhouette_distances(
    pixels: Tensor<2>,
    pairs: &[SilhouettePair],
    loss: SilhouetteLoss,
) -> Tensor<1> {
    let device = pixels.device().inner();
    let column = |values: Vec<f32>| {
        let columns = values.len() / pairs.len();
        Tensor::<2>::from_data(TensorData::new(values, [pairs.len(), columns]), &device)
    };
    let targets = column(pairs.iter().flat_map(|pair| pair.target.at).collect());
    let tangents = column(pairs.iter().flat_map(|pair| pair.target.tangent).collect());
    let weights = column(pairs.iter().map(|pair| pair.weight).collect());
    let tolerances = column(pairs.iter().map(|pair| pair.tolerance).collect());

    let offsets = pixels - targets; // [pairs, 2]
    let along = (offsets.clone() * tangents.clone()).sum_dim(1); // [pairs, 1]
    let squared = (offsets - tangents * along).square().sum_dim(1);
    // (d − τ)² = d² − τ (2 d − τ), whose derivative stays finite where τ = 0 and d = 0.
    let distances = (squared.clone() + tolerances.clone().equal_elem(0.0).float()).sqrt();
    let excess = squared - (distances * 2.0 - tolerances.clone()) * tolerances;
    (loss.of(excess) * weights).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::ScalarImage;
    use image::Luma;

    /// Two pixels of a mask, a point in each, and points at 1 to 8 px to the right of them.
    #[test]
    fn trimming_leaves_out_the_points_that_are_farthest_off() {
        let mask = ScalarImage::from_fn(16, 4, |u, v| Luma([f32::from(u < 2 && v == 1)]));
        let silhouette = Silhouette::new(&mask).expect("two pixels");
        let projected: Vec<[f32; 2]> = (0..10).map(|i| [0.5 + i as f32, 1.5]).collect();
        let points: Vec<u32> = (0..10).rev().collect();
        let left = |trim: f32| -> Vec<u32> {
            let matching = SilhouetteMatching {
                to_outline: false,
                weights: [1.0; 2],
                tolerances: SilhouetteTolerances { coverage: 0.1, hole: 0.1, containment: 0.1 },
                trim,
            };
            let pairs = silhouette_pairs(&silhouette, &projected, &points, &matching);
            pairs.iter().map(|pair| pair.point_idx).collect()
        };
        assert_eq!(left(0.0), [9, 8, 7, 6, 5, 4, 3, 2]);
        // Shares are of all ten points, not of those that are off.
        assert_eq!(left(0.3), [6, 5, 4, 3, 2]);
        assert!(left(0.8).is_empty() && left(1.0).is_empty());
    }

    /// Both sides of iteratively reweighted least squares, by differences.
    #[test]
    fn a_weight_is_the_slope_of_its_loss() {
        let device = crate::device::Backend::Flex.device();
        for norm in [SilhouetteNorm::Squared, SilhouetteNorm::Unsquared, SilhouetteNorm::Saturating]
        {
            let loss = SilhouetteLoss { norm, scale: 1.5 };
            let of = |squared: f32| {
                loss.of(Tensor::<1>::from_floats([squared], &device)).into_scalar::<f32>()
            };
            for squared in [0.1, 1.0, 9.0] {
                let slope = (of(squared + 0.05) - of(squared - 0.05)) / 0.1;
                let weight = loss.weight(f64::from(squared)) as f32;
                assert!((slope - weight).abs() < 5e-3, "{norm:?} at {squared}: {slope}, {weight}");
            }
        }
    }
}
