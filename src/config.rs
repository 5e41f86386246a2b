//! Configs are TOML: a preset states what differs from the defaults, unknown keys are refused, and
//! the effective config is written beside every result.

use std::{fs, path::Path};

use serde::{Serialize, de::DeserializeOwned};

use crate::{Error, Result};

/// Reads a config; keys that are left out take their defaults.
pub fn read_config<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = fs::read_to_string(path).map_err(Error::io(path))?;
    toml::from_str(&text)
        .map_err(|error| Error::Config { path: path.into(), reason: error.to_string() })
}

/// Writes the effective config, every key included.
pub fn write_config<T: Serialize>(path: &Path, config: &T) -> Result<()> {
    let text = toml::to_string_pretty(config).expect("configs are plain tables");
    fs::write(path, text).map_err(Error::io(path))
}
