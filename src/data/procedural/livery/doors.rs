//! Where doors are painted.

use super::steps;
use crate::data::procedural::{parameters::BodyStyle, profile::Profile};

/// Where the doors are, z.
pub(super) struct Doors {
    pub start: f32,
    /// Ends of each door on a side, from front to rear.
    pub ends: Vec<f32>,
}

impl Doors {
    pub fn of(profile: &Profile) -> Self {
        let behind_wheel = profile.axles[0] + profile.arch_radius + 0.07;
        let cabin_end = profile.axles[1] + 0.1;
        match profile.parameters.style {
            // Truck drivers sit above the front wheels.
            BodyStyle::BoxTruck => {
                let end = profile.roof_end - 0.12;
                Self { start: behind_wheel.min(end - 0.8), ends: vec![end] }
            }
            BodyStyle::Bus => {
                let ends = steps(behind_wheel, profile.rear - 0.4, 5).skip(1).collect();
                Self { start: behind_wheel, ends }
            }
            BodyStyle::Coupe | BodyStyle::Roadster | BodyStyle::Microcar => {
                Self::one(behind_wheel, cabin_end)
            }
            BodyStyle::Pickup if profile.roof_end - behind_wheel < 1.4 => {
                Self::one(behind_wheel, cabin_end)
            }
            BodyStyle::Pickup => {
                let middle = 0.5 * (behind_wheel + profile.roof_end) + 0.1;
                Self { start: behind_wheel, ends: vec![middle, profile.roof_end] }
            }
            _ => {
                let middle = behind_wheel + 0.54 * (cabin_end - behind_wheel);
                Self { start: behind_wheel, ends: vec![middle, cabin_end] }
            }
        }
    }

    fn one(start: f32, cabin_end: f32) -> Self {
        Self { start, ends: vec![(start + 1.25).min(cabin_end - 0.5)] }
    }
}
