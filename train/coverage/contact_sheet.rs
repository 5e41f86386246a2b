//! Meshes side by side, all seen from the same place.

use std::path::Path;

use image::{Rgb, RgbImage, imageops};
use nalgebra::{Point3, Unit, Vector3};
use object_pba::{
    Error, Result,
    data::{
        lighting::{Light, Place, Scene},
        mesh::Mesh,
        rasteriser::render,
        viewpoint::{centered_intrinsics, look_at},
    },
};
use rayon::prelude::*;

/// Pixels of a picture.
const TILE: [u32; 2] = [124, 86];
/// Seen across a picture's width from three units away, in radians.
const FIELD_OF_VIEW: f32 = 0.345;
/// Grey of the background.
const PAPER: f32 = 0.96;

/// Writes a page of meshes, row by row, each in the canonical world frame.
pub fn write_contact_sheet(path: &Path, meshes: &[Mesh], n_columns: usize) -> Result<()> {
    let tiles: Vec<RgbImage> = meshes.par_iter().map(tile).collect();
    let [width, height] = TILE;
    let n_rows = tiles.len().div_ceil(n_columns);
    let paper = Rgb([(PAPER * 255.0) as u8; 3]);
    let mut page = RgbImage::from_pixel(width * n_columns as u32, height * n_rows as u32, paper);
    for (idx, tile) in tiles.iter().enumerate() {
        let [column, row] = [idx % n_columns, idx / n_columns].map(|i| i as i64);
        imageops::replace(&mut page, tile, column * i64::from(width), row * i64::from(height));
    }
    page.save(path).map_err(Error::image(path))
}

/// A car from its front left, slightly from above.
fn tile(mesh: &Mesh) -> RgbImage {
    let size = TILE.map(|side| side as usize);
    let towards_camera = Vector3::new(-1.6, 1.0, -1.9).normalize();
    let camera_from_world = look_at(Point3::from(towards_camera * 3.0), Point3::origin());
    let sun = Light {
        place: Place::Direction(Unit::new_normalize(Vector3::new(-0.4, 1.0, -0.9))),
        color: [0.7; 3],
    };
    let scene =
        Scene { ambient: [0.5; 3], lights: vec![sun], ground: None, background: [PAPER; 3] };
    let intrinsics = centered_intrinsics(size, FIELD_OF_VIEW);
    let picture = render(mesh, &scene, &camera_from_world, &intrinsics, size).color;
    RgbImage::from_fn(TILE[0], TILE[1], |x, y| {
        Rgb(picture[(x, y)].0.map(|value| (value * 255.0).round() as u8))
    })
}
