//! Beyond the prior's manifold: what the prior lacks, a few smooth modes make up for.

use burn::tensor::{Tensor, TensorData};
use nalgebra::Vector3;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Outcome, Step, bundle_adjust, displacement::DisplacementConfig,
        levenberg_marquardt::LevenbergMarquardtConfig, shape_model::ShapeModel, unknowns::Unknowns,
    },
    data::{
        procedural,
        sequence::{Sequence, SequenceOptions},
    },
    device::Backend,
    metrics::rotation_error,
};

const N_POINTS: usize = 12_288;
const N_MODES: usize = 40;

/// A prior of one direction: how large a cloud is.
struct Scaled(Tensor<3>);

impl ShapeModel for Scaled {
    fn points(&self, style: Tensor<2>) -> Tensor<3> {
        let [b, _] = style.dims();
        let factor = style * 0.02 + 1.0;
        self.0.clone().repeat_dim(0, b) * factor.unsqueeze_dim::<3>(2)
    }
}

/// The true cloud, swollen by up to 3 % of the diagonal around one flank.
fn dented(truth: &[Vector3<f32>]) -> Vec<Vector3<f32>> {
    let dent = |point: &Vector3<f32>| {
        let center = Vector3::new(0.0, 0.05, 0.15);
        let near = (-(point - center).norm_squared() / (2.0 * 0.15f32.powi(2))).exp();
        point + 0.03 * near * point.normalize()
    };
    truth.iter().map(dent).collect()
}

struct Found {
    outcome: Outcome,
    silhouette: f64,
    /// Mean rotation error over frames, in degrees.
    turned: f64,
}

/// Starts from the true poses.
fn adjusted(sequence: &Sequence, points: &[Vector3<f32>], n_modes: usize) -> Found {
    let device = Backend::Flex.device();
    let values: Vec<f32> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let prior = Scaled(Tensor::from_data(TensorData::new(values, [1, points.len(), 3]), &device));
    let truth = sequence.truth.as_ref().expect("rendered");
    let config = BundleAdjustmentConfig {
        blurs: vec![0.7, 0.0],
        displacement: DisplacementConfig { n_modes, deviation: 0.03, ..Default::default() },
        lm: LevenbergMarquardtConfig { max_residuals: 2000, ..Default::default() },
        ..Default::default()
    };
    let start = Unknowns::with_poses(&truth.camera_from_world, &[0.0], Default::default());
    let mut silhouette = f64::NAN;
    let mut observe = |step: &Step, _: &Unknowns| silhouette = step.silhouette;
    let outcome = bundle_adjust(sequence, &prior, &[start.into()], &config, &device, &mut observe);
    let poses = outcome.unknowns.camera_from_world(&device);
    let errors = poses.iter().zip(&truth.camera_from_world);
    let errors: Vec<f64> = errors.map(|(a, b)| rotation_error(a, b).to_degrees()).collect();
    let turned = errors.iter().sum::<f64>() / errors.len() as f64;
    Found { outcome, silhouette, turned }
}

#[test]
fn silhouettes_tell_a_dent_that_the_prior_lacks() {
    let options = SequenceOptions {
        n_frames: 8,
        step_degrees: 5.0,
        n_true_points: N_POINTS,
        ..Default::default()
    };
    let sequence = Sequence::render(&procedural::car(12), &options, 12);
    let points = sequence.truth.as_ref().and_then(|truth| truth.points.clone());
    let points: Vec<_> = points.expect("asked for").iter().map(|point| point.coords).collect();

    let of_truth = adjusted(&sequence, &points, 0).silhouette;
    let [on_manifold, beyond] = [0, N_MODES].map(|n| adjusted(&sequence, &dented(&points), n));
    let [before, after] = [&on_manifold, &beyond].map(|found| found.silhouette - of_truth);
    println!("{of_truth:.4} px², {before:.4} → {after:.4} above");
    assert!(before > 1e-3 && after < 0.3 * before, "{before} → {after} above {of_truth}");
    assert!(beyond.turned < 1.0, "{}°", beyond.turned);
    let n_steps = |found: &Found| -> usize {
        found.outcome.uncertainty.as_ref().expect("all is held").steps.nrows()
    };
    assert_eq!(n_steps(&beyond), n_steps(&on_manifold) + N_MODES);
}
