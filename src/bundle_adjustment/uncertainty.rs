//! How far what was found may be off: covariances at convergence.
//!
//! Residuals are taken to be normal with a variance that nobody knows, and worth n independent
//! observations: the likelihood of some unknowns, at the best variance, is L^(−n/2), where L is their
//! objective. Around its least value that is a normal distribution of covariance (L / n) H⁻¹, where H is
//! that of the normal equations, reweighted as the robust loss has it. So the scale is the variance of
//! the robust residuals, L / n, and hypotheses are chosen by the same likelihood.
//!
//! It is no better than n, and what is wrong about the shape as a whole is not in it.

use nalgebra::{DMatrix, Isometry3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use super::{
    levenberg_marquardt::{LevenbergMarquardtConfig, normal_equations},
    objective::Objective,
    shape_jacobian::ShapeJacobian,
    unknowns::Unknowns,
};

/// Covariances of poses and points, to first order around what was found.
///
/// A pose's is of [φ, ρ], in radians and world units along the camera's axes, by which the true pose
/// (exp(φ) R, t + ρ) is off: the left tangent of SO(3) × R³. In that of SE(3), ρ is ρ − φ × t.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// Of each frame's `camera_from_world`.
    pub poses: Vec<Matrix6<f64>>,
    /// Of each target's Δp_l: its motion from the reference frame.
    pub relative_poses: Vec<Matrix6<f64>>,
    /// For each point, the root of its expected squared distance from where it should be, in world
    /// units. Style directions that are not solved for count as known.
    pub points: Vec<f64>,
    /// Of the small steps [p_0 | s | focal | Δp_1 | …] that all of these follow from.
    pub steps: DMatrix<f64>,
}

/// Shares of the components of true errors that lie within two standard deviations; of normal errors
/// whose covariance is right, 0.954 do.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct WithinTwoSigma {
    pub rotation: f64,
    pub translation: f64,
    pub relative_rotation: f64,
}

/// Around what was found with an objective that is worth `n_observations`; `None` where residuals leave
/// some unknown open.
pub(super) fn uncertainty(
    objective: &Objective,
    unknowns: &Unknowns,
    level: usize,
    config: &LevenbergMarquardtConfig,
    n_observations: f64,
) -> Option<Uncertainty> {
    let (found, matches) = objective.value(unknowns, level);
    let mut shape = ShapeJacobian::default();
    shape.refresh(objective, unknowns, config.n_directions.min(unknowns.style().len()));
    let equations = normal_equations(objective, unknowns, level, &shape, &matches, config);
    let inverse = equations.hessian().cholesky()?.inverse();
    let covariance = inverse * (found.objective / n_observations);
    let n_shared = 6 + shape.n_directions() + unknowns.focal().len();
    let poses = unknowns.host_poses(&objective.device);
    covariance.iter().all(|x| x.is_finite()).then(|| Uncertainty {
        poses: pose_covariances(&covariance, &poses, n_shared),
        relative_poses: relative_covariances(&covariance, poses.len(), n_shared),
        points: point_deviations(&covariance, &shape, matches.points.len()),
        steps: covariance,
    })
}

impl Uncertainty {
    /// Root of the expected square of each frame's rotation error, in radians.
    pub fn rotation_deviations(&self) -> Vec<f64> {
        self.poses.iter().map(|pose| root_of_trace(pose, 0)).collect()
    }

    /// Root of the expected square of each frame's error in t, in world units.
    pub fn translation_deviations(&self) -> Vec<f64> {
        self.poses.iter().map(|pose| root_of_trace(pose, 3)).collect()
    }

    /// The same as [`rotation_deviations`](Self::rotation_deviations) of each Δp_l.
    pub fn relative_rotation_deviations(&self) -> Vec<f64> {
        self.relative_poses.iter().map(|pose| root_of_trace(pose, 0)).collect()
    }

