//! Folders of the SRN data set: `intrinsics.txt`, `rgb/*.png` and `pose/*.txt`.
//!
//! Pictures have no masks. The object is what their alpha channel covers or, as in the data set itself,
//! all but the white (or black) that is joined to the border. Poses are of the renderer's world. The
//! intrinsics may be those of larger pictures: the data set's `cars_train` has them for 512 pixels of
//! width, beside pictures of 128.

use std::{fs, ops::Range, path::Path};

use nalgebra::Isometry3;

use super::{
    axes::{self, TransformMatrix},
    calibration::{Calibration, Distortion},
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{MaskSource, mask_in},
    pictures::{self, pictures_in, unusable},
};
use crate::{Error, Result};

/// What may be a picture's side, in pixels.
const SIDES: Range<f64> = 1.0..1e6;

/// Whether a folder is laid out like this.
pub fn is_srn(folder: &Path) -> bool {
    folder.join("intrinsics.txt").is_file()
        && folder.join("rgb").is_dir()
        && folder.join("pose").is_dir()
}

/// Lists the pictures in `rgb/`.
pub(super) fn list(folder: &Path, hints: &SequenceHints) -> Result<Listing> {
    let path = folder.join("intrinsics.txt");
    hints.refuse_focal().map_err(|reason| unusable(&path, &reason))?;
    let camera = read_intrinsics(&path)?;
    let mut listing = Listing::default();
    for path in pictures_in(&folder.join("rgb"))? {
        let size = pictures::size(&path, false)?;
        let calibration = camera.scaled_to(size).map_err(|reason| unusable(&path, &reason))?;
        let name = Path::new("rgb").join(path.file_name().unwrap_or_default());
        let stem = path.file_stem().unwrap_or_default();
        let pose_path = folder.join("pose").join(stem).with_extension("txt");
        let mask = match &hints.masks {
            Some(masks) => mask_in(masks, path.file_name().unwrap_or_default().as_ref()),
            None => MaskSource::Background,
        };
        let camera_from_world = Some(read_pose(&pose_path)?);
        if listing.shots.is_empty() && size != camera.size {
            let note = format!("intrinsics of {:?} pixels scaled to {size:?}", camera.size);
            listing.notes.push(note);
        }
        let shot = Shot { path, name, upright: false, mask, calibration, size, camera_from_world };
        listing.shots.push(shot);
    }
    listing.name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(listing)
}

/// The pinhole of an `intrinsics.txt`, in pixels of pictures of `size` = `[width, height]`.
struct Camera {
    focal: f64,
    center: [f64; 2],
    size: [usize; 2],
}

impl Camera {
    /// The same for smaller or larger pictures of the same view.
    fn scaled_to(&self, size: [usize; 2]) -> Result<Calibration, String> {
        if size[0] * self.size[1] != size[1] * self.size[0] {
            let taken = self.size;
            return Err(format!("it is {size:?} pixels, and its intrinsics are of {taken:?}"));
        }
        let scale = size[0] as f64 / self.size[0] as f64;
        let center = self.center.map(|coordinate| coordinate * scale);
        Calibration::new([self.focal * scale; 2], center, Distortion::default())
    }
}

/// `f cx cy 0.`, then what a grid takes and we need not, `height width`, and perhaps a 1 if poses were
/// the other way round.
fn read_intrinsics(path: &Path) -> Result<Camera> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    let lines: Vec<Vec<f64>> = text.lines().map(numbers).filter(|line| !line.is_empty()).collect();
    let first = lines.first().map(Vec::as_slice).unwrap_or_default();
    // Between them, the grid's origin has three numbers, its scale one.
    let is_size = |line: &Vec<f64>| line.len() == 2 && line.iter().all(|l| SIDES.contains(l));
    let size_at = lines.iter().position(is_size);
    let (&[focal, cx, cy, ..], Some(size_at)) = (first, size_at) else {
        let reason = "its first line is not f, cx, cy and 0, or none holds height and width";
        return Err(unusable(path, reason));
    };
    if lines[size_at + 1..].iter().any(|line| line[0] != 0.0) {
        return Err(unusable(path, "it says that poses are camera from world"));
    }
    let [width, height] = [lines[size_at][1], lines[size_at][0]].map(|side| side as usize);
    let camera = Camera { focal, center: [cx, cy], size: [width, height] };
    camera.scaled_to(camera.size).map_err(|reason| unusable(path, &reason))?;
    Ok(camera)
}

