//! Masks that are wrong in parts, and frames without any.

use std::f32::consts::{PI, TAU};

use object_pba::{
    bundle_adjustment::objective::ObjectiveConfig,
    data::{ScalarImage, keyed_rng, sequence::Sequence},
    loss::SilhouetteNorm,
};
use rand::Rng;
use rayon::prelude::*;

use crate::{adjusted, colors_lead, mean, rendered, rotation_error};

const SEEDS: std::ops::Range<u64> = 0..4;
/// Share of a mask's pixels that is wrong.
const WRONG: f32 = 0.1;

/// From every mask a wedge is bitten off about a direction of its own, or one is added.
fn spoilt(mut sequence: Sequence, seed: u64) -> Sequence {
    let mut rng = keyed_rng(seed, [9, 0]);
    for frame in &mut sequence.frames {
        let direction = rng.random_range(0.0..TAU);
        match rng.random() {
            true => bite(&mut frame.mask, direction),
            false => add(&mut frame.mask, direction),
        }
    }
    sequence
}

fn covered(mask: &ScalarImage) -> Vec<[u32; 2]> {
    let covered = mask.enumerate_pixels().filter(|(_, _, coverage)| coverage.0[0] > 0.5);
    covered.map(|(u, v, _)| [u, v]).collect()
}

fn center(mask: &ScalarImage) -> [f32; 2] {
    let pixels = covered(mask);
    [0, 1].map(|axis| pixels.iter().map(|at| at[axis] as f32).sum::<f32>() / pixels.len() as f32)
}

/// Angle from a direction, in [0, π].
fn off([du, dv]: [f32; 2], direction: f32) -> f32 {
    let turn = (dv.atan2(du) - direction).rem_euclid(TAU);
    turn.min(TAU - turn)
}

fn from(center: [f32; 2], [u, v]: [u32; 2]) -> [f32; 2] {
    [u as f32 - center[0], v as f32 - center[1]]
}

/// Removes the pixels within the narrowest wedge about the centre that holds enough of them.
fn bite(mask: &mut ScalarImage, direction: f32) {
    let (center, mut pixels) = (center(mask), covered(mask));
    let angle = |at: &[u32; 2]| off(from(center, *at), direction);
    pixels.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let n_wrong = (WRONG * pixels.len() as f32) as usize;
    let widest = angle(&pixels[n_wrong]);
    for (u, v, coverage) in mask.enumerate_pixels_mut() {
        if off(from(center, [u, v]), direction) < widest {
            coverage.0[0] = 0.0;
        }
    }
}

/// Adds the pixels outside that are nearest to the centre, within a narrow wedge about it.
fn add(mask: &mut ScalarImage, direction: f32) {
    let center = center(mask);
    let n_wrong = (WRONG * covered(mask).len() as f32) as usize;
    let within = |at: [f32; 2]| off(at, direction) < PI / 12.0;
    let outside = mask.enumerate_pixels().filter(|(_, _, coverage)| coverage.0[0] <= 0.5);
    let mut outside: Vec<[u32; 2]> = outside.map(|(u, v, _)| [u, v]).collect();
    outside.retain(|at| within(from(center, *at)));
    let distance = |at: &[u32; 2]| from(center, *at).map(|x| x * x).iter().sum::<f32>();
    outside.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    for [u, v] in outside.into_iter().take(n_wrong) {
        mask.get_pixel_mut(u, v).0[0] = 1.0;
    }
}

/// Mean errors over all sequences, in degrees, of each objective.
fn errors<const N: usize>(
    change: impl Fn(Sequence, u64) -> Sequence + Sync,
    objectives: [ObjectiveConfig; N],
) -> [f32; N] {
    let errors: Vec<[f32; N]> = SEEDS
        .into_par_iter()
        .map(|seed| {
            let sequence = change(rendered(seed), seed);
            let error = |config: &ObjectiveConfig| {
                rotation_error(&sequence, &adjusted(&sequence, seed, config.clone()))
            };
            objectives.each_ref().map(error)
        })
        .collect();
    println!("{errors:.2?}");
    std::array::from_fn(|i| mean(&errors.iter().map(|errors| errors[i]).collect::<Vec<_>>()))
}

#[test]
fn wrong_pieces_of_masks_are_stood_by_norms_that_saturate_and_by_trimming() {
    let objectives = || {
        let saturating = SilhouetteNorm::Saturating;
        let unsquared = SilhouetteNorm::Unsquared;
        [
            colors_lead(),
            ObjectiveConfig { silhouette_norm: saturating, ..colors_lead() },
            ObjectiveConfig { silhouette_norm: unsquared, ..colors_lead() },
            ObjectiveConfig { silhouette_trim: 0.2, ..colors_lead() },
        ]
    };
    let [squared, saturating, unsquared, trimmed] = errors(spoilt, objectives());
    println!("{squared:.2} {saturating:.2} {unsquared:.2} {trimmed:.2}");
    assert!(saturating < 0.25 * squared, "{saturating} against {squared}");
    assert!(unsquared < 0.8 * squared, "{unsquared} against {squared}");
    assert!(trimmed < 0.25 * squared, "{trimmed} against {squared}");
    // Where masks are right, saturating costs little; trimming costs more, as it leaves out what tells most.
    let [squared, saturating, ..] = errors(|sequence, _| sequence, objectives());
    assert!(saturating < 1.5 * squared, "{saturating} against {squared}");
}

#[test]
fn frames_without_masks_are_aligned_by_their_colors() {
    let unmasked = |mut sequence: Sequence, _| {
        let without = [1, 2, 4];
        without.iter().for_each(|&frame| sequence.frames[frame].mask.fill(0.0));
        sequence
    };
    let [all] = errors(|sequence, _| sequence, [colors_lead()]);
    let [some] = errors(unmasked, [colors_lead()]);
    println!("{all:.3} {some:.3}");
    assert!(some < 1.3 * all, "{some} against {all}");
}
