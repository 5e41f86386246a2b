//! The regressors: from one crop, the style and pose that optimisation starts from (Sec. 3.2).
//!
//! The paper trains two networks of its TL-embedding; ours share their convolutions, which are
//! nearly all of the cost, and differ in their heads.

mod mirror;
mod pose;
mod style;
mod trunk;

pub use pose::{PoseHead, PoseRegressor, PoseTarget};
pub use style::StyleRegressor;
pub use trunk::{Trunk, crop_values};

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    data::{ColorImage, ScalarImage, crop::CropCamera},
    host::host_values,
};

/// Radians within which two hypotheses mean one pose.
const SAME_POSE: f32 = 0.5;

/// The sizes of the regressors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegressorConfig {
    /// Side of the square crops that they see, in pixels.
    pub crop_size: usize,
    /// What these leave around the object on each side, as a share of the crop's side.
    pub crop_margin: f32,
    /// Channels after each halving of the crop.
    pub channels: Vec<usize>,
    /// Width of the feature that the heads share, and of the pose head's hidden layer.
    pub feature_width: usize,
    /// What the pose head predicts.
    pub head: PoseHead,
}

impl Default for RegressorConfig {
    fn default() -> Self {
        Self {
            crop_size: 64,
            crop_margin: 0.1,
            channels: vec![32, 48, 64, 96],
            feature_width: 256,
            head: PoseHead::Anchors,
        }
    }
}

impl RegressorConfig {
    /// Why no network has these sizes, if none has.
    pub fn check(&self) -> Result<(), String> {
        if self.channels.is_empty() || self.channels.contains(&0) || self.feature_width == 0 {
            return Err("the sizes of the regressors must be positive".into());
        }
        if !(0.0..0.5).contains(&self.crop_margin) {
            return Err(format!("crop_margin is {}, not within [0, 0.5)", self.crop_margin));
        }
        let coarsest = 1usize.checked_shl(self.channels.len() as u32).unwrap_or(0);
        if coarsest == 0 || self.crop_size < coarsest || !self.crop_size.is_multiple_of(coarsest) {
            let [size, n] = [self.crop_size, self.channels.len()];
            return Err(format!("a crop_size of {size} cannot be halved {n} times"));
        }
        Ok(())
    }

    pub fn init(&self, n_style: usize, device: &Device) -> Regressors {
        Regressors {
            trunk: Trunk::new(self, device),
            style: StyleRegressor::new(self.feature_width, n_style, device),
            pose: PoseRegressor::new(self.head, self.feature_width, device),
            crop_size: self.crop_size,
            crop_margin: self.crop_margin,
        }
    }
}

/// R_s and R_p on their common trunk.
#[derive(Module, Debug)]
pub struct Regressors {
    pub trunk: Trunk,
    pub style: StyleRegressor,
    pub pose: PoseRegressor,
    #[module(skip)]
    crop_size: usize,
    #[module(skip)]
    crop_margin: f32,
}

/// Where to start: what the regressors read off one picture.
#[derive(Clone, Debug)]
pub struct Guess {
    /// R_s(I), the style.
    pub style: Vec<f32>,
    /// R_p(I): `crop_from_world` and how sure of it we are, best first. Never empty; confidences
    /// add up to one.
    pub poses: Vec<(Isometry3<f32>, f32)>,
}

/// How a picture is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looks {
    One,
    /// And once more in the mirror, for symmetric shapes: both guesses are averaged.
    WithMirror,
}

impl Guess {
    /// The mean of this guess and one of the same picture in the mirror.
    fn and(self, in_mirror: Self) -> Self {
        let back: Vec<_> =
            in_mirror.poses.iter().map(|(pose, sure)| (mirror::mirrored(pose), *sure)).collect();
        let styles = self.style.iter().zip(&in_mirror.style);
        Self {
            style: styles.map(|(one, other)| 0.5 * (one + other)).collect(),
            poses: mirror::agreed(&self.poses, &back),
        }
    }
}

impl Regressors {
    /// Side of the square crops to give to [`regress`](Self::regress), in pixels.
    pub fn crop_size(&self) -> usize {
        self.crop_size
    }

    /// What to leave around the object on each side, as a share of the crop's side.
    pub fn crop_margin(&self) -> f32 {
        self.crop_margin
    }

    /// The style and the poses of the object in a crop, whose background may hold anything.
    pub fn regress(
        &self,
        color: &ColorImage,
        mask: &ScalarImage,
        camera: &CropCamera,
        looks: Looks,
    ) -> Guess {
        let shape = [1, self.crop_size, self.crop_size, 4];
        let crop = TensorData::new(crop_values(color, mask), shape);
        let focal_ratio = camera.intrinsics.focal[0] / self.crop_size as f32;
        let crop = Tensor::from_data(crop, &self.style.device());
        self.guesses(crop, &[focal_ratio], looks).remove(0)
    }

