//! Sequences as folders with a `transforms.json`, as NeRF and nerfstudio lay them out.
//!
//! Beyond that format: `"world": "canonical"` says that poses are in the object's canonical frame, and
//! `points.ply`, if there, is its true surface. Keys that we do not know are other programs' business.

mod pictures;
#[cfg(test)]
mod tests;
mod transforms;

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::DynamicImage;
use nalgebra::Isometry3;

use super::ply::{PointCloud, read_points, write_points};
use crate::{
    Error, Result,
    camera::Intrinsics,
    data::sequence::{Sequence, Truth},
};
use pictures::{mask_to_luma8, read_frame, write_png};
use transforms::{FrameEntry, Transforms};

const TRANSFORMS: &str = "transforms.json";
const POINTS: &str = "points.ply";

/// Reads the folder of a sequence.
pub fn read_sequence(folder: &Path) -> Result<Sequence> {
    let path = folder.join(TRANSFORMS);
    let unusable = |reason: String| Error::Sequence { path: path.clone(), reason };
    let text = fs::read_to_string(&path).map_err(Error::io(&path))?;
    let transforms: Transforms =
        serde_json::from_str(&text).map_err(|error| unusable(error.to_string()))?;
    transforms.check_supported().map_err(unusable)?;
    let poses = transforms.poses().map_err(unusable)?;

    let mut frames = vec![];
    for entry in &transforms.frames {
        frames.push(read_frame(folder, entry)?);
    }
    let sizes = frames.iter().map(|frame| {
        let (width, height) = frame.color.dimensions();
        [width as usize, height as usize]
    });
    let size = transforms.common_size(sizes).map_err(unusable)?;
    let intrinsics = transforms.intrinsics(size).map_err(unusable)?;

    let points_path = folder.join(POINTS);
    let points = points_path.exists().then(|| read_points(&points_path)).transpose()?;
    let canonical = transforms.canonical();
    let truth = poses.map(|camera_from_world| Truth { camera_from_world, canonical, points });
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Sequence { name, intrinsics, size, frames, truth })
}

/// Writes a sequence as a folder: 8-bit pictures and masks first, `transforms.json` last.
pub fn write_sequence(sequence: &Sequence, folder: &Path) -> Result<()> {
    for subfolder in ["images", "masks"].map(|name| folder.join(name)) {
        fs::create_dir_all(&subfolder).map_err(Error::io(&subfolder))?;
    }
    let mut entries = vec![];
    for (idx, frame) in sequence.frames.iter().enumerate() {
        let [picture, mask] =
            ["images", "masks"].map(|name| PathBuf::from(format!("{name}/frame_{idx:03}.png")));
        let color = DynamicImage::from(frame.color.clone()).into_rgb8();
        write_png(&folder.join(&picture), &color.into())?;
        write_png(&folder.join(&mask), &mask_to_luma8(&frame.mask))?;
        let pose = sequence.truth.as_ref().and_then(|truth| truth.camera_from_world.get(idx));
        entries.push(FrameEntry::new(picture, Some(mask), pose));
    }
    if let Some(points) = sequence.truth.as_ref().and_then(|truth| truth.points.clone()) {
        write_points(&folder.join(POINTS), &PointCloud { points, ..PointCloud::default() })?;
    }
    let canonical = sequence.truth.as_ref().is_some_and(|truth| truth.canonical);
    let transforms = Transforms::new(&sequence.intrinsics, sequence.size, entries, canonical);
    transforms.write(&folder.join(TRANSFORMS))
}

/// Writes poses, for example estimated ones, of pictures that have files already.
pub fn write_transforms(
    path: &Path,
    intrinsics: &Intrinsics,
    size: [usize; 2],
    camera_from_world: &[Isometry3<f32>],
    file_paths: &[PathBuf],
    canonical: bool,
) -> Result<()> {
    let entries = camera_from_world
        .iter()
        .zip(file_paths)
        .map(|(pose, file_path)| FrameEntry::new(file_path.clone(), None, Some(pose)))
        .collect();
    Transforms::new(intrinsics, size, entries, canonical).write(path)
}
