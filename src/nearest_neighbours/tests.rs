//! Every answer against all points, without any search.

use super::*;
use crate::data::keyed_rng;
use rand::Rng;
use rayon::ThreadPoolBuilder;

const UNIT: [f32; 3] = [1.0; 3];

/// Neighbours may differ where distances tie; distances may not.
#[track_caller]
fn check_exact(queries: &[[f32; 3]], points: &[[f32; 3]]) {
    let search = NearestNeighbours::new(points);
    for (&query, &found) in queries.iter().zip(&nearest_neighbours(queries, points)) {
        let nearest = points.iter().map(|&p| squared_distance(query, p));
        let nearest = nearest.fold(f32::INFINITY, f32::min);
        for found in [found, search.nearest(query)] {
            assert_eq!(squared_distance(query, points[found as usize]), nearest, "{query:?}");
        }
    }
}

#[track_caller]
fn check_both_ways(a: &[[f32; 3]], b: &[[f32; 3]]) {
    check_exact(a, b);
    check_exact(b, a);
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

fn cloud(n_points: usize, seed: u64, scale: [f32; 3], offset: f32) -> Vec<[f32; 3]> {
    let mut rng = keyed_rng(seed, [0, 0]);
    let mut point = || scale.map(|scale| scale * rng.random_range(-0.5..0.5) + offset);
    (0..n_points).map(|_| point()).collect()
}

#[test]
fn clouds_of_any_size_match_brute_force() {
    let queries = cloud(40, 1, UNIT, 0.0);
    for n_points in [1, 2, 7, 8, 9, 63, 64, 65, 100, 511, 513, 4097, 5000] {
        check_both_ways(&queries, &cloud(n_points, 2, [1.0, 0.4, 0.3], 0.0));
    }
}

#[test]
fn clouds_that_are_apart_match_brute_force() {
    for (scale, offset) in [(1e-3, 2.0), (1e-3, 0.1), (1.0, 50.0), (1e-3, -1e4)] {
        check_both_ways(&cloud(200, 1, UNIT, 0.0), &cloud(500, 2, [scale; 3], offset));
    }
}

#[test]
fn flat_needle_and_collapsed_clouds_match_brute_force() {
    for scale in [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0; 3], [1.0, 1e-6, 1e-7]] {
        check_both_ways(&cloud(200, 1, UNIT, 0.1), &cloud(500, 2, scale, 0.0));
    }
}

#[test]
fn a_slanted_plane_matches_brute_force() {
    let plane = |seed: u64| -> Vec<_> {
        let slant = |[u, v, _]: [f32; 3]| [0.6 * u, 0.5 * v, 0.3 * u - 0.4 * v];
        cloud(500, seed, UNIT, 0.2).into_iter().map(slant).collect()
    };
    check_exact(&plane(1), &plane(2));
}

#[test]
fn points_that_repeat_match_brute_force() {
    let repeated = cloud(60, 1, UNIT, 0.0).repeat(9);
    check_both_ways(&repeated, &cloud(300, 2, UNIT, 0.0));
    check_exact(&repeated, &repeated);
}

#[test]
fn a_lattice_of_ties_matches_brute_force() {
    let lattice: Vec<_> = (0..512).map(|i| [i % 8, i / 8 % 8, i / 64].map(|x| x as f32)).collect();
    let centers: Vec<_> = lattice.iter().map(|p| p.map(|x| x + 0.5)).collect();
    check_both_ways(&lattice, &centers);
}

#[test]
fn two_far_clusters_match_brute_force() {
    let mut clusters = cloud(300, 1, [0.1; 3], -1e3);
    clusters.extend(cloud(300, 2, [0.1; 3], 1e3));
    check_both_ways(&clusters, &cloud(200, 3, UNIT, 0.0));
    check_exact(&clusters, &clusters);
}

#[test]
fn one_far_outlier_costs_no_exactness() {
    let mut points = cloud(2000, 3, [0.1; 3], 0.0);
    points.push([1e4, -1e4, 3.0]);
    check_both_ways(&cloud(200, 4, [0.2; 3], 0.0), &points);
}

#[test]
fn points_that_are_not_finite_are_never_found() {
    let (finite, queries) = (cloud(300, 1, UNIT, 0.0), cloud(100, 2, UNIT, 0.0));
    let mut points = finite.clone();
    for (k, lost) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        points.push([lost, 0.0, 0.1]);
        points.insert(0, [0.1, lost, lost]);
        let expected = nearest_neighbours(&queries, &finite);
        let expected: Vec<u32> = expected.iter().map(|idx| idx + k as u32 + 1).collect();
        assert_eq!(nearest_neighbours(&queries, &points), expected);
    }
}

#[test]
fn where_no_distance_is_finite_the_answer_is_some_point() {
    let lost = [[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [3e38, -3e38, 0.0]];
    let points = cloud(100, 1, UNIT, 0.0);
    assert!(nearest_neighbours(&lost, &points).iter().all(|&idx| idx < 100));
    assert!(nearest_neighbours(&points, &lost).iter().all(|&idx| idx < 3));
    assert_eq!(nearest_neighbours(&points, &lost[..2]), [0; 100]);
    let search = NearestNeighbours::new(&points);
    assert!(lost.iter().all(|&query| search.nearest(query) < 100));
    assert_eq!(nearest_neighbours(&[], &points), [0; 0]);
}

#[test]
fn a_lost_query_does_not_lead_the_next_ones_astray() {
    let mut queries = cloud(100, 1, UNIT, 0.0);
    queries[40] = [3e38, 3e38, -3e38];
    queries[41] = [-3e38; 3];
    check_exact(&queries, &cloud(300, 2, UNIT, 0.0));
}

#[test]
fn either_way_gives_what_both_give_on_any_number_of_threads() {
    let lattice: Vec<_> = (0..6000).map(|i| [i % 20, i / 20 % 20, i / 400]).collect();
    let a: Vec<_> = lattice.iter().map(|p| p.map(|x| x as f32)).collect();
    let b = cloud(5000, 1, [20.0; 3], 10.0);
    let expected = [nearest_neighbours(&a, &b), nearest_neighbours(&b, &a)];
    for n_threads in [1, 3] {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads start");
        assert_eq!(pool.install(|| mutual_neighbours(&a, &b)), expected);
    }
}

#[test]
fn pixels_match_brute_force() {
    let pixels: Vec<_> = cloud(600, 5, [128.0; 3], 64.0).iter().map(|p| [p[0], p[1]]).collect();
    let queries: Vec<_> = (0..40).map(|i| [i as f32 * 4.0 - 10.0, 130.0 - i as f32]).collect();
    let search = NearestNeighbours::in_plane(pixels.iter().copied());
    for query in &queries {
        let found = search.nearest_pixel(*query);
        let distance = |p: &[f32; 2]| (p[0] - query[0]).powi(2) + (p[1] - query[1]).powi(2);
        let nearest = pixels.iter().map(distance).fold(f32::INFINITY, f32::min);
        assert_eq!(distance(&pixels[found as usize]), nearest);
    }
}
