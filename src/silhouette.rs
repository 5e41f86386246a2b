//! One frame's silhouette: its pixels, as Eq. 5 counts them, and its outline, to a fraction of one.

use crate::{
    data::{ScalarImage, bilinear::bilinear},
    nearest_neighbours::NearestNeighbours,
};

/// Coverage above which a location belongs to the object.
pub const MASK_THRESHOLD: f32 = 0.5;
/// Samples of the outline along each of its segments, which are about a pixel long.
const SAMPLES_PER_SEGMENT: usize = 4;

/// The object in one frame, ready to be matched with projected points.
pub struct Silhouette {
    /// U_l1: centres of the pixels inside.
    pub pixels: Vec<[f32; 2]>,
    /// Where coverage crosses one half, sampled about every quarter of a pixel.
    pub outline: Vec<[f32; 2]>,
    /// The outline's direction at each of its samples, of unit length, and the length in pixels that
    /// each stands for.
    tangents: Vec<[f32; 2]>,
    lengths: Vec<f32>,
    coverage: ScalarImage,
    pixel_search: NearestNeighbours,
    outline_search: Option<NearestNeighbours>,
}

impl Silhouette {
    /// `None` when no pixel of the mask belongs to the object.
    pub fn new(mask: &ScalarImage) -> Option<Self> {
        let pixels: Vec<_> = mask
            .enumerate_pixels()
            .filter(|(_, _, coverage)| coverage[0] > MASK_THRESHOLD)
            .map(|(u, v, _)| [u as f32 + 0.5, v as f32 + 0.5])
            .collect();
        if pixels.is_empty() {
            return None;
        }
        let samples = outline(mask);
        let outline: Vec<_> = samples.iter().map(|sample| sample.at).collect();
        let search = |points: &[[f32; 2]]| NearestNeighbours::in_plane(points.iter().copied());
        Some(Self {
            pixel_search: search(&pixels),
            outline_search: (!outline.is_empty()).then(|| search(&outline)),
            pixels,
            outline,
            tangents: samples.iter().map(|sample| sample.tangent).collect(),
            lengths: samples.iter().map(|sample| sample.length).collect(),
            coverage: mask.clone(),
        })
    }

    /// The weight of an outline's sample, where a pixel's is 1: they lie that much closer.
    pub const OUTLINE_WEIGHT: f32 = 1.0 / SAMPLES_PER_SEGMENT as f32;

    /// [width, height] of the frame, in pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.coverage.width() as usize, self.coverage.height() as usize]
    }

    /// The centre of the silhouette's pixel nearest to a location: its own pixel's, when inside.
    pub fn nearest_pixel(&self, location: [f32; 2]) -> [f32; 2] {
        let [u, v] = location;
        let (width, height) = self.coverage.dimensions();
        let in_frame = u >= 0.0 && v >= 0.0 && u < width as f32 && v < height as f32;
        match in_frame && self.coverage.get_pixel(u as u32, v as u32)[0] > MASK_THRESHOLD {
            true => [u.floor() + 0.5, v.floor() + 0.5],
            false => self.pixels[self.pixel_search.nearest_pixel(location) as usize],
        }
    }

    /// The line through a sample of the outline, along its tangent, as far as `reach` pixels each way.
    pub fn segment(&self, sample: usize, reach: f32) -> Segment {
        Segment { middle: self.outline[sample], tangent: self.tangents[sample], reach }
    }

    /// The location itself where it is inside, else the nearest of the outline.
    ///
    /// Beyond the frame, the coverage of its border goes on: nothing is known there.
    pub fn nearest_inside(&self, location: [f32; 2]) -> Target {
        let [coverage] = bilinear(&self.coverage, location);
        match &self.outline_search {
            Some(search) if coverage <= MASK_THRESHOLD => {
                let sample = search.nearest_pixel(location) as usize;
                self.segment(sample, 0.5 * self.lengths[sample]).nearest(location)
            }
            _ => location.into(),
        }
    }
}

