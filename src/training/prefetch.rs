//! Crops for one step after another, of which a thread makes the next round while one is shown.

use std::{
    mem,
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::Scope,
};

use indicatif::ProgressBar;
use rayon::ThreadPoolBuilder;

use super::{crops::Crop, rounds::Rounds};
use crate::Result;

/// Batches of crops. At most two rounds are in memory, this one and the next.
pub(super) struct Batches {
    batch_size: usize,
    steps_per_round: usize,
    round: usize,
    crops: Vec<Crop>,
    next: Receiver<Result<Vec<Crop>>>,
    stopped: Arc<AtomicBool>,
}

impl Batches {
    /// Waits for the first round of these steps. The thread in `scope` ends with the steps, with an
    /// error, or when the batches are dropped.
    pub fn start<'scope>(
        rounds: &'scope Rounds,
        steps: Range<usize>,
        scope: &'scope Scope<'scope, '_>,
    ) -> Result<Self> {
        let steps_per_round = rounds.steps_per_round();
        let range = steps.start / steps_per_round..steps.end.div_ceil(steps_per_round);
        // Without a buffer, a round waits here until it is taken.
        let (sender, next) = sync_channel(0);
        let stopped = Arc::new(AtomicBool::new(false));
        let mut batches = Self {
            batch_size: rounds.batch_size,
            steps_per_round,
            round: range.start,
            crops: Vec::new(),
            next,
            stopped: stopped.clone(),
        };
        if !steps.is_empty() {
            // In the threads that compute a step, that step would wait for a whole round.
            let threads = ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
            let pool = threads.build().expect("threads start");
            scope.spawn(move || pool.install(|| make(rounds, range, &sender, &stopped)));
            batches.crops = batches.receive()?;
        }
        Ok(batches)
    }

    /// The crops of a step; steps are taken in order.
    pub fn batch(&mut self, step: usize) -> Result<Vec<&Crop>> {
        let (round, idx) = (step / self.steps_per_round, step % self.steps_per_round);
        if self.round < round {
            // Taking a round lets the thread begin another, and there is room for two.
            self.crops = Vec::new();
            self.crops = self.receive()?;
            self.round = round;
        }
        let crops = (0..self.batch_size).map(|i| idx * self.batch_size + i);
        Ok(crops.map(|i| &self.crops[i % self.crops.len()]).collect())
    }

    fn receive(&self) -> Result<Vec<Crop>> {
        self.next.recv().expect("every round is made, or fails")
    }
}

impl Drop for Batches {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
    }
}

/// Makes rounds until one fails or nobody takes them any more.
fn make(
    rounds: &Rounds,
    range: Range<usize>,
    sender: &SyncSender<Result<Vec<Crop>>>,
    stopped: &AtomicBool,
) {
    let mut bar = ProgressBar::new(rounds.n_models as u64).with_message("rendering");
    for round in range {
        let go_on = || {
            bar.inc(1);
            !stopped.load(Ordering::Relaxed)
        };
        let crops = rounds.crops(round, go_on);
        // Only the first round is waited for.
        mem::replace(&mut bar, ProgressBar::hidden()).finish_and_clear();
        let failed = crops.is_err();
        if sender.send(crops).is_err() || failed {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::{TrainingConfig, shapes::Shapes};
    use std::{fs, path::Path, thread};

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n";

    fn config(meshes: Option<&Path>) -> TrainingConfig {
        let mut config = TrainingConfig::default();
        (config.data.n_models, config.data.n_validation) = (3, 1);
        config.data.meshes = meshes.map(Into::into);
        config.data.points_per_model = 1;
        (config.data.views_per_model, config.data.views_per_round) = (5, 2);
        config.regressors.schedule.batch_size = 2;
        config.regressors.network.crop_size = 16;
        config
    }

    /// Takes these steps on so many threads; stops at the first error.
    fn take(
        config: &TrainingConfig,
        steps: Range<usize>,
        n_threads: usize,
    ) -> Result<Vec<Vec<u8>>> {
        let shapes = Shapes::open(&config.data, config.seed)?;
        let rounds = Rounds::open(config, &shapes)?;
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads start");
        thread::scope(|scope| {
            let start = || Batches::start(&rounds, steps.clone(), scope);
            let mut batches = pool.install(start)?;
            let mut pixels = vec![];
            for step in steps.clone() {
                pixels.extend(batches.batch(step)?.iter().map(|crop| crop.pixels.clone()));
            }
            Ok(pixels)
        })
    }

    #[test]
    fn any_number_of_threads_and_any_first_step_give_the_same_batches() {
        let config = config(None);
        let batches = take(&config, 0..8, 1).expect("cars need no files");
        assert_eq!(batches.len(), 16);
        assert!(batches == take(&config, 0..8, 2).expect("cars need no files"));
        // Rounds have three steps.
        assert!(batches[10..] == take(&config, 5..8, 1).expect("cars need no files"));
        assert!(take(&config, 8..8, 1).expect("cars need no files").is_empty());
    }

    #[test]
    fn a_round_that_is_smaller_than_a_batch_is_one_step() {
        let mut config = config(None);
        config.regressors.schedule.batch_size = 8;
        let batches = take(&config, 0..2, 1).expect("cars need no files");
        assert_eq!(batches.len(), 16);
        assert!(batches[0..2] == batches[6..8] && batches[0..8] != batches[8..16]);
    }

    #[test]
    fn a_mesh_that_breaks_on_the_way_is_the_error_of_a_later_step() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |idx| folder.path().join(format!("{idx}.obj"));
        (0..4).for_each(|idx| fs::write(path(idx), TRIANGLE).expect("writable"));
        let config = config(Some(folder.path()));
        let shapes = Shapes::open(&config.data, config.seed).expect("they are readable");
        let rounds = Rounds::open(&config, &shapes).expect("there are no shards");
        let error = thread::scope(|scope| {
            let mut batches = Batches::start(&rounds, 0..1000, scope).expect("still readable");
            (0..4).for_each(|idx| fs::write(path(idx), "f 1 2 nine\n").expect("writable"));
            (0..1000).find_map(|step| batches.batch(step).err()).expect("no longer readable")
        });
        assert!(error.to_string().contains(".obj"), "{error}");
    }

    #[test]
    fn dropped_batches_end_the_thread() {
        let mut config = config(None);
        config.data.views_per_model = 1000;
        let shapes = Shapes::open(&config.data, config.seed).expect("cars need no files");
        let rounds = Rounds::open(&config, &shapes).expect("there are no shards");
        thread::scope(|scope| {
            drop(Batches::start(&rounds, 0..usize::MAX, scope).expect("cars need no files"));
        });
    }
}
