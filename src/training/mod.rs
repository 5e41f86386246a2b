//! Training: the autoencoder, then the regressors to its styles and to poses (Sec. 3.2).
//!
//! A run is a folder. Its config says everything that its weights depend on; a run that was
//! interrupted goes on where its last checkpoint was, and a finished stage is left alone.

mod augmentation;
mod batches;
mod config;
mod data_config;
mod crops;
mod crop_source;
mod crop_sample;
mod rounds;
mod prefetch;
mod held_out;
mod metrics;
mod pose_errors;
mod prior_report;
mod psgn_config;
mod psgn_report;
mod psgn_stage;
mod regressor_stage;
mod resume;
mod sampled_chamfer;
mod shape_stage;
mod shapes;
mod shards;
mod stage;
mod styles;

pub use augmentation::AugmentationConfig;
pub use config::{PriorStageConfig, RegressorStageConfig, Schedule, TrainingConfig};
pub use data_config::DataConfig;
pub use prior_report::{
    Reconstruction, ReconstructionErrors, ReportedShapes, TrainingShapes, report_prior,
};
pub use psgn_config::PsgnTrainingConfig;
pub use psgn_report::{ComparedClouds, compare_clouds};
pub use psgn_stage::train_psgn;
pub use shards::write_shard;
pub use stage::Measurements;

use std::{fs, path::Path, sync::Mutex};

use burn::{
    module::{Module, ModuleVisitor, Param},
    tensor::{Device, Tensor},
};

use crate::{
    Error, Result,
    checkpoint::{CONFIG_FILE, REGRESSORS_FILE, SHAPE_FILE, load_shape, save_weights},
    config::write_config,
    regressor::Regressors,
    shape_prior::ShapePrior,
};
use shapes::Shapes;

/// Trains the shape prior (Sec. 2.2) into the folder `out`; `device` is without autodiff.
pub fn train_shape_prior(config: &TrainingConfig, out: &Path, device: &Device) -> Result<()> {
    begin(config, out)?;
    let path = out.join(SHAPE_FILE);
    if path.exists() {
        eprintln!("prior: finished, in {}", path.display());
        return Ok(());
    }
    let shapes = Shapes::open(&config.data, config.seed)?;
    let stage = shape_stage::ShapeStage::prepare(config, &shapes, out, device)?;
    save_weights(&stage.train()?, &path)?;
    // What is measured is what was saved.
    stage.finish(&load_shape(config, &path, device)?)
}

/// Trains the regressors (Sec. 3.2) into the folder `out`, which holds a shape prior.
pub fn train_regressors(config: &TrainingConfig, out: &Path, device: &Device) -> Result<()> {
    begin(config, out)?;
    let path = out.join(REGRESSORS_FILE);
    if path.exists() {
        eprintln!("regressors: finished, in {}", path.display());
        return Ok(());
    }
    let prior = load_shape(config, &out.join(SHAPE_FILE), device)?;
    let shapes = Shapes::open(&config.data, config.seed)?;
    let stage = regressor_stage::RegressorStage::prepare(config, &shapes, &prior, out, device)?;
    save_weights(&stage.train()?, &path)?;
    stage.finish(&path)
}

/// What regressors make of pictures of shapes that training held out: errors by name, in degrees, and in
/// 1e-3 squared world units.
pub fn report_regressors(
    config: &TrainingConfig,
    prior: &ShapePrior,
    regressors: &Regressors,
    device: &Device,
) -> Result<Measurements> {
    let shapes = Shapes::open(&config.data, config.seed)?;
    let held_out = held_out::HeldOut::prepare(config, &shapes, prior, device)?;
    let mut measurements = held_out.measure(regressors);
    measurements.extend(held_out.measure_clouds(regressors));
    Ok(measurements)
}

/// Makes the folder, and writes the effective config into it; another run's folder is refused.
fn begin(config: &TrainingConfig, out: &Path) -> Result<()> {
    fs::create_dir_all(out).map_err(Error::io(out))?;
    let path = out.join(CONFIG_FILE);
    let holds = |file: &str| out.join(file).exists();
    if holds(CONFIG_FILE) {
        let other = TrainingConfig::read(&path)?;
        let same_shapes = (config.seed, config.data.without_stores(), &config.prior)
            == (other.seed, other.data.without_stores(), &other.prior);
        let same_regressors = config.regressors == other.regressors;
        let shape_begun = holds(SHAPE_FILE) || holds("prior.checkpoint");
        let regressors_begun = holds(REGRESSORS_FILE) || holds("regressors.checkpoint");
        if (shape_begun && !same_shapes) || (regressors_begun && !same_regressors) {
            let reason = "this folder holds a run of another config; choose another".into();
            return Err(Error::Config { path, reason });
        }
    }
    write_config(&path, config)
}

/// A module of which every parameter has been drawn, from `seed` alone.
fn seeded<M: Module>(device: &Device, seed: u64, init: impl FnOnce() -> M) -> M {
    // The device has one random stream: two runs in one process would share it.
    static STREAM: Mutex<()> = Mutex::new(());
    let _alone = STREAM.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    device.seed(seed);
    let module = init();
    module.visit(&mut Draw);
    module
}

/// Parameters are drawn when they are first looked at.
struct Draw;

impl ModuleVisitor for Draw {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        param.val();
    }
}