    /// How often true errors are no larger than they should be; both are `camera_from_world`.
    pub fn within_two_sigma(
        &self,
        estimate: &[Isometry3<f32>],
        truth: &[Isometry3<f32>],
    ) -> WithinTwoSigma {
        let errors: Vec<_> = estimate.iter().zip(truth).map(|(a, b)| tangent(a, b)).collect();
        let relative = |poses: &[Isometry3<f32>]| -> Vec<Isometry3<f32>> {
            let from_reference = |pose: &Isometry3<f32>| pose * poses[0].inverse();
            poses[1..].iter().map(from_reference).collect()
        };
        let relative_errors: Vec<_> = relative(estimate)
            .iter()
            .zip(&relative(truth))
            .map(|(estimate, truth)| tangent(estimate, truth))
            .collect();
        let share = |errors: &[Vector6<f64>], covariances: &[Matrix6<f64>], first: usize| {
            let pairs = errors.iter().zip(covariances);
            let within = pairs.flat_map(|(error, covariance)| {
                (first..first + 3).map(|i| error[i].powi(2) <= 4.0 * covariance[(i, i)])
            });
            let within: Vec<bool> = within.collect();
            within.iter().filter(|&&within| within).count() as f64 / within.len().max(1) as f64
        };
        WithinTwoSigma {
            rotation: share(&errors, &self.poses, 0),
            translation: share(&errors, &self.poses, 3),
            relative_rotation: share(&relative_errors, &self.relative_poses, 0),
        }
    }
}

