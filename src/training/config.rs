//! What a training run is: presets state what differs from these defaults.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::{DataConfig, augmentation::AugmentationConfig};
use crate::{
    Error, Result,
    regressor::{Looks, RegressorConfig},
    shape_prior::ShapePriorConfig,
};

/// A whole run: two runs of one config give the same weights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainingConfig {
    pub seed: u64,
    pub data: DataConfig,
    pub prior: PriorStageConfig,
    pub regressors: RegressorStageConfig,
}

/// The autoencoder and its training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PriorStageConfig {
    pub network: ShapePriorConfig,
    pub schedule: Schedule,
    /// Points of each cloud, and of its reconstruction, that look for their nearest neighbour.
    pub chamfer_queries: usize,
    /// Steps in which the encoder normalises by its batch; then by what it has gathered. The later
    /// that is, the more there is to learn anew.
    pub batch_statistics: usize,
}

impl Default for PriorStageConfig {
    fn default() -> Self {
        Self {
            network: ShapePriorConfig::default(),
            schedule: Schedule { steps: 4000, batch_size: 16, ..Schedule::default() },
            chamfer_queries: 1536,
            batch_statistics: 150,
        }
    }
}

/// The regressors and their training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegressorStageConfig {
    pub network: RegressorConfig,
    pub schedule: Schedule,
    /// How far, as a share of its extent, each side of the object's box is off in training.
    pub box_jitter: f32,
    /// Shapes of a step that are decoded as well, to compare them point by point.
    pub decoded_shapes: usize,
    /// What is done to the pictures of a step.
    pub augmentation: AugmentationConfig,
}

impl Default for RegressorStageConfig {
    fn default() -> Self {
        Self {
            network: RegressorConfig::default(),
            schedule: Schedule { steps: 8000, batch_size: 32, ..Schedule::default() },
            box_jitter: 0.05,
            decoded_shapes: 4,
            augmentation: AugmentationConfig::default(),
        }
    }
}

/// How a stage goes down its loss: Adam, with a warm-up and a cosine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Schedule {
    pub steps: usize,
    pub batch_size: usize,
    /// The highest learning rate, after `warm_up` steps; it ends at a hundredth of it.
    pub learning_rate: f64,
    pub warm_up: usize,
    /// Longest gradient of a tensor of weights; longer ones are shortened. Zero: none are.
    pub gradient_norm: f32,
    /// Measurements on held-out shapes without a new best after which a stage ends early. Zero: never.
    pub patience: usize,
    /// Steps between lines of metrics.jsonl, and between measurements on held-out shapes.
    pub log_every: usize,
    pub validate_every: usize,
    /// Steps between checkpoints: what an interruption can cost.
    pub checkpoint_every: usize,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            steps: 1000,
            batch_size: 16,
            learning_rate: 1e-3,
            warm_up: 100,
            gradient_norm: 0.0,
            patience: 0,
            log_every: 50,
            validate_every: 1000,
            checkpoint_every: 500,
        }
    }
}

impl Schedule {
    /// The learning rate of a step, counted from zero.
    pub fn learning_rate(&self, step: usize) -> f64 {
        let warm_up = (step + 1) as f64 / self.warm_up.max(1) as f64;
        let progress = step as f64 / self.steps.max(1) as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * progress).cos());
        self.learning_rate * warm_up.min(1.0) * (0.99 * cosine + 0.01)
    }
}

impl TrainingConfig {
    /// Reads a preset, and refuses what could not be trained.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text, path)
    }

    /// The config in a text, which errors say is at `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let invalid = |reason| Error::Config { path: path.into(), reason };
        let config: Self = toml::from_str(text).map_err(|error| invalid(error.to_string()))?;
        config.check().map_err(invalid)?;
        Ok(config)
    }

    /// How these regressors look at a picture: in the mirror, too, if mirrored shapes are shapes.
    pub fn looks(&self) -> Looks {
        if self.regressors.augmentation.mirror { Looks::WithMirror } else { Looks::One }
    }

    /// Why this cannot be trained, if it cannot.
    pub fn check(&self) -> Result<(), String> {
        self.prior.network.check()?;
        self.regressors.network.check()?;
        self.regressors.augmentation.check()?;
        let data = &self.data;
        data.selection()?;
        let positive = [
            ("n_models", data.n_models),
            ("n_validation", data.n_validation),
            ("views_per_model", data.views_per_model),
            ("paints_per_model", data.paints_per_model),
            ("views_per_round", data.views_per_round),
            ("views_per_validation", data.views_per_validation),
            ("chamfer_queries", self.prior.chamfer_queries),
            ("checkpoint_every", self.prior.schedule.checkpoint_every),
            ("checkpoint_every", self.regressors.schedule.checkpoint_every),
            ("log_every", self.prior.schedule.log_every),
            ("log_every", self.regressors.schedule.log_every),
            ("validate_every", self.prior.schedule.validate_every),
            ("validate_every", self.regressors.schedule.validate_every),
        ];
        if let Some((name, _)) = positive.iter().find(|(_, value)| *value == 0) {
            return Err(format!("{name} must be positive"));
        }
        // Batch normalisation needs a batch.
        if self.prior.schedule.batch_size.min(self.regressors.schedule.batch_size) < 2 {
            return Err("batch_size must be at least 2".into());
        }
        let n_points = self.prior.network.n_points();
        if data.points_per_model < n_points {
            return Err(format!("points_per_model must be at least {n_points}"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_learning_rate_rises_then_falls_to_a_hundredth() {
        let schedule = Schedule { steps: 1000, warm_up: 100, ..Schedule::default() };
        assert!(schedule.learning_rate(0) < 0.02 * schedule.learning_rate);
        assert!(schedule.learning_rate(100) > 0.95 * schedule.learning_rate);
        assert!(schedule.learning_rate(999) < 0.011 * schedule.learning_rate);
    }

    #[test]
    fn the_defaults_can_be_trained() {
        assert_eq!(TrainingConfig::default().check(), Ok(()));
    }

    #[test]
    fn a_batch_of_one_cannot_be_normalised() {
        let mut config = TrainingConfig::default();
        config.prior.schedule.batch_size = 1;
        assert!(config.check().is_err());
    }
}
