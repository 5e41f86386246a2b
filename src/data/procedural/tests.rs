use super::*;
use crate::data::procedural::solid::tests::{check_closed, signed_volume};

const N_CARS: u64 = 200;

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
        assert!(size.z > 1.2 * size.x && size.x > 0.6 * size.y, "{size}");
        assert!((5_000..13_000).contains(&mesh.triangles.len()), "{}", mesh.triangles.len());
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

    let unpainted = shape.unpainted_mesh();
    assert_eq!(unpainted.vertices, one.vertices);
    let triangles = |mesh: &Mesh| -> Vec<_> { mesh.triangles.iter().map(|t| t.vertices).collect() };
    assert_eq!(triangles(&unpainted), triangles(&one));
    assert!(unpainted.textures.is_empty());
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
        let body = body(&Profile::new(&shape));
        let n_columns = 1 + body.faces.iter().map(|face| face.column).max().expect("faces");
        let sections: Vec<_> = body.vertices.chunks_exact(n_columns).collect();
        for (one, next) in sections.iter().zip(&sections[1..]) {
            let in_order = one.iter().zip(*next).all(|(a, b)| a.z < b.z + 1e-5);
            assert!(in_order, "{shape:?} at {}", one[0]);
        }
    }
}

#[test]
fn windows_stand_on_the_sides_and_carry_the_roof() {
    for shape in shapes() {
        let profile = Profile::new(&shape);
        let length = profile.rear - profile.front;
        for z in (1..100).map(|step| profile.front + length * step as f32 / 100.0) {
            let cant = profile.cant(z);
            assert!(cant.half_width > 0.3 * profile.half_width(z), "{shape:?} at {z}");
            assert!(profile.top(z) - cant.radius > profile.bottom(z) + 0.1, "{shape:?} at {z}");
        }
    }
}

#[test]
fn the_box_of_a_truck_is_higher_and_wider_than_its_cab() {
    for seed in 0..20 {
        let mut rng = keyed_rng(seed, [0, 0]);
        let profile = Profile::new(&CarParameters::random_of_style(BodyStyle::BoxTruck, &mut rng));
        let (cab, cargo) = (profile.roof_end - 0.05, profile.roof_end + 0.05);
        assert!(profile.top(cab) < profile.top(cargo));
        assert!(profile.half_width(cab) <= profile.half_width(cargo));
    }
}

#[test]
fn three_in_four_are_passenger_cars() {
    let mut rng = keyed_rng(0, [0, 0]);
    let n_others = (0..4000)
        .map(|_| BodyStyle::random(&mut rng))
        .filter(|style| style.is_commercial() || *style == BodyStyle::Pickup)
        .count();
    assert!((700..1200).contains(&n_others), "{n_others}");
}
