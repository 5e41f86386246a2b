//! Reads samples by their numbers, in any order and from any thread.

use std::{
    fs::{self, File},
    io::{BufReader, Read, Seek, SeekFrom},
    ops::Range,
    path::{Path, PathBuf},
};

use image::{GrayImage, ImageFormat, RgbImage, load_from_memory_with_format};
use serde::de::DeserializeOwned;
use tar::{Archive, Entries};

use super::{
    EXTENSIONS, Manifest, Sample, file_name,
    merge::{check_complete, read_manifests},
    unusable,
};
use crate::{Error, Result};

/// All shards of a dataset. Only where their samples begin is in memory.
pub struct ShardReader {
    /// In order of their samples.
    shards: Vec<Shard>,
}

struct Shard {
    tar: PathBuf,
    samples: Range<usize>,
    /// Of each sample, in bytes.
    offsets: Vec<u64>,
}

/// A sample as it was before it was encoded.
pub struct DecodedSample<M> {
    pub color: RgbImage,
    pub mask: GrayImage,
    pub metadata: M,
}

impl ShardReader {
    /// Opens a tar of all samples, or a folder that has one or all parts of one.
    ///
    /// Refuses another dataset, or another number of samples in total, than the ones that are wanted.
    /// Hashes are not compared: it would take as long as reading everything.
    pub fn open(path: &Path, dataset: &str, total: usize) -> Result<Self> {
        let tars = tars_at(path)?;
        let mut shards = read_manifests(&tars)?;
        for (tar, Manifest { contents, .. }) in &shards {
            if (contents.dataset.as_str(), contents.total) != (dataset, total) {
                let found = format!("{} samples of dataset {}", contents.total, contents.dataset);
                let reason =
                    format!("expected {total} samples of dataset {dataset}, found {found}");
                return Err(unusable(tar, reason));
            }
        }
        let whole = shards.iter().position(|(_, shard)| shard.contents.samples == (0..total));
        if let Some(idx) = whole {
            shards = vec![shards.swap_remove(idx)];
        }
        check_complete(&shards, path)?;
        let shards = shards.into_iter().map(|(tar, manifest)| Shard::open(tar, manifest));
        Ok(Self { shards: shards.collect::<Result<_>>()? })
    }

    /// Reads one of the samples.
    pub fn read<M: DeserializeOwned>(&self, sample_idx: usize) -> Result<DecodedSample<M>> {
        let idx = self.shards.partition_point(|shard| shard.samples.end <= sample_idx);
        let shard = &self.shards[idx];
        let sample = shard.read(sample_idx)?;
        sample.decode().map_err(|reason| unusable(&shard.tar, format!("{sample_idx:08}: {reason}")))
    }
}

/// The tar, or those of a folder.
fn tars_at(path: &Path) -> Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.into()]);
    }
    let mut tars = vec![];
    for entry in fs::read_dir(path).map_err(Error::io(path))? {
        let tar = entry.map_err(Error::io(path))?.path();
        if tar.extension().is_some_and(|extension| extension == "tar") {
            tars.push(tar);
        }
    }
    Ok(tars)
}

impl Shard {
    /// Finds where the samples begin. Only the headers are read.
    fn open(tar: &Path, manifest: Manifest) -> Result<Self> {
        let samples = manifest.contents.samples;
        let mut archive = Archive::new(File::open(tar).map_err(Error::io(tar))?);
        let mut headers = vec![];
        for entry in archive.entries_with_seek().map_err(Error::io(tar))? {
            headers.push(entry.map_err(Error::io(tar))?.raw_header_position());
        }
        if headers.len() != samples.len() * EXTENSIONS.len() {
            let reason = format!("{} files are not {} samples", headers.len(), samples.len());
            return Err(unusable(tar, reason));
        }
        let offsets = headers.into_iter().step_by(EXTENSIONS.len()).collect();
        Ok(Self { tar: tar.into(), samples, offsets })
    }

    fn read(&self, sample_idx: usize) -> Result<Sample> {
        let mut file = File::open(&self.tar).map_err(Error::io(&self.tar))?;
        let offset = self.offsets[sample_idx - self.samples.start];
        file.seek(SeekFrom::Start(offset)).map_err(Error::io(&self.tar))?;
        let mut archive = Archive::new(BufReader::new(file));
        let mut entries = archive.entries().map_err(Error::io(&self.tar))?;
        read_sample(&mut entries, sample_idx, &self.tar)
    }
}

/// The next sample of a tar, if it is that one.
pub(super) fn read_sample<R: Read>(
    entries: &mut Entries<R>,
    sample_idx: usize,
    tar: &Path,
) -> Result<Sample> {
    let mut files = [vec![], vec![], vec![]];
    for (extension, bytes) in EXTENSIONS.into_iter().zip(&mut files) {
        let name = file_name(sample_idx, extension);
        let entry = entries.next().transpose().map_err(Error::io(tar))?;
        let Some(mut entry) = entry.filter(|entry| *entry.path_bytes() == *name.as_bytes()) else {
            return Err(unusable(tar, format!("{name} is not in its place")));
        };
        entry.read_to_end(bytes).map_err(Error::io(tar))?;
    }
    Ok(Sample { files })
}

impl Sample {
    fn decode<M: DeserializeOwned>(&self) -> Result<DecodedSample<M>, String> {
        let [color, mask, json] = &self.files;
        let picture = |png: &[u8]| -> Result<_, String> {
            load_from_memory_with_format(png, ImageFormat::Png).map_err(|error| error.to_string())
        };
        Ok(DecodedSample {
            color: picture(color)?.into_rgb8(),
            mask: picture(mask)?.into_luma8(),
            metadata: serde_json::from_slice(json).map_err(|error| error.to_string())?,
        })
    }
}
