//! The direct regression from pictures to clouds: the same crops as the regressors', other targets.

use std::{fs, path::Path, thread};

use burn::{
    module::Module,
    tensor::{Device, Tensor},
};
use rayon::prelude::*;

use super::{
    PsgnTrainingConfig, TrainingConfig,
    batches::{cloud_tensor, row_tensor},
    crops::Crop,
    held_out,
    prefetch::Batches,
    rounds::Rounds,
    seeded,
    shapes::{Shapes, Surface},
    stage::{Measurements, SCALE, Stage, Terms},
};
use crate::{
    Error, Result,
    chamfer::chamfer_distance,
    checkpoint::{CONFIG_FILE, PSGN_FILE, load_psgn, save_weights},
    config::{read_config, write_config},
    data::keyed_rng,
    host::host_values,
    psgn::Psgn,
};

const NAME: &str = "psgn";
/// The random stream of this stage's batches: the first half of its key.
const BATCH: u64 = 41 << 32;
/// Points of each training surface that targets are drawn from, in clouds.
const CLOUDS_PER_SURFACE: usize = 2;
/// Crops that are measured at a time.
const CHUNK: usize = 64;

/// Trains the direct regression into the folder `out`; `device` is without autodiff.
pub fn train_psgn(config: &PsgnTrainingConfig, out: &Path, device: &Device) -> Result<()> {
    begin(config, out)?;
    let path = out.join(PSGN_FILE);
    if path.exists() {
        eprintln!("{NAME}: finished, in {}", path.display());
        return Ok(());
    }
    let crops = config.crops();
    let shapes = Shapes::open(&config.data, config.seed)?;
    let stage = PsgnStage::prepare(config, &crops, &shapes, out, device)?;
    save_weights(&stage.train()?, &path)?;
    // What is measured is what was saved.
    let saved = load_psgn(&config.network, &path, device)?;
    stage.stage.finish(&stage.held_out.measure(&saved, device))
}

/// Makes the folder, and writes the effective config into it; another run's folder is refused.
fn begin(config: &PsgnTrainingConfig, out: &Path) -> Result<()> {
    fs::create_dir_all(out).map_err(Error::io(out))?;
    let path = out.join(CONFIG_FILE);
    let begun = [PSGN_FILE, "psgn.checkpoint"].iter().any(|file| out.join(file).exists());
    let without_stores = |config: &PsgnTrainingConfig| PsgnTrainingConfig {
        data: config.data.without_stores(),
        ..config.clone()
    };
    if path.exists() {
        let refused = match read_config(&path) {
            Ok(other) => begun && without_stores(&other) != without_stores(config),
            // It is of a run of another kind.
            Err(_) => true,
        };
        if refused {
            let reason = "this folder holds a run of another config; choose another".into();
            return Err(Error::Config { path, reason });
        }
    }
    write_config(&path, config)
}

struct PsgnStage<'a> {
    config: &'a PsgnTrainingConfig,
    crops: &'a TrainingConfig,
    stage: Stage<'a>,
    device: &'a Device,
    rounds: Rounds<'a>,
    /// Of the training shapes.
    surfaces: Vec<Surface>,
    held_out: HeldOutClouds,
}

impl<'a> PsgnStage<'a> {
    fn prepare(
        config: &'a PsgnTrainingConfig,
        crops: &'a TrainingConfig,
        shapes: &'a Shapes,
        out: &'a Path,
        device: &'a Device,
    ) -> Result<Self> {
        let n = config.network.n_points();
        let n_kept = (CLOUDS_PER_SURFACE * n).min(config.data.points_per_model);
        Ok(Self {
            rounds: Rounds::open(crops, shapes)?,
            surfaces: shapes.surfaces(&shapes.training(), n_kept)?,
            held_out: HeldOutClouds::prepare(crops, shapes, n, 0)?,
            stage: Stage { name: NAME, schedule: &config.schedule, out },
            config,
            crops,
            device,
        })
    }

