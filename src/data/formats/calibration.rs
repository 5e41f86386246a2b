//! Cameras as files describe them: a pinhole behind a lens that may distort.

use crate::camera::Intrinsics;

/// Intrinsics with the distortion of the lens before them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub intrinsics: Intrinsics,
    pub distortion: Distortion,
}

/// The distortion that OpenCV and COLMAP call FULL_OPENCV; other models leave coefficients zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// k1, k2, k3.
    pub radial: [f64; 3],
    /// k4, k5, k6, below the fraction bar.
    pub denominator: [f64; 3],
    /// p1, p2.
    pub tangential: [f64; 2],
}

impl Calibration {
    /// In pixels, or why there is no such camera.
    pub fn new(focal: [f64; 2], center: [f64; 2], distortion: Distortion) -> Result<Self, String> {
        // Far beyond any lens, and well within single precision.
        let possible = 1e-3..1e9;
        if !focal.iter().all(|length| possible.contains(length)) {
            return Err(format!("its focal lengths {focal:?} are not positive"));
        }
        if !center.iter().all(|coordinate| coordinate.abs() < possible.end) {
            return Err(format!("its principal point {center:?} is not finite"));
        }
        let Distortion { radial, denominator, tangential } = distortion;
        let mut coefficients = radial.iter().chain(&denominator).chain(&tangential);
        if !coefficients.all(|coefficient| coefficient.is_finite()) {
            return Err("its lens distortion is not finite".into());
        }
        let single = |lengths: [f64; 2]| lengths.map(|length| length as f32);
        let intrinsics = Intrinsics { focal: single(focal), center: single(center) };
        Ok(Self { intrinsics, distortion })
    }

    /// A pinhole with its principal point in the middle of a picture.
    pub fn centered(focal: f64, size: [usize; 2]) -> Result<Self, String> {
        Self::new([focal; 2], size.map(|side| side as f64 / 2.0), Distortion::default())
    }

    /// Where the ray with these slopes, x/z and y/z, meets the picture, in pixels.
    pub fn project(&self, slopes: [f64; 2]) -> [f64; 2] {
        let distorted = self.distortion.apply(slopes);
        let Intrinsics { focal, center } = self.intrinsics;
        [0, 1].map(|axis| distorted[axis] * f64::from(focal[axis]) + f64::from(center[axis]))
    }
}

impl Distortion {
    /// Slopes behind the lens, of slopes before it.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [p1, p2] = self.tangential;
        let r2 = x * x + y * y;
        let stretch = self.stretch(r2);
        [
            x * stretch + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * stretch + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// The radius up to which the lens keeps the order of rays, at most `limit`. Beyond it the
    /// polynomials fold back, and would show the middle of the picture once more.
    pub fn reach(&self, limit: f64) -> f64 {
        const STEPS: usize = 512;
        let radius = |step: usize| limit * step as f64 / STEPS as f64;
        let distorted = |step| radius(step) * self.stretch(radius(step) * radius(step));
        let grows = |step: &usize| distorted(step + 1) > distorted(*step);
        let n_growing = (0..STEPS).take_while(grows).count();
        // Without a fold, the limit to the last bit.
        if n_growing == STEPS { limit } else { radius(n_growing) }
    }

    /// (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶).
    fn stretch(&self, r2: f64) -> f64 {
        let polynomial = |[a, b, c]: [f64; 3]| 1.0 + r2 * (a + r2 * (b + r2 * c));
        polynomial(self.radial) / polynomial(self.denominator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed with pycolmap's `Camera.img_from_cam`.
    #[test]
    fn projections_are_those_of_colmap() {
        let distortion = Distortion {
            radial: [-0.12, 0.03, 0.01],
            denominator: [0.02, -0.01, 0.005],
            tangential: [0.004, -0.003],
        };
        let camera = Calibration::new([44.5, 43.25], [21.5, 13.75], distortion);
        let [u, v] = camera.expect("it is a camera").project([0.4, -0.3]);
        assert!((u - 38.606634).abs() < 1e-4 && (v - 1.299339).abs() < 1e-4, "{u}, {v}");
    }

    #[test]
    fn barrels_reach_to_where_they_fold() {
        // r − r³/3 grows up to r = 1.
        let barrel = Distortion { radial: [-1.0 / 3.0, 0.0, 0.0], ..Distortion::default() };
        assert!((barrel.reach(2.0) - 1.0).abs() < 0.01, "{}", barrel.reach(2.0));
        assert_eq!(barrel.reach(0.5), 0.5);
        assert_eq!(Distortion::default().reach(3.0), 3.0);
    }

    #[test]
    fn cameras_that_cannot_be_are_refused() {
        let refused = |focal, center, k1| {
            let distortion = Distortion { radial: [k1, 0.0, 0.0], ..Distortion::default() };
            Calibration::new([focal; 2], [center; 2], distortion).unwrap_err()
        };
        assert!(refused(0.0, 1.0, 0.0).contains("focal"));
        assert!(refused(f64::NAN, 1.0, 0.0).contains("focal"));
        assert!(refused(1.0, f64::INFINITY, 0.0).contains("principal"));
        assert!(refused(1.0, 1.0, f64::NAN).contains("distortion"));
    }
}
