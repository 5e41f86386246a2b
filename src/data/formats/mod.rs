//! Files that other programs read and write too.

pub mod axes;
pub mod hints;
pub mod layout;
pub mod nerfstudio;
pub mod colmap;
pub mod ply;
pub mod webdataset;
pub mod tum;
pub mod glb;
pub mod npz;
mod calibration;
mod exif;
mod listing;
mod masks;
mod natural_order;
mod pictures;
mod plain;
mod r2n2;
mod srn;
mod undistortion;
mod video;

use std::{
    fs,
    path::{Path, PathBuf},
    process,
};

use nalgebra::Isometry3;

use crate::{Error, Result, camera::Intrinsics};
pub use hints::SequenceHints;
pub use layout::{Layout, Reading, read_sequence};

/// One camera on its way, without the pictures that it took: what files of cameras hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    pub intrinsics: Intrinsics,
    /// `[width, height]` of every picture, in pixels.
    pub size: [usize; 2],
    /// One pose a picture.
    pub camera_from_world: Vec<Isometry3<f32>>,
    /// The pictures' files.
    pub pictures: Vec<PathBuf>,
    /// Whether the world is the object's canonical frame.
    pub canonical: bool,
}

/// Writes a file in one step: readers see the old one or the new one, never half of it.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.partial", process::id()));
    let partial = path.with_file_name(name);
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    written.map_err(|error| {
        // The first error is the one to report; there may be nothing to clean up.
        let _ = fs::remove_file(&partial);
        Error::io(path)(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("file");
        for text in ["old", "new"] {
            write_atomically(&path, text.as_bytes()).expect("it is writable");
            assert_eq!(fs::read_to_string(&path).expect("it is there"), text);
        }
        assert_eq!(fs::read_dir(folder.path()).expect("it is there").count(), 1);
        let error = write_atomically(&folder.path().join("no/such"), b"").unwrap_err();
        assert!(error.to_string().contains("no/such"), "{error}");
    }
}
