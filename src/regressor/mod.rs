//! The regressors: from one crop, the style and pose that optimisation starts from (Sec. 3.2).
//!
//! The paper trains two networks of its TL-embedding; ours share their convolutions, which are
//! nearly all of the cost, and differ in their heads.

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
    pub fn regress(&self, color: &ColorImage, mask: &ScalarImage, camera: &CropCamera) -> Guess {
        let device = self.style.device();
        let shape = [1, self.crop_size, self.crop_size, 4];
        let crop = Tensor::from_data(TensorData::new(crop_values(color, mask), shape), &device);
        let focal_ratio = camera.intrinsics.focal[0] / self.crop_size as f32;
        let (style, pose) = self.forward(crop, Tensor::from_floats([[focal_ratio]], &device));
        Guess {
            style: host_values(&style),
            poses: self.pose.hypotheses(&host_values(&pose), focal_ratio),
        }
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
            let guess =
                regressors.regress(&ColorImage::new(32, 32), &ScalarImage::new(32, 32), &camera);

            assert_eq!(guess.style.len(), 5);
            assert!(guess.poses.iter().all(|(pose, _)| pose.translation.z > 0.0));
            assert!(guess.poses.windows(2).all(|pair| pair[0].1 >= pair[1].1));
            let total: f32 = guess.poses.iter().map(|(_, confidence)| confidence).sum();
            assert!((total - 1.0).abs() < 1e-5);
        }
    }
}