/// A straight piece of the plane, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    pub middle: [f32; 2],
    /// Its direction, of unit length; zero where it has none.
    pub tangent: [f32; 2],
    /// From the middle to either end.
    pub reach: f32,
}

impl Segment {
    /// What of the segment a location is nearest to: all of its line between its ends, else one end.
    pub fn nearest(&self, location: [f32; 2]) -> Target {
        let Self { middle, tangent, reach } = *self;
        let along: f32 = (0..2).map(|axis| (location[axis] - middle[axis]) * tangent[axis]).sum();
        if along.abs() <= reach {
            return Target { at: middle, tangent };
        }
        let end = reach.copysign(along);
        Target::from([0, 1].map(|axis| middle[axis] + end * tangent[axis]))
    }
}

/// Where a projected point should be: at a location, or anywhere on a line through it.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub at: [f32; 2],
    /// Direction of the line, of unit length; zero where there is none.
    pub tangent: [f32; 2],
}

impl From<[f32; 2]> for Target {
    fn from(at: [f32; 2]) -> Self {
        Self { at, tangent: [0.0; 2] }
    }
}

impl Target {
    /// From the target straight to a location, in pixels.
    pub fn offset(&self, location: [f32; 2]) -> [f32; 2] {
        let offset = [0, 1].map(|axis| location[axis] - self.at[axis]);
        let along = offset[0] * self.tangent[0] + offset[1] * self.tangent[1];
        [0, 1].map(|axis| offset[axis] - along * self.tangent[axis])
    }

    /// The squared distance of a location, in pixels².
    pub fn squared(&self, location: [f32; 2]) -> f32 {
        let [u, v] = self.offset(location);
        u * u + v * v
    }
}

/// A piece of the outline: its middle, its direction and its length, in pixels.
struct Sample {
    at: [f32; 2],
    tangent: [f32; 2],
    length: f32,
}

/// Marching squares over the pixel centres.
fn outline(mask: &ScalarImage) -> Vec<Sample> {
    let (width, height) = mask.dimensions();
    let squares = (1..height).flat_map(|v| (1..width).map(move |u| (u - 1, v - 1)));
    squares.flat_map(|(u, v)| crossings(mask, u, v)).flat_map(samples).collect()
}

/// The segments of the outline within the square whose first corner is the centre of pixel (u, v).
fn crossings(mask: &ScalarImage, u: u32, v: u32) -> Vec<[[f32; 2]; 2]> {
    let corners = [(u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1)];
    let mut found = Vec::new();
    for (i, &(u, v)) in corners.iter().enumerate() {
        let (next_u, next_v) = corners[(i + 1) % 4];
        let [here, next] =
            [(u, v), (next_u, next_v)].map(|(u, v)| mask.get_pixel(u, v)[0] - MASK_THRESHOLD);
        if (here > 0.0) != (next > 0.0) {
            let share = here / (here - next);
            let between = |a: u32, b: u32| a as f32 + 0.5 + share * (b as f32 - a as f32);
            found.push([between(u, next_u), between(v, next_v)]);
        }
    }
    // Two crossings, or four around a saddle, of which neighbours belong together.
    found.chunks_exact(2).map(|ends| [ends[0], ends[1]]).collect()
}

