//! What an evaluation computes of each sequence, and what of it was computed already.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, Result};
use object_pba::data::{
    formats::{SequenceHints, read_sequence},
    sequence::Sequence,
};
use serde::de::DeserializeOwned;

use super::{
    estimates::Estimated,
    floors::{self, Floors},
    methods::Method,
    store::{self, Found, MadeFrom, MethodResult},
    work::Context,
};
use crate::{report, side_by_side::guarded};

/// A sequence's own report, below its folder.
pub const REPORT: &str = "report/index.html";

/// One thing to compute of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    Method(Method),
    /// The chosen solver on the first frames, so many.
    Views(usize),
    /// The folder in which another program's estimates lie, one folder a sequence.
    Estimates(PathBuf),
}

impl Task {
    /// The name of its files, unique within a plan.
    pub fn name(&self) -> String {
        match self {
            Self::Method(method) => method.name(),
            Self::Views(n_views) => format!("views-{n_views}"),
            Self::Estimates(folder) => {
                let name = folder.file_name().unwrap_or_default();
                format!("estimates-{}", name.to_string_lossy())
            }
        }
    }
}

/// All that is to be computed, and what it follows from.
pub struct Plan {
    pub context: Context,
    pub tasks: Vec<Task>,
    pub out: PathBuf,
    pub program: String,
    pub prior: String,
}

/// What is known of a sequence, or why it is not.
pub struct Entry {
    pub sequence: String,
    pub floors: Result<Floors, String>,
    /// By the names of tasks.
    pub results: BTreeMap<String, Result<MethodResult, String>>,
    /// What differed in results that were there and were computed anew.
    pub outdated: Vec<&'static str>,
    pub n_kept: usize,
}

impl Plan {
    /// The folder of all that belongs to a sequence.
    pub fn folder(&self, sequence: &str) -> PathBuf {
        self.out.join("sequences").join(sequence)
    }

    /// Computes what is not there yet. A failure is one of its task, not of all.
    pub fn work_on(&self, path: &Path) -> Entry {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut entry = Entry {
            sequence: name.clone(),
            floors: Err(String::new()),
            results: BTreeMap::new(),
            outdated: Vec::new(),
            n_kept: 0,
        };
        let folder = self.folder(&name);
        let read = guarded(|| {
            fs::create_dir_all(&folder)
                .with_context(|| format!("cannot create {}", folder.display()))?;
            let sequence = read_sequence(path, &SequenceHints::default())?.sequence;
            floors::write_thumbnail(&sequence, &folder)?;
            let digest = store::sequence_digest(&sequence);
            Ok((sequence, digest))
        });
        let (sequence, digest) = match read {
            Ok(read) => read,
            Err(error) => {
                let error = format!("{error:#}");
                entry.floors = Err(error.clone());
                let failed = |task: &Task| (task.name(), Err(error.clone()));
                entry.results = self.tasks.iter().map(failed).collect();
                return entry;
            }
        };
        entry.floors = self.result(&mut entry.outdated, &mut 0, &folder, "floors", &digest, || {
            let device = self.context.device();
            Ok(Floors::new(&self.context.prior, &sequence, &self.context.config, &device))
        });
        for task in &self.tasks {
            let name = task.name();
            // All views are what the solver saw.
            if matches!(task, Task::Views(n_views) if *n_views >= sequence.frames.len()) {
                let solved = entry.results[&Method::Solver.name()].clone();
                entry.results.insert(name, solved);
                continue;
            }
            let (outdated, n_kept) = (&mut entry.outdated, &mut entry.n_kept);
            let result = self.result(outdated, n_kept, &folder, &name, &digest, || {
                self.compute(task, &sequence, &folder)
            });
            entry.results.insert(name, result);
        }
        entry
    }

    fn compute(&self, task: &Task, sequence: &Sequence, folder: &Path) -> Result<MethodResult> {
        let own = folder.join(task.name());
        let applied = match task {
            Task::Method(method) => self.context.apply(*method, sequence, &own)?,
            Task::Views(n_views) => self.context.first_views(*n_views, sequence)?,
            Task::Estimates(estimates) => {
                let name = folder.file_name().unwrap_or_default();
                let estimated = Estimated::read(&estimates.join(name))?;
                return estimated.judge(sequence, &self.context.device());
            }
        };
        if let Some(estimate) = applied.last {
            estimate.write(&own, sequence)?;
        }
        if *task == Task::Method(Method::Solver) {
            if let Some(estimate) = applied.initial {
                estimate.write(&folder.join("initial"), sequence)?;
            }
            if let Some(found) = applied.reconstruction.filter(|_| self.context.reports) {
                let Context { prior, config, backend, .. } = &self.context;
                report::write(folder, prior, sequence, config, *backend, &found)?;
            }
        }
        Ok(applied.result)
    }

    /// What is kept in a file, or is computed and kept now. Tables follow from the file alone, so that
    /// they are the same whenever it was written.
    fn result<T: serde::Serialize + DeserializeOwned>(
        &self,
        outdated: &mut Vec<&'static str>,
        n_kept: &mut usize,
        folder: &Path,
        name: &str,
        sequence: &str,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<T, String> {
        let path = folder.join(format!("{name}.json"));
        let made_from = self.made_from(name, sequence);
        // Another program's estimates may have changed, and take no time to judge.
        let lasts = !name.starts_with("estimates-");
        let lacks_report =
            name == Method::Solver.name() && self.context.reports && !folder.join(REPORT).is_file();
        match store::find(&path, &made_from) {
            Found::Kept(result) if lasts && !lacks_report => {
                *n_kept += 1;
                return Ok(result);
            }
            Found::Outdated(what) => outdated.extend(what),
            _ => {}
        }
        let computed = guarded(|| {
            // From here on, the poses and clouds beside it are no longer those of an old result.
            let _ = fs::remove_file(&path);
            store::keep(&path, &made_from, &compute()?)?;
            match store::find(&path, &made_from) {
                Found::Kept(result) => Ok(result),
                _ => anyhow::bail!("{} cannot be read back", path.display()),
            }
        });
        computed.map_err(|error| format!("{error:#}"))
    }

    fn made_from(&self, name: &str, sequence: &str) -> MadeFrom {
        let task = self.tasks.iter().find(|task| task.name() == name);
        let config = match task {
            Some(Task::Method(method)) => method.config(&self.context.config),
            _ => self.context.config.clone(),
        };
        let config = toml::to_string(&config).expect("configs are plain tables");
        let backend = self.context.backend.to_string();
        MadeFrom {
            program: self.program.clone(),
            prior: self.prior.clone(),
            config: store::digest(&[config.as_bytes(), backend.as_bytes(), name.as_bytes()]),
            sequence: sequence.into(),
        }
    }
}
