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
        "images/0000.png",
        "images/0001.png",
        "images/0002.png",
        "images/0003.png",
        "images/0004.png",
        "images/0005.png",
        "images/0006.png",
        "images/0007.png",
        "images/0008.png",
        "images/0009.png",
        "images/0010.png",
        "images/0011.png",
        "images/0012.png",
        "images/0013.png",
        "images/0014.png",
        "masks/0000.png",
        "masks/0001.png",
        "masks/0002.png",
        "masks/0003.png",
        "masks/0004.png",
        "masks/0005.png",
        "masks/0006.png",
        "masks/0007.png",
        "masks/0008.png",
        "masks/0009.png",
        "masks/0010.png",
        "masks/0011.png",
        "masks/0012.png",
        "masks/0013.png",
        "masks/0014.png",
    ];
    for (name, bytes) in files {
        let path = folder.join(name);
        let parent = path.parent().expect("below the folder");
        fs::create_dir_all(parent).map_err(Error::io(parent))?;
        fs::write(&path, bytes).map_err(Error::io(&path))?;
    }
    Ok(())
}
