//! A finished run in the formats of other programs.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use clap::ValueEnum;
use object_pba::data::formats::{colmap, glb, nerfstudio, npz, ply, tum};

#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd, ValueEnum)]
pub enum Format {
    /// colmap/: cameras.txt, images.txt and points3D.txt.
    Colmap,
    /// trajectory.txt: a time, a position and a quaternion a line.
    Tum,
    /// scene.glb: the points and a node for each camera.
    Glb,
    /// run.npz: arrays for NumPy.
    Npz,
}

/// Writes the cameras and the cloud of a run's folder once more, beside its own files.
pub fn export(run: &Path, formats: &[Format]) -> Result<()> {
    let trajectory = nerfstudio::read_trajectory(&run.join("transforms.json"))?;
    let cloud = ply::read_cloud(&run.join("points.ply"))?;
    for format in formats {
        let path = run.join(match format {
            Format::Colmap => "colmap",
            Format::Tum => "trajectory.txt",
            Format::Glb => "scene.glb",
            Format::Npz => "run.npz",
        });
        match format {
            Format::Colmap => {
                fs::create_dir_all(&path)
                    .with_context(|| format!("cannot create {}", path.display()))?;
                colmap::write(&path, &trajectory, &cloud)?;
            }
            Format::Tum => tum::write(&path, &trajectory)?,
            Format::Glb => glb::write(&path, &trajectory, &cloud)?,
            Format::Npz => npz::write(&path, &trajectory, &cloud)?,
        }
        println!("{}", path.display());
    }
    Ok(())
}
