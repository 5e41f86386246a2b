//! The whole objective, as every solver sees it.

use burn::module::Module;
use image::{Luma, Rgb};
use nalgebra::{Isometry3, Vector3};
use object_pba::{
    bundle_adjustment::{
        Evaluation,
        objective::{Objective, ObjectiveConfig},
        observations::Observations,
        shape_model::{FreePoints, KnownPoints, ShapeModel},
        unknowns::Unknowns,
    },
    camera::Intrinsics,
    data::{
        ColorImage, ScalarImage,
        sequence::{Frame, Sequence},
    },
    loss::SilhouetteNorm,
    pseudo_render::visible_points,
    shape_prior::ShapePriorConfig,
};

use crate::{DEVICE, check_gradient, scattered, vector};

const SIZE: [usize; 2] = [48, 40];
const N_FRAMES: usize = 3;
const N_POINTS: usize = 64;

/// Ours, ours with everything that may be switched on, and the paper's.
fn configs() -> [ObjectiveConfig; 3] {
    let all = ObjectiveConfig {
        refine_focal: true,
        solve_exposure: true,
        silhouette_norm: SilhouetteNorm::Unsquared,
        silhouette_trim: 0.1,
        ..ObjectiveConfig::default()
    };
    [ObjectiveConfig::paper(), ObjectiveConfig::default(), all]
}

/// Smooth pictures of a disc, each a little unlike the last.
fn sequence() -> Sequence {
    let [width, height] = SIZE.map(|side| side as u32);
    let frame = |l: usize| {
        let l = l as f32;
        let color = ColorImage::from_fn(width, height, |u, v| {
            let wave = |phase: f32| 0.5 + 0.4 * (0.21 * u as f32 - 0.17 * v as f32 + phase).sin();
            Rgb([wave(0.2 * l), wave(1.0 - 0.1 * l), wave(2.0 + 0.3 * l)])
        });
        let mask = ScalarImage::from_fn(width, height, |u, v| {
            let radius = (u as f32 - 23.0 - l).hypot(v as f32 - 20.0);
            Luma([f32::from(radius < 12.0 + 0.5 * l)])
        });
        Frame { color, mask, path: Default::default() }
    };
    Sequence {
        name: "waves".into(),
        intrinsics: Intrinsics { focal: [60.0, 58.0], center: [24.0, 20.0] },
        size: SIZE,
        frames: (0..N_FRAMES).map(frame).collect(),
        truth: None,
    }
}

/// Two sheets, one behind the other: `[64 · 3]`. The camera sees the first.
fn two_sheets() -> Vec<f64> {
    let noise = scattered(3 * N_POINTS, 1);
    let point = |i: usize| {
        let (sheet, row, column) = (i / 32, (i % 32) / 8, i % 8);
        let at = [column as f64 * 0.09 - 0.3, row as f64 * 0.15 - 0.22, sheet as f64 * 0.5 - 0.2];
        [0, 1, 2].map(|axis| at[axis] + 0.02 * noise[3 * i + axis])
    };
    (0..N_POINTS).flat_map(point).collect()
}

/// Frames that turn by a few degrees in front of the camera; the last stays at rest. None looks straight
/// ahead: seen so, the mirror images of a symmetric shape would be equally far from what is level.
fn unknowns(style: &[f64], distance: f32, config: &ObjectiveConfig) -> Unknowns {
    let poses: Vec<_> = [0.0f32, 0.06, 0.0]
        .map(|turn| {
            Isometry3::new(Vector3::new(0.01, -0.02, distance), Vector3::new(0.02, turn, 0.03))
        })
        .to_vec();
    let mut unknowns = Unknowns::with_poses(&poses, &[], config.parameterisation);
    if config.refine_focal {
        unknowns = unknowns.with_focal();
        let focal = unknowns.focal();
        unknowns.values[focal].fill(0.04);
    }
    unknowns.values.extend(style);
    let likely = style.iter().map(|s| 0.7 * s).collect();
    unknowns.expecting(likely)
}

fn evaluate(shape: &dyn ShapeModel, unknowns: &Unknowns, config: &ObjectiveConfig) -> Evaluation {
    let observations = Observations::new(&sequence(), &[0.0], &DEVICE);
    let objective =
        Objective { observations: &observations, shape, config, device: DEVICE.clone() };
    objective.evaluate(unknowns, 0)
}

