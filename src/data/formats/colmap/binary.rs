//! COLMAP's binary files, little-endian throughout.

use std::{fs, path::Path};

use super::{Image, Model, lenses};
use crate::{
    Error, Result,
    data::formats::{axes, pictures::unusable},
};

/// Bytes of a 2D point: x, y and the id of its 3D point.
const POINT_2D: usize = 24;

/// Reads `cameras.bin` and `images.bin`.
pub fn read(cameras_path: &Path, images_path: &Path) -> Result<Model> {
    let mut model = Model::default();
    for_each_record(cameras_path, |file| {
        let id = file.u32()?;
        let (name, n_parameters) = lenses::model(file.u32()?.cast_signed())?;
        let size = [file.length()?, file.length()?];
        let parameters = (0..n_parameters).map(|_| file.f64()).collect::<Result<Vec<_>, _>>()?;
        model.cameras.insert(id, lenses::camera(name, size, &parameters)?);
        Ok(())
    })?;
    for_each_record(images_path, |file| {
        let _image_id = file.u32()?;
        let quaternion = [file.f64()?, file.f64()?, file.f64()?, file.f64()?];
        let translation = [file.f64()?, file.f64()?, file.f64()?];
        let camera_from_world = axes::from_colmap(quaternion, translation)?;
        let camera_id = file.u32()?;
        let name = file.text()?;
        let n_points = file.length()?;
        file.take(n_points.saturating_mul(POINT_2D))?;
        model.images.push(Image { name, camera_id, camera_from_world });
        Ok(())
    })?;
    Ok(model)
}

/// Calls back as often as the file's first number says; errors name the record.
fn for_each_record(
    path: &Path,
    mut read: impl FnMut(&mut Bytes) -> Result<(), String>,
) -> Result<()> {
    let bytes = fs::read(path).map_err(Error::io(path))?;
    let mut file = Bytes(&bytes);
    let n_records = file.length().map_err(|reason| unusable(path, &reason))?;
    for idx in 0..n_records {
        read(&mut file).map_err(|reason| unusable(path, &format!("record {idx}: {reason}")))?;
    }
    Ok(())
}

/// What is left to read of a file.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let (head, tail) = self.0.split_at_checked(n).ok_or("the file ends early")?;
        self.0 = tail;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32, String> {
        self.array().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, String> {
        self.array().map(f64::from_le_bytes)
    }

    /// A 64-bit count or side.
    fn length(&mut self) -> Result<usize, String> {
        let length = self.array().map(u64::from_le_bytes)?;
        usize::try_from(length).map_err(|_| format!("{length} is too large"))
    }

    /// Up to a zero byte.
    fn text(&mut self) -> Result<String, String> {
        let end = self.0.iter().position(|byte| *byte == 0).ok_or("the file ends early")?;
        let text = self.take(end)?.to_vec();
        self.take(1)?;
        String::from_utf8(text).map_err(|_| "an image's name is not UTF-8".into())
    }
}