fn root_of_trace(covariance: &Matrix6<f64>, first: usize) -> f64 {
    (first..first + 3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt()
}

/// [φ, ρ] from an estimate to the truth.
fn tangent(estimate: &Isometry3<f32>, truth: &Isometry3<f32>) -> Vector6<f64> {
    let (estimate, truth) = (estimate.cast::<f64>(), truth.cast::<f64>());
    let turn = (truth.rotation * estimate.rotation.inverse()).scaled_axis();
    let shift = truth.translation.vector - estimate.translation.vector;
    Vector6::from_iterator(turn.iter().chain(shift.iter()).copied())
}

/// Of p_l, where R_l = exp(δω_l) ΔR_l exp(δω_0) R_0 and t_l = t_0 + Δt_l: so φ = δω_l + ΔR_l δω_0 and
/// ρ = δt_0 + δt_l.
fn pose_covariances(
    covariance: &DMatrix<f64>,
    poses: &[Isometry3<f64>],
    n_shared: usize,
) -> Vec<Matrix6<f64>> {
    let of_frame = |(frame, pose): (usize, &Isometry3<f64>)| {
        let relative = (pose.rotation * poses[0].rotation.inverse()).to_rotation_matrix();
        let mut by_unknowns = DMatrix::zeros(6, covariance.nrows());
        by_unknowns.view_mut((0, 0), (3, 3)).copy_from(relative.matrix());
        by_unknowns.view_mut((3, 3), (3, 3)).fill_with_identity();
        if frame > 0 {
            let own = n_shared + 6 * (frame - 1);
            by_unknowns.view_mut((0, own), (6, 6)).fill_with_identity();
        }
        let covariance = &by_unknowns * covariance * by_unknowns.transpose();
        Matrix6::from_iterator(covariance.iter().copied())
    };
    poses.iter().enumerate().map(of_frame).collect()
}

fn relative_covariances(
    covariance: &DMatrix<f64>,
    n_frames: usize,
    n_shared: usize,
) -> Vec<Matrix6<f64>> {
    let own = |frame: usize| n_shared + 6 * (frame - 1);
    let of_frame = |frame| covariance.fixed_view::<6, 6>(own(frame), own(frame)).into();
    (1..n_frames).map(of_frame).collect()
}

/// √trace(∂X/∂s Σ_s ∂X/∂sᵀ).
fn point_deviations(covariance: &DMatrix<f64>, shape: &ShapeJacobian, n_points: usize) -> Vec<f64> {
    let k = shape.n_directions();
    let of_style = covariance.view((6, 6), (k, k)).into_owned();
    let variance = |point: usize| {
        let derivatives = shape.of_point(point);
        let mut sum = 0.0;
        for (i, a) in derivatives.iter().enumerate() {
            for (j, b) in derivatives.iter().enumerate() {
                let dot = Vector3::from(*a).dot(&Vector3::from(*b));
                sum += of_style[(i, j)] * f64::from(dot);
            }
        }
        sum.max(0.0).sqrt()
    };
    (0..n_points).into_par_iter().map(variance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bundle_adjustment::{
            BundleAdjustmentConfig, bundle_adjust, objective::ObjectiveConfig,
            observations::Observations, shape_model::KnownPoints, unknowns::Parameterisation,
        },
        data::{
            procedural,
            sequence::{Sequence, SequenceOptions},
        },
        device::Backend,
    };
    use burn::tensor::{Tensor, TensorData};
    use nalgebra::DVector;

    /// Steps of unknowns move poses as their covariances assume.
    #[test]
    fn a_step_of_the_unknowns_moves_every_pose_as_assumed() {
        let device = Backend::Flex.device();
        let poses = [0.0f32, 0.2, -0.3]
            .map(|turn| Isometry3::new(Vector3::new(0.1 * turn, 0.0, 2.0), Vector3::y() * turn));
        let unknowns = Unknowns::with_poses(&poses, &[], Parameterisation::ObjectCentred);
        let step: Vec<f64> = (0..18).map(|i| 1e-3 * (1.3 * f64::from(i)).sin()).collect();
        let moved = unknowns.stepped(&step, 0).camera_from_world(&device);
        // The covariance of a single known step is its outer product.
        let step = DMatrix::from_column_slice(18, 1, &step);
        let host = unknowns.host_poses(&device);
        let found = pose_covariances(&(&step * step.transpose()), &host, 6);
        for ((before, after), found) in poses.iter().zip(&moved).zip(found) {
            let error = tangent(before, after);
            let expected = error * error.transpose();
            assert!((found - expected).norm() < 2e-8, "{found} is not {expected}");
        }
    }

    /// A move by one standard deviation of an unknown, which the others follow as they covary, costs half
    /// a nat: half of the second difference of −log likelihood is that of a unit normal. It costs more
    /// where silhouettes begin to count what was within their tolerance, and what a view sees switches.
    #[test]
    fn a_standard_deviation_of_any_unknown_costs_about_half_a_nat() {
        const N_OBSERVATIONS: f64 = 20.0;
        let options = SequenceOptions {
            n_frames: 3,
            step_degrees: 4.0,
            size: [64, 64],
            n_true_points: 6000,
            ..Default::default()
        };
        let sequence = Sequence::render(&procedural::car(5), &options, 5);
        let truth = sequence.truth.clone().expect("rendered");
        let device = Backend::Flex.device();
        let points = truth.points.expect("asked for");
        let points: Vec<f32> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let points = TensorData::new(points, [1, options.n_true_points, 3]);
        let shape = KnownPoints(Tensor::from_data(points, &device));
        let lm = LevenbergMarquardtConfig { iterations: 40, ..Default::default() };
        let config = BundleAdjustmentConfig {
            blurs: vec![1.0],
            // Tolerances are kinks, which weigh as much as silhouettes do.
            objective: ObjectiveConfig { silhouette_weight: 40.0, ..Default::default() },
            lm: LevenbergMarquardtConfig { relative_tolerance: 1e-7, ..lm.clone() },
            ..Default::default()
        };
        let start = Unknowns::with_poses(&truth.camera_from_world, &[], Default::default());
        let starts = [start.into()];
        let found = bundle_adjust(&sequence, &shape, &starts, &config, &device, &mut |_, _| ());

        let observations = Observations::new(&sequence, &config.blurs, &device);
        let objective = Objective {
            observations: &observations,
            shape: &shape,
            config: &config.objective,
            device: device.clone(),
        };
        let cost = |unknowns: &Unknowns| {
            0.5 * N_OBSERVATIONS * objective.value(unknowns, 0).0.objective.ln()
        };
        let said = uncertainty(&objective, &found.unknowns, 0, &lm, N_OBSERVATIONS);
        let covariance = said.expect("colours and silhouettes hold all").steps;
        let least = cost(&found.unknowns);
        let nats = (0..18).map(|i| {
            let step = covariance.column(i) / covariance[(i, i)].sqrt();
            let beside = |step: DVector<f64>| cost(&found.unknowns.stepped(step.as_slice(), 0));
            0.5 * (beside(step.clone_owned()) + beside(-step)) - least
        });
        let nats: Vec<f64> = nats.collect();
        println!("{nats:.2?}");
        assert!(nats.iter().all(|nats| (0.3..0.8).contains(nats)), "{nats:?}");
    }

    #[test]
    fn errors_inside_of_two_deviations_are_counted_by_component() {
        let found = vec![Isometry3::<f32>::identity(); 2];
        let turned = Isometry3::new(Vector3::new(0.0, 0.0, 0.5), Vector3::new(0.05, 0.3, 0.0));
        let uncertainty = Uncertainty {
            poses: vec![Matrix6::identity() * 0.01; 2],
            relative_poses: vec![Matrix6::identity(); 1],
            points: Vec::new(),
            steps: DMatrix::zeros(0, 0),
        };
        let within = uncertainty.within_two_sigma(&found, &[Isometry3::identity(), turned]);
        let (rotation, translation) = (5.0 / 6.0, 5.0 / 6.0);
        assert_eq!(within, WithinTwoSigma { rotation, translation, relative_rotation: 1.0 });
    }
}
