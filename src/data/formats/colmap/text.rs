//! COLMAP's text files.

use std::{fmt::Write, fs, path::Path, str::FromStr};

use super::{Image, Model, lenses};
use crate::{
    Error, Result,
    data::formats::{Trajectory, axes, pictures::unusable, ply::PointCloud, write_atomically},
};

/// Reads `cameras.txt` and `images.txt`.
pub fn read(cameras_path: &Path, images_path: &Path) -> Result<Model> {
    let mut model = Model::default();
    for_each_line(cameras_path, |_, line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [id, name, width, height, ref parameters @ ..] = fields[..] else {
            return Err("CAMERA_ID, MODEL, WIDTH and HEIGHT are expected".into());
        };
        let parameters: Vec<f64> =
            parameters.iter().map(|field| number(field)).collect::<Result<_, _>>()?;
        let size = [number(width)?, number(height)?];
        model.cameras.insert(number(id)?, lenses::camera(name, size, &parameters)?);
        Ok(())
    })?;
    for_each_line(images_path, |lines, line| {
        model.images.push(image(line)?);
        // The line of its 2D points, which may be empty.
        lines.next();
        Ok(())
    })?;
    Ok(model)
}

/// Writes `cameras.txt`, `images.txt` and `points3D.txt` into a folder that exists.
pub fn write(folder: &Path, trajectory: &Trajectory, cloud: &PointCloud) -> Result<()> {
    let Trajectory { intrinsics, size: [width, height], .. } = trajectory;
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.center);
    let cameras = format!("1 PINHOLE {width} {height} {fx} {fy} {cx} {cy}\n");
    write_atomically(&folder.join("cameras.txt"), cameras.as_bytes())?;

    let mut images = String::new();
    for (idx, (pose, picture)) in
        trajectory.camera_from_world.iter().zip(&trajectory.pictures).enumerate()
    {
        let ([w, i, j, k], [x, y, z]) = axes::to_colmap(pose);
        let name = below_images(picture).display();
        // The empty line stands for 2D points.
        let line = format!("{} {w} {i} {j} {k} {x} {y} {z} 1 {name}\n\n", idx + 1);
        images += &line;
    }
    write_atomically(&folder.join("images.txt"), images.as_bytes())?;

    let mut points = String::new();
    for (idx, point) in cloud.points.iter().enumerate() {
        let [r, g, b] = cloud.color(idx);
        let [x, y, z] = [point.x, point.y, point.z];
        writeln!(points, "{} {x} {y} {z} {r} {g} {b} 0", idx + 1).expect("a string grows");
    }
    write_atomically(&folder.join("points3D.txt"), points.as_bytes())
}

/// COLMAP's names start below the folder of the pictures.
fn below_images(picture: &Path) -> &Path {
    let mut rest = picture;
    for up in [".", ".."] {
        while let Ok(below) = rest.strip_prefix(up) {
            rest = below;
        }
    }
    rest.strip_prefix("images").unwrap_or(rest)
}

/// Calls back for each line that is neither empty nor a comment; errors name its number.
fn for_each_line(
    path: &Path,
    mut read: impl FnMut(&mut dyn Iterator<Item = (usize, String)>, &str) -> Result<(), String>,
) -> Result<()> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    let mut lines = text.lines().enumerate().map(|(idx, line)| (idx + 1, line.trim().to_string()));
    while let Some((line_number, line)) = lines.next() {
        if !line.is_empty() && !line.starts_with('#') {
            let in_line = |reason| unusable(path, &format!("line {line_number}: {reason}"));
            read(&mut lines, &line).map_err(in_line)?;
        }
    }
    Ok(())
}

/// `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, where the name may hold spaces.
fn image(line: &str) -> Result<Image, String> {
    let mut rest = line;
    let mut fields = vec![];
    for _ in 0..9 {
        let (field, tail) = rest
            .split_once(char::is_whitespace)
            .ok_or("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID and NAME are expected")?;
        fields.push(field);
        rest = tail.trim_start();
    }
    let value = |idx: usize| number(fields[idx]);
    let quaternion = [value(1)?, value(2)?, value(3)?, value(4)?];
    let translation = [value(5)?, value(6)?, value(7)?];
    Ok(Image {
        name: rest.into(),
        camera_id: number(fields[8])?,
        camera_from_world: axes::from_colmap(quaternion, translation)?,
    })
}

fn number<T: FromStr>(field: &str) -> Result<T, String> {
    field.parse().map_err(|_| format!("{field:?} is not a number that belongs there"))
}
