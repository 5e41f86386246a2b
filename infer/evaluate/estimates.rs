//! Poses and clouds that other programs estimated.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::Isometry3;
use object_pba::{
    bundle_adjustment::{shape_model::KnownPoints, unknowns::Unknowns},
    data::{
        formats::{colmap, nerfstudio::read_trajectory, ply::read_points},
        sequence::{Sequence, Truth},
    },
    metrics::PoseErrors,
    reconstruction::score,
};

use super::{
    measured::Measured,
    store::{MethodResult, peak_memory_mb},
};

/// What lies in a folder: a `transforms.json` or a COLMAP model, and perhaps a `points.ply`.
pub struct Estimated {
    poses: Vec<(PathBuf, Isometry3<f32>)>,
    /// Whether its world is the canonical frame; if not, only relative errors mean something.
    canonical: bool,
    points: Option<Vec<[f32; 3]>>,
}

impl Estimated {
    /// Poses by the pictures' files, of which only relative errors mean something.
    pub fn in_its_own_world(poses: Vec<(PathBuf, Isometry3<f32>)>) -> Self {
        Self { poses, canonical: false, points: None }
    }

    pub fn read(folder: &Path) -> Result<Self> {
        let transforms = folder.join("transforms.json");
        let (poses, canonical) = if transforms.is_file() {
            let found = read_trajectory(&transforms)?;
            let poses = found.pictures.into_iter().zip(found.camera_from_world);
            (poses.collect(), found.canonical)
        } else if let Some((model, encoding)) = colmap::find_model(folder) {
            (colmap::read_poses(&model, encoding)?, false)
        } else {
            bail!("{}: there is no transforms.json or COLMAP model", folder.display());
        };
        let path = folder.join("points.ply");
        let points = path.is_file().then(|| read_points(&path)).transpose()?;
        let points = points.map(|points| points.iter().map(|point| point.coords.into()).collect());
        Ok(Self { poses, canonical, points })
    }

    /// Judges what was estimated of a sequence, by the frames that were given a pose.
    pub fn judge(&self, sequence: &Sequence, device: &Device) -> Result<MethodResult> {
        let n_frames = sequence.frames.len();
        let pose_of = |idx: usize| {
            let name = plain(&sequence.frames[idx].path);
            let found = self.poses.iter().find(|(picture, _)| {
                let picture = plain(picture);
                name.ends_with(&picture) || picture.ends_with(&name)
            });
            found.map(|(_, pose)| (idx, *pose))
        };
        let (posed, poses): (Vec<usize>, Vec<_>) = (0..n_frames).filter_map(pose_of).unzip();
        if posed.is_empty() {
            bail!("none of the pictures that it names is one of the sequence's");
        }
        Ok(MethodResult {
            initial: None,
            last: self.measure(&self.seen_by(sequence, &posed), &posed, &poses, device),
            seconds: None,
            status: None,
            n_posed: posed.len(),
            n_frames,
            report: None,
            peak_memory_mb: peak_memory_mb(),
        })
    }

    /// The frames that were given a pose, and of the truth what shares a world with the estimate.
    fn seen_by(&self, sequence: &Sequence, posed: &[usize]) -> Sequence {
        let truth = sequence.truth.as_ref().map(|truth| {
            let canonical = truth.canonical && self.canonical;
            Truth {
                camera_from_world: posed.iter().map(|&l| truth.camera_from_world[l]).collect(),
                canonical,
                points: truth.points.clone().filter(|_| canonical),
            }
        });
        let frames = posed.iter().map(|&l| sequence.frames[l].clone()).collect();
        Sequence { frames, truth, ..sequence.clone() }
    }

    fn measure(
        &self,
        sequence: &Sequence,
        posed: &[usize],
        poses: &[Isometry3<f32>],
        device: &Device,
    ) -> Measured {
        // Eq. 3 compares with the reference frame.
        let has_reference = posed[0] == 0;
        let mut measured = match &self.points {
            Some(points) if has_reference => {
                let data = TensorData::new(points.concat(), [1, points.len(), 3]);
                let shape = KnownPoints(Tensor::from_data(data, &device.clone().inner()));
                let unknowns = Unknowns::with_poses(poses, &[], Default::default());
                score(sequence, &shape, &unknowns, device).into()
            }
            _ => Measured {
                poses: sequence.truth.as_ref().map_or_else(PoseErrors::default, |truth| {
                    PoseErrors::new(poses, &truth.camera_from_world, truth.canonical)
                }),
                ..Measured::default()
            },
        };
        if !has_reference {
            measured.poses.reference_rotation_error_deg = None;
            measured.poses.relative_rotation_error_deg_mean = None;
        }
        measured
    }
}

/// A path without the folders that some programs leave out.
fn plain(path: &Path) -> PathBuf {
    let path = path.strip_prefix(".").unwrap_or(path);
    path.strip_prefix("images").unwrap_or(path).to_path_buf()
}
