//! `pba-train render`: test sequences with their ground truth.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use clap::Args;
use indicatif::{ParallelProgressIterator, ProgressStyle};
use object_pba::{
    Error, Result,
    config::read_config,
    data::{
        collection::{Collection, Model},
        formats::{nerfstudio::write_sequence, webdataset::Part, write_atomically},
        mesh::Mesh,
        procedural,
        sequence::{Sequence, SequenceOptions},
        shapenet::CARS,
    },
};
use rayon::prelude::*;
use serde::Serialize;

use crate::selection::SelectionArguments;

/// What to render, and where to.
#[derive(Args)]
pub struct RenderArguments {
    /// Folder of the dataset: one folder a sequence, named `model-0`, `model-1`, and so on.
    #[arg(long)]
    out: PathBuf,
    /// Folder of meshes: ShapeNetCore v1 or v2, or any; without it, shapes are procedural cars.
    #[arg(long, alias = "shapenet")]
    meshes: Option<PathBuf>,
    #[command(flatten)]
    selection: SelectionArguments,
    /// How many procedural cars; they are none of those that training draws.
    #[arg(long, default_value_t = 20)]
    models: u64,
    /// How many sequences of each model.
    #[arg(long, default_value_t = 1)]
    sequences: u64,
    /// Draws shapes, cameras and lights.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// TOML file with what differs from 15 frames of 128 × 128, 2° apart.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Render part i of n of the models only, say 2/8; parts go into one folder, in any order.
    #[arg(long, value_name = "I/N", default_value_t = Part::WHOLE)]
    shard: Part,
}

enum Shape {
    Procedural(u64),
    Model(Model),
}

/// What, beside `config.toml`, all sequences of a folder follow from.
#[derive(Serialize)]
struct Dataset {
    seed: u64,
    sequences: u64,
    /// All ids, whichever part is rendered: a model's number draws its cameras.
    models: Vec<String>,
}

/// Renders what is missing of a dataset or of its part.
pub fn render(arguments: &RenderArguments) -> Result<()> {
    let options = match &arguments.config {
        Some(path) => read_config(path)?,
        None => SequenceOptions::default(),
    };
    let shapes = shapes(arguments)?;
    fs::create_dir_all(&arguments.out).map_err(Error::io(&arguments.out))?;
    begin(arguments, &shapes, &options)?;
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} models (ETA {eta})");
    let part: Vec<_> = arguments.shard.range(shapes.len()).collect();
    let skipped: Vec<Option<Error>> = part
        .par_iter()
        .progress_with_style(style.expect("a valid template"))
        .map(|&idx| write_sequences(&shapes[idx], idx as u64, arguments, &options))
        .collect::<Result<_>>()?;
    let skipped: Vec<_> = skipped.into_iter().flatten().collect();
    skipped.iter().for_each(|error| eprintln!("skipped: {error}"));
    let n_models = part.len() - skipped.len();
    println!("{n_models} models, {} sequences of each", arguments.sequences);
    match skipped.into_iter().next() {
        Some(error) if n_models == 0 => Err(error),
        _ => Ok(()),
    }
}

fn shapes(arguments: &RenderArguments) -> Result<Vec<Shape>> {
    let Some(root) = &arguments.meshes else {
        let seeds = (0..arguments.models).map(|idx| arguments.seed * 1_000_000 + idx);
        return Ok(seeds.map(Shape::Procedural).collect());
    };
    let selection = arguments.selection.selection(&[CARS]);
    let selection = selection.map_err(|reason| Error::Config { path: root.clone(), reason })?;
    Ok(Collection::open(root, &selection)?.models.into_iter().map(Shape::Model).collect())
}

/// Writes what the folder holds; one that holds something else is refused.
fn begin(arguments: &RenderArguments, shapes: &[Shape], options: &SequenceOptions) -> Result<()> {
    let dataset = Dataset {
        seed: arguments.seed,
        sequences: arguments.sequences,
        models: shapes.iter().map(Shape::id).collect(),
    };
    write_once(&arguments.out.join("dataset.toml"), &dataset)?;
    write_once(&arguments.out.join("config.toml"), options)
}

