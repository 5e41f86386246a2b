//! Wheel arches.

use super::{Profile, ramp};

/// Free space between a wheel and its arch, as a fraction of the wheel's radius.
pub const GAP: f32 = 0.13;
/// How far around an arch its flare reaches, in metres.
pub const FLARE_WIDTH: f32 = 0.12;

impl Profile {
    /// Height of the wheel arch over `z`, if there is one.
    pub fn arch(&self, z: f32) -> Option<f32> {
        self.axles.iter().find_map(|axle| {
            let squared = self.arch_radius.powi(2) - (z - axle).powi(2);
            // The arch's end, up to rounding, belongs to it.
            (squared > -1e-4).then(|| self.parameters.axles.radius + squared.max(0.0).sqrt())
        })
    }

    /// How far the edge of a wheel arch stands out of the side at `[y, z]`.
    pub fn flare(&self, y: f32, z: f32) -> f32 {
        let from_edge =
            |axle: f32| (z - axle).hypot(y - self.parameters.axles.radius) - self.arch_radius;
        let nearest = from_edge(self.axles[0]).min(from_edge(self.axles[1]));
        self.parameters.hull.flare * ramp(1.0 - nearest / FLARE_WIDTH)
    }
}
