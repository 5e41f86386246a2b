//! One step of the chain at a time, from a twist to a distance.

use burn::{
    module::Module,
    tensor::{Tensor, s},
};
use nalgebra::Isometry3;
use object_pba::{
    bundle_adjustment::unknowns::{Leaves, Parameterisation, Unknowns},
    camera::{Intrinsics, Pose},
    chamfer::chamfer_distance,
    data::{ColorImage, ScalarImage},
    host::{host_pixels, index_tensor},
    loss::{
        SilhouetteLoss, SilhouetteMatching, SilhouetteNorm, SilhouetteTolerances, charbonnier,
        silhouette_distances, silhouette_pairs,
    },
    sampling::ImageTable,
    shape_prior::ShapePriorConfig,
    silhouette::Silhouette,
};

use crate::{DEVICE, check_gradient, mixed, on_graph, scattered, vector};

/// At rest, nearly at rest, turned, and nearly a half turn.
const TURNS: [[f64; 3]; 4] = [[0.0; 3], [1e-5, -2e-5, 1e-5], [0.3, -0.5, 0.2], [0.2, 3.0, -0.4]];

const CAMERA: Intrinsics = Intrinsics { focal: [60.0, 55.0], center: [16.0, 12.0] };

/// A cloud `[1, n, 3]` within `radius` of the origin along each axis.
fn cloud(n_points: usize, seed: u64, radius: f64) -> Tensor<3> {
    vector(&scattered(3 * n_points, seed)).reshape([1, n_points as i32, 3]) * radius
}

#[test]
fn the_exponential_of_so3() {
    let points = cloud(4, 1, 1.0);
    for turn in TURNS {
        let twist = [&turn[..], &[0.1, -0.2, 0.3]].concat();
        check_gradient(
            &twist,
            on_graph(|twist| {
                mixed(Pose::from_twist(twist.reshape([1, 6])).camera_from_world(points.clone()))
            }),
        );
    }
}

#[track_caller]
fn check_pixels(parameterisation: Parameterisation) {
    let points = cloud(5, 2, 0.4);
    let initial = Isometry3::translation(0.1, -0.1, 2.0);
    for (reference, relative) in TURNS.iter().zip(TURNS.iter().rev()) {
        let shifts = [[0.02, 0.01, -0.03], [-0.01, 0.03, 0.02]];
        let twists = [&reference[..], &shifts[0], relative, &shifts[1]].concat();
        let unknowns = Unknowns::new(initial, 2, &[], parameterisation);
        let pixels = |twists: Tensor<1>| {
            let twist = |start: usize| twists.clone().slice(s![start..start + 6]).reshape([1, 6]);
            let style = Tensor::zeros([1, 1], &*DEVICE);
            let leaves = Leaves {
                reference_twist: twist(0),
                relative_twists: twist(6),
                log_focal: None,
                style,
            };
            let points_in_camera = unknowns.poses(&leaves).camera_from_world(points.clone());
            mixed(CAMERA.project(points_in_camera).pixels)
        };
        check_gradient(&twists, on_graph(pixels));
    }
}

#[test]
fn pixels_of_poses_that_turn_about_the_object() {
    check_pixels(Parameterisation::ObjectCentred);
}

#[test]
fn pixels_of_poses_that_turn_about_the_camera() {
    check_pixels(Parameterisation::CameraCentred);
}

#[test]
fn colors_of_locations() {
    let values: Vec<f32> = scattered(2 * 3 * 8 * 6, 3).iter().map(|&x| x as f32).collect();
    let images: Vec<_> = values
        .chunks(3 * 8 * 6)
        .map(|image| ColorImage::from_vec(8, 6, image.to_vec()).expect("8 by 6 pixels"))
        .collect();
    let table = ImageTable::new(&images, &DEVICE);
    // Inside, between the border's centres and the border, and outside.
    let locations = [1.2, 3.3, 6.9, 2.1, 4.7, 0.2, -3.0, 2.2];
    check_gradient(
        &[locations, locations.map(|x| 0.9 * x + 0.01)].concat(),
        on_graph(|locations| mixed(table.sample_bilinear(&[1, 0], locations.reshape([2, 4, 2])))),
    );
}

#[test]
fn robust_residuals() {
    let residuals = [0.0, 0.01, -0.1, 0.9];
    check_gradient(&residuals, on_graph(|r| mixed(charbonnier(r.square(), 0.1))));
}

#[test]
fn silhouette_distances_to_points() {
    let disc = ScalarImage::from_fn(32, 24, |u, v| {
        let inside = (u as f32 - 15.0).hypot(v as f32 - 12.0) < 7.0;
        image::Luma([f32::from(inside)])
    });
    let silhouette = Silhouette::new(&disc).expect("a disc");
    let pixels: Vec<f64> = scattered(2 * 2 * 20, 4).iter().map(|x| 14.0 + 12.0 * x).collect();
    let everything: Vec<u32> = (0..40).collect();
    let all = [SilhouetteNorm::Squared, SilhouetteNorm::Unsquared, SilhouetteNorm::Saturating];
    let matchings = [
        (false, [0.0; 2], 0.0),
        (false, [0.9, 0.6], 0.0),
        (true, [0.3, 0.0], 0.0),
        (true, [0.3, 0.6], 0.2),
    ];
    for (norm, (to_outline, tolerances, trim)) in
        all.into_iter().flat_map(|norm| matchings.map(|matching| (norm, matching)))
    {
        let loss = SilhouetteLoss { norm, scale: 0.8 };
        let weights = [0.3, 0.7];
        let [coverage, containment] = tolerances;
        let tolerances = SilhouetteTolerances { coverage, hole: 1.5 * coverage, containment };
        let matching = SilhouetteMatching { to_outline, weights, tolerances, trim };
        let distances = |pixels: Tensor<1>| {
            let pixels = pixels.reshape([1, 40, 2]);
            let projected = &host_pixels(&pixels)[0];
            let pairs = silhouette_pairs(&silhouette, projected, &everything, &matching);
            let point_idx = pairs.iter().map(|pair| i64::from(pair.point_idx)).collect();
            let point_idx = index_tensor(point_idx, &pixels);
            silhouette_distances(pixels.squeeze_dim::<2>(0).select(0, point_idx), &pairs, loss)
        };
        check_gradient(&pixels, on_graph(distances));
    }
}

#[test]
fn chamfer_distances_of_both_clouds() {
    let (n, m) = (14, 11);
    let distance = |points: Tensor<1>| {
        let predicted = points.clone().slice(s![..3 * n]).reshape([1, n as i32, 3]);
        let target = points.slice(s![3 * n..]).reshape([1, m as i32, 3]);
        chamfer_distance(predicted, target)
    };
    check_gradient(&scattered(3 * (n + m), 5), on_graph(distance));
}

#[test]
fn distances_of_generated_points_to_a_cloud() {
    let config = ShapePriorConfig {
        n_latent: 5,
        encoder_widths: [4; 3],
        n_encoder_points: 16,
        n_fc_points: 24,
        fc_width: 16,
        grid_side: 8,
        grid_channels: 16,
        symmetric: true,
    };
    let template: Vec<[f32; 3]> = (0..config.n_points())
        .map(|i| [0.1, 0.23, 0.37].map(|step| (step * i as f32).sin() * 0.5))
        .collect();
    DEVICE.seed(6);
    let generator = config.init(&template, &DEVICE).freeze().generator;
    let target = cloud(30, 7, 0.5);
    check_gradient(
        &scattered(generator.n_style(), 8),
        on_graph(|style| chamfer_distance(generator.forward(style.unsqueeze()), target.clone())),
    );
}
