//! What both stages share: a loop that can be interrupted, and its records.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use burn::{
    grad_clipping::GradientClippingConfig,
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
pub type Measurements = Vec<(&'static str, f64)>;

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
        let longest = self.schedule.gradient_norm;
        let clipping = (longest > 0.0).then_some(GradientClippingConfig::Norm(longest));
        let optimizer = AdamConfig::new().with_epsilon(1e-8).with_grad_clipping(clipping).init();
        let start = Progress { step: 0, elapsed: Duration::ZERO, module, optimizer, best: None };
        start.resume(&self.checkpoint_path())
    }

    /// Trains from there to the end, or until patience does, and returns what did best on held-out
    /// shapes: what has the least of the first measurement of `validate`.
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
            if progress.step.is_multiple_of(validate_every) || progress.step == steps {
                let values = validate(&progress.module);
                let line = format!("{} step {}: {}", self.name, progress.step, summary(&values));
                bar.suspend(|| eprintln!("{line}"));
                metrics.append(progress.step, progress.elapsed, &values)?;
                if !progress.keep_if_best(values[0].1, &self.checkpoint_path())?
                    && self.is_out_of_patience(&progress)
                {
                    break;
                }
            }
            if progress.step.is_multiple_of(checkpoint_every) {
                progress.save(&self.checkpoint_path())?;
            }
        }
        bar.finish_and_clear();
        self.report_best(&progress);
        progress.into_best(&self.checkpoint_path())
    }

    fn is_out_of_patience<M>(&self, progress: &Progress<M>) -> bool {
        let Schedule { patience, validate_every, .. } = *self.schedule;
        let best_step = progress.best.as_ref().map_or(progress.step, |best| best.step);
        patience > 0 && progress.step - best_step >= patience * validate_every
    }

    fn report_best<M>(&self, progress: &Progress<M>) {
        if let Some(best) = progress.best.as_ref().filter(|best| best.step < progress.step) {
            let step = progress.step;
            eprintln!(
                "{}: the weights of step {} did better than step {step}'s",
                self.name, best.step
            );
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use burn::{
        nn::{Linear, LinearConfig},
        tensor::Device,
    };
    use std::cell::RefCell;

    /// Trains a layer, whose squared weights are the loss, on a scale of each step's own. Its weights at
    /// each measurement, which says what `scores` do, and at the end.
    fn train(schedule: Schedule, scales: &[f64], scores: &[f64]) -> (Vec<Vec<f32>>, Vec<f32>) {
        let folder = tempfile::tempdir().unwrap();
        let stage = Stage { name: "test", schedule: &schedule, out: folder.path() };
        let device = Device::flex().autodiff();
        device.seed(0);
        let weights = |layer: &Linear| host_values(&layer.weight.val());
        let measured = RefCell::new(Vec::new());
        let loss = |layer: &Linear, step: usize| {
            let squared = layer.weight.val().square().sum();
            Ok(vec![("loss", squared * scales[step % scales.len()])])
        };
        let measure = |layer: &Linear| {
            measured.borrow_mut().push(weights(layer));
            vec![("score", scores[measured.borrow().len() - 1])]
        };
        let layer = LinearConfig::new(3, 2).with_bias(false).init(&device);
        let trained = stage.train(stage.resume(layer).unwrap(), loss, measure).unwrap();
        (measured.into_inner(), weights(&trained))
    }

    fn schedule(steps: usize) -> Schedule {
        Schedule { steps, warm_up: 1, validate_every: 1, ..Schedule::default() }
    }

    #[test]
    fn what_does_best_on_held_out_shapes_is_kept() {
        let (measured, trained) = train(schedule(4), &[1.0], &[3.0, 1.0, 2.0, 1.5]);
        assert_eq!(trained, measured[1]);
        assert_ne!(trained, measured[3]);
    }

    #[test]
    fn patience_ends_a_stage_that_no_longer_improves() {
        let scores = [3.0, 1.0, 2.0, 2.0, 2.0, 2.0];
        let (measured, trained) = train(Schedule { patience: 2, ..schedule(6) }, &[1.0], &scores);
        assert_eq!((measured.len(), trained), (4, measured[1].clone()));
    }

    #[test]
    fn clipped_gradients_are_as_long_whatever_the_loss() {
        let clipped = Schedule { gradient_norm: 0.01, ..schedule(3) };
        let trained = |schedule: &Schedule, scales: &[f64]| {
            train(schedule.clone(), scales, &[3.0, 2.0, 1.0]).1
        };
        let distance = |schedule: &Schedule| {
            let [even, uneven] = [[1.0; 3], [1.0, 1000.0, 1.0]].map(|s| trained(schedule, &s));
            even.iter().zip(uneven).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(distance(&clipped) < 1e-6 && distance(&schedule(3)) > 1e-5);
    }
}
