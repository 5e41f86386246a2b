//! A focal length that is wrong.

use object_pba::{
    bundle_adjustment::{Outcome, objective::ObjectiveConfig},
    camera::Intrinsics,
    data::{
        procedural,
        sequence::{Sequence, SequenceOptions},
        viewpoint::ViewpointRange,
    },
    device::Backend,
};
use rayon::prelude::*;

use crate::{adjusted, mean, rotation_error};

const SEEDS: std::ops::Range<u64> = 0..6;
/// What is given, as a share of what is true.
const WRONG: f32 = 0.95;

/// A focal length shows by perspective alone: how much larger the near end is than the far one. Here
/// the camera is near; at the usual distances, five per cent are a fifth of a pixel.
fn near_view(seed: u64) -> Sequence {
    let viewpoint = ViewpointRange {
        field_of_view_degrees: [55.0, 70.0],
        fill: [0.8, 0.95],
        ..Default::default()
    };
    let options = SequenceOptions {
        n_frames: 4,
        step_degrees: 5.0,
        n_true_points: 24_576,
        viewpoint,
        ..Default::default()
    };
    Sequence::render(&procedural::car(seed), &options, seed)
}

/// Mean distance of the object from where it is, in world units.
fn translation_error(sequence: &Sequence, outcome: &Outcome) -> f32 {
    let truth = &sequence.truth.as_ref().expect("rendered").camera_from_world;
    let found = outcome.unknowns.camera_from_world(&Backend::Flex.device());
    let errors = found.iter().zip(truth);
    let errors = errors.map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
    errors.sum::<f32>() / truth.len() as f32
}

#[test]
fn a_focal_length_that_is_wrong_is_found_and_poses_with_it() {
    // Silhouettes tell the perspective: they may count for more, and from coarse to fine alike.
    let fixed = || ObjectiveConfig {
        silhouette_weight: 200.0,
        tolerance_per_blur: 0.0,
        ..Default::default()
    };
    let refined = || ObjectiveConfig { refine_focal: true, ..fixed() };
    let errors: Vec<[f32; 5]> = SEEDS
        .into_par_iter()
        .map(|seed| {
            let sequence = near_view(seed);
            let true_focal = sequence.intrinsics.focal[0];
            let focal = sequence.intrinsics.focal.map(|focal| WRONG * focal);
            let intrinsics = Intrinsics { focal, ..sequence.intrinsics };
            let misjudged = Sequence { intrinsics, ..sequence };
            let found = adjusted(&misjudged, seed, refined());
            let without = adjusted(&misjudged, seed, fixed());
            let found_focal = found.unknowns.intrinsics(&intrinsics).focal[0];
            [
                (found_focal / true_focal - 1.0).abs(),
                translation_error(&misjudged, &found),
                translation_error(&misjudged, &without),
                rotation_error(&misjudged, &found),
                rotation_error(&misjudged, &without),
            ]
        })
        .collect();
    let [focal, translation, fixed_translation, rotation, fixed_rotation] =
        [0, 1, 2, 3, 4].map(|i| mean(&errors.iter().map(|errors| errors[i]).collect::<Vec<_>>()));
    println!("focal {focal:.4}, translations {translation:.4} {fixed_translation:.4}");
    println!("rotations {rotation:.3} {fixed_rotation:.3}: {errors:.3?}");
    assert!(focal < 0.025, "{focal}");
    assert!(translation < 0.5 * fixed_translation, "{translation} against {fixed_translation}");
    assert!(rotation < fixed_rotation, "{rotation} against {fixed_rotation}");
}
