//! What is compiled into the binary: a small car prior, and a sequence to try it on.

use std::{fs, path::Path};

use burn::tensor::Device;
use object_pba::{Error, Result, checkpoint::Prior};

/// The car prior of `assets/car-prior`; its model card says what it was trained on.
pub fn car_prior(device: &Device) -> Result<Prior> {
    Prior::load_bytes(
        include_str!("../assets/car-prior/config.toml"),
        include_bytes!("../assets/car-prior/prior.safetensors"),
        include_bytes!("../assets/car-prior/regressors.safetensors"),
        device,
    )
}

/// Names and contents of files below `assets/sample-sequence`.
macro_rules! sample_files {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_bytes!(concat!("../assets/sample-sequence/", $name)).as_slice())),*]
    };
}

/// Writes the sample sequence to `folder`.
pub fn unpack_sample_sequence(folder: &Path) -> Result<()> {
    let files = sample_files![
        "transforms.json",
        "points.ply",
        "images/frame_000.png",
        "images/frame_001.png",
        "images/frame_002.png",
        "images/frame_003.png",
        "images/frame_004.png",
        "images/frame_005.png",
        "images/frame_006.png",
        "images/frame_007.png",
        "images/frame_008.png",
        "images/frame_009.png",
        "images/frame_010.png",
        "images/frame_011.png",
        "images/frame_012.png",
        "images/frame_013.png",
        "images/frame_014.png",
        "masks/frame_000.png",
        "masks/frame_001.png",
        "masks/frame_002.png",
        "masks/frame_003.png",
        "masks/frame_004.png",
        "masks/frame_005.png",
        "masks/frame_006.png",
        "masks/frame_007.png",
        "masks/frame_008.png",
        "masks/frame_009.png",
        "masks/frame_010.png",
        "masks/frame_011.png",
        "masks/frame_012.png",
        "masks/frame_013.png",
        "masks/frame_014.png",
    ];
    for (name, bytes) in files {
        let path = folder.join(name);
        let parent = path.parent().expect("below the folder");
        fs::create_dir_all(parent).map_err(Error::io(parent))?;
        fs::write(&path, bytes).map_err(Error::io(&path))?;
    }
    Ok(())
}
