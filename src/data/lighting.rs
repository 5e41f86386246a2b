//! What surrounds the object: light, the carpet it stands on, and the backdrop (Sec. 3.1).
//!
//! Reflection is Lambertian, so that a surface point has one colour from every side and photometric
//! consistency holds. Everything here is fixed in the world frame.

use std::f32::consts::TAU;

use image::{Rgb, RgbImage};
use nalgebra::{Point3, Unit, Vector3};
use rand::Rng;

use super::texture::Texture;

/// Light and surroundings, fixed in the world frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Light that arrives from everywhere: the environment, RGB.
    pub ambient: [f32; 3],
    pub lights: Vec<Light>,
    pub ground: Option<Ground>,
    /// What is seen where there is neither object nor ground, RGB in [0, 1].
    pub background: [f32; 3],
}

/// A lamp; its colour is the light that a surface facing it at the origin receives, RGB.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    pub place: Place,
    pub color: [f32; 3],
}

#[derive(Clone, Copy, Debug)]
pub enum Place {
    /// Infinitely far, towards this direction.
    Direction(Unit<Vector3<f32>>),
    /// Here, in world units; its light falls with the square of the distance.
    Point(Point3<f32>),
}

/// An infinite carpet, level at `height`.
#[derive(Clone, Debug)]
pub struct Ground {
    /// The y of its surface, in world units.
    pub height: f32,
    pub texture: Texture,
    /// Side of one repeat of the texture, in world units.
    pub repeat: f32,
}

impl Scene {
    /// Environment, one to four lamps and backdrop at random; the carpet, if any, is the caller's.
    ///
    /// Environment and lamps together stay near one, so pictures come out neither black nor burnt.
    pub fn random(rng: &mut impl Rng, ground: Option<Ground>) -> Self {
        let ambient = tint(rng, 0.06).map(|channel| channel * rng.random_range(0.3..0.5));
        let mut lights: Vec<_> = (0..rng.random_range(1..=4)).map(|_| Light::random(rng)).collect();

        let drawn: f32 = lights.iter().map(|light| light.color[1]).sum();
        let total = rng.random_range(0.5..0.9);
        for light in &mut lights {
            light.color = light.color.map(|channel| channel * total / drawn);
        }
        let brightness = rng.random_range(0.3..0.9);
        let background = tint(rng, 0.15).map(|channel| (channel * brightness).clamp(0.0, 1.0));
        Self { ambient, lights, ground, background }
    }

    /// Light that a surface at `point` receives (world frame, unit `normal`), times its albedo.
    pub fn shade(&self, point: Point3<f32>, normal: Vector3<f32>, albedo: [f32; 3]) -> [f32; 3] {
        let mut received = self.ambient;
        for light in &self.lights {
            let strength = light.strength(point, normal);
            for (channel, color) in received.iter_mut().zip(light.color) {
                *channel += strength * color;
            }
        }
        std::array::from_fn(|c| (albedo[c] * received[c]).clamp(0.0, 1.0))
    }
}

impl Light {
    /// Above the horizon, since the ground would hide it otherwise; intensity relative to others.
    fn random(rng: &mut impl Rng) -> Self {
        let azimuth = rng.random_range(0.0..TAU);
        let elevation = rng.random_range(0.2_f32..1.4);
        let direction = Vector3::new(
            azimuth.sin() * elevation.cos(),
            elevation.sin(),
            azimuth.cos() * elevation.cos(),
        );
        let place = if rng.random() {
            Place::Direction(Unit::new_normalize(direction))
        } else {
            Place::Point(Point3::from(direction * rng.random_range(1.5..4.0)))
        };
        let intensity = rng.random_range(0.3..1.0);
        Self { place, color: tint(rng, 0.1).map(|channel| channel * intensity) }
    }

    /// Lambert's cosine and, for a point light, the fall-off relative to the origin.
    fn strength(&self, point: Point3<f32>, normal: Vector3<f32>) -> f32 {
        match self.place {
            Place::Direction(direction) => normal.dot(&direction).max(0.0),
            Place::Point(position) => {
                let towards = position - point;
                let squared = towards.norm_squared().max(f32::MIN_POSITIVE);
                let facing = normal.dot(&towards).max(0.0);
                facing * position.coords.norm_squared() / (squared * squared.sqrt())
            }
        }
    }
}