#[track_caller]
fn check_objective(shape: &dyn ShapeModel, style: &[f64]) {
    for config in configs() {
        let unknowns = unknowns(style, 2.0, &config);
        check_gradient(&unknowns.values.clone(), |values| {
            let mut unknowns = unknowns.clone();
            unknowns.values.copy_from_slice(values);
            let Evaluation { objective, gradient, .. } = evaluate(shape, &unknowns, &config);
            (objective, gradient)
        });
    }
}

fn known_points() -> KnownPoints {
    KnownPoints(vector(&two_sheets()).reshape([1, N_POINTS as i32, 3]))
}

#[test]
fn the_objective_of_poses() {
    check_objective(&known_points(), &[]);
}

#[test]
fn the_objective_of_poses_and_points() {
    check_objective(&FreePoints, &two_sheets());
}

#[test]
fn the_objective_of_poses_and_style() {
    let config = ShapePriorConfig {
        n_latent: 5,
        encoder_widths: [4; 3],
        n_encoder_points: 16,
        n_fc_points: 48,
        fc_width: 16,
        grid_side: 4,
        grid_channels: 16,
        symmetric: true,
    };
    let template: Vec<f32> = two_sheets().iter().map(|&x| x as f32).collect();
    DEVICE.seed(9);
    let prior = config.init(template.as_chunks::<3>().0, &DEVICE).freeze();
    check_objective(&prior.generator, &scattered(5, 2));
}

#[test]
fn points_that_no_frame_sees_have_no_gradient() {
    for config in configs() {
        // Without the pull of the style prior, and of silhouettes on points that lie hidden inside them.
        let (style_weight, silhouette_of_hidden_points) = (0.0, false);
        let config = ObjectiveConfig { style_weight, silhouette_of_hidden_points, ..config };
        let unknowns = unknowns(&two_sheets(), 2.0, &config);
        let gradient = evaluate(&FreePoints, &unknowns, &config).gradient;
        let seen = seen_by_any_frame(&unknowns, &config);
        assert!(seen.contains(&true) && seen.contains(&false));
        let moved = gradient[unknowns.style()].chunks(3).map(|gradient| gradient != [0.0; 3]);
        let of_seen: Vec<bool> =
            moved.zip(seen).filter_map(|(m, seen)| m.then_some(seen)).collect();
        assert!(!of_seen.is_empty() && !of_seen.contains(&false), "{of_seen:?}");
    }
}

fn seen_by_any_frame(unknowns: &Unknowns, config: &ObjectiveConfig) -> Vec<bool> {
    let leaves = unknowns.leaves(&DEVICE);
    let points = leaves.style.clone().reshape([1, N_POINTS as i32, 3]);
    let (poses, intrinsics) =
        (unknowns.poses(&leaves), unknowns.intrinsics(&sequence().intrinsics));
    let visible = visible_points(points.inner(), &poses, &intrinsics, SIZE, &config.pseudo_render);
    let mut seen = vec![false; N_POINTS];
    visible.concat().iter().for_each(|&point_idx| seen[point_idx as usize] = true);
    seen
}

#[test]
fn seeing_nothing_costs_more_than_seeing_everything() {
    for config in configs() {
        let in_view = unknowns(&[], 2.0, &config);
        let mut out_of_view = in_view.clone();
        out_of_view.values[3] += 5.0;
        let full = evaluate(&known_points(), &in_view, &config);
        let empty = evaluate(&known_points(), &out_of_view, &config);
        assert!(full.n_visible > 0 && empty.n_visible == 0);
        assert!(empty.photometric > full.photometric && empty.silhouette > full.silhouette);
        // The silhouettes call the cloud back: going on outwards costs still more.
        assert!(empty.gradient[3] > 0.0);
    }
}

#[test]
fn points_behind_the_camera_have_finite_gradients() {
    for config in configs() {
        // All of the cloud, half of it, and points in the plane of the camera.
        for distance in [-2.0, 0.0, 0.2] {
            let unknowns = unknowns(&two_sheets(), distance, &config);
            let Evaluation { objective, gradient, .. } = evaluate(&FreePoints, &unknowns, &config);
            assert!(objective.is_finite());
            assert!(gradient.iter().all(|g| g.is_finite()), "{gradient:?}");
        }
    }
}
