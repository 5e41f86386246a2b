//! Checkpoints of an unfinished stage: one file, replaced as a whole, of step, weights, the best
//! weights so far, and optimiser state.

use std::{fs, io::ErrorKind, path::Path, time::Duration};

use burn::{module::Module, optim::ModuleOptimizer, store::ModuleRecord, tensor::Bytes};

use crate::{Error, Result, data::formats::write_atomically};

/// Where a stage stands.
pub(super) struct Progress<M> {
    pub step: usize,
    pub elapsed: Duration,
    pub module: M,
    pub optimizer: ModuleOptimizer,
    pub best: Option<Best>,
}

/// What did best on held-out shapes so far.
pub(super) struct Best {
    /// The less, the better.
    pub score: f64,
    pub step: usize,
    weights: Vec<u8>,
}

/// What a checkpoint begins with, each as 64 little-endian bits.
struct Header {
    step: u64,
    milliseconds: u64,
    /// Lengths of the weights and of the best ones, in bytes; none are best before a measurement.
    n_weights: u64,
    n_best: u64,
    best_step: u64,
    best_score: f64,
}

impl<M: Module> Progress<M> {
    /// Goes on from a checkpoint, if there is one.
    pub fn resume(self, path: &Path) -> Result<Self> {
        match fs::read(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(self),
            bytes => self.resume_from(&bytes.map_err(Error::io(path))?).map_err(|reason| {
                Error::Prior { path: path.into(), reason: format!("cannot resume: {reason}") }
            }),
        }
    }

    pub fn save(&self, path: &Path) -> Result<()> {
        let invalid = unusable(path);
        let weights = weights(&self.module).map_err(&invalid)?;
        let optimizer = self.optimizer.into_bytes().map_err(|e| invalid(e.to_string()))?;
        let best = self.best.as_ref();
        let best_weights = best.map_or(&[][..], |best| &best.weights);
        let header = Header {
            step: self.step as u64,
            milliseconds: self.elapsed.as_millis() as u64,
            n_weights: weights.len() as u64,
            n_best: best_weights.len() as u64,
            best_step: best.map_or(0, |best| best.step as u64),
            best_score: best.map_or(0.0, |best| best.score),
        };
        write_atomically(path, &[&header.bytes(), &weights[..], best_weights, &optimizer].concat())
    }

    fn resume_from(self, bytes: &[u8]) -> Result<Self, String> {
        let cut = "it is cut short";
        let (header, rest) = bytes.split_first_chunk().ok_or(cut)?;
        let header = Header::of_bytes(header);
        let (weights, rest) = rest.split_at_checked(header.n_weights as usize).ok_or(cut)?;
        let (best, optimizer) = rest.split_at_checked(header.n_best as usize).ok_or(cut)?;
        let best = Best {
            score: header.best_score,
            step: header.best_step as usize,
            weights: best.to_vec(),
        };
        Ok(Self {
            step: header.step as usize,
            elapsed: Duration::from_millis(header.milliseconds),
            module: with_weights(self.module, weights)?,
            optimizer: self.optimizer.from_bytes(owned(optimizer)).map_err(|e| e.to_string())?,
            best: (header.n_best > 0).then_some(best),
        })
    }

    /// Keeps the weights if no others scored less. Says whether it did.
    pub fn keep_if_best(&mut self, score: f64, path: &Path) -> Result<bool> {
        let is_best = self.best.as_ref().is_none_or(|best| score < best.score);
        if is_best {
            let weights = weights(&self.module).map_err(unusable(path))?;
            self.best = Some(Best { score, step: self.step, weights });
        }
        Ok(is_best)
    }

    /// The module with its best weights, or as it is where none were kept.
    pub fn into_best(self, path: &Path) -> Result<M> {
        match self.best {
            None => Ok(self.module),
            Some(best) => with_weights(self.module, &best.weights).map_err(unusable(path)),
        }
    }
}

impl Header {
    fn bytes(&self) -> [u8; 48] {
        let Self { step, milliseconds, n_weights, n_best, best_step, best_score } = *self;
        let numbers = [step, milliseconds, n_weights, n_best, best_step, best_score.to_bits()];
        let mut bytes = [0; 48];
        for (bytes, number) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(numbers) {
            *bytes = number.to_le_bytes();
        }
        bytes
    }

    fn of_bytes(bytes: &[u8; 48]) -> Self {
        let number = |i: usize| u64::from_le_bytes(bytes.as_chunks::<8>().0[i]);
        Self {
            step: number(0),
            milliseconds: number(1),
            n_weights: number(2),
            n_best: number(3),
            best_step: number(4),
            best_score: f64::from_bits(number(5)),
        }
    }
}

fn unusable(path: &Path) -> impl Fn(String) -> Error {
    move |reason| Error::Prior { path: path.into(), reason }
}

/// Validation settles the running means of batch normalisation, which lag behind a step.
fn weights<M: Module>(module: &M) -> Result<Vec<u8>, String> {
    let bytes = module.valid().into_record().into_bytes().map_err(|e| e.to_string())?;
    Ok(bytes.to_vec())
}

fn with_weights<M: Module>(module: M, weights: &[u8]) -> Result<M, String> {
    let weights = ModuleRecord::from_bytes(owned(weights)).map_err(|e| e.to_string())?;
    module.try_load_record(weights).map_err(|e| e.to_string())
}

fn owned(bytes: &[u8]) -> Bytes {
    Bytes::from_bytes_vec(bytes.to_vec())
}
