//! What both stages share: a loop that can be interrupted, and its records.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use burn::{
    module::Module,
    optim::{AdamConfig, GradientsParams, ModuleOptimizer},
    tensor::Tensor,
};
use indicatif::{ProgressBar, ProgressStyle};

use super::{Schedule, metrics::MetricsFile, resume::Progress};
use crate::{Error, Result, host::host_values};

/// Squared world units are small numbers: losses and measurements are a thousand of them.
pub(super) const SCALE: f64 = 1e3;

/// Terms of a loss, by name, `[1]` each; training goes down their sum.
pub(super) type Terms = Vec<(&'static str, Tensor<1>)>;
/// Measurements, by name.
pub(super) type Measurements = Vec<(&'static str, f64)>;

/// One stage of a run, in its folder.
pub(super) struct Stage<'a> {
    pub name: &'static str,
    pub schedule: &'a Schedule,
    pub out: &'a Path,
}

impl Stage<'_> {
    /// Where the last run was interrupted, or the start, with `module`.
    pub fn resume<M: Module>(&self, module: M) -> Result<Progress<M>> {
        // Gradients of distances in world units are small; Burn's own epsilon would hide them.
        let optimizer = AdamConfig::new().with_epsilon(1e-8).init();
        let start = Progress { step: 0, elapsed: Duration::ZERO, module, optimizer };
        start.resume(&self.checkpoint_path())
    }

    /// Trains from there to the end.
    ///
    /// `loss` sees the module and the number of the step, on which alone its batch depends, so an
    /// interrupted run takes the same steps as an uninterrupted one.
    pub fn train<M: Module>(
        &self,
        mut progress: Progress<M>,
        mut loss: impl FnMut(&M, usize) -> Result<Terms>,
        validate: impl Fn(&M) -> Measurements,
    ) -> Result<M> {
        let mut metrics = MetricsFile::open(self.out, self.name, progress.step)?;
        let bar = self.progress_bar(progress.step);

        let mut clock = Instant::now();
        let Schedule { steps, log_every, validate_every, checkpoint_every, .. } = *self.schedule;
        while progress.step < steps {
            let rate = self.schedule.learning_rate(progress.step);
            let terms = loss(&progress.module, progress.step)?;
            let logged = progress.step.is_multiple_of(log_every).then(|| values(&terms));
            progress.module = descend(progress.module, &mut progress.optimizer, terms, rate);
            progress.elapsed += std::mem::replace(&mut clock, Instant::now()).elapsed();
            progress.step += 1;
            bar.inc(1);

            if let Some(mut values) = logged {
                self.check_finite(&values, progress.step)?;
                bar.set_message(summary(&values));
                values.push(("learning_rate", rate));
                metrics.append(progress.step, progress.elapsed, &values)?;
            }
            if progress.step == steps {
                break;
            }
            if progress.step.is_multiple_of(validate_every) {
                let values = validate(&progress.module);
                let line = format!("{} step {}: {}", self.name, progress.step, summary(&values));
                bar.suspend(|| eprintln!("{line}"));
                metrics.append(progress.step, progress.elapsed, &values)?;
            }
            if progress.step.is_multiple_of(checkpoint_every) {
                progress.save(&self.checkpoint_path())?;
            }
        }
        bar.finish_and_clear();
        Ok(progress.module)
    }

    /// Records what came out, once it is saved: there is nothing to resume any more.
    pub fn finish(&self, measurements: &Measurements) -> Result<()> {
        eprintln!("{}: {}", self.name, summary(measurements));
        let mut metrics = MetricsFile::open(self.out, self.name, usize::MAX)?;
        metrics.append_final(measurements)?;
        let path = self.checkpoint_path();
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::io(&path)(error)),
            _ => Ok(()),
        }
    }

    fn check_finite(&self, values: &Measurements, step: usize) -> Result<()> {
        match values.iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((name, value)) => {
                let reason = format!("training diverged: {name} is {value} at step {step}");
                Err(Error::Prior { path: self.out.into(), reason })
            }
        }
    }

    fn checkpoint_path(&self) -> PathBuf {
        self.out.join(format!("{}.checkpoint", self.name))
    }

    fn progress_bar(&self, step: usize) -> ProgressBar {
        let template = "{prefix} {wide_bar} {pos}/{len} {per_sec}, {eta} left  {msg}";
        let style = ProgressStyle::with_template(template).expect("a valid template");
        let bar = ProgressBar::new(self.schedule.steps as u64).with_style(style);
        bar.with_prefix(self.name).with_position(step as u64)
    }
}

fn descend<M: Module>(module: M, optimizer: &mut ModuleOptimizer, terms: Terms, rate: f64) -> M {
    let total = terms.into_iter().map(|(_, term)| term).reduce(|a, b| a + b);
    let gradients = total.expect("a loss has terms").backward();
    let gradients = GradientsParams::from_grads(gradients, &module);
    optimizer.step(rate, module, gradients)
}

fn values(terms: &Terms) -> Measurements {
    terms.iter().map(|(name, term)| (*name, f64::from(host_values(term)[0]))).collect()
}

fn summary(measurements: &Measurements) -> String {
    let parts: Vec<String> =
        measurements.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
    parts.join(", ")
}
