//! What can go wrong at the edges: reading, writing, and input that does not make sense.

use std::path::{Path, PathBuf};

pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An edge failed. Every variant names the file or folder at fault; the mathematics cannot fail.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Image { path: PathBuf, source: image::ImageError },
    #[error("{}: not a usable mesh: {reason}", path.display())]
    Mesh { path: PathBuf, reason: String },
    #[error("{}: not a usable collection of meshes: {reason}", path.display())]
    Collection { path: PathBuf, reason: String },
    #[error("{}: points cannot be kept there: {source}", path.display())]
    Cache { path: PathBuf, source: Box<Error> },
    #[error("{}: not a usable sequence: {reason}", path.display())]
    Sequence { path: PathBuf, reason: String },
    #[error("{}: not a usable point cloud: {reason}", path.display())]
    Points { path: PathBuf, reason: String },
    #[error("{}: not a valid config: {reason}", path.display())]
    Config { path: PathBuf, reason: String },
    #[error("{}: not a usable shard: {reason}", path.display())]
    Shard { path: PathBuf, reason: String },
    #[error("{}: not a usable prior: {reason}", path.display())]
    Prior { path: PathBuf, reason: String },
}

impl Error {
    /// For `map_err`: an I/O error at `path`.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.into(), source }
    }

    /// For `map_err`: an image at `path` that could not be read or written.
    pub fn image(path: &Path) -> impl FnOnce(image::ImageError) -> Self + '_ {
        move |source| Self::Image { path: path.into(), source }
    }
}
