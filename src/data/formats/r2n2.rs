//! Renderings of 3D-R2N2 (ShapeNetRendering): `rendering_metadata.txt` and a PNG for each of its lines.
//!
//! They are of ShapeNetCore v1's models as they are, which but for a quarter turn is the canonical frame.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    axes,
    calibration::Calibration,
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{MaskSource, mask_in},
    pictures::{self, unusable},
};
use crate::{Error, Result};

const METADATA: &str = "rendering_metadata.txt";
/// Focal length by the width of the picture: a lens of 35 mm before a sensor of 32 mm. The 25 in the
/// metadata is not the field of view.
const FOCAL_RATIO: f64 = 35.0 / 32.0;
/// Distance of the camera where the metadata say 1, in world units.
const FARTHEST: f32 = 1.75;

/// The folder of the metadata that belong to a model's folder.
pub fn find_metadata(folder: &Path) -> Option<PathBuf> {
    ["", "rendering"]
        .map(|below| folder.join(below))
        .into_iter()
        .find(|folder| folder.join(METADATA).is_file())
}

/// Lists `00.png` and its successors; each line holds `azimuth elevation in-plane ratio 25`, in degrees.
pub(super) fn list(folder: &Path, hints: &SequenceHints) -> Result<Listing> {
    let path = folder.join(METADATA);
    hints.refuse_focal().map_err(|reason| unusable(&path, &reason))?;
    let text = fs::read_to_string(&path).map_err(Error::io(&path))?;
    let mut shots = vec![];
    for (idx, line) in text.lines().filter(|line| !line.trim().is_empty()).enumerate() {
        let in_line = |reason: &str| unusable(&path, &format!("line {}: {reason}", idx + 1));
        let values: Option<Vec<f32>> =
            line.split_whitespace().map(|field| field.parse().ok()).collect();
        let Some([azimuth, elevation, in_plane, ratio, _]) = values.as_deref() else {
            return Err(in_line("it does not hold five numbers"));
        };
        if *in_plane != 0.0 || !(*ratio > 0.0 && ratio.is_finite()) {
            return Err(in_line("it turns in the plane, or its distance is not positive"));
        }
        let [azimuth, elevation] = [azimuth, elevation].map(|degrees| degrees.to_radians());
        let name = PathBuf::from(format!("{idx:02}.png"));
        let picture = folder.join(&name);
        let size = pictures::size(&picture, false)?;
        let focal = FOCAL_RATIO * size[0] as f64;
        shots.push(Shot {
            path: picture,
            upright: false,
            mask: match &hints.masks {
                Some(masks) => mask_in(masks, &name),
                None => MaskSource::Background,
            },
            name,
            calibration: Calibration::centered(focal, size).map_err(|reason| in_line(&reason))?,
            size,
            camera_from_world: Some(axes::from_orbit(azimuth, elevation, ratio * FARTHEST)),
        });
    }
    let name = folder.canonicalize().map_err(Error::io(folder))?;
    let name = name.components().rev().find(|part| part.as_os_str() != "rendering");
    let name = name.map(|part| part.as_os_str().to_string_lossy().into_owned());
    let name = name.unwrap_or_default();
    Ok(Listing { name, shots, canonical: true, ..Listing::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgba, RgbaImage};

    fn written(metadata: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let rendering = folder.path().join("rendering");
        fs::create_dir(&rendering).expect("it is writable");
        fs::write(rendering.join(METADATA), metadata).expect("it is writable");
        for idx in 0..2 {
            let picture =
                RgbaImage::from_fn(137, 137, |x, _| Rgba([9, 9, 9, (x > 60) as u8 * 255]));
            picture.save(rendering.join(format!("{idx:02}.png"))).expect("it is writable");
        }
        folder
    }

    #[test]
    fn the_object_is_at_its_distance_on_the_axis() {
        let folder = written("33.25 27.5 0.0 0.8 25\n123.25 27.5 0 0.6 25\n");
        let rendering = find_metadata(folder.path()).expect("it is there");
        let listing = list(&rendering, &SequenceHints::default()).expect("it is usable");
        let (sequence, _) = listing.load(folder.path()).expect("it is usable");
        // The camera matrix of its users: f = 149.84375, and the principal point at 68.5.
        assert_eq!(sequence.intrinsics.focal, [149.84375; 2]);
        assert_eq!(sequence.intrinsics.center, [68.5; 2]);
        let poses = sequence.truth.expect("it has poses").camera_from_world;
        for (pose, ratio) in poses.iter().zip([0.8, 0.6]) {
            let expected = nalgebra::Vector3::new(0.0, 0.0, 1.75 * ratio);
            assert!((pose.translation.vector - expected).norm() < 1e-5);
        }
        assert_eq!(sequence.frames[0].mask.get_pixel(61, 0).0, [1.0]);
    }

    #[test]
    fn broken_metadata_are_refused_by_line() {
        for text in
            ["33 27 0 0.8 25\n33 27 0 0.8", "1 2 0 3 25\n1 2 5 0.8 25", "1 2 0 1 25\n1 2 0 0 25"]
        {
            let folder = written(text);
            let rendering = find_metadata(folder.path()).expect("it is there");
            let error = list(&rendering, &SequenceHints::default()).unwrap_err().to_string();
            assert!(error.contains(METADATA) && error.contains("line 2"), "{error}");
        }
    }
}
