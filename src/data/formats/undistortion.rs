//! Undoing a lens: a picture as a pinhole camera in the same place would have taken it.

use image::{Luma, Rgb};

use super::{axes::PIXEL_CENTRE, calibration::Calibration};
use crate::{
    camera::Intrinsics,
    data::{ColorImage, ScalarImage, bilinear::bilinear, crop::in_picture},
};

/// Resamples a picture and its mask, bilinearly, from one camera to another of `size`.
///
/// Where the first one saw nothing, the mask is empty and the last colours go on.
pub fn undistort(
    color: &ColorImage,
    mask: &ScalarImage,
    from: &Calibration,
    to: &Intrinsics,
    size: [usize; 2],
) -> (ColorImage, ScalarImage) {
    let [width, height] = size.map(|side| side as u32);
    let slopes = |x: u32, y: u32| {
        let pixel = [x as f32 + PIXEL_CENTRE[0], y as f32 + PIXEL_CENTRE[1]];
        [0, 1].map(|axis| f64::from((pixel[axis] - to.center[axis]) / to.focal[axis]))
    };
    let corners = [(0, 0), (width, 0), (0, height), (width, height)];
    let farthest = corners.map(|(x, y)| norm(slopes(x, y))).into_iter().fold(0.0, f64::max);
    let reach = from.distortion.reach(farthest);

    let mut resampled = (ColorImage::new(width, height), ScalarImage::new(width, height));
    for (x, y, color_pixel) in resampled.0.enumerate_pixels_mut() {
        let slopes = slopes(x, y);
        let pixel = from.project(slopes).map(|coordinate| coordinate as f32);
        *color_pixel = Rgb(bilinear(color, pixel));
        if norm(slopes) <= reach && in_picture(mask, pixel) {
            resampled.1.put_pixel(x, y, Luma(bilinear(mask, pixel)));
        }
    }
    resampled
}

fn norm([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::formats::calibration::Distortion;

    const PINHOLE: Intrinsics = Intrinsics { focal: [40.0, 42.0], center: [33.0, 22.0] };

    /// A picture whose colours are the slopes of the ray that each pixel sees, found by inverting
    /// the lens with a fixed point.
    fn slopes_through(lens: &Calibration, size: [u32; 2]) -> ColorImage {
        ColorImage::from_fn(size[0], size[1], |x, y| {
            let Intrinsics { focal, center } = lens.intrinsics;
            let pixel = [x as f32 + 0.5, y as f32 + 0.5];
            let behind = [0, 1].map(|a| f64::from((pixel[a] - center[a]) / focal[a]));
            let mut before = behind;
            for _ in 0..50 {
                let behind_now = lens.distortion.apply(before);
                before = [0, 1].map(|a| before[a] + behind[a] - behind_now[a]);
            }
            Rgb([before[0] as f32, before[1] as f32, 0.5])
        })
    }

    #[test]
    fn an_undistorted_picture_shows_each_ray_where_a_pinhole_sees_it() {
        let distortion = Distortion {
            radial: [-0.2, 0.05, 0.0],
            tangential: [0.01, -0.005],
            ..Default::default()
        };
        let lens = Calibration { intrinsics: PINHOLE, distortion };
        let distorted = slopes_through(&lens, [64, 48]);
        let mask = ScalarImage::from_pixel(64, 48, Luma([1.0]));
        let (color, mask) = undistort(&distorted, &mask, &lens, &PINHOLE, [64, 48]);
        let mut n_seen = 0;
        for (x, y, pixel) in color.enumerate_pixels() {
            if mask.get_pixel(x, y).0[0] == 1.0 && (2..62).contains(&x) && (2..46).contains(&y) {
                let expected = [(x as f32 - 32.5) / 40.0, (y as f32 - 21.5) / 42.0];
                let error = (pixel.0[0] - expected[0]).hypot(pixel.0[1] - expected[1]);
                assert!(error < 2e-3, "at {x}, {y}: {error}");
                n_seen += 1;
            }
        }
        assert!(n_seen > 2000, "{n_seen}");
    }

    #[test]
    fn what_the_lens_did_not_see_is_not_of_the_object() {
        let white = ScalarImage::from_pixel(64, 48, Luma([1.0]));
        let gray = ColorImage::from_pixel(64, 48, Rgb([0.5; 3]));
        let lens = Calibration { intrinsics: PINHOLE, distortion: Distortion::default() };
        let wide = Intrinsics { focal: [20.0, 21.0], ..PINHOLE };
        let (color, mask) = undistort(&gray, &white, &lens, &wide, [64, 48]);
        assert_eq!(mask.get_pixel(33, 22).0, [1.0]);
        assert_eq!((mask.get_pixel(1, 22).0, color.get_pixel(1, 22).0), ([0.0], [0.5; 3]));

        // A barrel folds back beyond r = 1/√3, and would show the object a second time there.
        let distortion = Distortion { radial: [-1.0, 0.0, 0.0], ..Distortion::default() };
        let barrel = Calibration { intrinsics: PINHOLE, distortion };
        let (_, mask) = undistort(&gray, &white, &barrel, &wide, [64, 48]);
        assert_eq!(mask.get_pixel(63, 22).0, [0.0]);
    }

    #[test]
    fn a_camera_onto_itself_changes_nothing() {
        let picture = ColorImage::from_fn(9, 7, |x, y| Rgb([x as f32 / 9.0, y as f32 / 7.0, 0.25]));
        let mask = ScalarImage::from_fn(9, 7, |x, _| Luma([x as f32 / 8.0]));
        let same = Calibration { intrinsics: PINHOLE, distortion: Distortion::default() };
        let (color, coverage) = undistort(&picture, &mask, &same, &PINHOLE, [9, 7]);
        let colors = color.as_raw().iter().zip(picture.as_raw());
        assert!(colors.clone().all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(coverage.as_raw().iter().zip(mask.as_raw()).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
