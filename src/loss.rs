//! What the reconstruction is judged by (Eq. 3, 5): colours that agree, silhouettes that match.

use burn::tensor::{Tensor, TensorData};

use crate::{data::ScalarImage, host::index_tensor, nearest_neighbours::NearestNeighbours};

/// Coverage above which a pixel belongs to the object.
pub const MASK_THRESHOLD: f32 = 0.5;

/// Charbonnier's loss of a squared residual, 2σ²(√(1 + r²/σ²) − 1): r² near zero, 2σ|r| far out.
pub fn charbonnier<const D: usize>(squared: Tensor<D>, scale: f32) -> Tensor<D> {
    let scale_squared = f64::from(scale * scale);
    ((squared / scale_squared + 1.0).sqrt() - 1.0) * (2.0 * scale_squared)
}

/// The pixels U_l1 of one frame's silhouette, ready to be matched with projected points.
pub struct Silhouette {
    /// Centres of the pixels inside.
    pub pixels: Vec<[f32; 2]>,
    /// For each pixel of the image, its index in `pixels`.
    pixel_idx: Vec<Option<u32>>,
    width: usize,
    height: usize,
    search: NearestNeighbours,
}

impl Silhouette {
    /// `None` when no pixel of the mask belongs to the object.
    pub fn new(mask: &ScalarImage) -> Option<Self> {
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let mut pixels = Vec::new();
        let mut pixel_idx = vec![None; width * height];
        for (u, v, coverage) in mask.enumerate_pixels() {
            if coverage[0] > MASK_THRESHOLD {
                pixel_idx[v as usize * width + u as usize] = Some(pixels.len() as u32);
                pixels.push([u as f32 + 0.5, v as f32 + 0.5]);
            }
        }
        if pixels.is_empty() {
            return None;
        }
        let search = NearestNeighbours::in_plane(pixels.iter().copied());
        Some(Self { pixels, pixel_idx, width, height, search })
    }

    /// The silhouette's pixel centre nearest to a location: its own pixel's, when that is inside.
    pub fn nearest(&self, location: [f32; 2]) -> [f32; 2] {
        let [u, v] = location;
        let in_frame = u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        let own = in_frame.then(|| self.pixel_idx[v as usize * self.width + u as usize]).flatten();
        self.pixels[own.unwrap_or_else(|| self.search.nearest_pixel(location)) as usize]
    }
}

/// A projected point, and the silhouette pixel that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct SilhouettePair {
    pub point_idx: u32,
    /// The pixel's centre.
    pub target: [f32; 2],
    pub weight: f32,
    /// Distance in pixels from which on the pair counts.
    pub tolerance: f32,
}

/// Pairs each silhouette pixel with its nearest projected point, and each point with its nearest
/// pixel; `weights` are those of the two directions.
///
/// So are `tolerances`, the distances in pixels up to which a pair counts as matched. Eq. 5 has none,
/// and then asks for points exactly at the centres of pixels, and for as many of them as there are
/// pixels. `visible` are indices into `projected`, and not empty.
pub fn silhouette_pairs(
    silhouette: &Silhouette,
    projected: &[[f32; 2]],
    visible: &[u32],
    weights: [f32; 2],
    tolerances: [f32; 2],
) -> Vec<SilhouettePair> {
    let mut pairs = Vec::new();
    let mut pair = |point_idx: u32, target: [f32; 2], direction: usize| {
        let ([u, v], tolerance) = (projected[point_idx as usize], tolerances[direction]);
        if (u - target[0]).powi(2) + (v - target[1]).powi(2) > tolerance * tolerance {
            pairs.push(SilhouettePair { point_idx, target, weight: weights[direction], tolerance });
        }
    };
    let search = NearestNeighbours::in_plane(visible.iter().map(|&i| projected[i as usize]));
    for &pixel in &silhouette.pixels {
        pair(visible[search.nearest_pixel(pixel) as usize], pixel, 0);
    }
    for &point_idx in visible {
        pair(point_idx, silhouette.nearest(projected[point_idx as usize]), 1);
    }
    pairs
}

/// The weighted squares of what distances exceed their tolerance by, over all pairs, in pixels², on
/// the graph: `[1]`.
///
/// `pixels` are the projected points `[b, n, 2]`; each list of pairs comes with its row of them.
pub fn silhouette_distances(
    pixels: Tensor<3>,
    pairs: &[(usize, Vec<SilhouettePair>)],
) -> Tensor<1> {
    let [b, n, _] = pixels.dims();
    let n_pairs: usize = pairs.iter().map(|(_, pairs)| pairs.len()).sum();
    let device = pixels.device().inner();
    if n_pairs == 0 {
        return Tensor::zeros([1], &device);
    }
    let all = || pairs.iter().flat_map(|(row, pairs)| pairs.iter().map(move |pair| (row, pair)));
    let rows = all().map(|(row, pair)| (row * n + pair.point_idx as usize) as i64);
    let rows = index_tensor(rows.collect(), &pixels);
    let column = |values: Vec<f32>| {
        let columns = values.len() / n_pairs;
        Tensor::<2>::from_data(TensorData::new(values, [n_pairs, columns]), &device)
    };
    let targets = column(all().flat_map(|(_, pair)| pair.target).collect());
    let weights = column(all().map(|(_, pair)| pair.weight).collect());
    let tolerances = column(all().map(|(_, pair)| pair.tolerance).collect());

    let offsets = pixels.reshape([b * n, 2]).select(0, rows) - targets;
    let squared = offsets.square().sum_dim(1); // [pairs, 1]
    // (d − τ)² = d² − τ (2 d − τ), whose derivative stays finite where τ = 0 and d = 0.
    let distances = (squared.clone() + tolerances.clone().equal_elem(0.0).float()).sqrt();
    let excess = squared - (distances * 2.0 - tolerances.clone()) * tolerances;
    (excess * weights).sum()
}