impl Ground {
    /// A carpet of a random colour, woven of coarse blotches, finer patches and single threads.
    pub fn random(rng: &mut impl Rng, height: f32) -> Self {
        /// Side of the woven square, in texels.
        const SIDE: u32 = 64;
        /// Patch sizes in texels, with how far they stray from the base colour.
        const WEAVE: [(u32, f32); 3] = [(16, 0.10), (4, 0.12), (1, 0.08)];

        let level = rng.random_range(0.3..0.65);
        let base = tint(rng, 0.3).map(|channel| channel * level);
        let mut texels = vec![base; (SIDE * SIDE) as usize];
        for (patch, contrast) in WEAVE {
            let patches_per_side = SIDE / patch;
            let shades: Vec<[f32; 3]> = (0..patches_per_side.pow(2))
                .map(|_| {
                    let shade = rng.random_range(-contrast..contrast);
                    tint(rng, 0.3).map(|channel| channel * shade)
                })
                .collect();
            for (texel, idx) in texels.iter_mut().zip(0..) {
                let [x, y] = [idx % SIDE / patch, idx / SIDE / patch];
                let shade = shades[(y * patches_per_side + x) as usize];
                *texel = std::array::from_fn(|c| texel[c] + shade[c]);
            }
        }
        let woven = RgbImage::from_fn(SIDE, SIDE, |x, y| {
            Rgb(texels[(y * SIDE + x) as usize].map(|value| (value * 255.0) as u8))
        });
        Self { height, texture: Texture::new(&woven), repeat: rng.random_range(0.8..1.6) }
    }
}

/// A near-white RGB factor, each channel within `spread` of one.
fn tint(rng: &mut impl Rng, spread: f32) -> [f32; 3] {
    std::array::from_fn(|_| rng.random_range(1.0 - spread..1.0 + spread))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;

    fn lit_by(place: Place) -> Scene {
        let light = Light { place, color: [0.5, 0.4, 0.3] };
        Scene { ambient: [0.1; 3], lights: vec![light], ground: None, background: [0.0; 3] }
    }

    #[track_caller]
    fn check_eq(actual: [f32; 3], expected: [f32; 3]) {
        assert!(actual.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{actual:?}");
    }

    #[test]
    fn a_surface_facing_the_light_gets_all_of_it_and_one_turned_away_the_ambient() {
        let scene = lit_by(Place::Direction(Vector3::y_axis()));
        check_eq(scene.shade(Point3::origin(), Vector3::y(), [1.0; 3]), [0.6, 0.5, 0.4]);
        check_eq(scene.shade(Point3::origin(), -Vector3::y(), [1.0; 3]), [0.1; 3]);
    }

    #[test]
    fn light_falls_with_the_cosine_and_the_square_of_the_distance() {
        let scene = lit_by(Place::Point(Point3::new(0.0, 2.0, 0.0)));
        let tilted = Vector3::new(0.6, 0.8, 0.0);
        check_eq(scene.shade(Point3::origin(), tilted, [1.0; 3]), [0.5, 0.42, 0.34]);
        let twice_as_far = Point3::new(0.0, -2.0, 0.0);
        check_eq(scene.shade(twice_as_far, Vector3::y(), [1.0; 3]), [0.225, 0.2, 0.175]);
    }

    #[test]
    fn random_scenes_are_well_exposed() {
        for seed in 0..200 {
            let scene = Scene::random(&mut keyed_rng(seed, [0, 0]), None);
            let grey_seen_along = |normal| scene.shade(Point3::origin(), normal, [0.5; 3])[1];
            let axes = [Vector3::x(), -Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::z()];
            let mean = axes.into_iter().map(grey_seen_along).sum::<f32>() / 5.0;
            assert!((0.15..0.65).contains(&mean), "seed {seed}: {mean}");
            assert!((1..=4).contains(&scene.lights.len()));
        }
    }
}
