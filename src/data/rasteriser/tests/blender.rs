//! The rasteriser against Blender's Cycles: pictures of the same mesh from the same cameras.

use std::path::Path;

use image::Luma;
use nalgebra::{Unit, Vector3};

use super::{real_car, render};
use crate::data::{
    formats::{SequenceHints, read_sequence},
    lighting::{Light, Place, Scene},
};

/// As in `tests/fixtures/blender/render.py`.
const SUN: [f32; 3] = [0.4, 0.8, -0.45];

#[test]
fn blender_sees_the_same_silhouettes_and_colours() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blender");
    let reading = read_sequence(&folder, &SequenceHints::default()).expect("the fixture");
    let sequence = reading.sequence;
    let poses = sequence.truth.expect("Blender knows its cameras").camera_from_world;
    let sun = Place::Direction(Unit::new_normalize(Vector3::from(SUN)));
    let scene = Scene {
        ambient: [0.0; 3],
        lights: vec![Light { place: sun, color: [1.0; 3] }],
        ground: None,
        background: [0.0; 3],
    };
    assert_eq!(poses.len(), 3);
    for (frame, pose) in sequence.frames.iter().zip(&poses) {
        let ours = render(&real_car(), &scene, pose, &sequence.intrinsics, sequence.size);
        let [mut both, mut either] = [0.0, 0.0];
        let mut differences = vec![];
        for (x, y, Luma([mask])) in frame.mask.enumerate_pixels() {
            let coverage = ours.coverage.get_pixel(x, y).0[0];
            both += mask.min(coverage);
            either += mask.max(coverage);
            if mask.min(coverage) == 1.0 {
                let [color, other] =
                    [&frame.color, &ours.color].map(|image| image.get_pixel(x, y).0);
                differences.extend(color.iter().zip(other).map(|(a, b)| (a - b).abs()));
            }
        }
        differences.sort_by(f32::total_cmp);
        let median = differences[differences.len() / 2];
        // Blender takes 256 samples a pixel and we four: along the outline they differ a little.
        assert!(both / either >= 0.99, "silhouettes overlap by {}", both / either);
        assert!(median < 0.5 / 255.0, "colours differ by {median}");
    }
}
