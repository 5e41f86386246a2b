//! metrics.jsonl: one JSON object a line, with its stage, step and seconds.

use std::{
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
    time::Duration,
};

use serde_json::{Value, json};

use super::stage::Measurements;
use crate::{Error, Result};

/// The end of the file, where one stage writes.
pub(super) struct MetricsFile {
    file: File,
    path: PathBuf,
    stage: &'static str,
}

impl MetricsFile {
    /// Opens the file in a folder; lines of this stage after `step` are of steps to be taken again.
    pub fn open(out: &Path, stage: &'static str, step: usize) -> Result<Self> {
        let path = out.join("metrics.jsonl");
        let text = match fs::read_to_string(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            text => text.map_err(Error::io(&path))?,
        };
        let mut kept = String::new();
        for line in text.lines().filter(|line| !is_later(line, stage, step)) {
            kept.push_str(line);
            kept.push('\n');
        }
        fs::write(&path, kept).map_err(Error::io(&path))?;
        let file = OpenOptions::new().append(true).open(&path).map_err(Error::io(&path))?;
        Ok(Self { file, path, stage })
    }

    pub fn append(
        &mut self,
        step: usize,
        elapsed: Duration,
        measurements: &Measurements,
    ) -> Result<()> {
        let seconds = (elapsed.as_secs_f64() * 10.0).round() / 10.0;
        self.write(&[("step", json!(step)), ("seconds", json!(seconds))], measurements)
    }

    /// What the stage came to.
    pub fn append_final(&mut self, measurements: &Measurements) -> Result<()> {
        self.write(&[("final", json!(true))], measurements)
    }

    fn write(&mut self, head: &[(&str, Value)], measurements: &Measurements) -> Result<()> {
        let mut line = format!("{{\"stage\":\"{}\"", self.stage);
        let measured = measurements.iter().map(|&(name, value)| (name, json!(value)));
        for (name, value) in head.iter().cloned().chain(measured) {
            line.push_str(&format!(",\"{name}\":{value}"));
        }
        writeln!(self.file, "{line}}}").map_err(Error::io(&self.path))
    }
}

fn is_later(line: &str, stage: &str, step: usize) -> bool {
    let Ok(line) = serde_json::from_str::<Value>(line) else {
        return true; // the last line of a run that was killed while it wrote
    };
    let line_step = line["step"].as_u64().map_or(usize::MAX, |step| step as usize);
    line["stage"] == stage && line_step > step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_stage_drops_what_it_will_write_again() {
        let folder = tempfile::tempdir().unwrap();
        let append = |file: &mut MetricsFile, step| {
            file.append(step, Duration::ZERO, &vec![("loss", step as f64)]).unwrap();
        };
        let mut other = MetricsFile::open(folder.path(), "other", 0).unwrap();
        append(&mut other, 99);
        let mut file = MetricsFile::open(folder.path(), "stage", 0).unwrap();
        for step in 1..=3 {
            append(&mut file, step);
        }
        writeln!(file.file, "{{\"stage\": \"st").unwrap();

        MetricsFile::open(folder.path(), "stage", 2).unwrap();
        let text = fs::read_to_string(folder.path().join("metrics.jsonl")).unwrap();
        let steps: Vec<_> = text
            .lines()
            .map(|line| serde_json::from_str::<Value>(line).unwrap()["step"].clone())
            .collect();
        assert_eq!(steps, [99, 1, 2]);
    }
}