/// Pieces of equal length that make up a segment; one that begins where it ends has no direction.
fn samples([start, end]: [[f32; 2]; 2]) -> impl Iterator<Item = Sample> {
    let offset = [0, 1].map(|axis| end[axis] - start[axis]);
    let length = offset[0].hypot(offset[1]);
    let tangent = offset.map(|x| if length > 0.0 { x / length } else { 0.0 });
    (0..SAMPLES_PER_SEGMENT).map(move |k| {
        let share = (k as f32 + 0.5) / SAMPLES_PER_SEGMENT as f32;
        let at = [0, 1].map(|axis| start[axis] + share * offset[axis]);
        Sample { at, tangent, length: length / SAMPLES_PER_SEGMENT as f32 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    /// A disc about (16.3, 15.6) whose rim covers pixels in part.
    const CENTER: [f32; 2] = [16.3, 15.6];
    const RADIUS: f32 = 9.0;

    fn from_center([u, v]: [f32; 2]) -> f32 {
        (u - CENTER[0]).hypot(v - CENTER[1])
    }

    fn disc() -> Silhouette {
        let mask = ScalarImage::from_fn(32, 32, |u, v| {
            let samples = (0..64).map(|k| {
                [u as f32 + (k % 8) as f32 / 8.0 + 0.0625, v as f32 + (k / 8) as f32 / 8.0 + 0.0625]
            });
            Luma([samples.filter(|&at| from_center(at) < RADIUS).count() as f32 / 64.0])
        });
        Silhouette::new(&mask).expect("a disc")
    }

    #[test]
    fn the_outline_of_a_disc_is_its_circle_to_a_fraction_of_a_pixel() {
        let outline = disc().outline;
        assert!(outline.len() as f32 > 3.0 * std::f32::consts::TAU * RADIUS);
        for at in outline {
            assert!((from_center(at) - RADIUS).abs() < 0.15, "{at:?}");
        }
    }

    #[test]
    fn locations_inside_stay_and_others_move_to_the_outline() {
        let disc = disc();
        for k in 0..200 {
            let (turn, radius) = (k as f32, 0.1 * k as f32);
            let at = [CENTER[0] + radius * turn.cos(), CENTER[1] + radius * turn.sin()];
            let [u, v] = disc.nearest_inside(at).offset(at);
            let moved = u.hypot(v);
            assert!((moved - (radius - RADIUS).max(0.0)).abs() < 0.15, "{at:?} moved by {moved}");
        }
    }

    /// From a location that is 0.4 px inside of a sample and 0.6 px beside it.
    #[test]
    fn distances_are_taken_across_the_outline_within_reach() {
        let disc = disc();
        let pieces =
            disc.outline.iter().enumerate().filter(|(sample, _)| disc.lengths[*sample] > 0.1);
        for (sample, &at) in pieces {
            let out = [0, 1].map(|axis| (at[axis] - CENTER[axis]) / from_center(at));
            let along = [-out[1], out[0]];
            let location = [0, 1].map(|axis| at[axis] - 0.4 * out[axis] + 0.6 * along[axis]);
            let distance =
                |reach: f32| disc.segment(sample, reach).nearest(location).squared(location).sqrt();
            // Marching squares turn by some degrees from one pixel to the next.
            assert!((distance(1.0) - 0.4).abs() < 0.2, "{location:?}: {}", distance(1.0));
            let straight = 0.4f32.hypot(0.6);
            assert!((distance(0.0) - straight).abs() < 1e-5, "{location:?}: {}", distance(0.0));
        }
    }

    #[test]
    fn an_object_cut_by_the_frame_goes_on_beyond_it() {
        let mask = ScalarImage::from_fn(8, 6, |u, _| Luma([if u < 4 { 1.0 } else { 0.0 }]));
        let half = Silhouette::new(&mask).expect("half a frame");
        assert_eq!(half.nearest_inside([-3.0, 2.0]).offset([-3.0, 2.0]), [0.0; 2]);
        assert_eq!(half.nearest_inside([6.0, 2.6]).offset([6.0, 2.6]), [2.0, 0.0]);
        let full = Silhouette::new(&ScalarImage::from_pixel(4, 4, Luma([1.0]))).expect("full");
        assert!(full.outline.is_empty());
        assert_eq!(full.nearest_inside([9.0, 9.0]).at, [9.0, 9.0]);
    }

    #[test]
    fn an_empty_mask_has_no_silhouette() {
        assert!(Silhouette::new(&ScalarImage::new(4, 4)).is_none());
        assert!(Silhouette::new(&ScalarImage::new(0, 0)).is_none());
    }
}
