//! {p_0, Δp_l, s}, and the focal length if asked for: what bundle adjustment solves for, as one flat vector that solvers share.

use std::ops::Range;

use burn::tensor::{DType, Device, Tensor, TensorData};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::camera::{Intrinsics, Pose};

/// How Δp_l acts on p_0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parameterisation {
    /// About the object, ΔR_l R_0 x + t_0 + Δt_l: turning and moving hardly interact.
    #[default]
    ObjectCentred,
    /// About the camera, ΔR_l (R_0 x + t_0) + Δt_l: Eq. 4.
    CameraCentred,
}

/// The unknowns: p_0, as a twist about the initial reference pose, then each Δp_l, then the log of a
/// factor on the focal length, where that is refined, then the style.
///
/// Twists are `[φn, t]`, radians and world units, in SO(3) × R³.
#[derive(Clone, Debug)]
pub struct Unknowns {
    pub values: Vec<f64>,
    n_frames: usize,
    /// Whether the focal length is an unknown.
    refines_focal: bool,
    initial_reference: Isometry3<f32>,
    parameterisation: Parameterisation,
    /// s̄, around which styles are likely.
    likely_style: Vec<f64>,
}

/// The unknowns as leaves of the graph.
pub struct Leaves {
    pub reference_twist: Tensor<2>, // [1, 6]
    pub relative_twists: Tensor<2>, // [L − 1, 6]
    /// The log of a factor on the focal length, `[1, 1]`, where it is an unknown.
    pub log_focal: Option<Tensor<2>>,
    pub style: Tensor<2>, // [1, k]
}

impl Unknowns {
    /// The paper's initialisation: p_0 and s from the regressors, every Δp_l zero.
    pub fn new(
        reference_pose: Isometry3<f32>,
        n_frames: usize,
        style: &[f32],
        parameterisation: Parameterisation,
    ) -> Self {
        let mut values = vec![0.0; 6 * n_frames];
        values.extend(style.iter().map(|&s| f64::from(s)));
        Self {
            values,
            n_frames,
            refines_focal: false,
            initial_reference: reference_pose,
            parameterisation,
            likely_style: vec![0.0; style.len()],
        }
    }

    /// Starts every frame from a pose of its own.
    pub fn with_poses(
        camera_from_world: &[Isometry3<f32>],
        style: &[f32],
        parameterisation: Parameterisation,
    ) -> Self {
        let reference = camera_from_world[0];
        let mut unknowns = Self::new(reference, camera_from_world.len(), style, parameterisation);
        for (l, pose) in camera_from_world.iter().enumerate().skip(1) {
            let turn: UnitQuaternion<f32> = pose.rotation * reference.rotation.inverse();
            let start: Vector3<f32> = match parameterisation {
                Parameterisation::ObjectCentred => reference.translation.vector,
                Parameterisation::CameraCentred => turn * reference.translation.vector,
            };
            let shift = pose.translation.vector - start;
            let twist =
                turn.scaled_axis().iter().chain(shift.iter()).map(|&x| f64::from(x)).collect();
            unknowns.values.splice(Self::relative(l), Vec::<f64>::into_iter(twist));
        }
        unknowns
    }

    /// The focal length, too, from where it is given on.
    pub fn with_focal(mut self) -> Self {
        if !self.refines_focal {
            self.values.insert(6 * self.n_frames, 0.0);
            self.refines_focal = true;
        }
        self
    }

    /// The same poses, and another style: around zero, if it is longer or shorter.
    pub fn with_style(&self, style: &[f32]) -> Self {
        let mut unknowns = self.clone();
        unknowns.values.truncate(self.style().start);
        unknowns.values.extend(style.iter().map(|&s| f64::from(s)));
        if self.likely_style.len() != style.len() {
            unknowns.likely_style = vec![0.0; style.len()];
        }
        unknowns
    }

    /// The same, taking styles to be likely around this one instead of around the mean shape's, zero.
    pub fn expecting(mut self, likely_style: Vec<f64>) -> Self {
        assert_eq!(likely_style.len(), self.style().len(), "numbers in a style");
        self.likely_style = likely_style;
        self
    }

    /// s̄, around which styles are likely.
    pub fn likely_style(&self) -> &[f64] {
        &self.likely_style
    }

    /// s − s̄.
    pub(super) fn unlikely_style(&self) -> Vec<f64> {
        let style = &self.values[self.style()];
        style.iter().zip(&self.likely_style).map(|(style, likely)| style - likely).collect()
    }

    /// Where p_0 lies in `values`.
    pub const REFERENCE: Range<usize> = 0..6;

    /// Where Δp_l lies in `values`, for 1 ≤ l < L.
    pub fn relative(l: usize) -> Range<usize> {
        6 * l..6 * l + 6
    }

