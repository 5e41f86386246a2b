//! What a training run of the direct regression is.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{AugmentationConfig, DataConfig, RegressorStageConfig, Schedule, TrainingConfig};
use crate::{Error, Result, config::read_config, psgn::PsgnConfig};

/// A whole run. Of the same seed and data as a prior's, its crops and its held-out shapes are the prior's,
/// too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PsgnTrainingConfig {
    pub seed: u64,
    pub data: DataConfig,
    pub network: PsgnConfig,
    pub schedule: Schedule,
    /// How far, as a share of its extent, each side of the object's box is off in training.
    pub box_jitter: f32,
    /// What is done to the pictures of a step. Mirrored ones keep their cloud, as our regressors' keep
    /// their style: that asks for shapes that look the same in the mirror.
    pub augmentation: AugmentationConfig,
}

impl Default for PsgnTrainingConfig {
    fn default() -> Self {
        let RegressorStageConfig { schedule, box_jitter, augmentation, .. } =
            RegressorStageConfig::default();
        Self {
            seed: 0,
            data: DataConfig::default(),
            network: PsgnConfig::default(),
            schedule,
            box_jitter,
            augmentation,
        }
    }
}

impl PsgnTrainingConfig {
    /// Reads a preset, and refuses what could not be trained.
    pub fn read(path: &Path) -> Result<Self> {
        let config: Self = read_config(path)?;
        let invalid = |reason| Error::Config { path: path.into(), reason };
        config.network.check().map_err(invalid)?;
        config.crops().check().map_err(invalid)?;
        if config.data.points_per_model < config.network.n_points() {
            let n = config.network.n_points();
            return Err(invalid(format!("points_per_model must be at least {n}")));
        }
        Ok(config)
    }

    /// The run of regressors that would see the same crops in the same order.
    pub(super) fn crops(&self) -> TrainingConfig {
        let mut config = TrainingConfig { seed: self.seed, ..TrainingConfig::default() };
        config.data = self.data.clone();
        // Only the regressors' part is used; a prior that asks for as many points would be refused.
        config.prior.network.n_fc_points = 16;
        config.prior.network.grid_side = 4;
        config.prior.network.n_encoder_points = 16;
        config.regressors = RegressorStageConfig {
            network: self.network.trunk(),
            schedule: self.schedule.clone(),
            box_jitter: self.box_jitter,
            augmentation: self.augmentation.clone(),
            ..RegressorStageConfig::default()
        };
        config
    }
}
