//! One page that shows a reconstruction: `report/index.html`, which needs neither network nor server.
//!
//! The page holds the frames, the clouds and poses of some steps, and the history. Where points land,
//! what colours they have and how these differ, it works out itself: that is much less to store.

mod encode;
mod page;
mod replay;
mod thumbnail;

use std::{fs, path::Path};

use anyhow::{Context, Result};
use object_pba::{
    bundle_adjustment::BundleAdjustmentConfig,
    checkpoint::Prior,
    data::sequence::Sequence,
    device::Backend,
    host::host_points,
    reconstruction::{points, views},
};

use crate::{figures, run::Reconstruction};

/// Writes `report/index.html` and `report/thumb.png` (224 × 112 pixels: the reference frame, and the cloud
/// from the reference camera) below `out`. Fails where files cannot be written.
pub fn write(
    out: &Path,
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    backend: Backend,
    reconstruction: &Reconstruction,
) -> Result<()> {
    let folder = out.join("report");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let data = page::Data::new(prior, sequence, config, backend, reconstruction)?;
    let path = folder.join("index.html");
    fs::write(&path, page::html(&data)?)
        .with_context(|| format!("cannot write {}", path.display()))?;

    let device = backend.device();
    let (generator, unknowns) = (&prior.shape.generator, &reconstruction.outcome.unknowns);
    let views = views(sequence, generator, unknowns, &config.objective.pseudo_render, &device);
    let colors = figures::point_colors(sequence, &views);
    let colors: Vec<[u8; 3]> = colors.iter().map(|c| c.unwrap_or(figures::UNSEEN)).collect();
    let cloud = host_points(&points(generator, unknowns, &device));
    let reference = unknowns.camera_from_world(&device)[0];
    let picture = thumbnail::draw(&sequence.frames[0], &reference, &cloud, &colors);
    figures::save(&picture, &folder.join("thumb.png"))
}
