//! Folders of sequences.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use object_pba::data::formats::Layout;

/// The folders below `dataset` that hold a sequence with its camera, in order of their names.
pub fn sequences_below(dataset: &Path) -> Result<Vec<PathBuf>> {
    let entries =
        fs::read_dir(dataset).with_context(|| format!("cannot read {}", dataset.display()))?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir() && states_its_camera(path))
        .collect();
    folders.sort();
    if folders.is_empty() {
        bail!("{}: no folder below it holds a sequence", dataset.display());
    }
    Ok(folders)
}

/// Whether this is a sequence whose files say with which camera it was taken.
pub fn states_its_camera(folder: &Path) -> bool {
    Layout::detect(folder).is_ok_and(|layout| !matches!(layout, Layout::Plain(_)))
}
