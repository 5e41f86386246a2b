//! The pseudo-renderer (Eq. 2) against what can truly be seen of the surface that points lie on.

use burn::tensor::{Tensor, TensorData};
use nalgebra::Point3;
use object_pba::{
    camera::{Intrinsics, Pose},
    data::{
        ScalarImage, keyed_rng,
        lighting::Scene,
        mesh::Mesh,
        procedural,
        rasteriser::Renderer,
        surface::sample_surface,
        viewpoint::{Viewpoint, ViewpointRange, project},
    },
    device::Backend,
    pseudo_render::{Footprint, PseudoRenderConfig, visible_points},
};

const SIZE: [usize; 2] = [128, 128];
const N_CARS: u64 = 6;
const VIEWS_PER_CAR: u64 = 3;

/// Pixels of the depth map along a pixel of the view.
const SUPERSAMPLING: usize = 4;
/// How far behind the depth map a point still lies on the surface itself, in world units.
const THICKNESS: f32 = 0.004;

#[test]
fn visible_points_are_those_that_the_mesh_does_not_hide() {
    let (precision, recall) = precision_and_recall(24_576, &PseudoRenderConfig::default());
    assert!(precision >= 0.95, "precision is {precision}");
    assert!(recall >= 0.85, "recall is {recall}");
}

#[test]
fn discs_tell_more_than_pooled_cells() {
    let pooled = PseudoRenderConfig { footprint: Footprint::Cell, ..Default::default() };
    let [(precision, recall), cells] =
        [PseudoRenderConfig::default(), pooled].map(|config| precision_and_recall(6144, &config));
    assert!(precision > cells.0 && recall > cells.1);
}

#[test]
fn sparse_clouds_show_little_of_their_hidden_side() {
    for (n_points, least) in [(6144, [0.9, 0.8]), (2048, [0.8, 0.75])] {
        let (precision, recall) = precision_and_recall(n_points, &PseudoRenderConfig::default());
        assert!(precision >= least[0], "precision is {precision} at {n_points} points");
        assert!(recall >= least[1], "recall is {recall} at {n_points} points");
    }
}

/// The means over cars and views.
fn precision_and_recall(n_points: usize, config: &PseudoRenderConfig) -> (f32, f32) {
    let mut sums = [0.0; 2];
    for seed in 0..N_CARS {
        let mesh = procedural::car(seed);
        let points = sample_surface(&mesh, n_points, &mut keyed_rng(seed, [1, 0]));
        for view_idx in 0..VIEWS_PER_CAR {
            let rng = &mut keyed_rng(seed, [2, view_idx]);
            let view = Viewpoint::random(&mesh.vertices, SIZE, &ViewpointRange::default(), rng);
            let truth = truly_visible(&mesh, &points, &view);
            let found = pseudo_rendered(&points, &view, config);
            let n_right = found.iter().filter(|&&i| truth[i as usize]).count() as f32;
            sums[0] += n_right / found.len() as f32;
            sums[1] += n_right / truth.iter().filter(|&&visible| visible).count() as f32;
        }
    }
    let n_views = (N_CARS * VIEWS_PER_CAR) as f32;
    let (precision, recall) = (sums[0] / n_views, sums[1] / n_views);
    println!("{n_points} points: precision {precision:.3}, recall {recall:.3}");
    (precision, recall)
}

fn pseudo_rendered(
    points: &[Point3<f32>],
    view: &Viewpoint,
    config: &PseudoRenderConfig,
) -> Vec<u32> {
    let device = Backend::Flex.device();
    let values: Vec<f32> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let points = Tensor::from_data(TensorData::new(values, [1, points.len(), 3]), &device);
    let pose = Pose::from_isometries(&[view.camera_from_world], &device);
    visible_points(points, &pose, &view.intrinsics, SIZE, config).remove(0)
}

/// Whether each point is in the frame, and no part of the mesh is in front by over [`THICKNESS`].
fn truly_visible(mesh: &Mesh, points: &[Point3<f32>], view: &Viewpoint) -> Vec<bool> {
    let times = |x: f32| x * SUPERSAMPLING as f32;
    let Intrinsics { focal, center } = view.intrinsics;
    let intrinsics = Intrinsics { focal: focal.map(times), center: center.map(times) };
    let size = SIZE.map(|side| side * SUPERSAMPLING);
    let scene = Scene::random(&mut keyed_rng(0, [0, 0]), None);
    let depth =
        Renderer::new(mesh).render(&scene, &view.camera_from_world, &intrinsics, size).depth;
    let behind = |point: &Point3<f32>| {
        let point = view.camera_from_world * point;
        Some(point.z - surface_depth(&depth, project(&point, &intrinsics))?)
    };
    points.iter().map(|point| behind(point).is_some_and(|behind| behind <= THICKNESS)).collect()
}

/// The depth of the surface at a location: the greatest nearby, since a slanting surface varies
/// within a pixel. None out of the frame.
fn surface_depth(depth: &ScalarImage, location: [f32; 2]) -> Option<f32> {
    let [u, v] = location.map(|x| x.floor() as i64);
    let [width, height] = [depth.width(), depth.height()].map(i64::from);
    let in_frame = |[u, v]: &[i64; 2]| (0..width).contains(u) && (0..height).contains(v);
    let around = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| [u + du, v + dv]));
    let depths = around.filter(in_frame).map(|[u, v]| depth.get_pixel(u as u32, v as u32)[0]);
    in_frame(&[u, v]).then(|| depths.fold(0.0, f32::max))
}
