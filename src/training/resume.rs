//! Checkpoints of an unfinished stage: one file, replaced as a whole, of step, weights and
//! optimiser state.

use std::{fs, io::ErrorKind, path::Path, time::Duration};

use burn::{
    module::Module,
    optim::ModuleOptimizer,
    store::{ModuleRecord, RecordError},
    tensor::Bytes,
};

use crate::{Error, Result, data::formats::write_atomically};

/// Step, milliseconds and length of the weights, as 64-bit little-endian numbers.
const HEADER: usize = 3 * size_of::<u64>();

/// Where a stage stands.
pub(super) struct Progress<M> {
    pub step: usize,
    pub elapsed: Duration,
    pub module: M,
    pub optimizer: ModuleOptimizer,
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
        let unusable = |error: RecordError| {
            let reason = error.to_string();
            Error::Prior { path: path.into(), reason }
        };
        // Validation settles the running means of batch normalisation, which lag behind a step.
        let weights = self.module.valid().into_record().into_bytes().map_err(unusable)?;
        let optimizer = self.optimizer.into_bytes().map_err(unusable)?;
        let header = [self.step as u64, self.elapsed.as_millis() as u64, weights.len() as u64];
        let header = header.map(u64::to_le_bytes).concat();
        write_atomically(path, &[&header[..], &weights[..], &optimizer[..]].concat())
    }

    fn resume_from(self, bytes: &[u8]) -> Result<Self, String> {
        let (header, rest) = bytes.split_at_checked(HEADER).ok_or("it is cut short")?;
        let number = |i: usize| {
            let bytes = header[8 * i..8 * i + 8].try_into().expect("eight bytes");
            u64::from_le_bytes(bytes)
        };
        let (weights, optimizer) =
            rest.split_at_checked(number(2) as usize).ok_or("it is cut short")?;
        let owned = |bytes: &[u8]| Bytes::from_bytes_vec(bytes.to_vec());
        let weights = ModuleRecord::from_bytes(owned(weights)).map_err(|e| e.to_string())?;
        Ok(Self {
            step: number(0) as usize,
            elapsed: Duration::from_millis(number(1)),
            module: self.module.try_load_record(weights).map_err(|e| e.to_string())?,
            optimizer: self.optimizer.from_bytes(owned(optimizer)).map_err(|e| e.to_string())?,
        })
    }
}
