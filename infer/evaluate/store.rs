//! Results on disk, one file for each method and sequence, so that an evaluation goes on where it was.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use nalgebra::{Isometry3, Point3};
use object_pba::{
    bundle_adjustment::Status,
    data::{
        formats::{Trajectory, nerfstudio::write_trajectory, ply, write_atomically},
        sequence::Sequence,
    },
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::measured::Measured;

/// What a result follows from: it is taken up again only where all four are the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MadeFrom {
    /// SHA-256, shortened, of the program, of the prior's files, of the method with its config, and of
    /// the pictures, masks, camera and truth of the sequence.
    pub program: String,
    pub prior: String,
    pub config: String,
    pub sequence: String,
}

impl MadeFrom {
    /// What differs, in words.
    fn difference(&self, other: &Self) -> Vec<&'static str> {
        let pairs = [
            ("program", &self.program, &other.program),
            ("prior", &self.prior, &other.prior),
            ("config", &self.config, &other.config),
            ("sequence", &self.sequence, &other.sequence),
        ];
        pairs.iter().filter(|(_, a, b)| a != b).map(|(name, _, _)| *name).collect()
    }
}

/// What a method made of a sequence.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MethodResult {
    /// Where it started, if it is one that starts somewhere.
    pub initial: Option<Measured>,
    #[serde(rename = "final")]
    pub last: Measured,
    pub seconds: Option<f64>,
    pub status: Option<Status>,
    /// Frames that were given a pose, of all.
    pub n_posed: usize,
    pub n_frames: usize,
    /// What `run` writes as metrics.json; of bundle adjustment with the prior.
    pub report: Option<Value>,
    /// Peak memory of the whole process until then, in MB, where the system tells.
    pub peak_memory_mb: Option<f64>,
}

/// A file of results.
#[derive(Serialize, Deserialize)]
struct Stored<T> {
    made_from: MadeFrom,
    result: T,
}

/// Whether a result is there already.
pub enum Found<T> {
    Kept(T),
    /// One is there, and these differ.
    Outdated(Vec<&'static str>),
    Missing,
}

/// Looks for a result. What cannot be read is as if it were not there: it is computed again.
pub fn find<T: DeserializeOwned>(path: &Path, made_from: &MadeFrom) -> Found<T> {
    let Ok(text) = fs::read(path) else { return Found::Missing };
    let Ok(stored) = serde_json::from_slice::<Stored<Value>>(&text) else { return Found::Missing };
    let difference = stored.made_from.difference(made_from);
    if !difference.is_empty() {
        return Found::Outdated(difference);
    }
    serde_json::from_value(stored.result).map_or(Found::Missing, Found::Kept)
}

/// Writes a result in one step: whoever is interrupted leaves the whole of it or nothing.
pub fn keep<T: Serialize>(path: &Path, made_from: &MadeFrom, result: &T) -> Result<()> {
    let stored = Stored { made_from: made_from.clone(), result };
    let text = serde_json::to_vec_pretty(&stored)?;
    write_atomically(path, &text).context("a result cannot be kept")
}

/// Poses and a cloud, as other programs estimate them too.
pub struct Estimate {
    pub camera_from_world: Vec<Isometry3<f32>>,
    pub points: Option<Vec<[f32; 3]>>,
}

impl Estimate {
    /// Writes `transforms.json` and `points.ply` into a folder.
    pub fn write(&self, folder: &Path, sequence: &Sequence) -> Result<()> {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot create {}", folder.display()))?;
        let n_frames = self.camera_from_world.len();
        let pictures = sequence.frames[..n_frames].iter().map(|frame| frame.path.clone());
        let trajectory = Trajectory {
            intrinsics: sequence.intrinsics,
            size: sequence.size,
            camera_from_world: self.camera_from_world.clone(),
            pictures: pictures.collect(),
            canonical: true,
        };
        write_trajectory(&folder.join("transforms.json"), &trajectory)?;
        if let Some(points) = &self.points {
            let points = points.iter().map(|&point| Point3::from(point)).collect();
            let cloud = ply::PointCloud { points, ..ply::PointCloud::default() };
            ply::write_points(&folder.join("points.ply"), &cloud)?;
        }
        Ok(())
    }
}

/// The first digits of a SHA-256.
pub fn digest(parts: &[&[u8]]) -> String {
    let mut hasher = Sha256::new();
    for part in parts {
        hasher.update((part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    hasher.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

/// Of this program: another build may compute something else.
pub fn program_digest() -> Result<String> {
    let path = env::current_exe().context("where is this program?")?;
    let bytes = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(digest(&[&bytes]))
}

/// Of all files of a prior, or of the bundled one, which is part of the program.
pub fn prior_digest(folder: Option<&PathBuf>) -> Result<String> {
    use object_pba::checkpoint::{CONFIG_FILE, REGRESSORS_FILE, SHAPE_FILE};
    let Some(folder) = folder else { return Ok("bundled".into()) };
    let read = |name: &str| {
        let path = folder.join(name);
        fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let files = [CONFIG_FILE, SHAPE_FILE, REGRESSORS_FILE].map(read);
    let files: Vec<Vec<u8>> = files.into_iter().collect::<Result<_>>()?;
    Ok(digest(&files.iter().map(Vec::as_slice).collect::<Vec<_>>()))
}

/// Of what was read of a sequence, whatever its layout.
pub fn sequence_digest(sequence: &Sequence) -> String {
    let bytes =
        |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|x| x.to_le_bytes()).collect() };
    let mut parts = vec![
        format!("{:?} {:?}", sequence.intrinsics, sequence.size).into_bytes(),
        // Poses and points by their shortest decimals, which tell floats apart.
        format!("{:?}", sequence.truth).into_bytes(),
    ];
    for frame in &sequence.frames {
        parts.push(frame.path.to_string_lossy().as_bytes().to_vec());
        parts.push(bytes(frame.color.as_raw()));
        parts.push(bytes(frame.mask.as_raw()));
    }
    digest(&parts.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

/// Peak memory of this process in MB; Linux tells.
pub fn peak_memory_mb() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}
