//! Every preset in `configs/` parses, and says what the code does.

use std::path::Path;

use object_pba::{
    Error,
    bundle_adjustment::{BundleAdjustmentConfig, Solver},
    config::{read_config, write_config},
};

fn preset(name: &str) -> BundleAdjustmentConfig {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    read_config(&folder.join(name)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn inference_presets_are_those_of_their_solvers() {
    assert_eq!(preset("infer-adam.toml"), BundleAdjustmentConfig::preset(Solver::Adam));
    let paper = BundleAdjustmentConfig::preset(Solver::AlternatingLbfgs);
    assert_eq!(preset("infer-algorithm1.toml"), paper);
}

#[test]
fn an_effective_config_reads_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("config.toml");
    write_config(&path, &BundleAdjustmentConfig::paper()).unwrap();
    assert_eq!(
        read_config::<BundleAdjustmentConfig>(&path).unwrap(),
        BundleAdjustmentConfig::paper()
    );
}

#[test]
fn an_unknown_key_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("typo.toml");
    std::fs::write(&path, "[objective]\nsilhouete_weight = 1.0\n").unwrap();
    let error = read_config::<BundleAdjustmentConfig>(&path).unwrap_err();
    assert!(matches!(error, Error::Config { .. }));
    let message = error.to_string();
    assert!(message.contains("silhouete_weight") && message.contains("typo.toml"), "{message}");
}
