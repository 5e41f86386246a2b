//! The lines of a car: side profile, plan and landmarks.
//!
//! In the workshop frame: metres, x to the car's right, y up from the ground, z backwards from the
//! middle of the car.

use super::{
    curve::{sample_polyline, smooth},
    parameters::CarParameters,
};

/// Samples of the roof line.
const N_SAMPLES: usize = 1001;
/// Free space between a wheel and its arch, as a fraction of the wheel's radius.
const ARCH_GAP: f32 = 0.13;

/// Where things are on one car, in the workshop frame.
pub struct Profile {
    pub parameters: CarParameters,
    /// Ends of the body, z.
    pub front: f32,
    pub rear: f32,
    pub cowl: f32,
    pub roof_start: f32,
    pub roof_end: f32,
    /// Where the rear window meets the deck, z.
    pub deck_start: f32,
    /// The axles, z.
    pub axles: [f32; 2],
    pub arch_radius: f32,
    /// Heights, y.
    pub nose_height: f32,
    pub bonnet_height: f32,
    pub deck_height: f32,
    roof_line: Vec<f32>, // heights, evenly spaced from front to rear
}

impl Profile {
    pub fn new(parameters: &CarParameters) -> Self {
        let CarParameters { size, axles, cabin, hull, ends, .. } = *parameters;
        let run = |rise: f32, rake: f32| rise / rake.to_radians().tan() / size.length;

        let bonnet_height = hull.bonnet * size.height;
        let nose_height = ends.nose * bonnet_height;
        let roof_end_height = size.height * (1.0 - cabin.roof_fall);
        let deck_height = hull.deck * size.height;
        let roof_start = cabin.cowl + run(size.height - bonnet_height, cabin.windscreen_rake);
        let roof_end = cabin.roof_end.max(roof_start + 0.05).min(0.97);
        let deck_start =
            (roof_end + run(roof_end_height - deck_height, cabin.rear_rake)).min(0.985);
        let tail_height = deck_height * ends.tail;

        let corners = [
            [0.0, nose_height],
            [0.01, nose_height * 1.03],
            [0.045, bonnet_height - ends.bonnet_fall * size.height],
            [cabin.cowl, bonnet_height],
            [roof_start, size.height * 0.985],
            [0.5 * (roof_start + roof_end), size.height],
            [roof_end, roof_end_height],
            [deck_start, deck_height],
            [0.988_f32.max(deck_start + 0.002), tail_height],
            [1.0, tail_height * 0.95],
        ];
        let along = |fraction: f32| (fraction - 0.5) * size.length;
        Self {
            parameters: *parameters,
            front: along(0.0),
            rear: along(1.0),
            cowl: along(cabin.cowl),
            roof_start: along(roof_start),
            roof_end: along(roof_end),
            deck_start: along(deck_start),
            axles: [along(axles.front), along(axles.rear)],
            arch_radius: axles.radius * (1.0 + ARCH_GAP),
            nose_height,
            bonnet_height,
            deck_height,
            roof_line: smooth(
                &sample_polyline(&corners, N_SAMPLES),
                hull.softness * N_SAMPLES as f32,
            ),
        }
    }

    /// Height of the body's upper outline at `z`.
    pub fn top(&self, z: f32) -> f32 {
        let position = self.fraction(z) * (N_SAMPLES - 1) as f32;
        let below = (position as usize).min(N_SAMPLES - 2);
        let [left, right] = [self.roof_line[below], self.roof_line[below + 1]];
        left + (right - left) * (position - below as f32) - self.edge_inset(z)
    }

    /// Height of the floor at `z`; it rises towards both ends.
    pub fn bottom(&self, z: f32) -> f32 {
        let t = self.fraction(z);
        let rise = 0.07 * ramp((0.06 - t) / 0.06) + 0.10 * ramp((t - 0.93) / 0.07);
        self.parameters.size.clearance + rise + self.edge_inset(z)
    }

    /// Height of the windows' lower edge at `z`, where there are windows.
    pub fn belt(&self, z: f32) -> f32 {
        let hull = &self.parameters.hull;
        (hull.belt + hull.wedge * (self.fraction(z) - 0.5)) * self.parameters.size.height
    }

    /// Half the body's width at `z`, at the widest.
    pub fn half_width(&self, z: f32) -> f32 {
        let t = self.fraction(z);
        let ends = &self.parameters.ends;
        let taper = ends.front_taper * ramp((0.25 - t) / 0.25).powf(2.2)
            + ends.rear_taper * ramp((t - 0.75) / 0.25).powf(2.2);
        self.parameters.size.width / 2.0 * (1.0 - taper) - self.edge_inset(z)
    }

    /// Half the body's width where the sides meet the roof, the bonnet or the deck.
    pub fn shoulder(&self, z: f32) -> f32 {
        self.cant(z).half_width
    }

    /// The rounded edge between side and roof at `z`.
    pub fn cant(&self, z: f32) -> Cant {
        let height = self.parameters.size.height;
        let side = (self.top(z) - self.belt(z)).max(0.06);
        let lean = self.parameters.cabin.tumblehome * (side / (0.4 * height)).min(1.3);
        Cant {
            half_width: self.half_width(z) - lean * self.parameters.size.width / 2.0,
            radius: (0.4 * side + 0.02).min(0.085 * height),
        }
    }

    /// Height of the wheel arch over `z`, if there is one.
    pub fn arch(&self, z: f32) -> Option<f32> {
        self.axles.iter().find_map(|axle| {
            let squared = self.arch_radius.powi(2) - (z - axle).powi(2);
            // The arch's end, up to rounding, belongs to it.
            (squared > -1e-4).then(|| self.parameters.axles.radius + squared.max(0.0).sqrt())
        })
    }

    /// How far the ends' middle stands before their corners, at `z` and half width fraction `x`.
    pub fn bow(&self, x_fraction: f32, z: f32) -> f32 {
        let ends = &self.parameters.ends;
        // The bow fades out before the wheel arch, and too slowly for sections to cross.
        let fade = |depth: f32, overhang: f32, bow: f32| {
            bow.min(0.4 * overhang) * ramp(1.0 - depth / overhang).powi(2)
        };
        let front_overhang = self.axles[0] - self.arch_radius - self.front;
        let rear_overhang = self.rear - self.axles[1] - self.arch_radius;
        let front = fade(z - self.front, front_overhang, ends.front_bow);
        let rear = fade(self.rear - z, rear_overhang, ends.rear_bow);
        x_fraction.powi(2) * (front - rear)
    }

    /// The load bed of a pickup, z, if there is one.
    pub fn bed(&self) -> Option<[f32; 2]> {
        let deep = self.parameters.fittings.bed_depth > 0.0;
        deep.then_some([self.deck_start + 0.07, self.rear - 0.09])
    }

    fn fraction(&self, z: f32) -> f32 {
        ((z - self.front) / (self.rear - self.front)).clamp(0.0, 1.0)
    }

    /// A quarter round on the edges of both ends.
    fn edge_inset(&self, z: f32) -> f32 {
        let radius = self.parameters.ends.edge_radius;
        let remaining = radius - (z - self.front).min(self.rear - z).clamp(0.0, radius);
        radius - (radius * radius - remaining * remaining).max(0.0).sqrt()
    }
}

/// The rounded edge between side and roof.
#[derive(Clone, Copy, Debug)]
pub struct Cant {
    /// Outer half width.
    pub half_width: f32,
    pub radius: f32,
}

fn ramp(x: f32) -> f32 {
    x.clamp(0.0, 1.0)
}
