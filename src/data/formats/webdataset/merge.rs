//! Makes one shard of many.

use std::{
    fs::File,
    io::{self, BufReader},
    ops::Range,
    path::{Path, PathBuf},
};

use tar::Archive;

use super::{Contents, Hashed, Manifest, ShardWriter, is_finished, reader::read_sample, unusable};
use crate::{Error, Result};

/// Merges all shards of a dataset into the one at `out`, byte for byte what a single run writes.
///
/// Refuses gaps, overlaps, shards of another dataset, and tars that are not what their manifests
/// say: every sample is there exactly once.
pub fn merge_shards(tars: &[PathBuf], out: &Path) -> Result<Contents> {
    let shards = read_manifests(tars)?;
    let contents = check_complete(&shards, out)?;
    if is_finished(out, &contents)? {
        return Ok(contents);
    }
    let mut writer = ShardWriter::create(out, contents.clone())?;
    for (tar, manifest) in &shards {
        copy_samples(tar, manifest, &mut writer)?;
    }
    writer.finish()?;
    Ok(contents)
}

/// Finished shards, in order of their first samples.
pub(super) fn read_manifests(tars: &[PathBuf]) -> Result<Vec<(&Path, Manifest)>> {
    let mut shards = vec![];
    for tar in tars {
        let manifest = Manifest::read(tar)?;
        let manifest = manifest.ok_or_else(|| unusable(tar, "it has no manifest: unfinished"))?;
        shards.push((tar.as_path(), manifest));
    }
    shards.sort_by_key(|(_, Manifest { contents, .. })| {
        (contents.samples.start, contents.samples.end)
    });
    Ok(shards)
}

/// What shards in order of their first samples hold together; `place` is where one is missing.
pub(super) fn check_complete(shards: &[(&Path, Manifest)], place: &Path) -> Result<Contents> {
    let Some((_, Manifest { contents: first, .. })) = shards.first() else {
        return Err(unusable(place, "there are no shards"));
    };
    let mut next = 0;
    for (tar, Manifest { contents, .. }) in shards {
        if (&contents.dataset, contents.total) != (&first.dataset, first.total) {
            return Err(unusable(tar, "it is of another dataset than the other shards"));
        }
        let Range { start, end } = contents.samples;
        if start > end || end > contents.total {
            return Err(unusable(tar, "its manifest names samples that cannot be"));
        }
        if start < next {
            return Err(unusable(tar, format!("sample {start} is in another shard as well")));
        }
        check_reached(place, next, start)?;
        next = end;
    }
    check_reached(place, next, first.total)?;
    Ok(Contents { samples: 0..first.total, ..first.clone() })
}

fn check_reached(place: &Path, next: usize, start: usize) -> Result<()> {
    if next < start {
        return Err(unusable(place, format!("samples {next} to {} are missing", start - 1)));
    }
    Ok(())
}

fn copy_samples(tar: &Path, manifest: &Manifest, writer: &mut ShardWriter) -> Result<()> {
    let file = File::open(tar).map_err(Error::io(tar))?;
    let mut archive = Archive::new(Hashed::new(BufReader::new(file)));
    let mut entries = archive.entries().map_err(Error::io(tar))?;
    for sample_idx in manifest.contents.samples.clone() {
        writer.append(&read_sample(&mut entries, sample_idx, tar)?)?;
    }
    // What follows the samples counts as well.
    let mut hashed = archive.into_inner();
    io::copy(&mut hashed, &mut io::sink()).map_err(Error::io(tar))?;
    if hashed.finish() != manifest.sha256 {
        return Err(unusable(tar, "its bytes are not those that its manifest names"));
    }
    Ok(())
}
