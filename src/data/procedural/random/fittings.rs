//! How often cars carry what.

use std::ops::Range;

use rand::Rng;

use crate::data::procedural::parameters::{BodyStyle, Fittings};

impl Fittings {
    pub(super) fn random(style: BodyStyle, rng: &mut impl Rng) -> Self {
        let open = style == BodyStyle::Roadster;
        let sporty = matches!(style, BodyStyle::Coupe | BodyStyle::Sedan);
        let roomy = !style.has_deck() && style != BodyStyle::BoxTruck;
        let bed_depth = match style {
            BodyStyle::Pickup => rng.random_range(0.32..0.5),
            BodyStyle::Roadster => rng.random_range(0.35..0.5),
            _ => 0.0,
        };
        let working = style.is_rugged() || style.is_commercial();
        let spare_chance = match style {
            BodyStyle::OffRoader => 0.6,
            BodyStyle::Suv => 0.12,
            _ => 0.0,
        };
        let roof_load = random_roof_load(rng);
        Self {
            mirror: if_drawn(0.85, 0.07..if working { 0.2 } else { 0.15 }, rng),
            bed_depth,
            spoiler_height: if_drawn(if sporty { 0.3 } else { 0.0 }, 0.06..0.22, rng),
            roof_rail_height: if_drawn(if roomy { 0.35 } else { 0.0 }, 0.03..0.08, rng),
            bumper_depth: if_drawn(if working { 0.6 } else { 0.3 }, 0.04..0.16, rng),
            roof_load: if rng.random_bool(0.14) && !open { roof_load } else { [0.0; 3] },
            spare_wheel: rng.random_bool(spare_chance),
        }
    }
}

/// A taxi's sign, a light bar, or a luggage box: `[width, height, length]`.
fn random_roof_load(rng: &mut impl Rng) -> [f32; 3] {
    let [width, height, length] = match rng.random_range(0..3) {
        0 => [0.25..0.8, 0.12..0.3, 0.12..0.4],
        1 => [0.9..1.4, 0.09..0.18, 0.18..0.35],
        _ => [0.5..1.0, 0.2..0.42, 1.0..1.9],
    };
    [width, height, length].map(|range| rng.random_range(range))
}

/// A value of the range with the given chance, else 0.
fn if_drawn(chance: f64, range: Range<f32>, rng: &mut impl Rng) -> f32 {
    if rng.random_bool(chance) { rng.random_range(range) } else { 0.0 }
}
