//! Which face each sample of a picture sees.

use super::face::{Bounds, Face, NEAR, Row};

/// Samples in a pixel: 2 × 2, which fill a register.
pub const N: usize = 4;
/// Where they lie, from the pixel's corner: rightwards and downwards.
pub const OFFSETS: [[f32; N]; 2] = [[0.25, 0.75, 0.25, 0.75], [0.25, 0.25, 0.75, 0.75]];
/// The face index of a sample that sees none.
const NO_FACE: u32 = u32::MAX;

/// The pixels of a picture, row by row.
#[derive(Default)]
pub struct ZBuffer {
    width: usize,
    pub pixels: Vec<Pixel>,
}

/// The nearest face so far at each sample.
#[derive(Clone, Copy)]
pub struct Pixel {
    /// 0 where there is no face.
    inverse_depths: [f32; N],
    pub face_indices: [u32; N],
}

impl ZBuffer {
    /// Begins a picture in which nothing is seen yet.
    pub fn clear(&mut self, [width, height]: [usize; 2]) {
        let empty = Pixel { inverse_depths: [0.0; N], face_indices: [NO_FACE; N] };
        self.width = width;
        self.pixels.clear();
        self.pixels.resize(width * height, empty);
    }

    /// Draws a face; whether it is seen anywhere, so far.
    pub fn draw(&mut self, face: &Face, face_idx: u32, bounds: &Bounds) -> bool {
        let mut seen = false;
        for y in bounds.rows.clone() {
            let row = face.row(y as f32);
            let pixels = &mut self.pixels[y * self.width..][bounds.columns.clone()];
            for (x, pixel) in (bounds.columns.start as i32..).zip(pixels) {
                seen |= pixel.draw(&row, x as f32, face_idx);
            }
        }
        seen
    }
}

impl Pixel {
    /// Camera z of the nearest surface; infinite if there is none.
    pub fn depth(&self) -> f32 {
        1.0 / self.inverse_depths.into_iter().fold(0.0, f32::max)
    }

    pub fn covered_samples(&self) -> Samples {
        Samples::ALL.without(self.samples_of(NO_FACE))
    }

    /// The samples that see this face.
    pub fn samples_of(&self, face_idx: u32) -> Samples {
        let mut bits = 0;
        for k in 0..N {
            bits |= u8::from(self.face_indices[k] == face_idx) << k;
        }
        Samples(bits)
    }

    /// Draws what a face has in the pixel whose left side is at `x`; whether it is seen there.
    ///
    /// Masks instead of branches, which would be taken at random: all samples are as quick as one.
    #[inline(always)]
    fn draw(&mut self, row: &Row, x: f32, face_idx: u32) -> bool {
        let mut inverse_depths = [0.0; N];
        let mut nearer = [0; N];
        for k in 0..N {
            let x = x + OFFSETS[0][k];
            let value = |i: usize| row.slopes[i] * x + row.starts[i][k];
            inverse_depths[k] = value(3);
            let inside = smaller(smaller(value(0), value(1)), value(2)) >= 0.0;
            let in_front = inverse_depths[k] < 1.0 / NEAR;
            let hides = inverse_depths[k] > self.inverse_depths[k];
            nearer[k] = if inside & in_front & hides { u32::MAX } else { 0 };
        }
        if nearer == [0; N] {
            return false;
        }
        for k in 0..N {
            let select = |new: u32, old: u32| (new & nearer[k]) | (old & !nearer[k]);
            let depths = [inverse_depths[k], self.inverse_depths[k]].map(f32::to_bits);
            self.inverse_depths[k] = f32::from_bits(select(depths[0], depths[1]));
            self.face_indices[k] = select(face_idx, self.face_indices[k]);
        }
        true
    }
}

/// Some samples of a pixel, a bit each.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Samples(u8);

impl Samples {
    pub const ALL: Self = Self(0b1111);

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub fn first(self) -> Option<usize> {
        (self.0 != 0).then(|| self.0.trailing_zeros() as usize)
    }

    pub fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Their share of the pixel.
    pub fn share(self) -> f32 {
        SHARES[usize::from(self.0)]
    }

    /// Their middle, from the pixel's corner.
    pub fn middle(self) -> [f32; 2] {
        MIDDLES[usize::from(self.0)]
    }
}

/// How much of the pixel each set of samples is: baseline x86-64 has no instruction to count bits.
const SHARES: [f32; 1 << N] = {
    let mut shares = [0.0; 1 << N];
    let mut bits = 0;
    while bits < shares.len() {
        shares[bits] = bits.count_ones() as f32 / N as f32;
        bits += 1;
    }
    shares
};

/// The middle of each set of samples.
const MIDDLES: [[f32; 2]; 1 << N] = {
    let mut middles = [[0.0; 2]; 1 << N];
    let mut bits = 0;
    while bits < middles.len() {
        let mut k = 0;
        while k < N {
            if bits >> k & 1 == 1 {
                middles[bits][0] += OFFSETS[0][k] / bits.count_ones() as f32;
                middles[bits][1] += OFFSETS[1][k] / bits.count_ones() as f32;
            }
            k += 1;
        }
        bits += 1;
    }
    middles
};

/// Unlike `f32::min`, one instruction: it need not look for NaNs.
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
