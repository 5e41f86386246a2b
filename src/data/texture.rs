//! Textures that look the same from near and far.
//!
//! A photometric loss compares one surface point across frames, so a texture must not alias: each
//! lookup averages over the texels that one pixel covers, from a pyramid of halved images.

use image::{Rgb, RgbImage};

/// A repeating texture with its halved copies, the finest first and the coarsest 1 × 1.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<RgbImage>,
}

impl Texture {
    /// An empty image becomes plain white.
    pub fn new(image: RgbImage) -> Self {
        let empty = image.width() == 0 || image.height() == 0;
        let finest = if empty { RgbImage::from_pixel(1, 1, Rgb([255; 3])) } else { image };
        let halvings = finest.width().max(finest.height()).next_power_of_two().ilog2();
        let mut levels = vec![finest];
        for level in 0..halvings as usize {
            levels.push(halve(&levels[level]));
        }
        Self { levels }
    }

    /// RGB in [0, 1] at `uv`, v upwards, averaged over a pixel's footprint.
    ///
    /// `uv_per_pixel` holds ∂uv/∂x and ∂uv/∂y of the image. The longer of the two decides: rather a
    /// little too soft at a grazing angle than sparkling.
    pub fn sample(&self, uv: [f32; 2], uv_per_pixel: [[f32; 2]; 2]) -> [f32; 3] {
        let [width, height] = [self.levels[0].width() as f32, self.levels[0].height() as f32];
        let [along_x, along_y] =
            uv_per_pixel.map(|[u, v]| (u * width).powi(2) + (v * height).powi(2));
        let coarsest = (self.levels.len() - 1) as f32;
        // log₂ of a length is half that of its square. A NaN, from a degenerate uv map, becomes 0.
        let level = (along_x.max(along_y).max(1.0).log2() / 2.0).min(coarsest);

        let fine = level as usize;
        let blend = level - fine as f32;
        let color = bilinear(&self.levels[fine], uv);
        if blend == 0.0 {
            return color;
        }
        let coarse = bilinear(&self.levels[fine + 1], uv);
        mix(color, coarse, blend)
    }
}

/// Box-filters to half the size, rounded up; an odd last row or column counts twice.
fn halve(image: &RgbImage) -> RgbImage {
    let [last_x, last_y] = [image.width() - 1, image.height() - 1];
    RgbImage::from_fn(image.width().div_ceil(2), image.height().div_ceil(2), |x, y| {
        let [x0, y0] = [2 * x, 2 * y];
        let [x1, y1] = [(x0 + 1).min(last_x), (y0 + 1).min(last_y)];
        let texels = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|[x, y]| image.get_pixel(x, y).0);
        let sum = |c: usize| texels.iter().map(|texel| u32::from(texel[c])).sum::<u32>();
        Rgb(std::array::from_fn(|c| ((sum(c) + 2) / 4) as u8))
    })
}

/// RGB in [0, 1] between the four nearest texel centres, wrapping around at the borders.
fn bilinear(image: &RgbImage, [u, v]: [f32; 2]) -> [f32; 3] {
    let ([left, right], across) = neighbours(u, image.width());
    let ([above, below], down) = neighbours(1.0 - v, image.height());
    let texel = |x: u32, y: u32| {
        let first = 3 * (y as usize * image.width() as usize + x as usize);
        [0, 1, 2].map(|c| f32::from(image.as_raw()[first + c]))
    };
    let top = mix(texel(left, above), texel(right, above), across);
    let bottom = mix(texel(left, below), texel(right, below), across);
    mix(top, bottom, down).map(|value| value / 255.0)
}

/// The texels before and after `coordinate` on an axis of `size` texels, and the second's weight.
fn neighbours(coordinate: f32, size: u32) -> ([u32; 2], f32) {
    // The fractional part first: it keeps its precision however often the texture has repeated.
    // Casts instead of floor(): baseline x86-64 has no instruction for it.
    let mut fraction = coordinate - coordinate as i32 as f32;
    if fraction < 0.0 {
        fraction += 1.0;
    }
    // From the last texel's centre, one repeat before, so that the position is positive.
    let position = fraction * size as f32 + (size as f32 - 0.5);
    let before = position as u32;
    let wrapped = |texel: u32| if texel >= size { texel - size } else { texel };
    let first = wrapped(before).min(size - 1);
    ([first, wrapped(first + 1)], position - before as f32)
}

fn mix(from: [f32; 3], to: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|c| from[c] + share * (to[c] - from[c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINT: [[f32; 2]; 2] = [[0.0; 2]; 2];

    fn checkerboard() -> Texture {
        Texture::new(RgbImage::from_fn(8, 8, |x, y| Rgb([((x + y) % 2 * 255) as u8; 3])))
    }

    #[test]
    fn texel_centres_return_their_texel_with_v_upwards() {
        let mut image = RgbImage::new(4, 2);
        image.put_pixel(3, 0, Rgb([255, 0, 51]));
        let color = Texture::new(image).sample([3.5 / 4.0, 0.75], POINT);
        assert_eq!(color, [1.0, 0.0, 0.2]);
    }

    #[test]
    fn textures_repeat() {
        let texture = checkerboard();
        for uv in [[0.1, 0.2], [0.97, 0.01], [0.5, 0.999]] {
            let there = texture.sample([uv[0] + 3.0, uv[1] - 2.0], POINT);
            for (a, b) in texture.sample(uv, POINT).into_iter().zip(there) {
                assert!((a - b).abs() < 1e-4, "{a} and {b} at {uv:?}");
            }
        }
    }

    #[test]
    fn a_checkerboard_seen_from_afar_is_grey() {
        let color = checkerboard().sample([0.3, 0.8], [[0.25, 0.0], [0.0, 0.25]]);
        assert!(color.iter().all(|value| (value - 0.5).abs() < 0.01), "{color:?}");
    }

    #[test]
    fn odd_and_empty_images_are_textures_too() {
        let odd = Texture::new(RgbImage::from_pixel(5, 3, Rgb([51; 3])));
        assert_eq!(odd.levels.last().map(|level| level.dimensions()), Some((1, 1)));
        assert_eq!(odd.sample([0.9, 0.9], [[10.0; 2]; 2]), [0.2; 3]);
        assert_eq!(Texture::new(RgbImage::new(0, 4)).sample([0.5; 2], POINT), [1.0; 3]);
    }
}
