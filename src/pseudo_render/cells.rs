//! Points as they are: scatter-max of inverse depth, then max-pooling (Lin et al. 2018).
//!
//! They up-scale the plane five times, which leaves holes between the points of a sparse cloud, through
//! which the hidden side shows. Here its cells follow the spacing of the points.

use burn::tensor::{IndexingUpdateOp, Int, Tensor, module::max_pool2d, ops::MaxPoolOptions, s};

use super::PseudoRenderConfig;
use crate::camera::{NEAR, Projection};

/// Bound on [`nearness`].
const MAX_NEARNESS: f32 = 4.0;

/// For each view, the points that nothing in the cells around them hides.
///
/// `projection` holds b views of one cloud, in images of `size` = [width, height] pixels.
pub(super) fn visible_points(
    projection: &Projection,
    size: [usize; 2],
    config: &PseudoRenderConfig,
) -> Vec<Vec<u32>> {
    let pixels = projection.pixels.clone().inner(); // [b, n, 2]
    let depth = projection.depth.clone().inner(); // [b, n, 1]
    let [b, n, _] = pixels.dims();
    let [width, height] = size.map(|side| side as f32);
    let cell_size = config.cell_size * (width * height / n as f32).sqrt();
    let plane = [width, height].map(|side| (side / cell_size).ceil() as usize);

    let cell_sizes = nearness(depth.clone()) * cell_size; // [b, 1, 1]
    let cells = cells(pixels, depth.clone(), size, cell_sizes, plane); // [b · n]
    let inverse_depth = depth.clamp_min(NEAR).recip().reshape([b * n]);
    let nearest = nearest_in_window(cells.clone(), inverse_depth.clone(), b, plane, config);
    let nearest = nearest.gather(0, cells); // zero in the trash cell
    let in_frame = nearest.clone().greater_elem(0.0);
    // 1/z ≥ 1/(z_nearest + tolerance), exact for the nearest point itself.
    let threshold = nearest.clone() / (nearest * config.cell_tolerance + 1.0);
    let visible = inverse_depth.greater_equal(threshold).bool_and(in_frame);

    let visible = visible.into_data().try_into_vec::<bool>().expect("a mask");
    let of_view = |view: &[bool]| (0..n as u32).filter(|&i| view[i as usize]).collect();
    visible.chunks(n).map(of_view).collect()
}

/// How many times nearer the nearest points are than the mean, `[b, 1, 1]`: so many times wider
/// apart do they land, and close to the camera the hidden side would show between them.
fn nearness(depth: Tensor<3>) -> Tensor<3> {
    let mean = depth.clone().mean_dim(1);
    let deviation = (depth - mean.clone()).square().mean_dim(1).sqrt();
    // Few points lie nearer than two deviations; a bound, for views from within the cloud.
    let nearest = (mean.clone() - deviation * 2.0) / mean;
    nearest.clamp(1.0 / MAX_NEARNESS, 1.0).recip()
}

/// The cell of each point on its view's plane, as one index over all planes, `[b · n]`.
///
/// A plane ends with a trash cell, for points out of the frame or behind the camera.
fn cells(
    pixels: Tensor<3>,
    depth: Tensor<3>,
    size: [usize; 2],
    cell_sizes: Tensor<3>,
    [columns, rows]: [usize; 2],
) -> Tensor<1, Int> {
    let [b, n, _] = pixels.dims();
    let device = pixels.device();
    let limits = Tensor::<3>::from_floats([[[size[0] as f32, size[1] as f32]]], &device);
    let inside = pixels.clone().greater_equal_elem(0.0).bool_and(pixels.clone().lower(limits));
    let inside = inside.all_dim(2).bool_and(depth.greater_elem(NEAR));

    let cell = (pixels / cell_sizes).mask_fill(inside.clone().bool_not().expand([b, n, 2]), 0.0);
    let cell = cell.floor().int();
    let cell = cell.clone().slice(s![.., .., 1..2]) * columns as i64 + cell.slice(s![.., .., 0..1]);
    let trash = (columns * rows) as i64;
    let cell = cell.mask_fill(inside.bool_not(), trash);
    let plane = Tensor::arange(0..b as i64, &device).reshape([b, 1, 1]) * (trash + 1);
    (cell + plane).reshape([b * n])
}

