//! Procedural cars: an endless family of closed, painted meshes with known shape.
//!
//! [`CarParameters`] state a shape; `profile` turns them into lines, `body` lofts cross-sections
//! along the car, `wheels` and `fittings` add parts, and `livery` paints pictures that are
//! projected onto all of it. Shape and paint come from separate random streams, so that one shape
//! can wear many paints.
//!
//! Everything is built in the workshop frame (metres, x to the car's right, y up from the ground,
//! z backwards from the middle), which differs from the world frame in scale and origin only.

mod body;
mod canvas;
mod curve;
mod fittings;
mod livery;
mod parameters;
mod profile;
mod random;
mod solid;
mod styles;
mod wheels;

use nalgebra::Isometry3;
use rand::Rng;

use self::{
    body::{body, is_underside, is_upper_side},
    livery::{Livery, Pictures, View},
    profile::Profile,
    solid::{Face, Solid},
};
use super::{
    keyed_rng,
    mesh::{Mesh, Triangle},
};

pub use self::parameters::{Axles, BodyStyle, Cabin, CarParameters, Ends, Fittings, Hull, Size};

/// The colour of the floor and of wheel arches.
const UNDERSIDE: [f32; 3] = [0.04; 3];
/// The colour of rubber.
const TYRE: [f32; 3] = [0.05; 3];

/// A car in the world frame; the same one for the same seed.
pub fn car(seed: u64) -> Mesh {
    CarParameters::random(&mut keyed_rng(seed, [0, 0])).mesh(&mut keyed_rng(seed, [0, 1]))
}

impl CarParameters {
    /// This shape in a random paint, in the world frame.
    pub fn mesh(&self, paint_rng: &mut impl Rng) -> Mesh {
        let profile = Profile::new(self);
        let livery = Livery::random(paint_rng);
        let pictures = livery.pictures(&profile, paint_rng);
        let mesh = assemble(&profile, &livery, Some(&pictures));
        Mesh { textures: pictures.to_images(), ..mesh }
    }

    /// The triangles of [`mesh`](Self::mesh) without its pictures, which take most of the time.
    pub fn unpainted_mesh(&self) -> Mesh {
        assemble(&Profile::new(self), &Livery::random(&mut keyed_rng(0, [0, 1])), None)
    }
}

fn assemble(profile: &Profile, livery: &Livery, pictures: Option<&Pictures>) -> Mesh {
    let mut mesh = Mesh::default();
    for part in parts(profile, livery) {
        add_part(&mut mesh, &part, livery, pictures);
    }
    mesh.normalise();
    mesh
}

/// A closed surface in its own place, and how its faces are painted.
struct Part {
    solid: Solid,
    skins: Vec<Skin>, // one a face
    /// From the part's own frame, in which it is painted, into the workshop frame.
    pose: Isometry3<f32>,
}

/// How a face is painted.
#[derive(Clone, Copy, Debug)]
enum Skin {
    Plain([f32; 3]),
    Picture(View),
}

impl Part {
    /// A part of one colour, in the workshop frame.
    fn plain(solid: Solid, color: [f32; 3]) -> Self {
        let skins = vec![Skin::Plain(color); solid.faces.len()];
        Self { solid, skins, pose: Isometry3::identity() }
    }
}

fn parts(profile: &Profile, livery: &Livery) -> Vec<Part> {
    let body = body(profile);
    let skins = body.faces.iter().map(|face| body_skin(profile, livery, &body, face)).collect();
    let mut parts = vec![Part { solid: body, skins, pose: Isometry3::identity() }];

    let wheel = wheels::wheel(profile);
    let skins: Vec<_> = wheel.faces.iter().map(|face| wheel_skin(&wheel, face)).collect();
    parts.extend(wheels::wheel_poses(profile).into_iter().map(|pose| Part {
        solid: wheel.clone(),
        skins: skins.clone(),
        pose,
    }));

    let plain: [(Vec<Solid>, [f32; 3]); 8] = [
        (wheels::axle_rods(profile), UNDERSIDE),
        (fittings::mirrors(profile), livery.paint),
        (fittings::spoiler(profile), livery.paint),
        (fittings::roof_rails(profile), livery.accent),
        (fittings::bumpers(profile), livery.bumper),
        (fittings::roof_load(profile), livery.roof_load),
        (fittings::free_windscreen(profile), livery.glass),
        (fittings::seats(profile), livery.trim),
    ];
    for (solids, color) in plain {
        parts.extend(solids.into_iter().map(|solid| Part::plain(solid, color)));
    }
    parts
}

/// The picture that a face of the body looks at most directly, unless it is hidden or in the bed.
fn body_skin(profile: &Profile, livery: &Livery, body: &Solid, face: &Face) -> Skin {
    let [a, b, c] = body.corners(face);
    let normal = (b - a).cross(&(c - a)).normalize();
    let middle = (a.coords + b.coords + c.coords) / 3.0;
    // Where the section stood before the ends were bowed.
    let z = middle.z - profile.bow(middle.x, middle.z);
    let at_an_end = z < profile.front + 0.15 || z > profile.rear - 0.15;
    if normal.y < -0.6 || (is_underside(face.column) && !at_an_end) {
        return Skin::Plain(UNDERSIDE);
    }
    let in_bed = profile.bed().is_some_and(|[start, end]| z > start - 0.02 && z < end + 0.02);
    if in_bed && is_upper_side(face.column) && middle.y < profile.top(z) - 0.02 {
        return Skin::Plain(livery.trim);
    }
    Skin::Picture(match normal.map(f32::abs) {
        n if n.z > n.x.max(n.y) && z < 0.0 => View::Front,
        n if n.z > n.x.max(n.y) => View::Rear,
        n if n.y > n.x => View::Top,
        _ => View::Side,
    })
}

/// Rubber, but for the face that looks outwards.
fn wheel_skin(wheel: &Solid, face: &Face) -> Skin {
    let [a, b, c] = wheel.corners(face);
    let normal = (b - a).cross(&(c - a)).normalize();
    if normal.x > 0.3 { Skin::Picture(View::Wheel) } else { Skin::Plain(TYRE) }
}

fn add_part(mesh: &mut Mesh, part: &Part, livery: &Livery, pictures: Option<&Pictures>) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(part.solid.vertices.iter().map(|point| part.pose * point));
    mesh.triangles.extend(part.solid.faces.iter().zip(&part.skins).map(|(face, &skin)| {
        let vertices = face.vertices.map(|vertex| first + vertex);
        match (skin, pictures) {
            (Skin::Plain(color), _) => Triangle::plain(vertices, color),
            (Skin::Picture(_), None) => Triangle::plain(vertices, livery.paint),
            (Skin::Picture(view), Some(pictures)) => Triangle {
                vertices,
                uvs: part.solid.corners(face).map(|corner| pictures.uv(view, corner)),
                color: [1.0; 3],
                texture: Some(view as u32),
            },
        }
    }));
}

#[cfg(test)]
mod tests;