    /// The same of crops `[b, size, size, 4]`, see [`crop_values`], and their cameras' focal lengths in
    /// units of the crop's side.
    pub fn guesses(&self, crops: Tensor<4>, focal_ratios: &[f32], looks: Looks) -> Vec<Guess> {
        let guesses = self.look(crops.clone(), focal_ratios);
        match looks {
            Looks::One => guesses,
            Looks::WithMirror => {
                let in_mirror = self.look(crops.flip([2]), focal_ratios);
                guesses.into_iter().zip(in_mirror).map(|(one, other)| one.and(other)).collect()
            }
        }
    }

    fn look(&self, crops: Tensor<4>, focal_ratios: &[f32]) -> Vec<Guess> {
        let column = TensorData::new(focal_ratios.to_vec(), [focal_ratios.len(), 1]);
        let column = Tensor::from_data(column, &crops.device());
        let (styles, poses) = self.forward(crops, column);
        let ([_, n_style], [_, n_outputs]) = (styles.dims(), poses.dims());
        let (styles, poses) = (host_values(&styles), host_values(&poses));
        let rows = styles.chunks(n_style).zip(poses.chunks(n_outputs)).zip(focal_ratios);
        rows.map(|((style, outputs), &focal_ratio)| Guess {
            style: style.to_vec(),
            poses: self.pose.hypotheses(outputs, focal_ratio),
        })
        .collect()
    }

    /// Styles `[b, k]` and the pose head's outputs `[b, m]`, from crops `[b, size, size, 4]` and
    /// their cameras' focal lengths in units of the crop's side, `[b, 1]`.
    pub fn forward(&self, crops: Tensor<4>, focal_ratios: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        let features = self.trunk.forward(crops, focal_ratios);
        (self.style.forward(features.clone()), self.pose.forward(features))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::camera::Intrinsics;
    use burn::tensor::Distribution;

    pub fn tiny() -> RegressorConfig {
        RegressorConfig {
            crop_size: 32,
            channels: vec![8, 8, 16],
            feature_width: 16,
            ..Default::default()
        }
    }

    #[test]
    fn sizes_without_a_network_are_refused() {
        assert!(tiny().check().is_ok());
        assert!(RegressorConfig { crop_size: 36, ..tiny() }.check().is_err());
        assert!(RegressorConfig { channels: vec![8; 80], ..tiny() }.check().is_err());
        assert!(RegressorConfig { channels: vec![], ..tiny() }.check().is_err());
    }

    #[test]
    fn a_guess_has_a_style_and_poses_before_the_camera() {
        for head in [PoseHead::Anchors, PoseHead::Twist] {
            let config = RegressorConfig { head, ..tiny() };
            let regressors = config.init(5, &Device::flex());
            let source = Intrinsics { focal: [100.0; 2], center: [32.0; 2] };
            let camera = CropCamera::around([10.0, 20.0, 50.0, 40.0], &source, 32, 0.1);
            let (color, mask) = (ColorImage::new(32, 32), ScalarImage::new(32, 32));
            for looks in [Looks::One, Looks::WithMirror] {
                let guess = regressors.regress(&color, &mask, &camera, looks);
                assert_eq!(guess.style.len(), 5);
                assert!(guess.poses.iter().all(|(pose, _)| pose.translation.z > 0.0));
                assert!(guess.poses.windows(2).all(|pair| pair[0].1 >= pair[1].1));
                let total: f32 = guess.poses.iter().map(|(_, confidence)| confidence).sum();
                assert!((total - 1.0).abs() < 1e-5);
            }
        }
    }

    /// Of a picture and its mirror image, two looks make one guess, and its mirror image.
    #[test]
    fn two_looks_do_not_tell_left_from_right() {
        let device = Device::flex();
        let regressors = tiny().init(5, &device);
        let crops = Tensor::<4>::random([3, 32, 32, 4], Distribution::Uniform(0.0, 1.0), &device);
        let focal_ratios = [1.2, 2.0, 1.6];
        let guesses = regressors.guesses(crops.clone(), &focal_ratios, Looks::WithMirror);
        let in_mirror =
            regressors.guesses(crops.clone().flip([2]), &focal_ratios, Looks::WithMirror);
        let alone = regressors.guesses(crops, &focal_ratios, Looks::One);
        for ((guess, other), alone) in guesses.iter().zip(&in_mirror).zip(&alone) {
            assert_ne!(guess.style, alone.style);
            for (a, b) in guess.style.iter().zip(&other.style) {
                assert!((a - b).abs() < 1e-5, "{a} is not {b}");
            }
            let [pose, back] = [guess.poses[0].0, mirror::mirrored(&other.poses[0].0)];
            assert!(pose.rotation.angle_to(&back.rotation) < 1e-2, "{pose} is not {back}");
            assert!((pose.translation.vector - back.translation.vector).norm() < 1e-4);
        }
    }
}
