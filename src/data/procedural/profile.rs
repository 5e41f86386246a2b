//! The lines of a car: side profile, plan and landmarks.
//!
//! In the workshop frame: metres, x to the car's right, y up from the ground, z backwards from the
//! middle of the car.

mod arches;
mod plan;

use super::{
    curve::{sample_polyline, smooth},
    parameters::{BodyStyle, CarParameters},
};
use arches::GAP;

pub use arches::FLARE_WIDTH;

/// Samples of the roof line.
const N_SAMPLES: usize = 1001;
/// Rounding of the upper edges of a truck's box, in metres.
const BOX_EDGE: f32 = 0.04;

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
        let bonnet_edge = bonnet_height - ends.bonnet_fall * size.height;
        let nose_height = ends.nose * bonnet_edge;
        let roof_height = cabin.height * size.height;
        let roof_end_height = roof_height * (1.0 - cabin.roof_fall);
        let deck_height = hull.deck * size.height;
        let roof_start = cabin.cowl + run(roof_height - bonnet_height, cabin.windscreen_rake);
        let roof_end = cabin.roof_end.max(roof_start + 0.05).min(0.97);
        let deck_start = roof_end + run(roof_end_height - deck_height, cabin.rear_rake);
        let deck_start = deck_start.clamp(roof_end + 0.002, 0.985);
        let tail_height = deck_height * ends.tail;
        // Where a box follows, the roof line under it goes on, so that smoothing keeps the cab's.
        let boxed = parameters.style == BodyStyle::BoxTruck;
        let behind = |height: f32| if boxed { roof_end_height } else { height };

        let corners = [
            [0.0, nose_height],
            [0.01, nose_height * 1.03],
            [0.045, bonnet_edge],
            [cabin.cowl, bonnet_height],
            [roof_start, roof_height * 0.985],
            [0.5 * (roof_start + roof_end), roof_height],
            [roof_end, roof_end_height],
            [deck_start, behind(deck_height)],
            [0.988_f32.max(deck_start + 0.002), behind(tail_height)],
            [1.0, behind(tail_height * 0.95)],
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
            arch_radius: axles.radius * (1.0 + GAP),
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
        if self.in_box(z) {
            return self.parameters.size.height - self.edge_inset(z);
        }
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

    /// Half the body's width where the sides meet the roof, the bonnet or the deck.
    pub fn shoulder(&self, z: f32) -> f32 {
        self.cant(z).half_width
    }

    /// The rounded edge between side and roof at `z`.
    pub fn cant(&self, z: f32) -> Cant {
        if self.in_box(z) {
            return Cant { half_width: self.half_width(z), radius: BOX_EDGE };
        }
        let CarParameters { size, cabin, .. } = &self.parameters;
        let side = (self.top(z) - self.belt(z)).max(0.06);
        let lean = cabin.tumblehome * (side / (0.4 * size.height)).min(1.3);
        Cant {
            half_width: self.half_width(z) - self.shelf(z) - lean * size.width / 2.0,
            radius: (0.4 * side + 0.02).min(cabin.cant * size.height),
        }
    }

    /// How far the windows stand inside the shoulders at `z`; the bonnet has none.
    pub fn shelf(&self, z: f32) -> f32 {
        if self.in_box(z) {
            return 0.0;
        }
        self.parameters.cabin.shelf * ramp((self.top(z) - self.belt(z) - 0.06) / 0.2)
    }

    /// The load bed of a pickup or the cockpit of an open car, z, if there is one.
    pub fn bed(&self) -> Option<[f32; 2]> {
        match self.parameters.style {
            BodyStyle::Pickup => Some([self.deck_start + 0.07, self.rear - 0.09]),
            BodyStyle::Roadster => Some([self.cowl + 0.3, self.roof_end]),
            _ => None,
        }
    }

    /// Whether the box of a truck stands at `z`.
    pub fn in_box(&self, z: f32) -> bool {
        self.parameters.style == BodyStyle::BoxTruck && z >= self.roof_end
    }

    fn fraction(&self, z: f32) -> f32 {
        ((z - self.front) / (self.rear - self.front)).clamp(0.0, 1.0)
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
