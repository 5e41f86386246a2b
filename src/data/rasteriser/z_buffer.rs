//! Which face each sample of a picture sees.

use std::ops::Range;

use super::face::{Face, NEAR, Row};

/// Samples in a pixel: 2 × 2, which fill a register.
pub const N: usize = 4;
/// Where they lie, from the pixel's corner: rightwards and downwards.
pub const OFFSETS: [[f32; N]; 2] = [[0.25, 0.75, 0.25, 0.75], [0.25, 0.25, 0.75, 0.75]];
/// The face index of a sample that sees none.
pub const NO_FACE: u32 = u32::MAX;

/// The pixels of a picture, row by row.
pub struct ZBuffer {
    width: usize,
    pixels: Vec<Pixel>,
}

/// The nearest face so far at each sample.
#[derive(Clone, Copy)]
pub struct Pixel {
    /// 0 where there is no face.
    pub inverse_depths: [f32; N],
    pub face_indices: [u32; N],
}

impl ZBuffer {
    pub fn new([width, height]: [usize; 2]) -> Self {
        let empty = Pixel { inverse_depths: [0.0; N], face_indices: [NO_FACE; N] };
        Self { width, pixels: vec![empty; width * height] }
    }

    /// Draws a face within `[columns, rows]` of pixels; whether it is seen anywhere, so far.
    pub fn draw(&mut self, face: &Face, face_idx: u32, [across, down]: [Range<usize>; 2]) -> bool {
        let mut seen = false;
        for y in down {
            let row = face.row(y);
            let pixels = &mut self.pixels[y * self.width..][across.clone()];
            for (x, pixel) in across.clone().zip(pixels) {
                seen |= pixel.draw(&row, x as f32, face_idx);
            }
        }
        seen
    }

    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }
}

impl Pixel {
    /// Draws what a face has in the pixel whose left side is at `x`.
    ///
    /// Without branches, which would be taken at random: four samples are as quick as one.
    fn draw(&mut self, row: &Row, x: f32, face_idx: u32) -> bool {
        let mut seen = false;
        for k in 0..N {
            let x = x + OFFSETS[0][k];
            let [a, b, c, inverse_depth] =
                [0, 1, 2, 3].map(|i| row.slopes[i] * x + row.starts[i][k]);
            let nearer = (smaller(smaller(a, b), c) >= 0.0)
                & (inverse_depth > self.inverse_depths[k])
                & (inverse_depth < 1.0 / NEAR);
            self.inverse_depths[k] = if nearer { inverse_depth } else { self.inverse_depths[k] };
            self.face_indices[k] = if nearer { face_idx } else { self.face_indices[k] };
            seen |= nearer;
        }
        seen
    }
}

/// Unlike `f32::min`, one instruction: it need not look for NaNs.
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
