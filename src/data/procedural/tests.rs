use super::*;
use crate::data::procedural::solid::tests::{check_closed, signed_volume};

const N_CARS: u64 = 60;

fn shapes() -> impl Iterator<Item = CarParameters> {
    (0..N_CARS).map(|seed| CarParameters::random(&mut keyed_rng(seed, [0, 0])))
}

#[test]
fn every_part_is_closed_and_faces_outwards() {
    for shape in shapes() {
        let livery = Livery::random(&mut keyed_rng(0, [0, 1]));
        for part in parts(&Profile::new(&shape), &livery) {
            check_closed(&part.solid);
            assert!(signed_volume(&part.solid) > 0.0);
        }
    }
}

#[test]
fn cars_stand_in_the_world_frame() {
    for seed in 0..12 {
        let mesh = car(seed);
        assert_eq!(mesh.validate(), Ok(()));
        let bounds = mesh.bounds().expect("a car has triangles");
        let size = bounds.max - bounds.min;
        assert!(bounds.center().coords.norm() < 1e-5);
        assert!((bounds.diagonal() - 1.0).abs() < 1e-5);
        assert!(size.z > 1.6 * size.x && size.x > 0.7 * size.y, "{size}");
        assert!((8_000..25_000).contains(&mesh.triangles.len()), "{}", mesh.triangles.len());
    }
}

#[test]
fn headlamps_are_in_front_and_tail_lamps_behind() {
    let mesh = car(3);
    let mean_z = |view: View| {
        let painted = mesh.triangles.iter().filter(|t| t.texture == Some(view as u32));
        let z: Vec<f32> = painted.flat_map(|t| mesh.corners(t)).map(|corner| corner.z).collect();
        z.iter().sum::<f32>() / z.len() as f32
    };
    assert!(mean_z(View::Front) < -0.2, "the front is towards −Z");
    assert!(mean_z(View::Rear) > 0.2);
}

#[test]
fn one_shape_wears_many_paints() {
    let shape = CarParameters::random(&mut keyed_rng(7, [0, 0]));
    let [one, other] = [1, 2].map(|paint| shape.mesh(&mut keyed_rng(7, [0, paint])));
    assert_eq!(one.vertices, other.vertices);
    assert_ne!(one.textures, other.textures);
}

#[test]
fn the_same_seed_makes_the_same_car() {
    let [one, other] = [car(11), car(11)];
    assert_eq!(one.vertices, other.vertices);
    assert_eq!(one.textures, other.textures);
    assert_ne!(one.vertices, car(12).vertices);
}

#[test]
fn sections_follow_each_other_without_crossing() {
    for shape in shapes() {
        let profile = Profile::new(&shape);
        let body = body(&profile);
        let outside = |face: &&Face| {
            !(is_underside(face.column) || profile.bed().is_some() && is_upper_side(face.column))
        };
        // Where sections crossed, faces would look back at the spine of the car.
        for face in body.faces.iter().filter(outside) {
            let [a, b, c] = body.corners(face);
            let normal = (b - a).cross(&(c - a)).normalize();
            let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            let height = 0.5 * (profile.top(middle.z) + profile.bottom(middle.z));
            let along = middle.z.clamp(profile.front + 0.5, profile.rear - 0.5);
            let outwards = (middle - Point3::new(0.0, height, along)).normalize();
            assert!(normal.dot(&outwards) > 0.0, "{shape:?} at {middle}: {normal}");
        }
    }
}
