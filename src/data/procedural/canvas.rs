//! Painting flat pictures that are projected onto the body.

use image::{Rgb, RgbImage};
use rand::Rng;

/// RGB in [0, 1].
pub type Color = [f32; 3];
/// A place on a picture, in metres.
pub type Place = [f32; 2];

/// Texels a metre: a few for each pixel of a car that fills a 128-pixel picture.
const TEXELS_PER_METRE: f32 = 80.0;

/// A picture of one side of a car, to scale.
pub struct Canvas {
    low: Place,
    high: Place,
    size: [usize; 2],
    texels: Vec<Color>, // rows from the top
}

impl Canvas {
    /// One colour between the corners `low` and `high`.
    pub fn new(low: Place, high: Place, color: Color) -> Self {
        let size = [0, 1].map(|i| ((high[i] - low[i]) * TEXELS_PER_METRE).ceil().max(1.0) as usize);
        Self { low, high, size, texels: vec![color; size[0] * size[1]] }
    }

    /// Fills a closed outline, with smooth edges.
    pub fn fill(&mut self, outline: &[Place], color: Color) {
        self.blend(outline, 0.0, color, |place| {
            let distance = distance_to(outline, true, place);
            if contains(outline, place) { distance } else { -distance }
        });
    }

    /// Draws a line of the given width, in metres, along an open path.
    pub fn trace(&mut self, path: &[Place], width: f32, color: Color) {
        self.blend(path, width, color, |place| 0.5 * width - distance_to(path, false, place));
    }

    /// Draws a line of the given width, in metres, around a closed outline.
    pub fn outline(&mut self, outline: &[Place], width: f32, color: Color) {
        self.blend(outline, width, color, |place| 0.5 * width - distance_to(outline, true, place));
    }

    /// Multiplies smooth noise of the given cell size, in metres, onto the picture.
    pub fn grain(&mut self, cell: f32, amplitude: f32, rng: &mut impl Rng) {
        let n_cells = [0, 1].map(|i| ((self.high[i] - self.low[i]) / cell).ceil() as usize + 2);
        let lattice: Vec<f32> =
            (0..n_cells[0] * n_cells[1]).map(|_| rng.random_range(-1.0..1.0)).collect();
        for idx in 0..self.texels.len() {
            let place = self.place(idx);
            let [u, v] = [0, 1].map(|i| ((place[i] - self.low[i]) / cell).max(0.0));
            let (column, row) = (u as usize, v as usize);
            let node = |right, up| lattice[(row + up) * n_cells[0] + column + right];
            let (s, t) = (u.fract(), v.fract());
            let noise = (node(0, 0) * (1.0 - s) + node(1, 0) * s) * (1.0 - t)
                + (node(0, 1) * (1.0 - s) + node(1, 1) * s) * t;
            self.texels[idx] = self.texels[idx].map(|value| value * (1.0 + amplitude * noise));
        }
    }

    /// Texture coordinates of a place.
    pub fn uv(&self, place: Place) -> [f32; 2] {
        [0, 1].map(|i| (place[i] - self.low[i]) / (self.high[i] - self.low[i]))
    }

    pub fn to_image(&self) -> RgbImage {
        let [width, height] = self.size;
        RgbImage::from_fn(width as u32, height as u32, |column, row| {
            let texel = self.texels[row as usize * width + column as usize];
            Rgb(texel.map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8))
        })
    }

    /// Covers with `color` where `depth`, the distance in metres inside of an edge, is positive.
    fn blend(&mut self, around: &[Place], margin: f32, color: Color, depth: impl Fn(Place) -> f32) {
        let texel = 1.0 / TEXELS_PER_METRE;
        let reach = margin + texel;
        let end = |i: usize, choose: fn(f32, f32) -> f32, start: f32| {
            around.iter().map(|place| place[i]).fold(start, choose)
        };
        let low = [0, 1].map(|i| end(i, f32::min, f32::INFINITY) - reach);
        let high = [0, 1].map(|i| end(i, f32::max, f32::NEG_INFINITY) + reach);

        let [width, height] = self.size;
        let columns = texels_between(low[0] - self.low[0], high[0] - self.low[0], width);
        let rows = texels_between(self.high[1] - high[1], self.high[1] - low[1], height);
        for row in rows {
            for idx in columns.clone().map(|column| row * width + column) {
                let coverage = (0.5 + depth(self.place(idx)) / texel).clamp(0.0, 1.0);
                for (value, target) in self.texels[idx].iter_mut().zip(color) {
                    *value += (target - *value) * coverage;
                }
            }
        }
    }

    /// The middle of a texel.
    fn place(&self, idx: usize) -> Place {
        let [width, height] = self.size;
        let right = ((idx % width) as f32 + 0.5) / width as f32;
        let down = ((idx / width) as f32 + 0.5) / height as f32;
        [
            self.low[0] + right * (self.high[0] - self.low[0]),
            self.high[1] - down * (self.high[1] - self.low[1]),
        ]
    }
}

/// An outline between a diamond and a box, `|x|ᵏ + |y|ᵏ = 1` stretched to `half_size`: an ellipse
/// at exponent 2, a rounded rectangle at 6.
pub fn superellipse(center: Place, half_size: Place, exponent: f32) -> Vec<Place> {
    (0..32)
        .map(|step| {
            let (sine, cosine) = (step as f32 / 32.0 * std::f32::consts::TAU).sin_cos();
            let power = |x: f32| x.signum() * x.abs().powf(2.0 / exponent);
            [center[0] + half_size[0] * power(cosine), center[1] + half_size[1] * power(sine)]
        })
        .collect()
}

pub fn rectangle([x0, y0]: Place, [x1, y1]: Place) -> [Place; 4] {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

fn texels_between(start: f32, end: f32, limit: usize) -> std::ops::Range<usize> {
    let texel = |metres: f32| ((metres * TEXELS_PER_METRE).max(0.0) as usize).min(limit);
    texel(start)..(texel(end) + 1).min(limit)
}

/// Distance to the nearest point of a polyline.
fn distance_to(path: &[Place], closed: bool, [x, y]: Place) -> f32 {
    let n_edges = if closed { path.len() } else { path.len().saturating_sub(1) };
    let squared = (0..n_edges).map(|edge| {
        let ([ax, ay], [bx, by]) = (path[edge], path[(edge + 1) % path.len()]);
        let (dx, dy) = (bx - ax, by - ay);
        let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy).max(1e-12);
        let along = along.clamp(0.0, 1.0);
        (x - ax - along * dx).powi(2) + (y - ay - along * dy).powi(2)
    });
    squared.fold(f32::INFINITY, f32::min).sqrt()
}

/// Whether a ray to the right crosses the outline an odd number of times.
fn contains(outline: &[Place], [x, y]: Place) -> bool {
    let edges = (0..outline.len()).map(|i| (outline[i], outline[(i + 1) % outline.len()]));
    let crossings = edges.filter(|&([ax, ay], [bx, by])| {
        (ay > y) != (by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay)
    });
    crossings.count() % 2 == 1
}