    fn train(&self) -> Result<Psgn> {
        let autodiff = self.device.clone().autodiff();
        let init = || self.config.network.init(&autodiff);
        let progress = self.stage.resume(seeded(self.device, self.config.seed + 1, init))?;
        thread::scope(|scope| {
            let steps = progress.step..self.config.schedule.steps;
            let mut batches = Batches::start(&self.rounds, steps, scope)?;
            let loss =
                |psgn: &Psgn, step| Ok(self.loss(psgn, step, &batches.batch(step)?, &autodiff));
            self.stage
                .train(progress, loss, |psgn| self.held_out.measure(&psgn.valid(), self.device))
        })
    }

    fn loss(&self, psgn: &Psgn, step: usize, crops: &[&Crop], device: &Device) -> Terms {
        let n = self.config.network.n_points();
        let shown = crops.par_iter().enumerate().map(|(i, crop)| {
            let mut rng = keyed_rng(self.config.seed, [BATCH + i as u64, step as u64]);
            let (values, truth) = crop.augmented(self.crops, &mut rng);
            let target = self.surfaces[truth.shape_idx].draw(n, &mut rng);
            ((values, truth.focal_ratio), target)
        });
        let (shown, targets): (Vec<_>, Vec<_>) = shown.unzip();
        let clouds = predict(psgn, shown, device);
        let distance = chamfer_distance(clouds, cloud_tensor(&targets, device)).mean();
        vec![("chamfer", distance * SCALE)]
    }
}

/// Pictures of shapes that training does not see, and the clouds of these.
pub(super) struct HeldOutClouds {
    pub crops: Vec<Crop>,
    /// One a shape, as large as the network's.
    pub truth: Vec<Vec<[f32; 3]>>,
    /// Other points of the same surfaces.
    pub others: Vec<Vec<[f32; 3]>>,
}

impl HeldOutClouds {
    /// With clouds of `n` points, and `n_others` besides.
    pub fn prepare(
        crops: &TrainingConfig,
        shapes: &Shapes,
        n: usize,
        n_others: usize,
    ) -> Result<Self> {
        let models = shapes.held_out();
        let surfaces = shapes.surfaces(&models, n + n_others)?;
        let halves = surfaces.into_iter().map(|Surface(mut truth)| {
            let others = truth.split_off(n);
            (truth, others)
        });
        let (truth, others) = halves.unzip();
        Ok(Self { crops: held_out::render(crops, shapes, &models)?, truth, others })
    }

    /// The mean of Eq. 7 over all pictures, in thousandths of squared world units.
    fn measure(&self, psgn: &Psgn, device: &Device) -> Measurements {
        let distances = self.distances(psgn, device);
        vec![("held_out_chamfer", distances.iter().sum::<f64>() / distances.len() as f64)]
    }

    /// Eq. 7 of each picture's cloud, in the same unit.
    pub fn distances(&self, psgn: &Psgn, device: &Device) -> Vec<f64> {
        let of_chunk = |crops: &[Crop]| -> Vec<f64> {
            let shown = crops.iter().map(|crop| (crop.values(), crop.focal_ratio)).collect();
            let truth: Vec<_> =
                crops.iter().map(|crop| self.truth[crop.shape_idx].clone()).collect();
            let clouds = predict(psgn, shown, device);
            let distances = chamfer_distance(clouds, cloud_tensor(&truth, device));
            host_values(&distances).into_iter().map(|d| SCALE * f64::from(d)).collect()
        };
        self.crops.chunks(CHUNK).flat_map(of_chunk).collect()
    }
}

/// The clouds of crops' values and focal ratios, `[b, n, 3]`.
fn predict(psgn: &Psgn, shown: Vec<(Vec<f32>, f32)>, device: &Device) -> Tensor<3> {
    let (values, focal_ratios): (Vec<_>, Vec<_>) =
        shown.into_iter().map(|(values, focal_ratio)| (values, vec![focal_ratio])).unzip();
    let size = psgn.crop_size();
    let crops = row_tensor(&values, device).reshape([values.len(), size, size, 4]);
    psgn.forward(crops, row_tensor(&focal_ratios, device))
}
