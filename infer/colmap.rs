//! COLMAP on a sequence, by its own program: features, matches, incremental mapping.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use image::{DynamicImage, GrayImage, Luma};
use nalgebra::Isometry3;
use object_pba::{
    data::{
        formats::colmap::{find_model, read_poses},
        sequence::Sequence,
    },
    silhouette::MASK_THRESHOLD,
};

/// Poses of the frames that COLMAP registered, by their files; its world is its own.
///
/// The camera is given and stays as it is; with `masked`, features lie on the object only. Pictures,
/// database and models are left in `folder`.
pub fn poses(
    program: &Path,
    sequence: &Sequence,
    folder: &Path,
    masked: bool,
) -> Result<Vec<(PathBuf, Isometry3<f32>)>> {
    let folders = ["images", "masks", "sparse"].map(|name| folder.join(name));
    let database = folder.join("database.db");
    // A database of an interrupted run would be added to.
    let _ = fs::remove_dir_all(folder);
    for folder in &folders {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot create {}", folder.display()))?;
    }
    let [images, masks, sparse] = &folders;
    write_pictures(sequence, images, masks)?;
    let camera = &sequence.intrinsics;
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.center);
    let parameters = format!("{fx},{fy},{cx},{cy}");
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let (database, images, masks, sparse) =
        (text(&database), text(images), text(masks), text(sparse));

    let mut features = vec!["feature_extractor", "--database_path", &database];
    features.extend(["--image_path", &images, "--ImageReader.single_camera", "1"]);
    features.extend(["--ImageReader.camera_model", "PINHOLE"]);
    features.extend(["--ImageReader.camera_params", &parameters, "--SiftExtraction.use_gpu", "0"]);
    if masked {
        features.extend(["--ImageReader.mask_path", &masks]);
    }
    run(program, &features)?;
    let matches =
        ["exhaustive_matcher", "--database_path", &database, "--SiftMatching.use_gpu", "0"];
    run(program, &matches)?;
    let mut mapper = vec!["mapper", "--database_path", &database, "--image_path", &images];
    mapper.extend(["--output_path", &sparse, "--Mapper.ba_refine_focal_length", "0"]);
    mapper.extend(["--Mapper.ba_refine_principal_point", "0"]);
    mapper.extend(["--Mapper.ba_refine_extra_params", "0"]);
    run(program, &mapper)?;
    registered(sequence, Path::new(&sparse))
}

/// The largest of the models that the mapper left.
fn registered(sequence: &Sequence, sparse: &Path) -> Result<Vec<(PathBuf, Isometry3<f32>)>> {
    let entries =
        fs::read_dir(sparse).with_context(|| format!("cannot read {}", sparse.display()))?;
    let mut largest = Vec::new();
    for entry in entries {
        let Some((model, encoding)) = find_model(&entry?.path()) else { continue };
        let poses = read_poses(&model, encoding)?;
        if poses.len() > largest.len() {
            largest = poses;
        }
    }
    let frame_of = |name: &Path| {
        let stem = name.file_stem()?.to_str()?;
        let idx: usize = stem.strip_prefix("frame_")?.parse().ok()?;
        Some(sequence.frames.get(idx)?.path.clone())
    };
    let found: Vec<_> =
        largest.into_iter().filter_map(|(name, pose)| Some((frame_of(&name)?, pose))).collect();
    if found.len() < 2 {
        bail!("COLMAP registered {} of {} frames", found.len(), sequence.frames.len());
    }
    Ok(found)
}

/// Frames as `frame_000.png`, and masks under the names that COLMAP looks for.
fn write_pictures(sequence: &Sequence, images: &Path, masks: &Path) -> Result<()> {
    let threshold = MASK_THRESHOLD;
    for (idx, frame) in sequence.frames.iter().enumerate() {
        let path = images.join(format!("frame_{idx:03}.png"));
        let picture = DynamicImage::from(frame.color.clone()).into_rgb8();
        picture.save(&path).with_context(|| format!("cannot write {}", path.display()))?;
        let path = masks.join(format!("frame_{idx:03}.png.png"));
        let (width, height) = frame.mask.dimensions();
        let mask = GrayImage::from_fn(width, height, |x, y| {
            Luma([if frame.mask.get_pixel(x, y).0[0] > threshold { 255 } else { 0 }])
        });
        mask.save(&path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

fn run(program: &Path, arguments: &[&str]) -> Result<()> {
    let output = Command::new(program).args(arguments).output().with_context(|| {
        format!("{} cannot be started; install COLMAP or give --colmap PATH", program.display())
    })?;
    if !output.status.success() {
        let message = String::from_utf8_lossy(&output.stderr);
        let last = message.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
        bail!("COLMAP's {} failed ({}): {last}", arguments[0], output.status);
    }
    Ok(())
}
