//! COLMAP's camera models: their numbers, names and parameters.

use super::{Calibration, Camera};
use crate::data::formats::calibration::Distortion;

/// Names and numbers of parameters, in the order of COLMAP's model numbers.
const MODELS: [(&str, usize); 12] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// The name of a model and how many parameters it has.
pub fn model(number: i32) -> Result<(&'static str, usize), String> {
    let known = usize::try_from(number).ok().and_then(|number| MODELS.get(number).copied());
    known.ok_or_else(|| format!("camera model number {number} is not known"))
}

/// A camera from its model's name and parameters, lengths in pixels.
pub fn camera(model: &str, size: [usize; 2], parameters: &[f64]) -> Result<Camera, String> {
    let (focal, center, distortion) = match (model, parameters) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f; 2], [cx, cy], Distortion::default()),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], Distortion::default()),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => ([f; 2], [cx, cy], radial([k1, 0.0, 0.0])),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f; 2], [cx, cy], radial([k1, k2, 0.0])),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy], [cx, cy], Distortion { tangential: [p1, p2], ..radial([k1, k2, 0.0]) })
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            let [radial, denominator] = [[k1, k2, k3], [k4, k5, k6]];
            ([fx, fy], [cx, cy], Distortion { radial, denominator, tangential: [p1, p2] })
        }
        _ => return Err(refusal(model, parameters.len())),
    };
    Ok(Camera { calibration: Calibration::new(focal, center, distortion)?, size })
}

fn radial(radial: [f64; 3]) -> Distortion {
    Distortion { radial, ..Distortion::default() }
}

fn refusal(model: &str, n_given: usize) -> String {
    match MODELS.iter().find(|(name, _)| *name == model) {
        Some((_, n)) if *n != n_given => {
            format!("a {model} camera has {n} parameters, not {n_given}")
        }
        _ => format!(
            "camera model {model} is not supported; undistort it (colmap image_undistorter)"
        ),
    }
}
