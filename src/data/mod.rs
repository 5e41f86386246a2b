//! Meshes in, images out. Plain host code: nothing here knows of tensors.
//!
//! World frame: ShapeNetCore v2's axes (up +Y, front −Z), bounding-box centre at the origin and
//! diagonal 1. Cameras follow OpenCV (x right, y down, z forward).

pub mod mesh;
pub mod mesh_file;
mod polygon;
mod obj;
mod glb;
mod ply_mesh;
mod off;
pub mod collection;
pub mod shapenet;
pub mod surface;
pub mod surface_cache;
pub mod procedural;
pub mod texture;
pub mod lighting;
pub mod rasteriser;
pub mod viewpoint;
pub mod bilinear;
pub mod crop;
pub mod cloud_picture;
pub mod sequence;
pub mod formats;

use image::{ImageBuffer, Luma};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// RGB in [0, 1].
pub type ColorImage = image::Rgb32FImage;
/// One value a pixel: a mask's coverage in [0, 1], or a depth in world units.
pub type ScalarImage = ImageBuffer<Luma<f32>, Vec<f32>>;

/// The random stream of one item, whatever the order in which items are made.
///
/// `key` names the item, for example `[model_idx, view_idx]`.
pub fn keyed_rng(seed: u64, key: [u64; 2]) -> ChaCha8Rng {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    bytes[8..16].copy_from_slice(&key[0].to_le_bytes());
    bytes[16..24].copy_from_slice(&key[1].to_le_bytes());
    ChaCha8Rng::from_seed(bytes)
}
