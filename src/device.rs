//! The one file that names backends. Everything else takes a [`Device`].

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// A backend to compute on, chosen at run time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// Burn's pure-Rust CPU backend.
    #[default]
    Flex,
    /// burn-ndarray: deprecated upstream, first class here.
    Ndarray,
}

impl Backend {
    /// The device, without automatic differentiation; `.autodiff()` adds it.
    pub fn device(self) -> Device {
        match self {
            Self::Flex => Device::flex(),
            #[expect(deprecated, reason = "users of this crate ask for ndarray by name")]
            Self::Ndarray => Device::ndarray(),
        }
    }
}

impl std::fmt::Display for Backend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
        })
    }
}
