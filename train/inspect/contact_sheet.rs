//! One picture of many models, each from the same side.

use std::path::Path;

use image::{DynamicImage, Rgb, RgbImage, imageops};
use nalgebra::{Unit, Vector3};
use object_pba::{
    Error, Result,
    data::{
        keyed_rng,
        lighting::{Light, Place, Scene},
        mesh::Mesh,
        rasteriser::render,
        viewpoint::{Viewpoint, ViewpointRange},
    },
};

/// Models on a sheet, at most.
pub const MAX_TILES: usize = 100;
/// Side of a tile, in pixels.
const TILE: u32 = 160;
const PAPER: f32 = 0.96;

/// A model as seen from the right of its front and from above.
pub fn draw_tile(mesh: &Mesh) -> RgbImage {
    let range = ViewpointRange {
        azimuth_degrees: [40.0; 2],
        elevation_degrees: [20.0; 2],
        roll_degrees: [0.0; 2],
        field_of_view_degrees: [30.0; 2],
        fill: [0.9; 2],
        off_centre: 0.0,
    };
    let light = Light {
        place: Place::Direction(Unit::new_normalize(Vector3::new(0.3, 1.0, -0.7))),
        color: [0.6; 3],
    };
    let scene =
        Scene { ambient: [0.5; 3], lights: vec![light], ground: None, background: [PAPER; 3] };
    // The ranges leave nothing to chance.
    let mut rng = keyed_rng(0, [0, 0]);
    let size = [TILE as usize; 2];
    let view = Viewpoint::random(&mesh.vertices, size, &range, &mut rng);
    let picture = render(mesh, &scene, &view.camera_from_world, &view.intrinsics, size);
    DynamicImage::ImageRgb32F(picture.color).to_rgb8()
}

/// Writes the tiles row by row, and returns the row and column of each, counted from 1.
pub fn write_contact_sheet(
    path: &Path,
    tiles: &[(usize, RgbImage)],
) -> Result<Vec<(usize, [usize; 2])>> {
    let columns = (tiles.len() as f64).sqrt().ceil().max(1.0) as usize;
    let rows = tiles.len().div_ceil(columns).max(1);
    let paper = Rgb([(PAPER * 255.0).round() as u8; 3]);
    let mut sheet = RgbImage::from_pixel(columns as u32 * TILE, rows as u32 * TILE, paper);
    let mut places = Vec::new();
    for (tile_idx, (model_idx, tile)) in tiles.iter().enumerate() {
        let [row, column] = [tile_idx / columns, tile_idx % columns];
        let [x, y] = [column, row].map(|i| i as i64 * i64::from(TILE));
        imageops::replace(&mut sheet, tile, x, y);
        places.push((*model_idx, [row + 1, column + 1]));
    }
    sheet.save(path).map_err(Error::image(path))?;
    Ok(places)
}
