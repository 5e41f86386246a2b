//! What is done already: one file for each arm and sequence, under the hash of all that decides it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use object_pba::{checkpoint::Prior, data::formats::write_atomically};
use serde::{Deserialize, Serialize};

use super::{
    Subject,
    arm::{Arm, Outcome},
    digest,
};

/// What an arm came to on a sequence, or why to nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Entry {
    pub sequence: String,
    pub outcome: Option<Outcome>,
    pub failure: Option<String>,
}

/// A folder of entries. Arms of different studies that are the same share theirs.
pub struct Store {
    folder: PathBuf,
    prior: String,
}

impl Store {
    pub fn open(folder: &Path, prior: &Prior) -> Result<Self> {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot create {}", folder.display()))?;
        Ok(Self { folder: folder.into(), prior: digest::of_prior(prior) })
    }

    /// What is there; nothing, if that was written by something else.
    pub fn get(&self, arm: &Arm, subject: &Subject) -> Option<Entry> {
        let bytes = fs::read(self.path(arm, subject)).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Writes all of it or nothing, so that what is there can be trusted after any interruption.
    pub fn put(&self, arm: &Arm, subject: &Subject, outcome: Result<Outcome>) -> Result<()> {
        let failure = outcome.as_ref().err().map(|error| format!("{error:#}"));
        let entry = Entry { sequence: subject.name.clone(), outcome: outcome.ok(), failure };
        Ok(write_atomically(&self.path(arm, subject), &serde_json::to_vec_pretty(&entry)?)?)
    }

    /// Named for the reader by the sequence, and kept apart by the hash.
    fn path(&self, arm: &Arm, subject: &Subject) -> PathBuf {
        let version = env!("CARGO_PKG_VERSION");
        let hash = digest::of(&(version, arm, &self.prior, &subject.digest));
        self.folder.join(format!("{}-{}.json", subject.name, &hash[..16]))
    }
}
