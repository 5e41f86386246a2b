//! What the reconstruction is judged by (Eq. 3, 5): colours that agree, silhouettes that match.

use burn::tensor::{Tensor, TensorData};

use crate::{pixel_grid::PixelGrid, silhouette::Silhouette};

/// Charbonnier's loss of a squared residual, 2σ²(√(1 + r²/σ²) − 1): r² near zero, 2σ|r| far out.
pub fn charbonnier<const D: usize>(squared: Tensor<D>, scale: f32) -> Tensor<D> {
    let scale_squared = f64::from(scale * scale);
    ((squared / scale_squared + 1.0).sqrt() - 1.0) * (2.0 * scale_squared)
}

/// A projected point, and the location of the silhouette that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct SilhouettePair {
    pub point_idx: u32,
    /// A pixel's centre, or of the outline.
    pub target: [f32; 2],
    pub weight: f32,
    /// Distance in pixels from which on the pair counts.
    pub tolerance: f32,
}

/// What of a silhouette is matched, and how strictly.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteMatching {
    /// Measure to the outline at half coverage, a fraction of a pixel, where Eq. 5 only knows pixels.
    pub to_outline: bool,
    /// Weights of a pixel's distance to its point, and of a point's to its pixel.
    pub weights: [f32; 2],
    /// Distances in pixels up to which either counts as matched. Eq. 5 has none, and then asks for
    /// points exactly at the centres of pixels, and for as many of them as there are pixels.
    pub tolerances: [f32; 2],
}

/// Pairs each silhouette pixel with its nearest projected point, and each point with its nearest
/// pixel. `visible` are indices into `projected`, and not empty.
pub fn silhouette_pairs(
    silhouette: &Silhouette,
    projected: &[[f32; 2]],
    visible: &[u32],
    matching: &SilhouetteMatching,
) -> Vec<SilhouettePair> {
    let mut pairs = Vec::new();
    let ([of_pixel, of_point], [coverage, containment]) = (matching.weights, matching.tolerances);
    let mut pair = |point_idx: u32, target: [f32; 2], weight: f32, tolerance: f32| {
        let [u, v] = projected[point_idx as usize];
        if (u - target[0]).powi(2) + (v - target[1]).powi(2) > tolerance * tolerance {
            pairs.push(SilhouettePair { point_idx, target, weight, tolerance });
        }
    };
    let grid = PixelGrid::new(silhouette.size(), visible.iter().map(|&i| projected[i as usize]));
    let mut cover = |location: [f32; 2], weight: f32| {
        pair(visible[grid.nearest(location) as usize], location, weight, coverage);
    };
    silhouette.pixels.iter().for_each(|&pixel| cover(pixel, of_pixel));
    if matching.to_outline {
        let weight = of_pixel * Silhouette::OUTLINE_WEIGHT;
        silhouette.outline.iter().for_each(|&location| cover(location, weight));
    }
    for &point_idx in visible {
        let at = projected[point_idx as usize];
        let target = match matching.to_outline {
            true => silhouette.nearest_inside(at),
            false => silhouette.nearest_pixel(at),
        };
        pair(point_idx, target, of_point, containment);
    }
    pairs
}

/// The weighted squares of what distances exceed their tolerance by, over all pairs, in pixels², on
/// the graph: `[1]`.
///
/// `pixels` `[pairs, 2]` is where each pair's point lands.
pub fn silhouette_distances(pixels: Tensor<2>, pairs: &[SilhouettePair]) -> Tensor<1> {
    let device = pixels.device().inner();
    let column = |values: Vec<f32>| {
        let columns = values.len() / pairs.len();
        Tensor::<2>::from_data(TensorData::new(values, [pairs.len(), columns]), &device)
    };
    let targets = column(pairs.iter().flat_map(|pair| pair.target).collect());
    let weights = column(pairs.iter().map(|pair| pair.weight).collect());
    let tolerances = column(pairs.iter().map(|pair| pair.tolerance).collect());

    let squared = (pixels - targets).square().sum_dim(1); // [pairs, 1]
    // (d − τ)² = d² − τ (2 d − τ), whose derivative stays finite where τ = 0 and d = 0.
    let distances = (squared.clone() + tolerances.clone().equal_elem(0.0).float()).sqrt();
    let excess = squared - (distances * 2.0 - tolerances.clone()) * tolerances;
    (excess * weights).sum()
}
