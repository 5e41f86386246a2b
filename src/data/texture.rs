//! Textures that look the same from near and far.
//!
//! A photometric loss compares one surface point across frames, so a texture must not alias: each
//! lookup averages over the texels that one pixel covers, from a pyramid of halved images.

use image::RgbImage;
use nalgebra::{Matrix2, Vector2};

/// A repeating texture with its halved copies, the finest first and the coarsest 1 × 1.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Level>,
}

/// A picture whose border goes once around: before the first column stands the last one again, and
/// so on. Any texel then has its neighbours beside it.
#[derive(Clone, Debug)]
struct Level {
    /// `[width, height]` without the border, in texels.
    size: [u32; 2],
    /// RGB row by row; the fourth channel is zero, and only fills a register.
    texels: Vec<[u8; 4]>,
}

impl Texture {
    /// An empty image becomes plain white.
    pub fn new(image: &RgbImage) -> Self {
        let finest = match image.dimensions() {
            (0, _) | (_, 0) => Level::new([1, 1], |_| vec![[255, 255, 255, 0]]),
            (width, height) => Level::new([width, height], |y| {
                let start = (y * width * 3) as usize;
                let (row, _) = image.as_raw()[start..][..3 * width as usize].as_chunks();
                row.iter().map(|&[red, green, blue]| [red, green, blue, 0]).collect()
            }),
        };
        let halvings = finest.size[0].max(finest.size[1]).next_power_of_two().ilog2();
        let mut levels = vec![finest];
        for level in 0..halvings as usize {
            levels.push(levels[level].halved());
        }
        Self { levels }
    }

    /// RGB in [0, 1] at `uv`, v upwards, averaged over a pixel's footprint.
    ///
    /// `uv_per_pixel` holds ∂uv/∂x and ∂uv/∂y of the image as columns. The longer of the two
    /// decides: rather a little too soft at a grazing angle than sparkling.
    pub fn sample(&self, uv: Vector2<f32>, uv_per_pixel: Matrix2<f32>) -> [f32; 3] {
        let [width, height] = self.levels[0].size.map(|side| side as f32);
        let squared = |axis| {
            let along = uv_per_pixel.column(axis);
            (along.x * width).powi(2) + (along.y * height).powi(2)
        };
        let coarsest = (self.levels.len() - 1) as f32;
        // log₂ of a length is half that of its square. A NaN, from a degenerate uv map, becomes 0.
        let level = (rough_log2(squared(0).max(squared(1)).max(1.0)) / 2.0).min(coarsest);

        // A cast to few bits is the quickest.
        let fine = level as u8;
        let blend = level - f32::from(fine);
        let fine = usize::from(fine);
        let place = [fraction(uv.x), fraction(1.0 - uv.y)];
        let mut color = self.levels[fine].bilinear(place);
        if blend > 0.0 {
            color = mix(color, self.levels[fine + 1].bilinear(place), blend);
        }
        let [red, green, blue, _] = color;
        [red, green, blue].map(|value| value / 255.0)
    }
}

impl Level {
    /// From its rows, without the border.
    fn new([width, height]: [u32; 2], row: impl Fn(u32) -> Vec<[u8; 4]>) -> Self {
        let mut texels = Vec::with_capacity((width as usize + 2) * (height as usize + 2));
        for y in std::iter::once(height - 1).chain(0..height).chain([0]) {
            let row = row(y);
            texels.push(row[row.len() - 1]);
            texels.extend_from_slice(&row);
            texels.push(row[0]);
        }
        Self { size: [width, height], texels }
    }

    /// Box-filtered to half the size, rounded up; an odd last row or column counts twice.
    fn halved(&self) -> Self {
        let [last_x, last_y] = self.size.map(|side| side as usize - 1);
        let [width, height] = self.size.map(|side| side.div_ceil(2));
        Self::new([width, height], |y| {
            let y0 = 2 * y as usize;
            let [upper, lower] = [y0, (y0 + 1).min(last_y)].map(|y| self.row(y));
            let texel = |x0: usize| {
                let x1 = (x0 + 1).min(last_x);
                let four = [upper[x0], upper[x1], lower[x0], lower[x1]];
                let sum = |c: usize| four.iter().map(|texel| u32::from(texel[c])).sum::<u32>();
                std::array::from_fn(|c| ((sum(c) + 2) / 4) as u8)
            };
            (0..width as usize).map(|x| texel(2 * x)).collect()
        })
    }

