//! A baseline without a shape prior: a point set, straight from one picture (Table 1).
//!
//! This is the two-branch network of Fan, Su and Guibas, "A Point Set Generation Network for 3D Object
//! Reconstruction from a Single Image" (2017): a fully connected branch for what is particular and a
//! deconvolution branch for what is smooth, half of 1,536 points each. It sees what our regressors see,
//! through convolutions of their size, and answers in the canonical frame, so that its clouds compare with
//! theirs; Fan et al. answer in the camera's.

use std::path::Path;

use burn::{
    module::Module,
    nn::{Initializer, Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData, activation::relu},
};
use serde::{Deserialize, Serialize};

use crate::{
    Result,
    checkpoint::{CONFIG_FILE, PSGN_FILE, load_psgn},
    config::read_config,
    data::{ColorImage, ScalarImage, crop::CropCamera},
    host::host_points,
    layers::{Upsample, each_row, rectified_linear},
    regressor::{RegressorConfig, Trunk, crop_values},
    training::PsgnTrainingConfig,
};

/// Doublings of the deconvolution branch's grid.
const DOUBLINGS: usize = 3;
/// Half of the cube from which the fully connected branch's points start, in world units.
const SPREAD: f64 = 0.3;

/// The sizes of the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PsgnConfig {
    /// The crops and the convolutions, as of [`RegressorConfig`].
    pub crop_size: usize,
    pub crop_margin: f32,
    pub channels: Vec<usize>,
    pub feature_width: usize,
    /// Points of the fully connected branch, and the width of its hidden layer.
    pub n_fc_points: usize,
    pub fc_width: usize,
    /// Rows and columns of the deconvolution branch's grid of points, multiples of 8.
    pub grid: [usize; 2],
    /// Channels of the coarsest grid, an eighth as wide; every doubling halves them.
    pub grid_channels: usize,
}

impl Default for PsgnConfig {
    fn default() -> Self {
        let RegressorConfig { crop_size, crop_margin, channels, feature_width, .. } =
            RegressorConfig::default();
        Self {
            crop_size,
            crop_margin,
            channels,
            feature_width,
            n_fc_points: 768,
            fc_width: 512,
            grid: [32, 24],
            grid_channels: 128,
        }
    }
}

impl PsgnConfig {
    pub fn n_points(&self) -> usize {
        self.n_fc_points + self.grid[0] * self.grid[1]
    }

    /// The crops that it sees, as our regressors'.
    pub(crate) fn trunk(&self) -> RegressorConfig {
        RegressorConfig {
            crop_size: self.crop_size,
            crop_margin: self.crop_margin,
            channels: self.channels.clone(),
            feature_width: self.feature_width,
            ..RegressorConfig::default()
        }
    }

    /// Why no network has these sizes, if none has.
    pub fn check(&self) -> Result<(), String> {
        self.trunk().check()?;
        if self.n_fc_points == 0 || self.fc_width == 0 {
            return Err("the sizes of the fully connected branch must be positive".into());
        }
        let coarsest = 1 << DOUBLINGS;
        if self.grid.iter().any(|&side| side == 0 || !side.is_multiple_of(coarsest)) {
            return Err(format!("grid is {:?}, not of multiples of {coarsest}", self.grid));
        }
        match self.grid_channels >> DOUBLINGS {
            0 => Err(format!("grid_channels is {}, less than {coarsest}", self.grid_channels)),
            _ => Ok(()),
        }
    }

    pub fn init(&self, device: &Device) -> Psgn {
        let coarsest = self.grid.map(|side| side >> DOUBLINGS);
        let channels: Vec<_> = (0..=DOUBLINGS).map(|i| self.grid_channels >> i).collect();
        let n_coarsest = coarsest[0] * coarsest[1] * channels[0];
        let mut fc_output = LinearConfig::new(self.fc_width, 3 * self.n_fc_points).init(device);
        // Points that all start in one place take long to part.
        let spread = Initializer::Uniform { min: -SPREAD, max: SPREAD };
        fc_output.bias = Some(spread.init([3 * self.n_fc_points], device));
        Psgn {
            trunk: Trunk::new(&self.trunk(), device),
            fc: rectified_linear(self.feature_width, self.fc_width, device),
            fc_output,
            grid: rectified_linear(self.feature_width, n_coarsest, device),
            upsamples: channels.windows(2).map(|c| Upsample::new([c[0], c[1]], device)).collect(),
            grid_output: LinearConfig::new(channels[DOUBLINGS], 3).init(device),
            coarsest,
            crop_size: self.crop_size,
            crop_margin: self.crop_margin,
        }
    }
}

/// From one crop to a cloud in the canonical frame.
#[derive(Module, Debug)]
pub struct Psgn {
    trunk: Trunk,
    fc: Linear,
    fc_output: Linear,
    grid: Linear,
    upsamples: Vec<Upsample>,
    grid_output: Linear,
    /// Rows and columns of the coarsest grid.
    #[module(skip)]
    coarsest: [usize; 2],
    #[module(skip)]
    crop_size: usize,
    #[module(skip)]
    crop_margin: f32,
}

