//! The same numbers by plain loops, from written files alone.

use std::path::Path;

use super::support::{Matrix, cloud, matrices};

/// Degrees between two rotations, by the trace.
fn degrees(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> f64 {
    let mut trace = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            trace += a[i][j] * b[i][j];
        }
    }
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

/// Rotation and translation from world to camera of a matrix the other way.
fn inverse(matrix: &Matrix) -> ([[f64; 3]; 3], [f64; 3]) {
    let mut rotation = [[0.0; 3]; 3];
    let mut translation = [0.0; 3];
    for i in 0..3 {
        for j in 0..3 {
            rotation[i][j] = matrix[j][i];
            translation[i] -= matrix[j][i] * matrix[j][3];
        }
    }
    (rotation, translation)
}

/// a bᵀ
fn relative(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut product = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                product[i][j] += a[i][k] * b[j][k];
            }
        }
    }
    product
}

/// Names and values of the pose errors of an estimate.
pub fn pose_errors(estimate: &Path, truth: &Path) -> Vec<(&'static str, f64)> {
    let found: Vec<_> = matrices(estimate).iter().map(inverse).collect();
    let truth: Vec<_> = matrices(truth).iter().map(inverse).collect();
    let n = truth.len();
    assert_eq!(found.len(), n);
    let mut angles = Vec::new();
    let (mut shift, mut along, mut squared) = (0.0, 0.0, 0.0);
    for l in 0..n {
        angles.push(degrees(&found[l].0, &truth[l].0));
        let mut distance = 0.0;
        for i in 0..3 {
            distance += (found[l].1[i] - truth[l].1[i]).powi(2);
            along += found[l].1[i] * truth[l].1[i];
            squared += found[l].1[i].powi(2);
        }
        shift += distance.sqrt() / n as f64;
    }
    let mut scaled = 0.0;
    for l in 0..n {
        let mut distance = 0.0;
        for i in 0..3 {
            distance += (found[l].1[i] * along / squared - truth[l].1[i]).powi(2);
        }
        scaled += distance.sqrt() / n as f64;
    }
    let (mut pairs, mut of_reference) = (Vec::new(), 0.0);
    for to in 1..n {
        for from in 0..to {
            let turns = [&found, &truth].map(|poses| relative(&poses[to].0, &poses[from].0));
            let error = degrees(&turns[0], &turns[1]);
            pairs.push(error);
            if from == 0 {
                of_reference += error / (n - 1) as f64;
            }
        }
    }
    let share =
        |most: f64| pairs.iter().filter(|error| **error < most).count() as f64 / pairs.len() as f64;
    let area = |errors: &[f64]| {
        // Under the curve of shares: a sum over thin slices.
        let slices = 30_000;
        let mut sum = 0.0;
        for slice in 0..slices {
            let threshold = 30.0 * (slice as f64 + 0.5) / slices as f64;
            let below = errors.iter().filter(|error| **error < threshold).count();
            sum += below as f64 / errors.len() as f64 / slices as f64;
        }
        sum
    };
    let reference = angles[0];
    let mean = angles.iter().sum::<f64>() / n as f64;
    let frames_area = area(&angles);
    angles.sort_by(f64::total_cmp);
    vec![
        ("reference_rotation_error_deg", reference),
        ("rotation_error_deg_mean", mean),
        ("rotation_error_deg_median", angles[n / 2]),
        ("rotation_auc_30", frames_area),
        ("relative_rotation_error_deg_mean", of_reference),
        ("rra_5", share(5.0)),
        ("rra_15", share(15.0)),
        ("rra_30", share(30.0)),
        ("rra_auc_30", area(&pairs)),
        ("translation_error_mean", shift),
        ("scaled_translation_error_mean", scaled),
    ]
}

fn nearest(from: &[[f64; 3]], to: &[[f64; 3]]) -> Vec<f64> {
    let mut distances = Vec::new();
    for a in from {
        let mut least = f64::INFINITY;
        for b in to {
            let squared = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2);
            least = f64::min(least, squared);
        }
        distances.push(least.sqrt());
    }
    distances
}

/// Names and values of the errors of a cloud.
pub fn cloud_errors(estimate: &Path, truth: &Path) -> Vec<(&'static str, f64)> {
    let (found, truth) = (cloud(&estimate.join("points.ply")), cloud(&truth.join("points.ply")));
    let (to_truth, from_truth) = (nearest(&found, &truth), nearest(&truth, &found));
    let mean = |distances: &[f64], power: i32| {
        distances.iter().map(|distance| distance.powi(power)).sum::<f64>() / distances.len() as f64
    };
    let within = |distances: &[f64]| {
        distances.iter().filter(|distance| **distance <= 0.01).count() as f64
            / distances.len() as f64
    };
    let (precision, recall) = (within(&to_truth), within(&from_truth));
    vec![
        ("style_error", mean(&to_truth, 2) + mean(&from_truth, 2)),
        ("squared_to_truth", mean(&to_truth, 2)),
        ("squared_from_truth", mean(&from_truth, 2)),
        ("distance_to_truth", mean(&to_truth, 1)),
        ("distance_from_truth", mean(&from_truth, 1)),
        ("distance", mean(&to_truth, 1) + mean(&from_truth, 1)),
        ("f_score", 2.0 * precision * recall / (precision + recall).max(1e-300)),
    ]
}

/// Mean, median and quartiles, with the count.
pub fn statistics(values: &[f64]) -> (usize, [f64; 4]) {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    let quantile = |share: f64| {
        let place = share * (n - 1) as f64;
        let below = place as usize;
        let above = (below + 1).min(n - 1);
        values[below] * (1.0 - (place - below as f64)) + values[above] * (place - below as f64)
    };
    let mean = values.iter().sum::<f64>() / n as f64;
    (n, [mean, quantile(0.5), quantile(0.25), quantile(0.75)])
}
