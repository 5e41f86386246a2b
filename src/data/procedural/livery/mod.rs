//! Paint and trim: five pictures that are projected onto the shape.
//!
//! A livery is independent of the shape: any of them fits any car.

mod detail;
mod doors;
mod ends;
mod side;
mod top;
mod wheel;

use image::RgbImage;
use nalgebra::Point3;
use rand::Rng;

use self::detail::Detail;
use super::{
    canvas::{Canvas, Color, Place},
    profile::Profile,
};

/// Free border around a picture, in metres, so that its edges do not repeat onto the car.
const MARGIN: f32 = 0.06;

/// Middles and width of racing stripes, x, in metres.
const STRIPES: [f32; 2] = [-0.22, 0.22];
const STRIPE_WIDTH: f32 = 0.24;

/// The directions that pictures are projected from. Both sides share a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    Side,
    Top,
    Front,
    Rear,
    Wheel,
}

impl View {
    pub const ALL: [Self; 5] = [Self::Side, Self::Top, Self::Front, Self::Rear, Self::Wheel];

    /// Where a point of the workshop frame falls on the picture; for a wheel, of its own frame.
    fn place(self, point: Point3<f32>) -> Place {
        match self {
            Self::Side | Self::Wheel => [point.z, point.y],
            Self::Top => [point.z, point.x],
            Self::Front | Self::Rear => [point.x, point.y],
        }
    }
}

/// Colours, and the details of trim that all pictures agree on.
pub struct Livery {
    pub paint: Color,
    /// The roof of two-tone cars, else the paint.
    pub roof: Color,
    pub decal: Color,
    pub glass: Color,
    /// Plastic: bumpers, cladding, sills.
    pub trim: Color,
    /// Bright strips, or black ones.
    pub accent: Color,
    pub rim: Color,
    pub lamp: Color,
    pub tail_lamp: Color,
    pub plate: Color,
    /// Bumper bars: trim, bright metal or paint.
    pub bumper: Color,
    /// What stands on the roof.
    pub roof_load: Color,
    /// The box of a truck.
    pub cargo: Color,
    detail: Detail,
}

impl Livery {
    pub fn random(rng: &mut impl Rng) -> Self {
        let paint = random_paint(rng);
        let bright = rng.random_range(0.55..0.9);
        let trim = [rng.random_range(0.06..0.4); 3];
        // Windows are dark from outside, but where the sky is reflected in them.
        let glass = if rng.random_bool(0.2) { [0.55, 0.65, 0.70] } else { [0.10, 0.12, 0.15] };
        let white = [rng.random_range(0.8..0.95); 3];
        Self {
            paint,
            roof: if rng.random_bool(0.2) { random_paint(rng) } else { paint },
            decal: random_paint(rng),
            glass: darker(glass, rng.random_range(0.6..1.4)),
            trim,
            accent: [if rng.random_bool(0.6) { bright } else { 0.08 }; 3],
            rim: [rng.random_range(0.15..0.85); 3],
            lamp: [0.95, 0.95, rng.random_range(0.80..0.95)],
            tail_lamp: [rng.random_range(0.55..0.85), 0.05, 0.05],
            plate: if rng.random_bool(0.3) { [0.95, 0.80, 0.2] } else { [0.92; 3] },
            bumper: [trim, [bright; 3], paint][rng.random_range(0..3)],
            roof_load: [trim, white, random_paint(rng)][rng.random_range(0..3)],
            cargo: [paint, white, random_paint(rng)][rng.random_range(0..3)],
            detail: Detail::random(rng),
        }
    }

    /// Paints every picture, in the order of [`View::ALL`].
    pub fn pictures(&self, profile: &Profile, rng: &mut impl Rng) -> Pictures {
        let mut pictures = View::ALL.map(|view| match view {
            View::Side => self.side(profile),
            View::Top => self.top(profile),
            View::Front => self.front(profile),
            View::Rear => self.rear(profile),
            View::Wheel => self.wheel(profile),
        });
        // Dust, wear and the uneven sheen of paint, at two sizes.
        let wear = rng.random_range(0.02..0.08);
        for picture in &mut pictures {
            picture.grain(0.30, wear, rng);
            picture.grain(0.06, 0.5 * wear, rng);
        }
        Pictures(pictures)
    }
}

/// The pictures of one car, in the order of [`View::ALL`].
pub struct Pictures([Canvas; 5]);

impl Pictures {
    /// Texture coordinates of a point that is painted from `view`.
    pub fn uv(&self, view: View, point: Point3<f32>) -> [f32; 2] {
        self.0[view as usize].uv(view.place(point))
    }

    pub fn to_images(&self) -> Vec<RgbImage> {
        self.0.iter().map(Canvas::to_image).collect()
    }
}

/// White, silver, grey and black as often as on the road; otherwise any hue.
fn random_paint(rng: &mut impl Rng) -> Color {
    if rng.random_bool(0.35) {
        let value = rng.random_range(0.08..0.92);
        return [value, value, value * rng.random_range(0.95..1.05)];
    }
    let (hue, saturation) = (rng.random_range(0.0..6.0), rng.random_range(0.35..0.95));
    let value = rng.random_range(0.30..0.92);
    // A hue is a triangle wave on each channel, a third of a turn apart.
    [0.0_f32, 2.0, 4.0].map(|peak| {
        let distance = (hue - peak).abs().min(6.0 - (hue - peak).abs());
        value * (1.0 - saturation * (distance - 1.0).clamp(0.0, 1.0))
    })
}

/// Scales a colour.
fn darker(color: Color, factor: f32) -> Color {
    color.map(|value| value * factor)
}

/// Evenly spaced values from `start` to `end`, both included.
fn steps(start: f32, end: f32, n: usize) -> impl DoubleEndedIterator<Item = f32> + Clone {
    (0..=n).map(move |step| start + (end - start) * step as f32 / n as f32)
}
