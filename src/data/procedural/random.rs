//! How the shapes of cars are distributed.

mod fittings;

use std::ops::Range;

use rand::Rng;

use super::{
    parameters::{Axles, BodyStyle, Cabin, CarParameters, Ends, Fittings, Hull, Size},
    styles::Typical,
};

/// What sets a car apart from its kind as a whole.
struct Character {
    /// Length and height as multiples of the typical ones: small cars are short and tall.
    stretch: f32,
    tallness: f32,
    /// Rise of bonnet, belt and deck, as a fraction of the height.
    waist: f32,
    /// From angular, about 0.1, to round, about 1.
    roundness: f32,
}

impl Character {
    fn random(style: BodyStyle, rng: &mut impl Rng) -> Self {
        let short = rng.random_bool(0.28) && style != BodyStyle::Microcar;
        let long = rng.random_bool(0.35) && style.is_commercial();
        let [stretch, tallness] = match (short, long) {
            (true, _) => [0.66..0.95, 0.95..1.2],
            (false, true) => [1.05..1.4, 0.9..1.1],
            (false, false) => [0.9..1.1, 0.9..1.12],
        }
        .map(|range| rng.random_range(range));
        let angular =
            rng.random_bool(if short { 0.5 } else { 0.3 }) || style == BodyStyle::BoxTruck;
        let roundness = rng.random_range(if angular { 0.08..0.4 } else { 0.4..1.15 });
        let waist = if short { rng.random_range(-0.11..0.04) } else { around(-0.01, 0.05, rng) };
        Self { stretch, tallness, waist, roundness }
    }
}

impl CarParameters {
    /// Draws a car: its style first, then its proportions around the style's typical ones.
    pub fn random(rng: &mut impl Rng) -> Self {
        let style = BodyStyle::random(rng);
        Self::random_of_style(style, rng)
    }

    /// Draws a car of the given style.
    pub fn random_of_style(style: BodyStyle, rng: &mut impl Rng) -> Self {
        let typical = style.typical();
        let character = Character::random(style, rng);
        let [length, width, height, clearance, wheel_radius] = typical.size;
        let size = Size {
            length: length * character.stretch,
            width: width * around(1.0, 0.08, rng),
            height: height * character.tallness,
            clearance: around(clearance, 0.05, rng),
        };
        let ends = Ends::random(&character, rng);
        let hull = Hull::random(&typical, &character, rng);
        // The front arches must end below the bonnet and behind the nose.
        let largest_radius = (0.43 * (hull.bonnet - ends.bonnet_fall) * size.height)
            .min(0.72 * typical.axles[0] * size.length);
        let largest_growth = if character.stretch < 0.9 { 1.35 } else { 1.12 };
        let radius = (wheel_radius * rng.random_range(0.9..largest_growth)).min(largest_radius);

        let car = Self {
            style,
            size,
            axles: Axles::random(&typical, radius, rng),
            cabin: Cabin::random(style, &typical, &character, rng),
            hull,
            ends,
            fittings: Fittings::random(style, rng),
        };
        let lift = rng.random_range(0.08..0.4);
        if style.is_rugged() && rng.random_bool(0.35) { car.lifted(lift) } else { car }
    }

    /// The same body, higher above the wheels by `rise` metres.
    fn lifted(self, rise: f32) -> Self {
        let height = self.size.height + rise;
        let raised = |fraction: f32| (fraction * self.size.height + rise) / height;
        let Self { hull, ends, .. } = self;
        Self {
            size: Size { height, clearance: self.size.clearance + 0.8 * rise, ..self.size },
            axles: Axles { radius: self.axles.radius + 0.2 * rise, ..self.axles },
            hull: Hull {
                bonnet: raised(hull.bonnet),
                belt: raised(hull.belt),
                deck: raised(hull.deck),
                ..hull
            },
            ends: Ends { nose: raised(ends.nose), tail: raised(ends.tail), ..ends },
            ..self
        }
    }
}

