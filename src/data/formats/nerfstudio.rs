//! Sequences as folders with a `transforms.json`, as NeRF and nerfstudio lay them out.
//!
//! Beyond that format: `"world": "canonical"` says that poses are in the object's canonical frame, and
//! `points.ply`, if there, is its true surface. Keys that we do not know are other programs' business.

#[cfg(test)]
mod tests;
mod transforms;

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::DynamicImage;

use super::{
    Trajectory,
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{MaskSource, mask_beside, mask_in, mask_to_luma8},
    pictures::{self, unusable, write_png},
    ply::{PointCloud, read_points, write_points},
};
use crate::{Error, Result, data::sequence::Sequence};
use transforms::{FrameEntry, Transforms};

pub const TRANSFORMS: &str = "transforms.json";
const POINTS: &str = "points.ply";

/// Lists the frames of a `transforms.json`, whatever its name.
pub(super) fn list(path: &Path, hints: &SequenceHints) -> Result<Listing> {
    let unusable = |reason: String| unusable(path, &reason);
    hints.refuse_focal().map_err(unusable)?;
    let transforms = read_transforms(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut shots = vec![];
    for (idx, entry) in transforms.frames.iter().enumerate() {
        let in_frame = |reason: String| unusable(format!("frame {idx}: {reason}"));
        let path = with_extension(folder.join(&entry.file_path));
        let lens = transforms.lens(entry);
        let size = match lens.size() {
            Some(size) => size,
            None => pictures::size(&path, false)?,
        };
        let mask = match (&hints.masks, &entry.mask_path) {
            (Some(masks), _) => {
                mask_in(masks, entry.file_path.file_name().unwrap_or_default().as_ref())
            }
            (None, Some(mask_path)) => MaskSource::File(folder.join(mask_path)),
            (None, None) => mask_beside(folder, below_pictures(&entry.file_path)),
        };
        shots.push(Shot {
            path,
            name: entry.file_path.clone(),
            upright: false,
            mask,
            calibration: lens.calibration(size).map_err(in_frame)?,
            size,
            camera_from_world: entry.camera_from_world().map_err(in_frame)?,
        });
    }
    let points_path = folder.join(POINTS);
    Ok(Listing {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        shots,
        canonical: transforms.canonical(),
        points: points_path.exists().then(|| read_points(&points_path)).transpose()?,
        notes: vec![],
    })
}

/// Reads cameras without their pictures; the file must state one camera, its size and every pose.
pub fn read_trajectory(path: &Path) -> Result<Trajectory> {
    let unusable = |reason: String| unusable(path, &reason);
    let transforms = read_transforms(path)?;
    let lens = transforms.lens(&FrameEntry::default());
    let size = lens.size().ok_or_else(|| unusable("it states no w and h".into()))?;
    let intrinsics = lens.calibration(size).map_err(unusable)?.intrinsics;
    let mut camera_from_world = vec![];
    for (idx, entry) in transforms.frames.iter().enumerate() {
        let in_frame = |reason: String| unusable(format!("frame {idx}: {reason}"));
        let pose = entry.camera_from_world().map_err(in_frame)?;
        camera_from_world.push(pose.ok_or_else(|| in_frame("it has no transform_matrix".into()))?);
    }
    let pictures = transforms.frames.iter().map(|entry| entry.file_path.clone()).collect();
    let canonical = transforms.canonical();
    Ok(Trajectory { intrinsics, size, camera_from_world, pictures, canonical })
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

/// Writes cameras, for example estimated ones, of pictures that have files already.
pub fn write_trajectory(path: &Path, trajectory: &Trajectory) -> Result<()> {
    let Trajectory { intrinsics, size, camera_from_world, pictures, canonical } = trajectory;
    let entries = camera_from_world
        .iter()
        .zip(pictures)
        .map(|(pose, picture)| FrameEntry::new(picture.clone(), None, Some(pose)))
        .collect();
    Transforms::new(intrinsics, *size, entries, *canonical).write(path)
}

fn read_transforms(path: &Path) -> Result<Transforms> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    let transforms: Transforms =
        serde_json::from_str(&text).map_err(|error| unusable(path, &error.to_string()))?;
    match transforms.frames.is_empty() {
        true => Err(unusable(path, "it has no frames")),
        false => Ok(transforms),
    }
}

/// NeRF's own files leave out `.png`.
fn with_extension(path: PathBuf) -> PathBuf {
    if path.extension().is_none() && !path.exists() { path.with_extension("png") } else { path }
}

/// The name that a picture's mask shares: `images/left/a.png` has its mask at `masks/left/a.png`.
fn below_pictures(file_path: &Path) -> &Path {
    let path = file_path.strip_prefix("./").unwrap_or(file_path);
    path.strip_prefix("images").unwrap_or(path)
}