    /// Between the four nearest texel centres, in bytes' units, at `place` in [0, 1], to the right
    /// and downwards. The border wraps around.
    ///
    /// Were it inlined, the compiler would find the fourth channel unused, and the others no longer
    /// a register.
    #[inline(never)]
    fn bilinear(&self, place: [f32; 2]) -> [f32; 4] {
        let [(column, across), (row, down)] = [0, 1].map(|axis| {
            // With the border, texel 0 is centred on 1.5, and half a texel before it begins the
            // last one's share. Coordinates that are not finite end up at the border.
            let position = place[axis] * self.size[axis] as f32 + 0.5;
            let first = u32::from(position as u16).min(self.size[axis]);
            (first as usize, position - first as f32)
        });
        let stride = self.size[0] as usize + 2;
        let above = row * stride + column;
        let between = |first: usize| {
            let [left, right] = [self.texels[first], self.texels[first + 1]];
            mix(left.map(f32::from), right.map(f32::from), across)
        };
        mix(between(above), between(above + stride), down)
    }

    /// A row without its border.
    fn row(&self, y: usize) -> &[[u8; 4]] {
        let width = self.size[0] as usize;
        &self.texels[(y + 1) * (width + 2) + 1..][..width]
    }
}

/// log₂ of a positive number, straight between powers of two: at most 0.09 too low.
fn rough_log2(x: f32) -> f32 {
    // As an integer, a float is its exponent, then the mantissa's share of the way to the next.
    const ONE: i32 = 1.0_f32.to_bits() as i32;
    (x.to_bits() as i32 - ONE) as f32 / (1 << (f32::MANTISSA_DIGITS - 1)) as f32
}

/// What is left of a coordinate without its whole repeats: it keeps its precision however many.
fn fraction(coordinate: f32) -> f32 {
    // A cast instead of floor(): baseline x86-64 has no instruction for it.
    let fraction = coordinate - coordinate as i32 as f32;
    if fraction < 0.0 { fraction + 1.0 } else { fraction }
}

fn mix(from: [f32; 4], to: [f32; 4], share: f32) -> [f32; 4] {
    std::array::from_fn(|c| from[c] + share * (to[c] - from[c]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    const POINT: Matrix2<f32> = Matrix2::new(0.0, 0.0, 0.0, 0.0);

    fn checkerboard() -> Texture {
        Texture::new(&RgbImage::from_fn(8, 8, |x, y| Rgb([((x + y) % 2 * 255) as u8; 3])))
    }

    #[test]
    fn texel_centres_return_their_texel_with_v_upwards() {
        let mut image = RgbImage::new(4, 2);
        image.put_pixel(3, 0, Rgb([255, 0, 51]));
        let color = Texture::new(&image).sample(Vector2::new(3.5 / 4.0, 0.75), POINT);
        assert_eq!(color, [1.0, 0.0, 0.2]);
    }

    #[test]
    fn textures_repeat() {
        let texture = checkerboard();
        for uv in [[0.1, 0.2], [0.97, 0.01], [0.5, 0.999]] {
            let there = texture.sample(Vector2::new(uv[0] + 3.0, uv[1] - 2.0), POINT);
            for (a, b) in texture.sample(uv.into(), POINT).into_iter().zip(there) {
                assert!((a - b).abs() < 1e-4, "{a} and {b} at {uv:?}");
            }
        }
    }

    #[test]
    fn a_checkerboard_seen_from_afar_is_grey() {
        let color = checkerboard().sample(Vector2::new(0.3, 0.8), Matrix2::identity() / 4.0);
        assert!(color.iter().all(|value| (value - 0.5).abs() < 0.01), "{color:?}");
    }

    #[test]
    fn odd_and_empty_images_are_textures_too() {
        let odd = Texture::new(&RgbImage::from_pixel(5, 3, Rgb([51; 3])));
        assert_eq!(odd.levels.last().map(|level| level.size), Some([1, 1]));
        assert_eq!(odd.sample(Vector2::repeat(0.9), Matrix2::repeat(10.0)), [0.2; 3]);
        assert_eq!(
            Texture::new(&RgbImage::new(0, 4)).sample(Vector2::repeat(0.5), POINT),
            [1.0; 3]
        );
    }
    #[test]
    fn the_rough_logarithm_is_exact_at_powers_of_two_and_close_between() {
        for i in 0..100 {
            let exponent = i as f32 / 8.0;
            let error = exponent - rough_log2(exponent.exp2());
            assert!((-1e-5..0.0861).contains(&error), "{exponent}: {error}");
            assert!(i % 8 != 0 || error.abs() < 1e-5, "{exponent}: {error}");
        }
    }
}