    /// Where all the Δp_l lie in `values`.
    pub fn relatives(&self) -> Range<usize> {
        6..6 * self.n_frames
    }

    /// Where the log of the focal length's factor lies in `values`: nowhere, if it is no unknown.
    pub fn focal(&self) -> Range<usize> {
        6 * self.n_frames..6 * self.n_frames + usize::from(self.refines_focal)
    }

    /// Where the style lies in `values`.
    pub fn style(&self) -> Range<usize> {
        self.focal().end..self.values.len()
    }

    /// The camera, of which `given` is what is known beforehand.
    pub fn intrinsics(&self, given: &Intrinsics) -> Intrinsics {
        let factor = self.values[self.focal()].first().map_or(1.0, |log_focal| log_focal.exp());
        Intrinsics { focal: given.focal.map(|focal| focal * factor as f32), ..*given }
    }

    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// The unknowns on `device`, tracked when it differentiates, in its default precision.
    pub fn leaves(&self, device: &Device) -> Leaves {
        let leaf = |range: Range<usize>, columns: usize| {
            let data = TensorData::new(
                self.values[range.clone()].to_vec(),
                [range.len() / columns, columns],
            );
            let leaf = Tensor::<2>::from_data(data, device);
            if device.is_autodiff() { leaf.require_grad() } else { leaf }
        };
        Leaves {
            reference_twist: leaf(Self::REFERENCE, 6),
            relative_twists: leaf(self.relatives(), 6),
            log_focal: self.refines_focal.then(|| leaf(self.focal(), 1)),
            style: leaf(self.style(), self.style().len().max(1)),
        }
    }

    /// The unknowns after a small step: rotations step on the left, R ← exp(δω) R, the rest adds up.
    ///
    /// `step` is laid out as [p_0 | s | focal | Δp_1 | …], with the leading `n_directions` of the style.
    pub fn stepped(&self, step: &[f64], n_directions: usize) -> Self {
        let mut unknowns = self.clone();
        let turn_by = |twist: &mut [f64], step: &[f64]| {
            let rotation = |w: &[f64]| UnitQuaternion::from_scaled_axis(Vector3::from_row_slice(w));
            let turned = rotation(&step[..3]) * rotation(&twist[..3]);
            twist[..3].copy_from_slice(turned.scaled_axis().as_slice());
            (3..6).for_each(|i| twist[i] += step[i]);
        };
        turn_by(&mut unknowns.values[Self::REFERENCE], &step[..6]);
        for l in 1..self.n_frames {
            let start = 6 + n_directions + self.focal().len() + 6 * (l - 1);
            turn_by(&mut unknowns.values[Self::relative(l)], &step[start..start + 6]);
        }
        for (i, idx) in (6 + n_directions..).zip(self.focal()) {
            unknowns.values[idx] += step[i];
        }
        let style = self.style().start;
        (0..n_directions).for_each(|i| unknowns.values[style + i] += step[6 + i]);
        unknowns
    }

    /// p_0 and each p_l = p_0 ∘ Δp_l, in order, `[L, …]`.
    pub fn poses(&self, leaves: &Leaves) -> Pose {
        let device = leaves.reference_twist.device();
        let initial = Pose::from_isometries(&[self.initial_reference], &device);
        let reference = initial.turned_by(Pose::from_twist(leaves.reference_twist.clone()));
        if self.n_frames == 1 {
            return reference;
        }
        let relative_poses = Pose::from_twist(leaves.relative_twists.clone());
        let targets = match self.parameterisation {
            Parameterisation::ObjectCentred => reference.clone().turned_by(relative_poses),
            Parameterisation::CameraCentred => reference.clone().then(relative_poses),
        };
        reference.and(targets)
    }

    /// The same in double precision, to differentiate by.
    pub(super) fn host_poses(&self, device: &Device) -> Vec<Isometry3<f64>> {
        self.camera_from_world(device).iter().map(|pose| pose.cast()).collect()
    }

    /// The pose of every frame on the host.
    pub fn camera_from_world(&self, device: &Device) -> Vec<Isometry3<f32>> {
        self.poses(&self.leaves(&device.clone().inner())).to_isometries()
    }
}

/// The derivative with respect to each unknown, in the order of `values`.
pub(super) fn flatten(leaves: &Leaves, gradients: &burn::tensor::Gradients) -> Vec<f64> {
    let of = |leaf: &Tensor<2>| match leaf.grad(gradients) {
        Some(gradient) => {
            gradient.into_data().convert_dtype(DType::F64).try_into_vec().expect("f64")
        }
        None => vec![0.0; leaf.dims().iter().product()],
    };
    let log_focal = leaves.log_focal.as_ref().map(of).unwrap_or_default();
    [of(&leaves.reference_twist), of(&leaves.relative_twists), log_focal, of(&leaves.style)]
        .concat()
}
