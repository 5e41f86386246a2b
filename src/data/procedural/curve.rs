//! Sampled curves.

/// Heights at `n_samples` even steps of [0, 1] along corners `[position, height]`.
pub fn sample_polyline(corners: &[[f32; 2]], n_samples: usize) -> Vec<f32> {
    (0..n_samples)
        .map(|sample| {
            let position = sample as f32 / (n_samples - 1) as f32;
            let end = corners.partition_point(|c| c[0] < position).clamp(1, corners.len() - 1);
            let ([x0, y0], [x1, y1]) = (corners[end - 1], corners[end]);
            y0 + (y1 - y0) * ((position - x0) / (x1 - x0)).clamp(0.0, 1.0)
        })
        .collect()
}

/// Gaussian smoothing with `sigma` in samples; the ends continue as they are.
pub fn smooth(samples: &[f32], sigma: f32) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as i64;
    let kernel: Vec<f32> =
        (-reach..=reach).map(|offset| (-0.5 * (offset as f32 / sigma).powi(2)).exp()).collect();
    let total: f32 = kernel.iter().sum();
    let last = samples.len() as i64 - 1;
    (0..=last)
        .map(|idx| {
            let window = (idx - reach..=idx + reach).map(|i| samples[i.clamp(0, last) as usize]);
            window.zip(&kernel).map(|(sample, weight)| sample * weight).sum::<f32>() / total
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polyline_passes_through_its_corners() {
        let samples = sample_polyline(&[[0.0, 1.0], [0.5, 3.0], [1.0, 2.0]], 5);
        assert_eq!(samples, [1.0, 2.0, 3.0, 2.5, 2.0]);
    }

    #[test]
    fn smoothing_keeps_straight_lines_and_cuts_corners() {
        let line: Vec<f32> = (0..41).map(|idx| idx as f32).collect();
        assert!((smooth(&line, 2.0)[20] - 20.0).abs() < 1e-4);
        let peak = sample_polyline(&[[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]], 41);
        assert!(smooth(&peak, 2.0)[20] < 0.95);
    }
}
