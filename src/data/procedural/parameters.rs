//! The shape of a car in some forty numbers.

/// Kinds of car. A kind sets the typical proportions; each car varies around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyStyle {
    Sedan,
    Hatchback,
    Wagon,
    Suv,
    Pickup,
    Van,
    Coupe,
    /// A roof that slopes down to a high tail.
    Fastback,
    /// Upright and high off the ground.
    OffRoader,
    /// One box with a sloping nose.
    Minivan,
    /// Short, narrow and tall.
    Microcar,
    /// A cab before a higher and wider box.
    BoxTruck,
    /// A long box, glazed all along.
    Bus,
    /// An open two-seater behind a windscreen.
    Roadster,
}

/// The shape of one car. Paint is not part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarParameters {
    pub style: BodyStyle,
    pub size: Size,
    pub axles: Axles,
    pub cabin: Cabin,
    pub hull: Hull,
    pub ends: Ends,
    pub fittings: Fittings,
}

/// Outer dimensions of the body, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    pub length: f32,
    pub width: f32,
    pub height: f32,
    /// From the ground to the floor.
    pub clearance: f32,
}

/// Wheels, in metres, and where they stand, as fractions of the length from the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axles {
    pub radius: f32,
    pub tyre_width: f32,
    /// How far the tyres stand out of the sides; negative where they stand inside.
    pub stance: f32,
    pub front: f32,
    pub rear: f32,
}

/// The glasshouse: positions as fractions of the length from the front, rakes in degrees from the
/// horizontal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cabin {
    /// Where the bonnet meets the windscreen.
    pub cowl: f32,
    pub windscreen_rake: f32,
    pub roof_end: f32,
    pub rear_rake: f32,
    /// Fraction of the height that the roof falls from its middle to its end.
    pub roof_fall: f32,
    /// How far the sides lean in, as a fraction of the half width.
    pub tumblehome: f32,
    /// How far the windows stand inside the shoulders under them, in metres.
    pub shelf: f32,
    /// Rise of the roof from its edges to its middle, in metres.
    pub crown: f32,
    /// Rounding of the edge between side and roof, at most, as a fraction of the height.
    pub cant: f32,
    /// Height and width as fractions of the car's: less than 1 before the box of a truck.
    pub height: f32,
    pub width: f32,
}

/// The lower body: heights as fractions of the car's height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull {
    /// The bonnet at the windscreen.
    pub bonnet: f32,
    /// The lower edge of the side windows, amidships.
    pub belt: f32,
    /// Rise of the belt from front to rear.
    pub wedge: f32,
    /// The boot lid, or the tailgate below its window.
    pub deck: f32,
    /// Outward bulge of the doors, as a fraction of the half width.
    pub bulge: f32,
    /// How far the edges of the wheel arches stand out, in metres.
    pub flare: f32,
    /// How widely the side profile rounds its corners, as a fraction of the length.
    pub softness: f32,
}

/// How the body closes in front and at the rear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// Fall of the bonnet towards the nose, as a fraction of the height.
    pub bonnet_fall: f32,
    /// Height of the nose, as a fraction of that of the bonnet's front edge.
    pub nose: f32,
    /// Height of the tail, as a fraction of the deck's.
    pub tail: f32,
    /// Narrowing in plan, as fractions of the half width.
    pub front_taper: f32,
    pub rear_taper: f32,
    /// How far the corners lie behind the middle of an end, in metres.
    pub front_bow: f32,
    pub rear_bow: f32,
    /// Rounding of the edges of both ends, in metres.
    pub edge_radius: f32,
}

/// What not every car has, in metres; 0 where absent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fittings {
    pub mirror: f32,
    /// Of a pickup's bed, or of an open cockpit.
    pub bed_depth: f32,
    pub spoiler_height: f32,
    pub roof_rail_height: f32,
    /// How far bumper bars stand out.
    pub bumper_depth: f32,
    /// `[width, height, length]` of a sign, a light bar or a luggage box on the roof.
    pub roof_load: [f32; 3],
    /// Whether a wheel hangs on the tailgate.
    pub spare_wheel: bool,
}