impl Axles {
    fn random(typical: &Typical, radius: f32, rng: &mut impl Rng) -> Self {
        let [front, rear] = typical.axles;
        let wide = rng.random_bool(0.2);
        Self {
            radius,
            tyre_width: rng.random_range(0.17..0.28),
            stance: if wide { rng.random_range(0.02..0.14) } else { around(0.0, 0.03, rng) },
            front: around(front, 0.03, rng),
            rear: around(rear, 0.04, rng),
        }
    }
}

impl Cabin {
    fn random(
        style: BodyStyle,
        typical: &Typical,
        character: &Character,
        rng: &mut impl Rng,
    ) -> Self {
        let [cowl, windscreen_rake, roof_end, rear_rake, tumblehome] = typical.cabin;
        // A shorter, taller car has steeper windows.
        let steeper = |rake: f32| {
            let slope = rake.to_radians().tan() * character.tallness / character.stretch;
            slope.atan().to_degrees()
        };
        let roomy = !style.has_deck();
        let boxed = style == BodyStyle::BoxTruck;
        let widest_shelf = if character.roundness < 0.4 { 0.13 } else { 0.05 };
        let cowl_spread = if style == BodyStyle::Van { 0.08 } else { 0.04 };
        Self {
            cowl: around(cowl, cowl_spread, rng).max(0.06),
            windscreen_rake: (steeper(windscreen_rake) + around(0.0, 8.0, rng)).min(84.0),
            roof_end: around(roof_end, 0.05, rng).min(0.97),
            rear_rake: (steeper(rear_rake) + around(0.0, 12.0, rng)).clamp(12.0, 88.0),
            roof_fall: rng.random_range(0.0..if roomy { 0.04 } else { 0.07 }),
            tumblehome: around(tumblehome, 0.08, rng).max(0.0),
            shelf: rng.random_range(0.0..widest_shelf),
            crown: character.roundness * rng.random_range(0.015..0.05),
            cant: character.roundness * rng.random_range(0.05..0.10),
            height: if boxed { rng.random_range(0.68..0.92) } else { 1.0 },
            width: if boxed { rng.random_range(0.84..1.0) } else { 1.0 },
        }
    }
}

impl Hull {
    fn random(typical: &Typical, character: &Character, rng: &mut impl Rng) -> Self {
        let [bonnet, belt, deck] = typical.heights.map(|height| height + character.waist);
        Self {
            bonnet: around(bonnet, 0.05, rng).min(0.97),
            belt: around(belt, 0.04, rng),
            wedge: rng.random_range(-0.01..0.05),
            deck: around(deck, 0.06, rng).min(0.97),
            bulge: character.roundness * rng.random_range(0.01..0.05),
            flare: if rng.random_bool(0.4) { rng.random_range(0.01..0.09) } else { 0.0 },
            softness: character.roundness * rng.random_range(0.008..0.014),
        }
    }
}

impl Ends {
    fn random(character: &Character, rng: &mut impl Rng) -> Self {
        let mut rounded = |range: Range<f32>| character.roundness * rng.random_range(range);
        let [front_taper, rear_taper] = [rounded(0.05..0.22), rounded(0.02..0.15)];
        let [front_bow, rear_bow] = [rounded(0.05..0.22), rounded(0.02..0.14)];
        let edge_radius = rounded(0.05..0.11).max(0.015);
        Self {
            bonnet_fall: rng.random_range(0.01..0.13),
            nose: rng.random_range(0.76..0.97),
            tail: rng.random_range(0.86..0.99),
            front_taper,
            rear_taper,
            front_bow,
            rear_bow,
            edge_radius,
        }
    }
}

/// Bell-shaped (triangular) within `spread` of `center`.
fn around(center: f32, spread: f32, rng: &mut impl Rng) -> f32 {
    center + spread * (rng.random::<f32>() + rng.random::<f32>() - 1.0)
}
