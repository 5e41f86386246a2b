//! The order of frames and of points is nothing that solvers see.

use burn::tensor::{Tensor, TensorData};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Solver, adam::AdamConfig, bundle_adjust,
        joint_lbfgs::JointLbfgsConfig, levenberg_marquardt::LevenbergMarquardtConfig,
        shape_model::KnownPoints, unknowns::Unknowns,
    },
    data::{
        keyed_rng, procedural,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
};
use rand::{Rng, seq::SliceRandom};

/// Iterations, and how far poses may differ after these, in radians and world units.
///
/// Sums over frames and points round differently in another order. Steps of Levenberg–Marquardt end
/// at the same minimum for all that. Those of the others are as long as gradients say, whose last
/// digits tip what is near a threshold: which points are seen, and which pixel is whose. What comes of
/// it grows with each iteration, a tenfold in two of L-BFGS.
fn extent(solver: Solver) -> (usize, f32) {
    match solver {
        Solver::Lm => (16, 1e-6),
        _ => (4, 1e-4),
    }
}

fn cases() -> impl Iterator<Item = (u64, Solver)> {
    let solvers = [Solver::Lm, Solver::Adam, Solver::Lbfgs];
    (1..4).flat_map(move |seed| solvers.map(|solver| (seed, solver)))
}

/// A sequence, a cloud that fits it, and poses to start from.
#[derive(Clone)]
struct Scene {
    sequence: Sequence,
    points: Vec<Point3<f32>>,
    start: Vec<Isometry3<f32>>,
}

impl Scene {
    fn new(seed: u64) -> Self {
        let options = SequenceOptions {
            n_frames: 5,
            size: [64, 64],
            n_true_points: 1500,
            ..Default::default()
        };
        let sequence = Sequence::render(&procedural::car(seed), &options, seed);
        let truth = sequence.truth.clone().expect("rendered");
        let mut rng = keyed_rng(seed, [7, 0]);
        let mut turned = |pose: Isometry3<f32>| {
            let axis_angle = Vector3::from_fn(|_, _| rng.random_range(-0.05f32..0.05));
            let rotation = UnitQuaternion::from_scaled_axis(axis_angle) * pose.rotation;
            Isometry3::from_parts(pose.translation, rotation)
        };
        let start = truth.camera_from_world.into_iter().map(&mut turned).collect();
        Self { sequence, points: truth.points.expect("asked for"), start }
    }

    /// Frame `order[l]` comes l-th.
    fn with_frames(mut self, order: &[usize]) -> Self {
        let Self { sequence, start, .. } = self.clone();
        self.sequence.frames = order.iter().map(|&l| sequence.frames[l].clone()).collect();
        self.start = order.iter().map(|&l| start[l]).collect();
        self
    }

    fn adjusted(&self, solver: Solver) -> Vec<Isometry3<f32>> {
        let device = Backend::Flex.device().autodiff();
        let values: Vec<f32> = self.points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let values = TensorData::new(values, [1, self.points.len(), 3]);
        let shape = KnownPoints(Tensor::from_data(values, &device.clone().inner()));
        let (n, _) = extent(solver);
        let config = BundleAdjustmentConfig {
            blurs: vec![1.0],
            lm: LevenbergMarquardtConfig {
                iterations: n,
                relative_first: 1,
                relative_tolerance: 0.0,
                ..Default::default()
            },
            lbfgs: JointLbfgsConfig { iterations: n, relative_first: 2, ..Default::default() },
            adam: AdamConfig { iterations: n, ..Default::default() },
            ..BundleAdjustmentConfig::preset(solver)
        };
        let start = Unknowns::with_poses(&self.start, &[], config.objective.parameterisation);
        let outcome = bundle_adjust(
            &self.sequence,
            &shape,
            &[start.into()],
            &config,
            &device,
            &mut |_, _| (),
        );
        outcome.unknowns.camera_from_world(&device)
    }
}

/// The greatest angle and distance between poses, in radians and world units.
fn difference(a: &[Isometry3<f32>], b: &[Isometry3<f32>]) -> f32 {
    let of_pair = |(a, b): (&Isometry3<f32>, &Isometry3<f32>)| {
        let translation = (a.translation.vector - b.translation.vector).norm();
        a.rotation.angle_to(&b.rotation).max(translation)
    };
    a.iter().zip(b).map(of_pair).fold(0.0, f32::max)
}

#[track_caller]
fn check_same(solver: Solver, found: &[Isometry3<f32>], expected: &[Isometry3<f32>]) {
    let (_, tolerance) = extent(solver);
    let difference = difference(found, expected);
    assert!(difference < tolerance, "{solver:?}: {difference:e}");
}

#[test]
fn permuted_target_frames_get_their_own_poses() {
    let order = [0, 3, 1, 4, 2];
    for (seed, solver) in cases() {
        let scene = Scene::new(seed);
        let found = scene.adjusted(solver);
        // What does not move at all is no test.
        assert!(difference(&found, &scene.start) > 5e-3, "{solver:?}");
        let expected: Vec<_> = order.iter().map(|&l| found[l]).collect();
        check_same(solver, &scene.with_frames(&order).adjusted(solver), &expected);
    }
}

#[test]
fn permuted_points_give_the_same_poses() {
    for (seed, solver) in cases() {
        let scene = Scene::new(seed);
        let mut shuffled = scene.clone();
        shuffled.points.shuffle(&mut keyed_rng(seed, [8, 0]));
        check_same(solver, &shuffled.adjusted(solver), &scene.adjusted(solver));
    }
}
