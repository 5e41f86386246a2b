//! `pba-train inspect`: what a collection of meshes holds, before hours are spent on it, and what a
//! prior made of one.

mod contact_sheet;
mod prior;
mod table;

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ParallelProgressIterator, ProgressStyle};
use object_pba::{
    Error, Result,
    data::{
        collection::{Collection, Model},
        formats::write_atomically,
        mesh_file::Loaded,
    },
};
use rayon::prelude::*;
use serde::Serialize;

use crate::selection::SelectionArguments;
use contact_sheet::{MAX_TILES, draw_tile, write_contact_sheet};

/// What to look at.
#[derive(Args)]
pub struct InspectArguments {
    /// Folder of meshes: ShapeNetCore v1 or v2, or any.
    #[arg(required_unless_present = "prior")]
    folder: Option<PathBuf>,
    /// Folder of a shape prior: shows how well it gives back the meshes, or without these the shapes
    /// that its training held out, and walks along its leading style directions. In the picture,
    /// shapes are grey, reconstructions blue, nearest training shapes orange and walks green.
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Folder for inspect.json and contact_sheet.png, or of a prior prior.json, prior.png and, for shapes
    /// that training held out, regressors.json.
    #[arg(long, default_value = "runs/inspect")]
    out: PathBuf,
    #[command(flatten)]
    selection: SelectionArguments,
}

/// The contents of inspect.json.
#[derive(Serialize)]
struct Report {
    folder: PathBuf,
    models: Vec<Summary>,
    unusable: Vec<Unusable>,
}

/// A model that can be used.
#[derive(Serialize)]
struct Summary {
    id: String,
    synset: Option<String>,
    path: PathBuf,
    /// How it is turned in its file.
    axes: String,
    n_vertices: usize,
    n_triangles: usize,
    n_textures: usize,
    /// Width (x), height (y) and length (z) of its box, whose diagonal is 1.
    extents: [f32; 3],
    warnings: Vec<String>,
    /// Its row and column on the contact sheet, counted from 1.
    tile: Option<[usize; 2]>,
}

#[derive(Serialize)]
struct Unusable {
    id: String,
    reason: String,
}

pub fn inspect(arguments: &InspectArguments) -> Result<()> {
    let InspectArguments { folder, prior, out, selection } = arguments;
    let models = |folder: &Path| -> Result<Vec<Model>> {
        let invalid = |reason| Error::Config { path: folder.into(), reason };
        let selection = selection.selection(&[]).map_err(invalid)?;
        Ok(Collection::open(folder, &selection)?.models)
    };
    let models = folder.as_deref().map(models).transpose()?;
    std::fs::create_dir_all(out).map_err(Error::io(out))?;
    match (prior, folder, models) {
        (Some(prior), _, models) => prior::inspect(prior, models, out),
        (None, Some(folder), Some(models)) => inspect_meshes(folder, &models, out),
        _ => unreachable!("a folder is required without a prior"),
    }
}

/// Reads every model once. Fails if none of them can be used.
fn inspect_meshes(folder: &Path, models: &[Model], out: &Path) -> Result<()> {
    // Tiles are spread evenly over the collection.
    let stride = models.len().div_ceil(MAX_TILES);
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} models (ETA {eta})");
    let results: Vec<_> = models
        .par_iter()
        .enumerate()
        .progress_with_style(style.expect("a valid template"))
        .map(|(idx, model)| {
            let Loaded { mesh, warnings } = model.load()?;
            let tile = idx.is_multiple_of(stride).then(|| draw_tile(&mesh));
            Ok((summary(model, &mesh, warnings), tile))
        })
        .collect();

    let mut report = Report { folder: folder.into(), models: vec![], unusable: vec![] };
    let mut tiles = Vec::new();
    for (model, result) in models.iter().zip(results) {
        match result {
            Ok((summary, tile)) => {
                tiles.extend(tile.map(|tile| (report.models.len(), tile)));
                report.models.push(summary);
            }
            Err(error) => {
                let reason = Error::to_string(&error);
                report.unusable.push(Unusable { id: model.id.clone(), reason });
            }
        }
    }
    for (model_idx, place) in write_contact_sheet(&out.join("contact_sheet.png"), &tiles)? {
        report.models[model_idx].tile = Some(place);
    }
    let json = serde_json::to_string_pretty(&report).expect("a report is plain data");
    write_atomically(&out.join("inspect.json"), json.as_bytes())?;
    print!("{}", table::table(&report));
    match report.unusable.first().filter(|_| report.models.is_empty()) {
        None => Ok(()),
        Some(Unusable { reason, .. }) => {
            let reason = format!("none of its models is usable; the first: {reason}");
            Err(Error::Collection { path: folder.into(), reason })
        }
    }
}

fn summary(model: &Model, mesh: &object_pba::data::mesh::Mesh, warnings: Vec<String>) -> Summary {
    let bounds = mesh.bounds().expect("a mesh that was read has triangles");
    Summary {
        id: model.id.clone(),
        synset: model.synset.clone(),
        path: model.path.clone(),
        axes: model.axes.to_string(),
        n_vertices: mesh.vertices.len(),
        n_triangles: mesh.triangles.len(),
        n_textures: mesh.textures.len(),
        extents: (bounds.max - bounds.min).into(),
        warnings,
        tile: None,
    }
}
