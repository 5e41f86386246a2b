//! Clouds of whole collections, sampled once and kept on disk.

use std::{
    fs,
    io::{Cursor, Read},
    path::{Path, PathBuf},
};

use nalgebra::Point3;
use npyz::{NpyFile, WriteOptions, WriterBuilder};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};
use zip::{CompressionMethod, ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{
    collection::Model, formats::write_atomically, mesh_file::shape_hash, surface::sample_surface,
};
use crate::{Error, Result};

/// Changes whenever the same file would give other points.
const VERSION: &[u8] = b"object-pba surface 1";
/// The array within a file.
const ARRAY: &str = "points.npy";
/// Characters of a hash in hexadecimal.
const HASH_LEN: usize = 64;

/// Samples models, each with its own random stream, which depends on nothing but the model's shape,
/// its axes, the seed and the number of points.
#[derive(Clone, Debug)]
pub struct SurfaceSampler {
    seed: u64,
    cache: Option<PathBuf>,
}

impl SurfaceSampler {
    /// With a folder `cache`, each cloud is kept there as `points.npy`, `[n_points, 3]`, in an npz
    /// file. Many runs may share it, and each may be interrupted at any moment.
    pub fn new(seed: u64, cache: Option<PathBuf>) -> Result<Self> {
        if let Some(folder) = &cache {
            fs::create_dir_all(folder).map_err(Error::io(folder))?;
            remove_partial_files(folder)?;
        }
        Ok(Self { seed, cache })
    }

    /// The cloud of a model, in the world frame. [`Error::Cache`] says that it could not be kept.
    pub fn sample(&self, model: &Model, n_points: usize) -> Result<Vec<Point3<f32>>> {
        let key = self.key(model, n_points)?;
        let path = self.cache.as_ref().map(|folder| folder.join(format!("{}.npz", hex(&key))));
        // A file of which anything is not as it was written is as good as none.
        let kept = path.as_ref().and_then(|path| fs::read(path).ok());
        if let Some(points) = kept.and_then(|bytes| decode(&key, &bytes)) {
            return Ok(points);
        }
        let mut rng = ChaCha8Rng::from_seed(key);
        let points = sample_surface(&model.load()?.mesh, n_points, &mut rng);
        if let Some(path) = path {
            let bytes = encode(&key, &points);
            // A run that starts at this moment takes our half-written file for a dead run's.
            let written =
                write_atomically(&path, &bytes).or_else(|_| write_atomically(&path, &bytes));
            written.map_err(|error| Error::Cache { path, source: Box::new(error) })?;
        }
        Ok(points)
    }

    /// Everything that the points depend on.
    fn key(&self, model: &Model, n_points: usize) -> Result<[u8; 32]> {
        let mut hash = Sha256::new_with_prefix(VERSION);
        hash.update(shape_hash(&model.path)?);
        hash.update(model.axes.to_string());
        hash.update([self.seed.to_le_bytes(), (n_points as u64).to_le_bytes()].concat());
        Ok(hash.finalize().into())
    }
}

/// An npz file whose last bytes, the archive's comment, are the hash of all others.
fn encode(key: &[u8; 32], points: &[Point3<f32>]) -> Vec<u8> {
    let write = || -> zip::result::ZipResult<Vec<u8>> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        zip.start_file(ARRAY, options)?;
        let shape = [points.len() as u64, 3];
        let mut array =
            WriteOptions::new().default_dtype().shape(&shape).writer(&mut zip).begin_nd()?;
        array.extend(points.iter().flat_map(|point| [point.x, point.y, point.z]))?;
        array.finish()?;
        zip.set_comment("0".repeat(HASH_LEN))?;
        Ok(zip.finish()?.into_inner())
    };
    let mut bytes = write().expect("memory is writable");
    bytes.truncate(bytes.len() - HASH_LEN);
    let hash = content_hash(key, &bytes);
    bytes.extend(hash.into_bytes());
    bytes
}

fn decode(key: &[u8; 32], bytes: &[u8]) -> Option<Vec<Point3<f32>>> {
    let (content, hash) = bytes.split_at_checked(bytes.len().checked_sub(HASH_LEN)?)?;
    if hash != content_hash(key, content).as_bytes() {
        return None;
    }
    let mut array = Vec::new();
    ZipArchive::new(Cursor::new(bytes)).ok()?.by_name(ARRAY).ok()?.read_to_end(&mut array).ok()?;
    let values = NpyFile::new(array.as_slice()).ok()?.into_vec::<f32>().ok()?;
    Some(values.as_chunks::<3>().0.iter().copied().map(Point3::from).collect())
}

fn content_hash(key: &[u8; 32], content: &[u8]) -> String {
    hex(&Sha256::new_with_prefix(key).chain_update(content).finalize().into())
}

fn hex(hash: &[u8; 32]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Removes what interrupted runs left half-written.
fn remove_partial_files(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        if path.extension().is_some_and(|extension| extension == "partial") {
            // Whatever cannot be removed does no harm.
            let _ = fs::remove_file(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
