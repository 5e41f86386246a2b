//! Bilinear lookups.

use std::array;

use image::{ImageBuffer, Pixel};

/// A picture's `N` channels at `location`, in pixels; beyond the outermost centres their values go on.
pub fn bilinear<P, const N: usize>(
    picture: &ImageBuffer<P, Vec<f32>>,
    location: [f32; 2],
) -> [f32; N]
where
    P: Pixel<Subpixel = f32>,
{
    let (width, height) = picture.dimensions();
    let axis = |location: f32, side: u32| {
        let at = (location - 0.5).clamp(0.0, (side - 1) as f32);
        (at as u32, (at as u32 + 1).min(side - 1), at.fract())
    };
    let ((x, right, fx), (y, below, fy)) = (axis(location[0], width), axis(location[1], height));
    let mix = |a: &[f32], b: &[f32], share: f32| -> [f32; N] {
        array::from_fn(|channel| a[channel] + share * (b[channel] - a[channel]))
    };
    let at = |x: u32, y: u32| picture.get_pixel(x, y).channels();
    let [above, below] = [y, below].map(|y| mix(at(x, y), at(right, y), fx));
    mix(&above, &below, fy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::ColorImage;
    use image::Rgb;

    #[test]
    fn planes_are_reproduced_and_end_at_the_outermost_centres() {
        let plane = |u: f32, v: f32| [u, 2.0 * v, 0.5 * u - v];
        let picture = ColorImage::from_fn(5, 4, |x, y| Rgb(plane(x as f32 + 0.5, y as f32 + 0.5)));
        for [u, v] in [[0.5_f32, 0.5], [4.5, 3.5], [2.0, 2.75], [-3.0, 1.1], [4.9, 9.0], [5.0, 0.0]]
        {
            let expected = plane(u.clamp(0.5, 4.5), v.clamp(0.5, 3.5));
            let found: [f32; 3] = bilinear(&picture, [u, v]);
            let error = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(error < 1e-6, "{found:?} is not {expected:?}");
        }
    }
}
