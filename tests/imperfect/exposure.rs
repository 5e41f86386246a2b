//! A camera that exposes every picture anew.

use object_pba::{
    bundle_adjustment::{Exposure, objective::ObjectiveConfig},
    data::{keyed_rng, sequence::Sequence},
};
use rand::Rng;
use rayon::prelude::*;

use crate::{adjusted, colors_lead, mean, rendered, rotation_error};

const SEEDS: std::ops::Range<u64> = 0..6;

/// Target frames about × 1.3, + 0.05, each by another exposure.
fn brightened(mut sequence: Sequence, seed: u64) -> (Sequence, Vec<Exposure>) {
    let mut rng = keyed_rng(seed, [8, 0]);
    let mut exposures = Vec::new();
    for frame in &mut sequence.frames[1..] {
        let (gain, bias) = (rng.random_range(1.15..1.45f32), rng.random_range(0.02..0.08f32));
        frame.color.iter_mut().for_each(|channel| *channel = gain * *channel + bias);
        // What brings it back to the reference's.
        let gain = f64::from(gain);
        exposures.push(Exposure { gain: 1.0 / gain, bias: -f64::from(bias) / gain });
    }
    (sequence, exposures)
}

#[test]
fn frames_that_are_exposed_anew_are_aligned_as_well_as_those_that_are_not() {
    let solved = || ObjectiveConfig { solve_exposure: true, ..colors_lead() };
    let errors: Vec<[f32; 3]> = SEEDS
        .into_par_iter()
        .map(|seed| {
            let untouched = rendered(seed);
            let (sequence, exposures) = brightened(untouched.clone(), seed);
            let found = adjusted(&sequence, seed, solved());
            for (found, expected) in found.exposures.iter().flatten().zip(&exposures) {
                let errors =
                    (found.gain - expected.gain).abs() + (found.bias - expected.bias).abs();
                assert!(errors < 0.02, "{found:?} is not {expected:?}");
            }
            [
                rotation_error(&untouched, &adjusted(&untouched, seed, colors_lead())),
                rotation_error(&sequence, &found),
                rotation_error(&sequence, &adjusted(&sequence, seed, colors_lead())),
            ]
        })
        .collect();
    let [untouched, solved, unsolved] =
        [0, 1, 2].map(|i| mean(&errors.iter().map(|errors| errors[i]).collect::<Vec<_>>()));
    println!("{errors:.2?}: {untouched:.3} {solved:.3} {unsolved:.3}");
    assert!(solved < 1.15 * untouched, "{solved} against {untouched}");
    assert!(unsolved > 1.7 * solved, "{unsolved} against {solved}");
}
