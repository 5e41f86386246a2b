//! Direct point set regression: trained, then held beside the regressed style of a prior.

use std::{fs, path::PathBuf};

use clap::Args;
use object_pba::{
    Error, Result,
    checkpoint::Prior,
    device::Backend,
    training::{ComparedClouds, PsgnTrainingConfig, compare_clouds, train_psgn},
};

/// Interrupt training whenever you like: the same command goes on from its last checkpoint.
#[derive(Args)]
pub struct PsgnArguments {
    /// What to train: a preset such as configs/psgn.toml.
    #[arg(long)]
    config: PathBuf,
    /// Folder for the weights, the effective config and the table.
    #[arg(long)]
    out: PathBuf,
    /// Folder of the prior to compare with, trained on the same shapes.
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Replaces the config's folder of meshes.
    #[arg(long)]
    meshes: Option<PathBuf>,
    #[arg(long, default_value_t)]
    device: Backend,
}

pub fn psgn(arguments: &PsgnArguments) -> Result<()> {
    let PsgnArguments { config, out, prior, meshes, device } = arguments;
    let mut config = PsgnTrainingConfig::read(config)?;
    config.data.meshes = meshes.clone().or(config.data.meshes);
    let device = device.device();
    train_psgn(&config, out, &device)?;
    let Some(prior) = prior else { return Ok(()) };
    let prior = Prior::load(prior, &device)?;
    let table = table(&config, &prior, &compare_clouds(&config, out, &prior, &device)?);
    let path = out.join("psgn.md");
    fs::write(&path, &table).map_err(Error::io(&path))?;
    print!("{table}");
    Ok(())
}

fn table(config: &PsgnTrainingConfig, prior: &Prior, rows: &[ComparedClouds]) -> String {
    let schedule = |steps: usize, batch_size: usize| format!("{steps} steps of {batch_size} crops");
    let own = schedule(config.schedule.steps, config.schedule.batch_size);
    let theirs = &prior.config.regressors.schedule;
    let theirs = schedule(theirs.steps, theirs.batch_size);
    let mut text = format!(
        "Eq. 7 (1e-3 diagonals²) of clouds of {} points in the canonical frame, to as many true ones: {} \
        pictures of {} shapes that no network saw. The direct regression was trained for {own}; the \
        regressors, on the same crops, for {theirs}, and their generator for {} points, of which these are \
        some.\n\n| | mean | median |\n| --- | --- | --- |\n",
        config.network.n_points(),
        rows[0].distances.len(),
        config.data.n_validation,
        prior.shape.generator.n_points(),
    );
    for ComparedClouds { what, distances } in rows {
        let mut sorted = distances.clone();
        sorted.sort_by(f64::total_cmp);
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        let half = sorted.len() / 2;
        let median = (sorted[(sorted.len() - 1) / 2] + sorted[half]) / 2.0;
        text += &format!("| {what} | {mean:.3} | {median:.3} |\n");
    }
    text
}
