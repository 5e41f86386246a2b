//! Reading sequences of any layout, and saying how they were read.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use anyhow::{Result, bail};
use clap::Args;
use object_pba::data::{
    formats::{Reading, SequenceHints, read_sequence},
    sequence::Sequence,
};

/// What the files of a sequence may not say.
#[derive(Args, Default)]
pub struct Input {
    /// Focal length in pixels, where no file states the camera.
    #[arg(long)]
    focal: Option<f64>,
    /// Field of view across the width, in degrees, instead of a focal length.
    #[arg(long, conflicts_with = "focal")]
    fov: Option<f64>,
    /// Folder of masks, or a video's video of masks.
    #[arg(long)]
    masks: Option<PathBuf>,
    /// Frames to take, as in 30..60; they count from 0 in the order of their names.
    #[arg(long, value_parser = range)]
    frames: Option<Range<usize>>,
    /// Take every n-th frame.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Most frames to take.
    #[arg(long)]
    max_frames: Option<usize>,
    /// The reference frame, whose points the others are compared with; it counts from 0 among the
    /// frames that are taken, and comes first in the results. One in the middle is seen from most of
    /// them, and it needs a mask.
    #[arg(long, default_value_t = 0)]
    reference: usize,
}

impl Input {
    /// Reads a sequence; says on stderr which layout it has and what was assumed.
    pub fn read(&self, path: &Path) -> Result<Sequence> {
        let hints = SequenceHints {
            focal: self.focal,
            field_of_view: self.fov,
            masks: self.masks.clone(),
            frames: self.frames.clone(),
            every: self.every,
            max_frames: self.max_frames,
        };
        let Reading { sequence, layout, notes } = read_sequence(path, &hints)?;
        let n_frames = sequence.frames.len();
        if self.reference >= n_frames {
            let last = n_frames - 1;
            bail!(
                "{}: --reference is {}, and its frames are 0 to {last}",
                path.display(),
                self.reference
            );
        }
        let sequence = sequence.with_reference(self.reference);
        let [width, height] = sequence.size;
        eprintln!(
            "{}: {layout}, {} frames of {width} × {height}, focal length {:.1} px",
            path.display(),
            sequence.frames.len(),
            sequence.intrinsics.focal[0]
        );
        for note in notes {
            eprintln!("note: {note}");
        }
        Ok(sequence)
    }
}

/// `a..b`, without b.
fn range(text: &str) -> Result<Range<usize>, String> {
    let parts = text.split_once("..");
    let range = parts.and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    range.filter(|range| !range.is_empty()).ok_or_else(|| "it is not a range like 30..60".into())
}
