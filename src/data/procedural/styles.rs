//! The kinds of car: how often each stands on a parking lot, and what is typical of it.

use rand::{Rng, distr::weighted::WeightedIndex};

use super::parameters::BodyStyle;

/// Typical proportions, in the terms of [`CarParameters`](super::CarParameters).
pub(super) struct Typical {
    /// `[length, width, height, clearance, wheel radius]`, in metres.
    pub size: [f32; 5],
    /// `[front axle, rear axle]`.
    pub axles: [f32; 2],
    /// `[cowl, windscreen rake, roof end, rear rake, tumblehome]`.
    pub cabin: [f32; 5],
    /// `[bonnet, belt, deck]`.
    pub heights: [f32; 3],
}

impl BodyStyle {
    /// Draws a kind: three in four are ordinary passenger cars.
    pub fn random(rng: &mut impl Rng) -> Self {
        const SHARES: [(BodyStyle, u32); 14] = [
            (BodyStyle::Sedan, 16),
            (BodyStyle::Hatchback, 15),
            (BodyStyle::Suv, 13),
            (BodyStyle::Wagon, 9),
            (BodyStyle::Coupe, 8),
            (BodyStyle::Fastback, 5),
            (BodyStyle::Minivan, 6),
            (BodyStyle::Microcar, 5),
            (BodyStyle::Roadster, 2),
            (BodyStyle::OffRoader, 7),
            (BodyStyle::Pickup, 8),
            (BodyStyle::Van, 7),
            (BodyStyle::BoxTruck, 5),
            (BodyStyle::Bus, 2),
        ];
        let shares = WeightedIndex::new(SHARES.map(|(_, share)| share));
        SHARES[rng.sample(shares.expect("the shares are positive"))].0
    }

    /// Whether goods or many people ride in it.
    pub(super) fn is_commercial(self) -> bool {
        matches!(self, Self::Van | Self::BoxTruck | Self::Bus)
    }

    /// Whether it is made for rough ground.
    pub(super) fn is_rugged(self) -> bool {
        matches!(self, Self::OffRoader | Self::Pickup)
    }

    /// Whether something lower than the roof follows the cabin.
    pub(super) fn has_deck(self) -> bool {
        matches!(self, Self::Sedan | Self::Coupe | Self::Pickup | Self::Roadster)
    }

    #[rustfmt::skip] // A table.
    pub(super) fn typical(self) -> Typical {
        let (size, axles, cabin, heights) = match self {
            Self::Sedan     => ([4.70, 1.82, 1.45, 0.15, 0.33], [0.195, 0.785], [0.285, 29., 0.70, 27., 0.24], [0.66, 0.64, 0.73]),
            Self::Hatchback => ([4.00, 1.75, 1.49, 0.15, 0.31], [0.200, 0.830], [0.260, 32., 0.86, 58., 0.22], [0.65, 0.63, 0.64]),
            Self::Wagon     => ([4.75, 1.82, 1.49, 0.15, 0.33], [0.190, 0.780], [0.285, 30., 0.90, 57., 0.22], [0.65, 0.63, 0.64]),
            Self::Suv       => ([4.60, 1.89, 1.72, 0.21, 0.37], [0.195, 0.790], [0.270, 37., 0.90, 66., 0.18], [0.64, 0.62, 0.63]),
            Self::Coupe     => ([4.45, 1.86, 1.28, 0.13, 0.34], [0.205, 0.790], [0.335, 27., 0.62, 20., 0.28], [0.67, 0.66, 0.73]),
            Self::Fastback  => ([4.50, 1.80, 1.46, 0.15, 0.33], [0.200, 0.805], [0.240, 26., 0.66, 17., 0.24], [0.62, 0.60, 0.75]),
            Self::Minivan   => ([4.60, 1.84, 1.72, 0.16, 0.33], [0.190, 0.800], [0.190, 33., 0.92, 70., 0.18], [0.59, 0.56, 0.58]),
            Self::Microcar  => ([3.10, 1.58, 1.56, 0.16, 0.28], [0.180, 0.830], [0.190, 42., 0.88, 66., 0.18], [0.62, 0.59, 0.61]),
            Self::Roadster  => ([4.05, 1.75, 0.93, 0.13, 0.31], [0.200, 0.785], [0.340, 30., 0.66, 35., 0.05], [0.94, 0.90, 0.96]),
            Self::OffRoader => ([4.50, 1.90, 1.88, 0.28, 0.40], [0.190, 0.785], [0.290, 60., 0.95, 82., 0.12], [0.64, 0.63, 0.63]),
            Self::Pickup    => ([5.35, 1.95, 1.83, 0.24, 0.39], [0.175, 0.785], [0.265, 42., 0.57, 78., 0.17], [0.63, 0.63, 0.67]),
            Self::Van       => ([5.20, 1.96, 2.05, 0.18, 0.34], [0.180, 0.790], [0.145, 43., 0.96, 84., 0.10], [0.56, 0.55, 0.56]),
            Self::BoxTruck  => ([6.00, 2.15, 2.75, 0.35, 0.40], [0.165, 0.740], [0.140, 60., 0.34, 88., 0.10], [0.45, 0.44, 0.45]),
            Self::Bus       => ([7.50, 2.25, 2.75, 0.28, 0.42], [0.220, 0.740], [0.060, 72., 0.97, 86., 0.07], [0.40, 0.42, 0.42]),
        };
        Typical { size, axles, cabin, heights }
    }
}