fn write_once(path: &Path, config: &impl Serialize) -> Result<()> {
    let text = toml::to_string_pretty(config).expect("configs are plain tables");
    match fs::read_to_string(path) {
        Ok(there) if there == text => Ok(()),
        Ok(_) => {
            let reason = "this folder holds another dataset; choose another".into();
            Err(Error::Config { path: path.into(), reason })
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {
            write_atomically(path, text.as_bytes())
        }
        Err(error) => Err(Error::io(path)(error)),
    }
}

impl Shape {
    fn id(&self) -> String {
        match self {
            Self::Procedural(seed) => format!("car_{seed:06}"),
            // Datasets have one folder a sequence, side by side.
            Self::Model(model) => model.id.replace('/', "_"),
        }
    }

    fn load(&self) -> Result<Mesh> {
        match self {
            Self::Procedural(seed) => Ok(procedural::car(*seed)),
            Self::Model(model) => Ok(model.load()?.mesh),
        }
    }
}

/// Writes the sequences of one model that are not there yet; what makes it unusable, if so.
fn write_sequences(
    shape: &Shape,
    model_idx: u64,
    arguments: &RenderArguments,
    options: &SequenceOptions,
) -> Result<Option<Error>> {
    let folder = |idx: u64| arguments.out.join(format!("{}-{idx}", shape.id()));
    // It is written last.
    let finished = |idx: &u64| folder(*idx).join("transforms.json").exists();
    let missing: Vec<_> = (0..arguments.sequences).filter(|idx| !finished(idx)).collect();
    if missing.is_empty() {
        return Ok(None);
    }
    let mesh = match shape.load() {
        Ok(mesh) => mesh,
        Err(error) => return Ok(Some(error)),
    };
    for idx in missing {
        let seed = (arguments.seed << 40) + (model_idx << 16) + idx;
        write_sequence(&Sequence::render(&mesh, options, seed), &folder(idx))?;
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn arguments(out: &Path, shard: &str) -> RenderArguments {
        RenderArguments {
            out: out.into(),
            meshes: None,
            selection: SelectionArguments::default(),
            models: 3,
            sequences: 1,
            seed: 7,
            config: None,
            shard: shard.parse().expect("a part"),
        }
    }

    /// Every file below a folder, and its bytes.
    fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        let mut folders = vec![folder.to_path_buf()];
        while let Some(next) = folders.pop() {
            for entry in fs::read_dir(next).expect("it is there") {
                let path = entry.expect("it is there").path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let name = path.strip_prefix(folder).expect("it is below").to_path_buf();
                    files.insert(name, fs::read(path).expect("it is there"));
                }
            }
        }
        files
    }

    #[test]
    fn parts_in_one_folder_are_one_run_byte_for_byte() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [one, many] = ["one", "many"].map(|name| folder.path().join(name));
        render(&arguments(&one, "1/1")).expect("it is writable");
        for shard in ["2/2", "1/2"] {
            render(&arguments(&many, shard)).expect("it is writable");
        }
        let expected = files(&one);
        assert!(expected.len() > 3 * 30 && files(&many) == expected);

        // Again, after an interruption: what is missing is filled in.
        fs::remove_file(many.join("car_7000001-0/transforms.json")).expect("it is there");
        render(&arguments(&many, "1/1")).expect("it is writable");
        assert!(files(&many) == expected);
    }

    #[test]
    fn another_dataset_is_not_mixed_in() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        // A part without models begins the folder and no more.
        render(&arguments(folder.path(), "1/9")).expect("it is writable");
        let other = RenderArguments { seed: 8, ..arguments(folder.path(), "1/9") };
        let error = render(&other).expect_err("it is another").to_string();
        assert!(error.contains("dataset.toml"), "{error}");
    }
}
