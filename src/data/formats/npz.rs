//! Cameras and cloud as NumPy arrays, for `numpy.load`.

use std::{
    io::{self, Cursor, Write},
    path::Path,
};

use npyz::{AutoSerialize, WriterBuilder};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{Trajectory, ply::PointCloud, write_atomically};
use crate::{Error, Result};

/// Writes `camera_from_world` [L, 4, 4], `intrinsics` K [3, 3], `size` (width, height), `points` [N, 3]
/// and, where known, `colors` `[N, 3]` and `visible` `[N]`. Camera axes are OpenCV's.
pub fn write(path: &Path, trajectory: &Trajectory, cloud: &PointCloud) -> Result<()> {
    let bytes = archive(trajectory, cloud).map_err(Error::io(path))?;
    write_atomically(path, &bytes)
}

fn archive(trajectory: &Trajectory, cloud: &PointCloud) -> io::Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(vec![]));
    let matrices = trajectory.camera_from_world.iter().map(|pose| pose.to_homogeneous());
    // nalgebra stores columns; NumPy wants rows.
    let poses: Vec<f32> =
        matrices.flat_map(|matrix| matrix.transpose().as_slice().to_vec()).collect();
    add(&mut archive, "camera_from_world", &[trajectory.camera_from_world.len(), 4, 4], &poses)?;
    let ([fx, fy], [cx, cy]) = (trajectory.intrinsics.focal, trajectory.intrinsics.center);
    add(&mut archive, "intrinsics", &[3, 3], &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])?;
    add(&mut archive, "size", &[2], &trajectory.size.map(|side| side as i64))?;

    let n_points = cloud.points.len();
    let points: Vec<f32> =
        cloud.points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
    add(&mut archive, "points", &[n_points, 3], &points)?;
    if let Some(colors) = &cloud.colors {
        add(&mut archive, "colors", &[colors.len(), 3], colors.as_flattened())?;
    }
    if let Some(visible) = &cloud.visible {
        add(&mut archive, "visible", &[visible.len()], visible)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// Adds an array of this shape, its values in row-major order.
fn add<T: AutoSerialize + Copy>(
    archive: &mut ZipWriter<Cursor<Vec<u8>>>,
    name: &str,
    shape: &[usize],
    values: &[T],
) -> io::Result<()> {
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    archive.start_file(format!("{name}.npy"), stored)?;
    let shape: Vec<u64> = shape.iter().map(|&length| length as u64).collect();
    let mut bytes = vec![];
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes);
    let mut writer = options.begin_nd()?;
    writer.extend(values.iter().copied())?;
    writer.finish()?;
    archive.write_all(&bytes)
}
