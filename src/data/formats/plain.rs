//! Folders of pictures and masks, without any file that describes the camera.

use std::path::{Path, PathBuf};

use super::{
    calibration::Calibration,
    exif::focal_in_pixels,
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{mask_beside, mask_in},
    pictures::{self, pictures_in, unusable},
};
use crate::Result;

/// Where pictures lie below the folder of a sequence.
const PICTURE_FOLDERS: [&str; 5] = ["images", "rgb", "frames", "pictures", ""];

/// The folder of the pictures, relative to that of the sequence.
pub fn find_pictures(folder: &Path) -> Result<Option<PathBuf>> {
    for below in PICTURE_FOLDERS {
        if !pictures_in(&folder.join(below))?.is_empty() {
            return Ok(Some(below.into()));
        }
    }
    Ok(None)
}

/// Lists pictures by one camera, whose focal length is a hint's or, picture by picture, EXIF's.
pub(super) fn list(folder: &Path, below: &Path, hints: &SequenceHints) -> Result<Listing> {
    let mut notes = vec![];
    let mut shots: Vec<Shot> = vec![];
    for path in pictures_in(&folder.join(below))? {
        let size = pictures::size(&path, true)?;
        if let Some(first) = shots.first().filter(|first| first.size != size) {
            let reason = format!("it is {size:?} pixels, and the first picture {:?}", first.size);
            return Err(unusable(&path, &reason));
        }
        let given = hints.calibration(size).map_err(|reason| unusable(&path, &reason))?;
        let calibration = match given {
            Some(calibration) => calibration,
            None => from_exif(&path, size)?,
        };
        if given.is_none() && shots.is_empty() {
            let focal = calibration.intrinsics.focal[0];
            let name = path.file_name().unwrap_or_default().display();
            notes.push(format!(
                "focal length from EXIF, {focal:.1} px in {name}; --focal or --fov would say better"
            ));
        }
        let file_name = Path::new(path.file_name().unwrap_or_default());
        shots.push(Shot {
            name: below.join(file_name),
            upright: true,
            mask: match &hints.masks {
                Some(masks) => mask_in(masks, file_name),
                None => mask_beside(folder, file_name),
            },
            calibration,
            size,
            camera_from_world: None,
            path,
        });
    }
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Listing { name, shots, notes, ..Listing::default() })
}

fn from_exif(path: &Path, size: [usize; 2]) -> Result<Calibration> {
    let reason = "its focal length is not known, and its EXIF data do not tell; give --focal (pixels) or --fov (degrees across the width)";
    let focal = focal_in_pixels(path, size).ok_or_else(|| unusable(path, reason))?;
    Calibration::centered(focal, size).map_err(|reason| unusable(path, &reason))
}
