use super::*;
use nalgebra::Point3;

/// A wedge whose single highest corner is at `nose`.
fn write_wedge(path: &Path, nose: &str) {
    let obj = format!("v {nose}\nv -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nf 1 2 3\nf 1 4 5\n");
    fs::create_dir_all(path.parent().expect("it has a parent")).expect("writable");
    fs::write(path, obj).expect("writable");
}

fn ids(root: &Path, selection: &Selection) -> Vec<String> {
    let collection = Collection::open(root, selection).expect("models");
    collection.models.into_iter().map(|model| model.id).collect()
}

fn refusal(root: &Path, selection: &Selection) -> String {
    Collection::open(root, selection).expect_err("no models").to_string()
}

#[test]
fn a_plain_folder_is_searched_through() {
    let root = tempfile::tempdir().expect("a temporary folder");
    for name in ["b.obj", "vans/a.OBJ", "vans/old/c.obj", ".hidden/d.obj", "vans/._a.obj"] {
        write_wedge(&root.path().join(name), "0 1 -2");
    }
    fs::write(root.path().join("vans/a.mtl"), "").expect("writable");
    assert_eq!(ids(root.path(), &Selection::default()), ["b", "vans/a", "vans/old/c"]);
}

#[test]
fn an_extension_stays_where_it_tells_two_models_apart() {
    let root = tempfile::tempdir().expect("a temporary folder");
    for name in ["a.obj", "a.glb", "b.obj", "v1.0/c.obj", "v1.1/c.obj"] {
        write_wedge(&root.path().join(name), "0 1 -2");
    }
    let expected = ["a.glb", "a.obj", "b", "v1.0/c", "v1.1/c"];
    assert_eq!(ids(root.path(), &Selection::default()), expected);
}

#[test]
fn patterns_fit_an_id_or_its_last_part() {
    let root = tempfile::tempdir().expect("a temporary folder");
    for name in ["vans/suv_1.obj", "vans/suv_2.obj", "cars/suv_3.obj", "cars/mini.obj"] {
        write_wedge(&root.path().join(name), "0 1 -2");
    }
    let take = |include: &str, exclude: &str| {
        let patterns = |text: &str| text.split_whitespace().map(str::to_owned).collect();
        let selection = Selection {
            include: patterns(include),
            exclude: patterns(exclude),
            ..Selection::default()
        };
        Collection::open(root.path(), &selection).map(|collection| collection.models.len()).ok()
    };
    assert_eq!(take("", ""), Some(4));
    assert_eq!(take("suv*", ""), Some(3));
    assert_eq!(take("vans/*", ""), Some(2));
    assert_eq!(take("suv*", "*_2 cars/*"), Some(1));
    assert_eq!(take("bus*", ""), None);
}

#[test]
fn given_axes_turn_the_front_to_minus_z() {
    let root = tempfile::tempdir().expect("a temporary folder");
    // Up is z here, and the front −y.
    let obj = "v 0 -2 1\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nf 1 2 3\nf 1 4 5\n";
    fs::write(root.path().join("car.obj"), obj).expect("writable");
    let axes = Axes::given("z".parse().ok(), "-y".parse().ok()).expect("not parallel");
    let selection = Selection { axes, ..Selection::default() };
    let models = Collection::open(root.path(), &selection).expect("a wedge").models;
    let nose = models[0].load().expect("a wedge").mesh.vertices[0];
    let expected = Point3::new(0.0, 0.5, -2.0) / 33.0_f32.sqrt(); // The box is 4 × 1 × 4.
    assert!((nose - expected).norm() < 1e-6, "{nose}");
}

#[test]
fn a_tree_of_shapenet_is_a_plain_folder_where_axes_are_given() {
    let root = tempfile::tempdir().expect("a temporary folder");
    write_wedge(&root.path().join("02958343/a/model.obj"), "2 1 0");
    assert_eq!(ids(root.path(), &Selection::default()), ["a"]);
    let plain = Selection { axes: Some(Axes::WORLD), ..Selection::default() };
    assert_eq!(ids(root.path(), &plain), ["02958343/a/model"]);
}

#[test]
fn a_folder_without_models_is_refused() {
    let root = tempfile::tempdir().expect("a temporary folder");
    assert!(refusal(root.path(), &Selection::default()).contains("no models"));
    write_wedge(&root.path().join("a.obj"), "0 1 -2");
    let none = Selection { include: vec!["b".into()], ..Selection::default() };
    assert!(refusal(root.path(), &none).contains("selected"));
    let split = Selection { split: Some(Split::Test), ..Selection::default() };
    assert!(refusal(root.path(), &split).contains("splits"));
    assert!(refusal(&root.path().join("none"), &Selection::default()).contains("none"));
}
