//! Object-centric photometric bundle adjustment with a deep shape prior, in Burn.
//!
//! A few pictures of an object and a known camera go in; the camera pose of every frame and a full
//! point cloud, hidden side included, come out. The method is Zhu, Wang, Lin, Wang and Lucey's
//! "Object-Centric Photometric Bundle Adjustment with Deep Shape Prior"; modules stand in the order
//! in which its text meets them, and name the equation that they are.

pub mod camera;
pub mod shape_prior;
pub mod regressor;
pub mod psgn;
pub mod pseudo_render;
pub mod sampling;
pub mod nearest_neighbours;
pub mod pixel_grid;
pub mod chamfer;
pub mod silhouette;
pub mod loss;
pub mod bundle_adjustment;
pub mod metrics;
pub mod initial_guess;
pub mod reconstruction;
pub mod training;
pub mod data;

pub mod checkpoint;
pub mod config;
pub mod device;
pub mod error;
pub mod host;
mod layers;

pub use error::{Error, Result};
