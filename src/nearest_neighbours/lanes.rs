//! Arithmetic on eight numbers side by side, in loops that the compiler turns into vectors.

/// Points of a leaf, and boxes of a node.
pub const WIDTH: usize = 8;

pub type Lanes = [f32; WIDTH];

/// Points, by axis. Lanes beyond the last point are at infinity.
pub struct Locations([Lanes; 3]);

/// Axis-aligned boxes, by axis. Lanes beyond the last box are at infinity.
pub struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

/// An axis-aligned box, or what is in no box yet.
#[derive(Clone, Copy)]
pub struct Bounds {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Locations {
    /// At most [`WIDTH`] points.
    pub fn new(points: impl Iterator<Item = [f32; 3]>) -> Self {
        Self(by_axis(points))
    }

    pub fn get(&self, lane: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.0[axis][lane])
    }

    #[inline]
    pub fn squared_distances(&self, query: [f32; 3]) -> Lanes {
        let mut squared = [0.0; WIDTH];
        for (lanes, at) in self.0.iter().zip(query) {
            for (sum, x) in squared.iter_mut().zip(lanes) {
                *sum += (x - at) * (x - at);
            }
        }
        squared
    }
}

impl Boxes {
    /// At most [`WIDTH`] boxes.
    pub fn new(bounds: &[Bounds]) -> Self {
        Self {
            low: by_axis(bounds.iter().map(|bounds| bounds.low)),
            high: by_axis(bounds.iter().map(|bounds| bounds.high)),
        }
    }

    /// Zero inside. Rounded, these are still no larger than those of the points inside: each step
    /// rounds the smaller of two numbers to the smaller result.
    #[inline]
    pub fn squared_distances(&self, query: [f32; 3]) -> Lanes {
        let mut squared = [0.0; WIDTH];
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(query) {
            for (sum, (low, high)) in squared.iter_mut().zip(low.iter().zip(high)) {
                let outside = larger(larger(low - at, at - high), 0.0);
                *sum += outside * outside;
            }
        }
        squared
    }
}

impl Bounds {
    pub const NONE: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    #[inline]
    pub fn with(self, other: Self) -> Self {
        Self {
            low: [0, 1, 2].map(|axis| smaller(self.low[axis], other.low[axis])),
            high: [0, 1, 2].map(|axis| larger(self.high[axis], other.high[axis])),
        }
    }

    pub fn longest_axis(&self) -> usize {
        let extent = |axis: usize| self.high[axis] - self.low[axis];
        let longer = |a, b| if extent(b) > extent(a) { b } else { a };
        longer(longer(0, 1), 2)
    }
}

impl From<[f32; 3]> for Bounds {
    fn from(point: [f32; 3]) -> Self {
        Self { low: point, high: point }
    }
}

/// As [`Locations::squared_distances`] has it, to the last bit.
#[inline]
pub fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.into_iter().zip(b).fold(0.0, |sum, (a, b)| sum + (a - b) * (a - b))
}

/// A bit for each lane that is smaller than `bound`.
#[inline]
pub fn smaller_than(lanes: &Lanes, bound: f32) -> u32 {
    let bits: [u32; WIDTH] = std::array::from_fn(|i| if lanes[i] < bound { 1 << i } else { 0 });
    bits.iter().fold(0, |all, bit| all | bit)
}

/// The lane of the smallest of those whose bits are set; there must be one.
#[inline]
pub fn smallest_among(lanes: &Lanes, mut set: u32) -> usize {
    let mut smallest = set.trailing_zeros() as usize;
    set &= set - 1;
    while set != 0 {
        let lane = set.trailing_zeros() as usize;
        if lanes[lane] < lanes[smallest] {
            smallest = lane;
        }
        set &= set - 1;
    }
    smallest
}

#[inline]
pub fn smallest(lanes: &Lanes) -> f32 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    let [a, b, c, d] = [smaller(a, e), smaller(b, f), smaller(c, g), smaller(d, h)];
    smaller(smaller(a, c), smaller(b, d))
}

// A single instruction each, unlike `f32::min` and `f32::max`, which care for what is not a number.

#[inline]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

fn by_axis(points: impl Iterator<Item = [f32; 3]>) -> [Lanes; 3] {
    let mut axes = [[f32::INFINITY; WIDTH]; 3];
    for (lane, point) in points.enumerate() {
        axes.iter_mut().zip(point).for_each(|(lanes, x)| lanes[lane] = x);
    }
    axes
}
