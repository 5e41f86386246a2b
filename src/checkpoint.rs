//! The prior on disk: a folder with `config.toml`, `prior.safetensors`, `regressors.safetensors`.

use std::{fs, path::Path};

use burn::{
    module::Module,
    store::{
        FloatCastAdapter, HalfPrecisionAdapter, ModuleSnapshot, ModuleStore, SafetensorsStore,
    },
    tensor::{DType, Device},
};

use crate::{
    Error, Result,
    data::formats::write_atomically,
    psgn::{Psgn, PsgnConfig},
    regressor::Regressors,
    shape_prior::ShapePrior,
    training::TrainingConfig,
};

pub const CONFIG_FILE: &str = "config.toml";
pub const SHAPE_FILE: &str = "prior.safetensors";
pub const REGRESSORS_FILE: &str = "regressors.safetensors";
pub const PSGN_FILE: &str = "psgn.safetensors";

/// A trained prior, frozen: gradients pass through it and do not stay.
#[derive(Clone, Debug)]
pub struct Prior {
    pub shape: ShapePrior,
    pub regressors: Regressors,
    /// The run that made it.
    pub config: TrainingConfig,
}

impl Prior {
    /// Reads the folder that a training run has written.
    ///
    /// Weights are kept off the graph, whatever `device` does: styles and poses bring it along where
    /// they need it, and on it even what nobody differentiates stays in memory until the next backward
    /// pass, which Levenberg–Marquardt never makes.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        let device = &device.clone().inner();
        let config = TrainingConfig::read(&folder.join(CONFIG_FILE))?;
        let shape = load_shape(&config, &folder.join(SHAPE_FILE), device)?;
        let regressors =
            load_regressors(&config, shape.n_style(), &folder.join(REGRESSORS_FILE), device)?;
        Ok(Self { shape, regressors, config })
    }

    /// Reads the contents of these files from memory, [as from a folder](Self::load); errors name the files
    /// they would be.
    pub fn load_bytes(
        config: &str,
        shape: &[u8],
        regressors: &[u8],
        device: &Device,
    ) -> Result<Self> {
        let device = &device.clone().inner();
        let config = TrainingConfig::parse(config, Path::new(CONFIG_FILE))?;
        let shape = shape_from_bytes(&config, shape, Path::new(SHAPE_FILE), device)?;
        let module = config.regressors.network.init(shape.n_style(), device);
        let store = SafetensorsStore::from_bytes(Some(regressors.to_vec()));
        let regressors = load_weights(module, store, Path::new(REGRESSORS_FILE))?;
        Ok(Self { shape, regressors, config })
    }
}

/// Reads the shape prior of a run.
pub fn load_shape(config: &TrainingConfig, path: &Path, device: &Device) -> Result<ShapePrior> {
    shape_from_bytes(config, &read(path, "the weights of the shape prior")?, path, device)
}

/// Reads the regressors of a run; the style is the shape prior's.
pub fn load_regressors(
    config: &TrainingConfig,
    n_style: usize,
    path: &Path,
    device: &Device,
) -> Result<Regressors> {
    let bytes = read(path, "the weights of the regressors")?;
    let module = config.regressors.network.init(n_style, device);
    load_weights(module, SafetensorsStore::from_bytes(Some(bytes)), path)
}

/// Reads the direct regression of a run.
pub fn load_psgn(config: &PsgnConfig, path: &Path, device: &Device) -> Result<Psgn> {
    let bytes = read(path, "the weights of the point set regression")?;
    load_weights(config.init(device), SafetensorsStore::from_bytes(Some(bytes)), path)
}

/// Writes weights, in half precision where that is beyond what training determines.
///
/// Statistics of batch normalisation and the whitening of the style stay as they are.
pub fn save_weights<M: Module>(module: &M, path: &Path) -> Result<()> {
    // Linear layers, and the template, which is the generator's own.
    let half = HalfPrecisionAdapter::new().with_module("Generator");
    // Metadata come in any order; without them, equal weights are equal files.
    let mut store = SafetensorsStore::from_bytes(None).clear_metadata().with_to_adapter(half);
    let unusable = |reason: String| Error::Prior { path: path.into(), reason };
    module.valid().save_into(&mut store).map_err(|error| unusable(error.to_string()))?;
    write_atomically(path, &store.get_bytes().map_err(|error| unusable(error.to_string()))?)
}

fn shape_from_bytes(
    config: &TrainingConfig,
    bytes: &[u8],
    path: &Path,
    device: &Device,
) -> Result<ShapePrior> {
    let unusable = |reason: String| Error::Prior { path: path.into(), reason };
    let mut store = SafetensorsStore::from_bytes(Some(bytes.to_vec()));
    // The file says how many directions of the latent were kept.
    let basis = store.get_tensor("generator.whitening.basis");
    let basis = basis.map_err(|error| unusable(error.to_string()))?;
    let n_style = basis.and_then(|basis| basis.shape.iter().next().copied());
    let n_style = n_style.ok_or_else(|| unusable("it holds no style basis".into()))?;
    load_weights(config.prior.network.init_empty(n_style, device), store, path)
}

