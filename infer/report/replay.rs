//! Which steps of an optimisation are shown, and what there is to see at each.

use burn::tensor::Device;
use nalgebra::Isometry3;
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Step, unknowns::Unknowns},
    checkpoint::Prior,
    data::sequence::Sequence,
    host::host_points,
    metrics::{PoseErrors, rotation_error},
    reconstruction::{Views, points, views},
};
use serde::Serialize;

use super::encode::{self, Bounds};
use crate::run::Reconstruction;

/// Most snapshots that a page holds, of 250 KB each at N = 24,576 and 15 frames.
const MOST_SNAPSHOTS: usize = 16;
/// Most steps of each hypothesis that the chart shows.
const MOST_STEPS: usize = 300;

/// The optimisation at one step, large arrays as `encode` has them.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Snapshot {
    /// Which of the chart's points of the kept hypothesis this is.
    pub step: usize,
    pub cloud: String,
    /// The points that each frame sees.
    pub visible: Vec<String>,
    /// `camera_from_world` of each frame, three rows of four.
    pub poses: Vec<[f32; 12]>,
    /// Focal lengths in pixels of the sequence's frames.
    pub focal: [f32; 2],
}

/// One step of the chart.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ChartStep {
    #[serde(flatten)]
    pub step: Step,
    /// How many steps of its hypothesis came before.
    pub ordinal: usize,
    /// Mean over frames, in degrees; of relative rotations where the true world is not canonical.
    pub pose_error: Option<f64>,
}

/// The steps of each hypothesis, and some snapshots of the one that was kept.
pub struct Replay {
    pub kept: usize,
    pub hypotheses: Vec<Vec<ChartStep>>,
    pub snapshots: Vec<Snapshot>,
    pub bounds: Bounds,
}

impl Replay {
    /// `device` need not differentiate.
    pub fn new(
        prior: &Prior,
        sequence: &Sequence,
        config: &BundleAdjustmentConfig,
        device: &Device,
        reconstruction: &Reconstruction,
    ) -> Self {
        let Reconstruction { history, trace, outcome, .. } = reconstruction;
        let kept = kept_hypothesis(history, trace, &outcome.unknowns, device);
        let n_hypotheses = history.iter().map(|step| step.hypothesis + 1).max().unwrap_or(0);
        // Of each hypothesis, the steps that are charted: an ordinal, and where it is in the history.
        let steps: Vec<Vec<(usize, usize)>> = (0..n_hypotheses)
            .map(|hypothesis| {
                let of_it: Vec<usize> =
                    (0..history.len()).filter(|&i| history[i].hypothesis == hypothesis).collect();
                spread(of_it.len(), MOST_STEPS).into_iter().map(|i| (i, of_it[i])).collect()
            })
            .collect();

        let generator = &prior.shape.generator;
        let shown = spread(steps.get(kept).map_or(0, Vec::len), MOST_SNAPSHOTS);
        let mut states: Vec<&Unknowns> = shown.iter().map(|&i| &trace[steps[kept][i].1]).collect();
        if let Some(last) = states.last_mut() {
            *last = &outcome.unknowns;
        }
        let clouds: Vec<Vec<[f32; 3]>> =
            states.iter().map(|state| host_points(&points(generator, state, device))).collect();
        let bounds = encode::bounds(clouds.iter().map(Vec::as_slice));
        let snapshots = shown.iter().zip(&states).zip(&clouds).map(|((&step, state), cloud)| {
            let Views { visible, .. } =
                views(sequence, generator, state, &config.objective.pseudo_render, device);
            Snapshot {
                step,
                cloud: encode::cloud(cloud, &bounds),
                visible: visible.iter().map(|seen| encode::bits(seen, cloud.len())).collect(),
                poses: state.camera_from_world(device).iter().map(rows).collect(),
                focal: state.intrinsics(&sequence.intrinsics).focal,
            }
        });
        let snapshots = snapshots.collect();
        let judged = |&(ordinal, i): &(usize, usize)| ChartStep {
            step: history[i].clone(),
            ordinal,
            pose_error: pose_error(sequence, &trace[i].camera_from_world(device)),
        };
        let hypotheses = steps.iter().map(|steps| steps.iter().map(judged).collect()).collect();
        Self { kept, hypotheses, snapshots, bounds }
    }
}

