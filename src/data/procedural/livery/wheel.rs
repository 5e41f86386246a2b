//! The picture of a wheel: `[z, y]` around its centre.

use std::f32::consts::TAU;

use super::Livery;
use crate::data::procedural::{
    TYRE,
    canvas::{Canvas, Place, superellipse},
    profile::Profile,
    wheels::RIM_FRACTION,
};

impl Livery {
    pub(super) fn wheel(&self, profile: &Profile) -> Canvas {
        let radius = profile.parameters.axles.radius;
        let rim = RIM_FRACTION * radius;
        let mut canvas = Canvas::new([-1.05 * radius; 2], [1.05 * radius; 2], TYRE);
        canvas.outline(&disc(0.86 * radius), 0.015, [0.14; 3]);
        canvas.fill(&disc(rim), self.rim);

        // The openings between the spokes.
        let n_spokes = self.detail.n_spokes as f32;
        for spoke in 0..self.detail.n_spokes {
            let middle = (spoke as f32 + 0.5) / n_spokes * TAU;
            let half = 0.5 * (1.0 - self.detail.spoke_width) / n_spokes * TAU;
            let polar = |radius: f32, angle: f32| [radius * angle.cos(), radius * angle.sin()];
            let opening = [
                polar(0.35 * rim, middle - 0.6 * half),
                polar(0.88 * rim, middle - half),
                polar(0.92 * rim, middle),
                polar(0.88 * rim, middle + half),
                polar(0.35 * rim, middle + 0.6 * half),
            ];
            canvas.fill(&opening, [0.06; 3]);
        }
        canvas.outline(&disc(0.2 * rim), 0.012, [0.15; 3]);
        canvas
    }
}

fn disc(radius: f32) -> Vec<Place> {
    superellipse([0.0; 2], [radius; 2], 2.0)
}