fn load_weights<M: Module>(mut module: M, store: SafetensorsStore, path: &Path) -> Result<M> {
    let unusable = |reason: String| Error::Prior { path: path.into(), reason };
    let mut store = store.with_from_adapter(FloatCastAdapter::to(DType::F32));
    let outcome = module.load_from(&mut store).map_err(|error| unusable(error.to_string()))?;
    match outcome.unused.first() {
        Some(name) => Err(unusable(format!("{name} is not a part of this network"))),
        None => Ok(module.freeze()),
    }
}

fn read(path: &Path, contents: &str) -> Result<Vec<u8>> {
    fs::read(path).map_err(|error| Error::Prior {
        path: path.into(),
        reason: format!("expected {contents}: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config::write_config, host::host_values, regressor, shape_prior};
    use burn::tensor::Tensor;

    fn tiny() -> TrainingConfig {
        let mut config = TrainingConfig::default();
        config.prior.network = shape_prior::tests::tiny();
        config.regressors.network = regressor::tests::tiny();
        config
    }

    fn write_prior(folder: &Path) -> (ShapePrior, Regressors) {
        let device = Device::flex();
        let template = vec![[0.25; 3]; tiny().prior.network.n_points()];
        let shape = tiny().prior.network.init(&template, &device);
        let regressors = tiny().regressors.network.init(6, &device);
        write_config(&folder.join(CONFIG_FILE), &tiny()).unwrap();
        save_weights(&shape, &folder.join(SHAPE_FILE)).unwrap();
        save_weights(&regressors, &folder.join(REGRESSORS_FILE)).unwrap();
        (shape, regressors)
    }

    #[test]
    fn a_prior_comes_back_to_half_precision() {
        let folder = tempfile::tempdir().unwrap();
        let (shape, _) = write_prior(folder.path());
        let device = Device::flex();
        let prior = Prior::load(folder.path(), &device).unwrap();
        let style = Tensor::ones([2, 6], &device);
        let [before, after] = [&shape, &prior.shape]
            .map(|shape| host_values(&shape.generator.forward(style.clone())));
        assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-3));
    }

    #[test]
    fn weights_stay_off_the_graph_and_styles_bring_it_along() {
        let folder = tempfile::tempdir().unwrap();
        write_prior(folder.path());
        let device = Device::flex().autodiff();
        let prior = Prior::load(folder.path(), &device).unwrap();
        let decode = |style: Tensor<2>| prior.shape.generator.forward(style);
        assert!(!decode(Tensor::ones([1, 6], &device.clone().inner())).device().is_autodiff());

        let style = Tensor::<2>::ones([1, 6], &device).require_grad();
        let gradients = decode(style.clone()).square().sum().backward();
        let gradient = host_values(&style.grad(&gradients).unwrap());
        assert!(gradient.iter().any(|&g| g != 0.0));
    }

    #[test]
    fn loading_and_saving_again_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        write_prior(folder.path());
        for file in [SHAPE_FILE, REGRESSORS_FILE] {
            let first = fs::read(folder.path().join(file)).unwrap();
            let prior = Prior::load(folder.path(), &Device::flex()).unwrap();
            save_weights(&prior.shape, &folder.path().join(SHAPE_FILE)).unwrap();
            save_weights(&prior.regressors, &folder.path().join(REGRESSORS_FILE)).unwrap();
            assert_eq!(first, fs::read(folder.path().join(file)).unwrap());
        }
    }

    #[track_caller]
    fn check_refused(folder: &Path, named: &str) {
        let error = Prior::load(folder, &Device::flex()).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }

    #[test]
    fn missing_cut_and_mismatching_files_are_refused_by_name() {
        for file in [CONFIG_FILE, SHAPE_FILE, REGRESSORS_FILE] {
            let folder = tempfile::tempdir().unwrap();
            write_prior(folder.path());
            let path = folder.path().join(file);
            let bytes = fs::read(&path).unwrap();
            fs::remove_file(&path).unwrap();
            check_refused(folder.path(), file);
            // Between two lines, a shorter config would be a config still.
            let end = match file {
                CONFIG_FILE => bytes.iter().position(|&byte| byte == b'=').unwrap() + 1,
                _ => bytes.len() / 3,
            };
            fs::write(&path, &bytes[..end]).unwrap();
            check_refused(folder.path(), file);
        }

        let folder = tempfile::tempdir().unwrap();
        write_prior(folder.path());
        let mut config = tiny();
        config.prior.network.fc_width += 1;
        write_config(&folder.path().join(CONFIG_FILE), &config).unwrap();
        check_refused(folder.path(), SHAPE_FILE);
        fs::copy(folder.path().join(REGRESSORS_FILE), folder.path().join(SHAPE_FILE)).unwrap();
        check_refused(folder.path(), "no style basis");
    }
}