/// A pose as three rows of four, [R | t].
pub fn rows(pose: &Isometry3<f32>) -> [f32; 12] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|i| matrix[(i / 4, i % 4)])
}

/// The hypothesis whose last poses are nearest to those that were found. Their unknowns do not compare:
/// they are twists about different poses.
fn kept_hypothesis(
    history: &[Step],
    trace: &[Unknowns],
    found: &Unknowns,
    device: &Device,
) -> usize {
    let found = found.camera_from_world(device);
    let distance = |state: &Unknowns| -> f64 {
        let poses = state.camera_from_world(device);
        let apart = poses.iter().zip(&found).map(|(a, b)| {
            let shift = (a.translation.vector - b.translation.vector).norm();
            rotation_error(a, b) + f64::from(shift)
        });
        apart.sum()
    };
    let n_hypotheses = history.iter().map(|step| step.hypothesis + 1).max().unwrap_or(0);
    let last_of = |hypothesis: usize| history.iter().rposition(|s| s.hypothesis == hypothesis);
    (0..n_hypotheses)
        .filter_map(|hypothesis| Some((distance(&trace[last_of(hypothesis)?]), hypothesis)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(0, |(_, hypothesis)| hypothesis)
}

fn pose_error(sequence: &Sequence, poses: &[Isometry3<f32>]) -> Option<f64> {
    let truth = sequence.truth.as_ref()?;
    let errors = PoseErrors::new(poses, &truth.camera_from_world, truth.canonical);
    errors.rotation_error_deg_mean.or(errors.relative_rotation_error_deg_mean)
}

/// At most `most` of the indices below `n`, evenly spread, the first and the last among them.
fn spread(n: usize, most: usize) -> Vec<usize> {
    if n <= most {
        return (0..n).collect();
    }
    (0..most).map(|i| (i * (n - 1) + (most - 1) / 2) / (most - 1)).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use object_pba::{bundle_adjustment::unknowns::Parameterisation, device::Backend};

    use super::*;

    /// Both hypotheses have not moved at all: their unknowns are equal, their poses are not.
    #[test]
    fn the_kept_hypothesis_is_known_by_its_poses() {
        let starts = [0.0, 180.0f32].map(|degrees| {
            let turn = Isometry3::rotation(Vector3::y() * degrees.to_radians());
            Unknowns::new(turn, 2, &[], Parameterisation::default())
        });
        let step = |hypothesis| Step {
            iteration: 0,
            hypothesis,
            blur: 0.0,
            block: "joint".into(),
            objective: 1.0,
            photometric: 1.0,
            silhouette: 1.0,
            n_visible: 1,
        };
        let history = [step(0), step(1), step(0)];
        let trace = [0, 1, 0].map(|hypothesis| starts[hypothesis].clone());
        let device = Backend::default().device();
        for (hypothesis, found) in starts.iter().enumerate() {
            assert_eq!(kept_hypothesis(&history, &trace, found, &device), hypothesis);
        }
    }

    #[test]
    fn what_is_spread_begins_and_ends_with_the_whole_and_skips_evenly() {
        assert_eq!(spread(3, 16), [0, 1, 2]);
        assert_eq!(spread(0, 16), [0usize; 0]);
        for n in 17..200 {
            let some = spread(n, 16);
            assert_eq!((some.len(), some[0], some[15]), (16, 0, n - 1));
            let gaps: Vec<usize> = some.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(gaps.iter().max().unwrap() - gaps.iter().min().unwrap() <= 1, "{gaps:?}");
        }
    }
}
