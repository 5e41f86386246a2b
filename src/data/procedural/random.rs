//! How the shapes of cars are distributed.

use rand::{Rng, distr::weighted::WeightedIndex};

use super::parameters::{Axles, BodyStyle, Cabin, CarParameters, Ends, Fittings, Hull, Size};

impl CarParameters {
    /// Draws a car: its style first, then its proportions around the style's typical ones.
    pub fn random(rng: &mut impl Rng) -> Self {
        const STYLES: [(BodyStyle, u32); 7] = [
            (BodyStyle::Sedan, 22),
            (BodyStyle::Hatchback, 17),
            (BodyStyle::Wagon, 12),
            (BodyStyle::Suv, 18),
            (BodyStyle::Pickup, 9),
            (BodyStyle::Van, 9),
            (BodyStyle::Coupe, 13),
        ];
        let shares = WeightedIndex::new(STYLES.map(|(_, share)| share));
        let style = STYLES[rng.sample(shares.expect("the shares are positive"))].0;
        Self::random_of_style(style, rng)
    }

    /// Draws a car of the given style.
    pub fn random_of_style(style: BodyStyle, rng: &mut impl Rng) -> Self {
        let (size, wheel_radius, cabin_line, heights) = typical(style);
        let [length, width, height, clearance] = size;
        let [front_axle, cowl, windscreen_rake, roof_end, rear_rake, rear_axle] = cabin_line;
        let [bonnet, belt, deck, tumblehome] = heights;
        let bonnet_fall = rng.random_range(0.04..0.13);
        let height = around(height, 0.12, rng);
        let bonnet = around(bonnet, 0.04, rng);
        // The front arches must end below the bonnet.
        let largest_radius = 0.43 * (bonnet - bonnet_fall) * height;
        let sporty = matches!(style, BodyStyle::Coupe | BodyStyle::Sedan);
        let roomy = matches!(style, BodyStyle::Suv | BodyStyle::Wagon | BodyStyle::Van);

        Self {
            style,
            size: Size {
                length: around(length, 0.45, rng),
                width: around(width, 0.11, rng),
                height,
                clearance: around(clearance, 0.04, rng),
            },
            axles: Axles {
                radius: around(wheel_radius, 0.04, rng).min(largest_radius),
                tyre_width: rng.random_range(0.18..0.26),
                front: around(front_axle, 0.015, rng),
                rear: around(rear_axle, 0.02, rng),
            },
            cabin: Cabin {
                cowl: around(cowl, 0.03, rng),
                windscreen_rake: around(windscreen_rake, 6.0, rng),
                roof_end: around(roof_end, 0.035, rng).min(0.965),
                rear_rake: around(rear_rake, 9.0, rng).min(86.0),
                roof_fall: rng.random_range(0.0..if roomy { 0.04 } else { 0.07 }),
                tumblehome: around(tumblehome, 0.07, rng),
                crown: rng.random_range(0.015..0.05),
            },
            hull: Hull {
                bonnet,
                belt: around(belt, 0.03, rng),
                wedge: rng.random_range(0.0..0.05),
                deck: around(deck, 0.04, rng),
                bulge: rng.random_range(0.01..0.05),
                softness: rng.random_range(0.006..0.014),
            },
            ends: Ends {
                bonnet_fall,
                nose: rng.random_range(0.70..0.84),
                tail: rng.random_range(0.86..0.99),
                front_taper: rng.random_range(0.06..0.20),
                rear_taper: rng.random_range(0.03..0.13),
                front_bow: rng.random_range(0.05..0.20),
                rear_bow: rng.random_range(0.03..0.12),
                edge_radius: rng.random_range(0.05..0.11),
            },
            fittings: Fittings {
                mirror: rng.random_range(0.10..0.15),
                bed_depth: draw_if(style == BodyStyle::Pickup, 0.32..0.45, rng),
                spoiler_height: draw_if(sporty && rng.random_bool(0.3), 0.06..0.18, rng),
                roof_rail_height: draw_if(roomy && rng.random_bool(0.45), 0.03..0.07, rng),
            },
        }
    }
}

/// Typical proportions of a style:
/// `[length, width, height, clearance]` and the wheels' radius, in metres;
/// `[front axle, cowl, windscreen rake, roof end, rear rake, rear axle]` and
/// `[bonnet, belt, deck, tumblehome]`, as [`CarParameters`] has them.
#[rustfmt::skip] // A table.
fn typical(style: BodyStyle) -> ([f32; 4], f32, [f32; 6], [f32; 4]) {
    match style {
        BodyStyle::Sedan =>
            ([4.70, 1.82, 1.45, 0.15], 0.33, [0.195, 0.285, 29., 0.70, 27., 0.785], [0.66, 0.64, 0.73, 0.24]),
        BodyStyle::Hatchback =>
            ([4.00, 1.75, 1.49, 0.15], 0.31, [0.200, 0.260, 32., 0.86, 58., 0.830], [0.65, 0.63, 0.64, 0.22]),
        BodyStyle::Wagon =>
            ([4.75, 1.82, 1.49, 0.15], 0.33, [0.190, 0.285, 30., 0.90, 57., 0.780], [0.65, 0.63, 0.64, 0.22]),
        BodyStyle::Suv =>
            ([4.60, 1.89, 1.72, 0.21], 0.37, [0.195, 0.270, 37., 0.90, 66., 0.790], [0.64, 0.62, 0.63, 0.18]),
        BodyStyle::Pickup =>
            ([5.35, 1.95, 1.83, 0.24], 0.39, [0.175, 0.265, 40., 0.57, 78., 0.785], [0.63, 0.63, 0.67, 0.17]),
        BodyStyle::Van =>
            ([5.00, 1.94, 2.00, 0.18], 0.34, [0.180, 0.165, 44., 0.96, 83., 0.790], [0.58, 0.57, 0.58, 0.12]),
        BodyStyle::Coupe =>
            ([4.45, 1.86, 1.30, 0.13], 0.34, [0.205, 0.335, 27., 0.62, 20., 0.790], [0.67, 0.66, 0.73, 0.28]),
    }
}

/// Bell-shaped (triangular) within `spread` of `center`.
fn around(center: f32, spread: f32, rng: &mut impl Rng) -> f32 {
    center + spread * (rng.random::<f32>() + rng.random::<f32>() - 1.0)
}

fn draw_if(present: bool, range: std::ops::Range<f32>, rng: &mut impl Rng) -> f32 {
    let value = rng.random_range(range);
    if present { value } else { 0.0 }
}
