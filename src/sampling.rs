//! I(u): the colour of an image at subpixel locations (Eq. 3).

use burn::tensor::{Int, Tensor, TensorData, s};

use crate::{data::ColorImage, host::index_tensor};

/// Images of one size as a table of pixels, `[l · height · width, 3]`, RGB in [0, 1].
///
/// The table is a constant: gradients reach the locations, never the images.
#[derive(Clone, Debug)]
pub struct ImageTable {
    pixels: Tensor<2>,
    width: usize,
    height: usize,
}

impl ImageTable {
    /// `device` may differentiate; the table itself is kept out of the graph.
    pub fn new(images: &[ColorImage], device: &burn::tensor::Device) -> Self {
        let (width, height) = images[0].dimensions();
        let values: Vec<f32> = images.iter().flat_map(|image| image.as_raw()).copied().collect();
        let shape = [values.len() / 3, 3];
        let pixels = Tensor::from_data(TensorData::new(values, shape), &device.clone().inner());
        Self { pixels, width: width as usize, height: height as usize }
    }

    /// Colours `[b, m, 3]` at `locations` `[b, m, 2]`, row i read from the image `frames[i]`.
    ///
    /// Interpolates bilinearly between pixel centres, which lie on half-integers. Beyond the
    /// outermost centres the border's colour continues, without a gradient across it.
    pub fn sample_bilinear(&self, frames: &[usize], locations: Tensor<3>) -> Tensor<3> {
        let [b, m, _] = locations.dims();
        let centers = locations - 0.5;
        let x = centers.clone().slice(s![.., .., 0..1]).clamp(0.0, (self.width - 1) as f64);
        let y = centers.slice(s![.., .., 1..2]).clamp(0.0, (self.height - 1) as f64);
        // The last pixel is reached from the left and from above, so that a neighbour exists.
        let left = x.clone().inner().floor().clamp_max(self.width.saturating_sub(2) as f64);
        let top = y.clone().inner().floor().clamp_max(self.height.saturating_sub(2) as f64);

        let first = self.row_of(frames, left.clone(), top.clone());
        let (right, below) =
            ((self.width > 1) as i64, (self.height > 1) as i64 * self.width as i64);
        let corner =
            |offset: i64| self.pixels.clone().select(0, first.clone() + offset).reshape([b, m, 3]);
        let (fx, fy) = (x - left, y - top); // [b, m, 1]
        let upper = corner(0) * (-fx.clone() + 1.0) + corner(right) * fx.clone();
        let lower = corner(below) * (-fx.clone() + 1.0) + corner(below + right) * fx;
        upper * (-fy.clone() + 1.0) + lower * fy
    }

    /// The table's row of each top-left pixel, `[b · m]`.
    fn row_of(&self, frames: &[usize], left: Tensor<3>, top: Tensor<3>) -> Tensor<1, Int> {
        let [b, m, _] = left.dims();
        let starts = frames.iter().map(|&frame| (frame * self.width * self.height) as i64);
        let starts = index_tensor(starts.collect(), &left).reshape([b, 1, 1]);
        (top.int() * self.width as i64 + left.int() + starts).reshape([b * m])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{device::Backend, host::host_values};
    use image::Rgb;

    /// A colour that is linear in the location: bilinear interpolation must be exact on it.
    fn ramp(width: u32, height: u32, offset: f32) -> ColorImage {
        ColorImage::from_fn(width, height, |u, v| {
            let (u, v) = (u as f32 + 0.5, v as f32 + 0.5);
            Rgb([0.1 * u + offset, 0.2 * v, 0.03 * u - 0.01 * v])
        })
    }

    #[track_caller]
    fn check_colors(images: &[ColorImage], frames: &[usize], at: [f32; 2], expected: [f32; 3]) {
        let device = Backend::Flex.device();
        let table = ImageTable::new(images, &device);
        let at = Tensor::<1>::from_floats(at, &device).reshape([1, 1, 2]);
        let colors = table.sample_bilinear(frames, at.expand([frames.len(), 1, 2]));
        let colors = host_values(&colors);
        for (color, expected) in colors.iter().zip(expected) {
            assert!((color - expected).abs() < 1e-5, "{colors:?} is not {expected:?}");
        }
    }

    #[test]
    fn a_linear_image_is_reproduced_between_its_pixels() {
        check_colors(&[ramp(8, 6, 0.0)], &[0], [3.7, 2.2], [0.37, 0.44, 0.089]);
    }

    #[test]
    fn a_pixel_centre_has_the_color_of_its_pixel() {
        check_colors(&[ramp(8, 6, 0.0)], &[0], [7.5, 5.5], [0.75, 1.1, 0.17]);
    }

    #[test]
    fn the_border_continues_outside() {
        check_colors(&[ramp(8, 6, 0.0)], &[0], [-30.0, 99.0], [0.05, 1.1, -0.04]);
    }

    #[test]
    fn each_row_reads_its_own_frame() {
        check_colors(&[ramp(4, 4, 0.0), ramp(4, 4, 1.0)], &[1], [2.0, 2.0], [1.2, 0.4, 0.04]);
    }

    #[test]
    fn an_image_of_one_pixel_is_constant() {
        check_colors(&[ramp(1, 1, 0.0)], &[0], [0.9, 0.1], [0.05, 0.1, 0.01]);
    }
}
