//! Training samples as WebDataset tars, in shards that can be made apart and merged.
//!
//! A sample is three files that share a key: `00000042.color.png`, `00000042.mask.png` and
//! `00000042.json`. Keys count through the whole dataset, and a shard is a range of them. Beside each
//! tar lies its [`Manifest`], written last: a tar without one is unfinished.
//!
//! Bytes depend on the samples alone, not on the time, the user or the machine.

mod merge;
mod part;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use merge::merge_shards;
pub use part::Part;
pub use reader::{DecodedSample, ShardReader};
pub use writer::ShardWriter;

use std::{
    fs,
    io::{self, Cursor, Read, Write},
    ops::Range,
    path::Path,
};

use image::{GrayImage, ImageFormat, RgbImage};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// What the files of a sample are called after its key, in their order.
const EXTENSIONS: [&str; 3] = ["color.png", "mask.png", "json"];

/// One sample, encoded: the bytes of its files.
pub struct Sample {
    files: [Vec<u8>; 3],
}

impl Sample {
    pub fn new(color: &RgbImage, mask: &GrayImage, metadata: &impl Serialize) -> Self {
        let (mut color_png, mut mask_png) = (Cursor::new(vec![]), Cursor::new(vec![]));
        let written = color
            .write_to(&mut color_png, ImageFormat::Png)
            .and_then(|()| mask.write_to(&mut mask_png, ImageFormat::Png));
        written.expect("memory takes any picture");
        let json = serde_json::to_vec(metadata).expect("metadata are plain JSON");
        Self { files: [color_png.into_inner(), mask_png.into_inner(), json] }
    }
}

/// Which samples a shard holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contents {
    /// Names what all samples follow from; shards of different datasets never mix.
    pub dataset: String,
    /// Numbers of the shard's samples.
    pub samples: Range<usize>,
    /// How many samples all shards have together.
    pub total: usize,
}

/// A finished shard: `name.json` beside `name.tar`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    #[serde(flatten)]
    pub contents: Contents,
    /// Of the tar, in hexadecimal.
    pub sha256: String,
}

impl Manifest {
    /// The manifest of a tar, if it has one.
    pub fn read(tar: &Path) -> Result<Option<Self>> {
        let path = tar.with_extension("json");
        match fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Error::io(&path)(error)),
            Ok(bytes) => match serde_json::from_slice(&bytes) {
                Ok(manifest) => Ok(Some(manifest)),
                Err(error) => Err(unusable(&path, error)),
            },
        }
    }
}

/// Whether a shard is finished and intact. One of other contents is refused: it is not ours to
/// overwrite.
pub fn is_finished(tar: &Path, contents: &Contents) -> Result<bool> {
    let Some(manifest) = Manifest::read(tar)? else { return Ok(false) };
    if manifest.contents != *contents {
        return Err(unusable(tar, "it is of another dataset; choose another folder"));
    }
    match fs::File::open(tar) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(Error::io(tar)(error)),
        Ok(file) => {
            let mut hashed = Hashed::new(file);
            io::copy(&mut hashed, &mut io::sink()).map_err(Error::io(tar))?;
            Ok(hashed.finish() == manifest.sha256)
        }
    }
}

/// The name of a sample's file.
fn file_name(sample_idx: usize, extension: &str) -> String {
    format!("{sample_idx:08}.{extension}")
}

/// Reads or writes through, and takes the SHA-256 of what has passed.
struct Hashed<T> {
    inner: T,
    hasher: Sha256,
}

impl<T> Hashed<T> {
    fn new(inner: T) -> Self {
        Self { inner, hasher: Sha256::new() }
    }

    /// In hexadecimal.
    fn finish(self) -> String {
        self.hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

impl<T: Read> Read for Hashed<T> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.hasher.update(&buffer[..n]);
        Ok(n)
    }
}

impl<T: Write> Write for Hashed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

fn unusable(path: &Path, reason: impl ToString) -> Error {
    Error::Shard { path: path.into(), reason: reason.to_string() }
}
