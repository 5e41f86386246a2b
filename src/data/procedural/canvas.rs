//! Painting flat pictures that are projected onto the body.

use std::ops::Range;

use image::RgbImage;
use rand::Rng;

/// RGB in [0, 1].
pub type Color = [f32; 3];
/// A place on a picture, in metres.
pub type Place = [f32; 2];

/// Texels a metre: a few for each pixel of a car that fills a 128-pixel picture.
const TEXELS_PER_METRE: f32 = 80.0;

/// The side of a texel, in metres.
const TEXEL: f32 = 1.0 / TEXELS_PER_METRE;

/// A straight line between two places.
type Edge = [Place; 2];

/// A picture of one side of a car, to scale.
pub struct Canvas {
    low: Place,
    high: Place,
    /// Where the middles of the columns lie, from the left, and those of the rows, from the top.
    middles: [Vec<f32>; 2],
    texels: Vec<Color>, // row by row
}

/// A rectangle of texels.
struct Window {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Window {
    /// Numbers of its texels in a picture of this width, row by row.
    fn texels(&self, width: usize) -> impl Iterator<Item = usize> {
        let columns = self.columns.clone();
        self.rows
            .clone()
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

impl Canvas {
    /// One colour between the corners `low` and `high`.
    pub fn new(low: Place, high: Place, color: Color) -> Self {
        let extent = [high[0] - low[0], high[1] - low[1]];
        let size = extent.map(|extent| (extent * TEXELS_PER_METRE).ceil().max(1.0) as usize);
        let middles =
            |i: usize| (0..size[i]).map(move |texel| (texel as f32 + 0.5) / size[i] as f32);
        let columns = middles(0).map(|right| low[0] + right * extent[0]);
        let rows = middles(1).map(|down| high[1] - down * extent[1]);
        Self {
            low,
            high,
            middles: [columns.collect(), rows.collect()],
            texels: vec![color; size[0] * size[1]],
        }
    }

    /// Fills a closed outline, with smooth edges.
    pub fn fill(&mut self, outline: &[Place], color: Color) {
        let window = self.window(outline, TEXEL);
        let distances = self.distances(&window, &closed(outline), TEXEL);
        let inside = self.inside(&window, outline);
        let depths = distances.into_iter().zip(inside);
        self.blend(&window, color, depths.map(|(d, inside)| if inside { d } else { -d }));
    }

    /// Draws a line of the given width, in metres, along an open path.
    pub fn trace(&mut self, path: &[Place], width: f32, color: Color) {
        let edges: Vec<_> = path.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        self.draw(&edges, width, color);
    }

    /// Draws a line of the given width, in metres, around a closed outline.
    pub fn outline(&mut self, outline: &[Place], width: f32, color: Color) {
        self.draw(&closed(outline), width, color);
    }

    /// Multiplies smooth noise of the given cell size, in metres, onto the picture.
    pub fn grain(&mut self, cell: f32, amplitude: f32, rng: &mut impl Rng) {
        let n_cells = [0, 1].map(|i| ((self.high[i] - self.low[i]) / cell).ceil() as usize + 2);
        let lattice: Vec<f32> =
            (0..n_cells[0] * n_cells[1]).map(|_| rng.random_range(-1.0..1.0)).collect();
        // The cell that a middle lies in, and how far in.
        let [across, up] = [0, 1].map(|i| -> Vec<(usize, f32)> {
            let cells = self.middles[i].iter().map(|x| ((x - self.low[i]) / cell).max(0.0));
            cells.map(|x| (x as usize, x.fract())).collect()
        });
        for (texels, &(row, t)) in self.texels.chunks_mut(across.len()).zip(&up) {
            let [lower, upper] =
                [row, row + 1].map(|row| &lattice[row * n_cells[0]..][..n_cells[0]]);
            for (texel, &(column, s)) in texels.iter_mut().zip(&across) {
                let along = |row: &[f32]| row[column] * (1.0 - s) + row[column + 1] * s;
                let noise = along(lower) * (1.0 - t) + along(upper) * t;
                *texel = texel.map(|value| value * (1.0 + amplitude * noise));
            }
        }
    }

    /// Texture coordinates of a place.
    pub fn uv(&self, place: Place) -> [f32; 2] {
        [0, 1].map(|i| (place[i] - self.low[i]) / (self.high[i] - self.low[i]))
    }

    pub fn to_image(&self) -> RgbImage {
        let [width, height] = self.size().map(|size| size as u32);
        let bytes = self.texels.as_flattened().iter().map(|value| {
            (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8 // rounded
        });
        RgbImage::from_raw(width, height, bytes.collect()).expect("three bytes a texel")
    }

    fn draw(&mut self, edges: &[Edge], width: f32, color: Color) {
        let reach = width + TEXEL;
        let window = self.window(edges.as_flattened(), reach);
        let distances = self.distances(&window, edges, reach);
        self.blend(&window, color, distances.into_iter().map(|d| 0.5 * width - d));
    }

    /// Covers with `color` where the depth inside of an edge, in metres, is positive.
    fn blend(&mut self, window: &Window, color: Color, depths: impl Iterator<Item = f32>) {
        for (idx, depth) in window.texels(self.size()[0]).zip(depths) {
            let coverage = (0.5 + depth / TEXEL).clamp(0.0, 1.0);
            for (value, target) in self.texels[idx].iter_mut().zip(color) {
                *value += (target - *value) * coverage;
            }
        }
    }

    /// Distances of a window's texels from the nearest edge; infinite where none is in reach.
    fn distances(&self, window: &Window, edges: &[Edge], reach: f32) -> Vec<f32> {
        let width = window.columns.len();
        let mut squared = vec![f32::INFINITY; width * window.rows.len()];
        for edge in edges {
            let near = self.window(edge, reach);
            let xs = &self.middles[0][near.columns.clone()];
            for row in near.rows {
                let start = (row - window.rows.start) * width + near.columns.start;
                let nearest = &mut squared[start - window.columns.start..][..xs.len()];
                let y = self.middles[1][row];
                for (nearest, &x) in nearest.iter_mut().zip(xs) {
                    *nearest = nearest.min(squared_distance(edge, [x, y]));
                }
            }
        }
        squared.into_iter().map(f32::sqrt).collect()
    }

    /// Which texels of a window lie inside: a ray to the right crosses the outline an odd number of
    /// times.
    fn inside(&self, window: &Window, outline: &[Place]) -> Vec<bool> {
        let mut inside = Vec::with_capacity(window.columns.len() * window.rows.len());
        for row in window.rows.clone() {
            let y = self.middles[1][row];
            let edges = closed(outline).into_iter();
            let crossed = edges.filter(|[[_, ay], [_, by]]| (*ay > y) != (*by > y));
            let crossings: Vec<f32> =
                crossed.map(|[[ax, ay], [bx, by]]| ax + (bx - ax) * (y - ay) / (by - ay)).collect();
            inside.extend(
                self.middles[0][window.columns.clone()]
                    .iter()
                    .map(|x| crossings.iter().filter(|&crossing| x < crossing).count() % 2 == 1),
            );
        }
        inside
    }

    /// The texels in reach of some places.
    fn window(&self, places: &[Place], reach: f32) -> Window {
        let end = |i: usize, choose: fn(f32, f32) -> f32, start: f32| {
            places.iter().map(|place| place[i]).fold(start, choose)
        };
        let low = [0, 1].map(|i| end(i, f32::min, f32::INFINITY) - reach);
        let high = [0, 1].map(|i| end(i, f32::max, f32::NEG_INFINITY) + reach);
        let [width, height] = self.size();
        Window {
            columns: texels_between(low[0] - self.low[0], high[0] - self.low[0], width),
            rows: texels_between(self.high[1] - high[1], self.high[1] - low[1], height),
        }
    }

    /// Columns and rows.
    fn size(&self) -> [usize; 2] {
        [0, 1].map(|i| self.middles[i].len())
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

fn texels_between(start: f32, end: f32, limit: usize) -> Range<usize> {
    let texel = |metres: f32| ((metres * TEXELS_PER_METRE).max(0.0) as usize).min(limit);
    texel(start)..(texel(end) + 1).min(limit)
}

/// The edges of a closed outline.
fn closed(outline: &[Place]) -> Vec<Edge> {
    (0..outline.len()).map(|i| [outline[i], outline[(i + 1) % outline.len()]]).collect()
}

/// From the nearest point of an edge.
fn squared_distance([[ax, ay], [bx, by]]: &Edge, [x, y]: Place) -> f32 {
    let (dx, dy) = (bx - ax, by - ay);
    let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy).max(1e-12);
    let along = along.clamp(0.0, 1.0);
    (x - ax - along * dx).powi(2) + (y - ay - along * dy).powi(2)
}
