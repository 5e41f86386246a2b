//! The regressors' training pictures as files: the very crops that training renders.

use std::{fs, path::Path};

use indicatif::ProgressBar;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{
    TrainingConfig,
    crop_sample::sample_of_crop,
    crops::{crops_of_models, render_model},
    shapes::Shapes,
};
use crate::{
    Error, Result,
    config::write_config,
    data::formats::webdataset::{Contents, Part, ShardWriter, is_finished},
};

/// Models that are rendered at a time: enough for many threads, little enough for memory.
const CHUNK: usize = 32;

/// Renders a part of the training crops into the folder `out`, as a WebDataset tar.
///
/// Sample `model · views_per_model + view` is that view of that model. A finished part is left alone.
pub fn write_shard(config: &TrainingConfig, part: Part, out: &Path) -> Result<Contents> {
    let shapes = Shapes::open(&config.data, config.seed)?;
    let models = shapes.training();
    let n_views = config.data.views_per_model;
    let range = part.range(models.len());
    let contents = Contents {
        dataset: fingerprint(config, models.len()),
        samples: range.start * n_views..range.end * n_views,
        total: models.len() * n_views,
    };
    let path = out.join(part.file_name("crops", "tar"));
    if is_finished(&path, &contents)? {
        return Ok(contents);
    }
    fs::create_dir_all(out).map_err(Error::io(out))?;
    write_config(&out.join("config.toml"), config)?;

    let bar = ProgressBar::new(range.len() as u64).with_message("rendering");
    let mut writer = ShardWriter::create(&path, contents.clone())?;
    let views: Vec<_> = (0..n_views).collect();
    let render = |model_idx| {
        bar.inc(1);
        render_model(config, &shapes, model_idx, &views)
    };
    let size = config.regressors.network.crop_size;
    for models in models[range].chunks(CHUNK) {
        for crop in crops_of_models(models, render, || true)? {
            writer.append(&sample_of_crop(&crop, size, config.seed, models[crop.shape_idx]))?;
        }
    }
    writer.finish()?;
    bar.finish_and_clear();
    Ok(contents)
}

/// Config keys that say where data lie, or which of the crops are shown when, but not what they are.
const NO_ORIGIN: [&str; 4] = ["meshes", "cache", "shards", "views_per_round"];

/// Names all that the crops follow from. Where a machine keeps its meshes is not part of it.
pub(super) fn fingerprint(config: &TrainingConfig, n_models: usize) -> String {
    #[derive(Serialize)]
    struct Origin {
        seed: u64,
        n_models: usize,
        procedural: bool,
        crop_size: usize,
        crop_margin: f32,
        box_jitter: f32,
        data: toml::Table,
    }
    let mut data = toml::Table::try_from(&config.data).expect("configs are plain tables");
    for key in NO_ORIGIN {
        data.remove(key);
    }
    let origin = Origin {
        seed: config.seed,
        n_models,
        procedural: config.data.meshes.is_none(),
        crop_size: config.regressors.network.crop_size,
        crop_margin: config.regressors.network.crop_margin,
        box_jitter: config.regressors.box_jitter,
        data,
    };
    let text = toml::to_string(&origin).expect("configs are plain tables");
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        data::formats::webdataset::merge_shards,
        training::{DataConfig, crop_source::CropSource, crops::Crop},
    };
    use std::path::PathBuf;

    fn config() -> TrainingConfig {
        let data = DataConfig {
            n_models: 5,
            views_per_model: 2,
            paints_per_model: 2,
            ..DataConfig::default()
        };
        let mut config = TrainingConfig { data, ..TrainingConfig::default() };
        config.regressors.network.crop_size = 16;
        config
    }

    /// Writes parts of the dataset, and returns their tars.
    fn write(parts: &[&str], out: &Path) -> Vec<PathBuf> {
        let write = |text: &&str| {
            let part: Part = text.parse().expect("a part");
            write_shard(&config(), part, out).expect("it is writable");
            out.join(part.file_name("crops", "tar"))
        };
        parts.iter().map(write).collect()
    }

    #[test]
    fn merged_shards_are_one_run_byte_for_byte() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [one, many, merged] = ["one", "many", "merged"].map(|name| folder.path().join(name));
        let whole = &write(&["1/1"], &one)[0];
        let shards = write(&["3/3", "1/3", "2/3"], &many);

        fs::create_dir(&merged).expect("writable");
        let out = merged.join("crops.tar");
        let contents = merge_shards(&shards, &out).expect("all are there");
        assert_eq!((contents.samples, contents.total), (0..10, 10));
        for extension in ["tar", "json"] {
            let bytes =
                |path: &Path| fs::read(path.with_extension(extension)).expect("it is there");
            assert!(bytes(&out) == bytes(whole), "{extension}");
        }
    }

    fn read(config: &TrainingConfig) -> Result<Vec<Crop>> {
        let shapes = Shapes::open(&config.data, config.seed)?;
        CropSource::open(config, &shapes)?.crops(&[0, 1], || true)
    }

    #[test]
    fn stored_crops_are_rendered_ones_to_the_last_bit() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write(&["1/2", "2/2"], folder.path());
        let mut stored = config();
        stored.data.shards = Some(folder.path().into());
        let [rendered, stored] = [config(), stored].map(|config| read(&config).expect("readable"));
        let data = |crops: Vec<Crop>| -> Vec<_> {
            let data = |crop: Crop| {
                (crop.shape_idx, crop.view, crop.pixels, crop.crop_from_world, crop.focal_ratio)
            };
            crops.into_iter().map(data).collect()
        };
        assert!(data(rendered) == data(stored));
    }

    #[test]
    fn shards_of_other_crops_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write(&["1/1"], folder.path());
        let mut other = config();
        other.data.shards = Some(folder.path().into());
        other.regressors.box_jitter = 0.0;
        let error = read(&other).err().expect("it is another dataset").to_string();
        assert!(error.contains("expected 10 samples of dataset"), "{error}");
    }

    #[test]
    fn another_seed_or_view_count_is_another_dataset() {
        let print = |config: &TrainingConfig| fingerprint(config, 5);
        let mut other = config();
        assert_eq!(print(&other), print(&config()));
        other.data.meshes = None;
        other.seed = 1;
        assert_ne!(print(&other), print(&config()));
        other = config();
        other.data.views_per_model = 3;
        assert_ne!(print(&other), print(&config()));
        // How long to train on the crops, and on how many at a time, is another matter.
        other = config();
        other.regressors.schedule.steps += 1;
        other.data.views_per_round += 1;
        other.data.shards = Some("shards".into());
        assert_eq!(print(&other), print(&config()));
    }
}