/// World from camera, 16 numbers row by row.
fn read_pose(path: &Path) -> Result<Isometry3<f32>> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    let values = numbers(&text);
    let (&[a, b, c, d], []) = values.as_chunks::<4>() else {
        return Err(unusable(path, "it does not hold 16 numbers"));
    };
    let matrix: TransformMatrix = [a, b, c, d];
    axes::from_opencv_matrix(&matrix).map_err(|reason| unusable(path, &reason))
}

/// The numbers in a text; nothing if anything else is in it.
fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace()
        .map(|field| field.parse().ok())
        .collect::<Option<_>>()
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};

    /// Two pictures of a dark square on white, from a camera 1.3 behind the origin, then 1.3 to the
    /// left of it, looking along +x.
    fn written() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("it is below")).expect("it is writable");
            fs::write(path, text).expect("it is writable");
        };
        write("intrinsics.txt", "131.250000 64.000000 63.000000 0.\n0. 0. 0.\n1.\n126 128\n");
        write("pose/000000.txt", "1 0 0 0 0 1 0 0 0 0 1 -1.3 0 0 0 1");
        write("pose/000001.txt", "0 0 1 -1.3\n0 1 0 0\n-1 0 0 0\n0 0 0 1\n");
        fs::create_dir(folder.path().join("rgb")).expect("it is writable");
        for idx in 0..2 {
            let picture = RgbImage::from_fn(128, 126, |x, y| {
                let inside = (40..80).contains(&x) && (40..80).contains(&y);
                Rgb(if inside { [40, 50, 60] } else { [255; 3] })
            });
            let path = folder.path().join(format!("rgb/{idx:06}.png"));
            picture.save(path).expect("it is writable");
        }
        folder
    }

    #[test]
    fn folders_are_read() {
        let folder = written();
        assert!(is_srn(folder.path()));
        let listing = list(folder.path(), &SequenceHints::default()).expect("it is usable");
        let (sequence, _) = listing.load(folder.path()).expect("it is usable");
        assert_eq!((sequence.size, sequence.intrinsics.focal), ([128, 126], [131.25; 2]));
        assert_eq!(sequence.intrinsics.center, [64.0, 63.0]);
        let covered: f32 = sequence.frames[1].mask.as_raw().iter().sum();
        assert_eq!(covered, 1600.0);
        let truth = sequence.truth.expect("it has poses");
        assert!(!truth.canonical);
        // The origin lies 1.3 ahead of both; +z is to the left of the second.
        for pose in &truth.camera_from_world {
            assert!(
                (pose.translation.vector - nalgebra::Vector3::new(0.0, 0.0, 1.3)).norm() < 1e-6
            );
        }
        let point = truth.camera_from_world[1] * nalgebra::Point3::new(0.0, 0.0, 1.0);
        assert!((point - nalgebra::Point3::new(-1.0, 0.0, 1.3)).norm() < 1e-6, "{point}");
    }

    #[test]
    fn intrinsics_are_scaled_to_the_pictures() {
        let folder = written();
        let path = folder.path().join("intrinsics.txt");
        // As DeepVoxels writes them, with the nearest depth of its grid and a direction of poses.
        fs::write(&path, "525. 256. 252. 0.\n0. 0. 0.\n0.\n1.\n504 512\n0\n").expect("writable");
        let listing = list(folder.path(), &SequenceHints::default()).expect("it is usable");
        let (sequence, notes) = listing.load(folder.path()).expect("it is usable");
        assert_eq!((sequence.size, sequence.intrinsics.focal), ([128, 126], [131.25; 2]));
        assert_eq!(sequence.intrinsics.center, [64.0, 63.0]);
        assert!(notes[0].contains("scaled"), "{notes:?}");

        fs::write(&path, "525. 256. 256. 0.\n0. 0. 0.\n1.\n512 512\n").expect("writable");
        let error = list(folder.path(), &SequenceHints::default()).unwrap_err().to_string();
        assert!(error.contains("000000.png") && error.contains("[512, 512]"), "{error}");
    }

    #[test]
    fn broken_folders_are_refused_by_file() {
        for (name, text, reason) in [
            ("intrinsics.txt", "f cx cy\n1 2", "first line"),
            ("intrinsics.txt", "", "first line"),
            ("intrinsics.txt", "0 64 64 0\n128 128", "focal"),
            ("intrinsics.txt", "131 64 64 0\n0 0 0\n1\n0 128", "height"),
            ("intrinsics.txt", "131 64 64 0\n0 0 0\n1\n126 128\n1", "camera from world"),
            ("pose/000001.txt", "1 2 3", "16 numbers"),
            ("pose/000001.txt", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "rotation"),
        ] {
            let folder = written();
            fs::write(folder.path().join(name), text).expect("it is writable");
            let error = list(folder.path(), &SequenceHints::default()).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(reason), "{error}");
        }
    }
}