impl Psgn {
    /// Reads the folder that `pba-train psgn` has written; weights are kept off the graph.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        let config: PsgnTrainingConfig = read_config(&folder.join(CONFIG_FILE))?;
        load_psgn(&config.network, &folder.join(PSGN_FILE), &device.clone().inner())
    }

    /// Side of the square crops to give to [`predict`](Self::predict), in pixels.
    pub fn crop_size(&self) -> usize {
        self.crop_size
    }

    /// What to leave around the object on each side, as a share of the crop's side.
    pub fn crop_margin(&self) -> f32 {
        self.crop_margin
    }

    /// The cloud of the object in a crop, in the canonical frame (diagonal 1); what is outside the mask
    /// may be anything.
    pub fn predict(
        &self,
        color: &ColorImage,
        mask: &ScalarImage,
        camera: &CropCamera,
    ) -> Vec<[f32; 3]> {
        let device = self.fc_output.weight.device();
        let shape = [1, self.crop_size, self.crop_size, 4];
        let crop = Tensor::from_data(TensorData::new(crop_values(color, mask), shape), &device);
        let focal_ratio = camera.intrinsics.focal[0] / self.crop_size as f32;
        host_points(&self.forward(crop, Tensor::from_floats([[focal_ratio]], &device)))
    }

    /// Clouds `[b, n, 3]` of crops `[b, size, size, 4]` and their cameras' focal lengths in units of the
    /// crop's side, `[b, 1]`: first the points of the fully connected branch, then the grid's.
    pub fn forward(&self, crops: Tensor<4>, focal_ratios: Tensor<2>) -> Tensor<3> {
        let features = self.trunk.forward(crops, focal_ratios);
        Tensor::cat(vec![self.fc_branch(features.clone()), self.grid_branch(features)], 1)
    }

    fn fc_branch(&self, features: Tensor<2>) -> Tensor<3> {
        let [b, _] = features.dims();
        let hidden = relu(self.fc.forward(features));
        self.fc_output.forward(hidden).reshape([b as i32, -1, 3])
    }

    fn grid_branch(&self, features: Tensor<2>) -> Tensor<3> {
        let [b, _] = features.dims();
        let [rows, columns] = self.coarsest;
        let coarsest = relu(self.grid.forward(features));
        let grid = coarsest.reshape([b as i32, rows as i32, columns as i32, -1]);
        let grid = self.upsamples.iter().fold(grid, |grid, layer| relu(layer.forward(grid)));
        each_row(&self.grid_output, grid).reshape([b as i32, -1, 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::host_values;
    use burn::tensor::Distribution;

    fn tiny() -> PsgnConfig {
        PsgnConfig {
            crop_size: 32,
            channels: vec![8, 8, 16],
            feature_width: 16,
            n_fc_points: 20,
            fc_width: 16,
            grid: [16, 8],
            grid_channels: 16,
            ..Default::default()
        }
    }

    #[test]
    fn the_default_has_the_papers_points() {
        let PsgnConfig { n_fc_points, grid, .. } = PsgnConfig::default();
        assert_eq!((n_fc_points, grid[0] * grid[1]), (768, 768));
        assert_eq!(PsgnConfig::default().n_points(), 1536);
        assert_eq!(PsgnConfig::default().check(), Ok(()));
    }

    #[test]
    fn sizes_without_a_network_are_refused() {
        for grid in [[0, 8], [12, 8], [16, 4]] {
            assert!(PsgnConfig { grid, ..tiny() }.check().is_err());
        }
        assert!(PsgnConfig { grid_channels: 4, ..tiny() }.check().is_err());
        assert!(PsgnConfig { n_fc_points: 0, ..tiny() }.check().is_err());
        assert!(PsgnConfig { crop_size: 36, ..tiny() }.check().is_err());
    }

    #[test]
    fn every_crop_gets_a_cloud_of_its_own() {
        let device = Device::flex();
        device.seed(3);
        let psgn = tiny().init(&device);
        let crops = Tensor::random([2, 32, 32, 4], Distribution::Uniform(0.0, 1.0), &device);
        let focal_ratios = Tensor::from_floats([[1.0], [2.0]], &device);
        let clouds = psgn.forward(crops.clone(), focal_ratios.clone());
        assert_eq!(clouds.dims(), [2, tiny().n_points(), 3]);
        let [one, other] = [0, 1].map(|i| host_values(&clouds.clone().slice(i..i + 1)));
        assert_ne!(one, other);
        // Beside others, it is the same as alone.
        let alone = psgn.forward(crops.slice(1..2), focal_ratios.slice(1..2));
        let alone = host_values(&alone);
        assert!(other.iter().zip(&alone).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