/// Scatter-max of inverse depth onto the planes, then max-pool: `[b · (cells + 1)]`.
fn nearest_in_window(
    cells: Tensor<1, Int>,
    inverse_depth: Tensor<1>,
    b: usize,
    [columns, rows]: [usize; 2],
    config: &PseudoRenderConfig,
) -> Tensor<1> {
    let n_cells = columns * rows;
    let planes = Tensor::<1>::zeros([b * (n_cells + 1)], &inverse_depth.device());
    let planes = planes.scatter(0, cells, inverse_depth, IndexingUpdateOp::Max);
    let planes = planes.reshape([b, n_cells + 1]);
    let trash = planes.clone().slice(s![.., n_cells..]).zeros_like();
    let planes = planes.slice(s![.., ..n_cells]).reshape([b, 1, rows, columns]);
    let pool = MaxPoolOptions::new([config.pool_size; 2])
        .with_stride([1; 2])
        .with_padding([config.pool_size / 2; 2]);
    let planes = max_pool2d(planes, pool).reshape([b, n_cells]);
    Tensor::cat(vec![planes, trash], 1).reshape([b * (n_cells + 1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{camera::Intrinsics, data::keyed_rng, device::Backend, host::host_values};
    use rand::Rng;

    const SIZE: [usize; 2] = [48, 32];

    fn project(points_in_camera: &[[f32; 3]]) -> Projection {
        let device = Backend::Flex.device();
        let camera = Intrinsics { focal: [40.0, 40.0], center: [24.0, 16.0] };
        let points = points_in_camera.as_flattened();
        let points = Tensor::<1>::from_floats(points, &device).reshape([1, -1, 3]);
        camera.project(points)
    }

    /// The definition, pair by pair: seen unless a point in the window lies further in front.
    fn by_brute_force(projection: &Projection, config: &PseudoRenderConfig) -> Vec<u32> {
        let pixels = host_values(&projection.pixels);
        let depth = host_values(&projection.depth);
        let spacing = (SIZE[0] as f32 * SIZE[1] as f32 / depth.len() as f32).sqrt();
        let mean = depth.iter().sum::<f32>() / depth.len() as f32;
        let variance = depth.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / depth.len() as f32;
        let nearness = (1.0 - 2.0 * variance.sqrt() / mean).clamp(1.0 / MAX_NEARNESS, 1.0).recip();
        let cell_size = config.cell_size * spacing * nearness;
        let in_frame = |i: usize| {
            let [u, v] = [pixels[2 * i], pixels[2 * i + 1]];
            let inside = u >= 0.0 && v >= 0.0 && u < SIZE[0] as f32 && v < SIZE[1] as f32;
            inside && depth[i] > NEAR
        };
        let cell = |i: usize| [pixels[2 * i], pixels[2 * i + 1]].map(|x| (x / cell_size) as i32);
        let hides = |j: usize, i: usize| {
            let apart = (cell(i)[0] - cell(j)[0]).abs().max((cell(i)[1] - cell(j)[1]).abs());
            let in_front = 1.0 / depth[i] < 1.0 / (depth[j] + config.cell_tolerance);
            in_frame(j) && apart <= (config.pool_size / 2) as i32 && in_front
        };
        let n = depth.len();
        let seen = |&i: &usize| in_frame(i) && !(0..n).any(|j| hides(j, i));
        (0..n).filter(seen).map(|i| i as u32).collect()
    }

    fn random_points(seed: u64) -> Vec<[f32; 3]> {
        let mut rng = keyed_rng(seed, [0, 0]);
        // Some lie out of the frame and behind the camera, and many at the same few depths.
        let mut point = || {
            let depth = rng.random_range(-1..8) as f32 * 0.25 + 0.5;
            [rng.random_range(-1.0..1.0), rng.random_range(-0.8..0.8), depth]
        };
        (0..600).map(|_| point()).collect()
    }

    #[test]
    fn the_visible_set_matches_a_brute_force_z_buffer() {
        for (seed, pool_size, cell_tolerance) in [(1, 1, 0.0), (2, 3, 0.0), (3, 3, 0.3)] {
            let cell_size = 2.0;
            let config =
                PseudoRenderConfig { cell_size, pool_size, cell_tolerance, ..Default::default() };
            let projection = project(&random_points(seed));
            let expected = by_brute_force(&projection, &config);
            assert_eq!(visible_points(&projection, SIZE, &config), [expected]);
        }
    }

    #[test]
    fn points_at_equal_depth_are_equally_visible() {
        let config = PseudoRenderConfig { cell_tolerance: 0.0, ..Default::default() };
        let projection = project(&[[0.0, 0.0, 2.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.1]]);
        assert_eq!(visible_points(&projection, SIZE, &config), [[0, 1]]);
    }

    #[test]
    fn nothing_is_visible_behind_the_camera_or_out_of_the_frame() {
        let projection = project(&[[0.0, 0.0, -2.0], [9.0, 0.0, 2.0], [0.0, f32::NAN, 1.0]]);
        assert!(visible_points(&projection, SIZE, &PseudoRenderConfig::default())[0].is_empty());
    }

    #[test]
    fn views_do_not_see_each_others_points() {
        let (a, b) = (project(&random_points(4)), project(&random_points(5)));
        let config = PseudoRenderConfig::default();
        let apart = [&a, &b].map(|view| visible_points(view, SIZE, &config).remove(0));
        let together = Projection {
            pixels: Tensor::cat(vec![a.pixels, b.pixels], 0),
            depth: Tensor::cat(vec![a.depth, b.depth], 0),
        };
        assert_eq!(visible_points(&together, SIZE, &config), apart);
    }
}
