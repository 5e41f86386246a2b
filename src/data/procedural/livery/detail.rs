//! The choices of trim that all pictures agree on.

use rand::Rng;

use super::random_paint;
use crate::data::procedural::canvas::{Color, Place};

/// Lengths in metres; chances that came out, as flags.
pub struct Detail {
    pub cladding: bool,
    pub plastic_bumpers: bool,
    pub bright_window_line: bool,
    pub panel_van: bool,
    pub racing_stripes: bool,
    pub sun_roof: bool,
    pub door_band: bool,
    pub light_bar: bool,
    pub round_lamps: bool,
    pub lamp_height: f32,
    pub lamp_inset: f32,
    pub grille_half_width: f32,
    pub n_grille_bars: usize,
    pub n_spokes: usize,
    pub spoke_width: f32,
    pub pillar_width: f32,
    pub decals: Vec<Decal>,
}

/// A patch on the doors: its place and size as fractions of the side.
pub struct Decal {
    pub center: Place,
    pub half_size: Place,
    pub exponent: f32,
    pub color: Color,
}

impl Detail {
    pub fn random(rng: &mut impl Rng) -> Self {
        let decorated = rng.random_bool(0.35);
        let n_decals = if decorated { rng.random_range(1..6) } else { 0 };
        Self {
            cladding: rng.random_bool(0.35),
            plastic_bumpers: rng.random_bool(0.35),
            bright_window_line: rng.random_bool(0.5),
            panel_van: rng.random_bool(0.45),
            racing_stripes: rng.random_bool(0.15),
            sun_roof: rng.random_bool(0.3),
            door_band: rng.random_bool(0.25),
            light_bar: rng.random_bool(0.3),
            round_lamps: rng.random_bool(0.25),
            lamp_height: rng.random_range(0.05..0.10),
            lamp_inset: rng.random_range(0.50..0.66),
            grille_half_width: rng.random_range(0.25..0.48),
            n_grille_bars: rng.random_range(2..7),
            n_spokes: rng.random_range(5..13),
            spoke_width: rng.random_range(0.35..0.65),
            pillar_width: rng.random_range(0.05..0.10),
            decals: (0..n_decals).map(|_| Decal::random(rng)).collect(),
        }
    }
}

impl Decal {
    fn random(rng: &mut impl Rng) -> Self {
        Self {
            center: [rng.random_range(0.25..0.9), rng.random_range(0.25..0.9)],
            half_size: [rng.random_range(0.02..0.10), rng.random_range(0.05..0.2)],
            exponent: rng.random_range(1.2..8.0),
            color: random_paint(rng),
        }
    }
}
