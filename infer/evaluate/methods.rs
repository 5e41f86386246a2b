//! What is evaluated: our solver, the paper's variants of its own, and what needs no bundle adjustment.

use std::str::FromStr;

use clap::ValueEnum;
use object_pba::bundle_adjustment::{BundleAdjustmentConfig, Solver};

/// How poses and a shape are estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Method {
    /// The chosen solver.
    Solver,
    /// The same from the true poses and the encoded true shape: what the prior and the objective cost.
    FromTruth,
    /// Algorithm 1 on L_ph alone.
    Photometric,
    /// Algorithm 1 on L_CD alone.
    Silhouette,
    /// Algorithm 1 on L_ph + λ L_CD.
    Algorithm1,
    /// Style and pose of every frame by themselves, after Zhu et al. 2017.
    PerFrame,
    /// The mean of all shapes at the initial poses.
    MeanShape,
    /// The training shape that is nearest to the regressed one, at the initial poses.
    Retrieval,
    /// Bundle adjustment without a prior: Adam on poses and free points.
    FreePoints,
    /// COLMAP, given the camera and the masks.
    Colmap,
    /// COLMAP, given the camera: it may use the ground.
    ColmapUnmasked,
}

impl Method {
    /// The name of its files and the value of its option.
    pub fn name(self) -> String {
        let value = self.to_possible_value().expect("no method is skipped");
        value.get_name().to_owned()
    }

    /// What tables and figures call it.
    pub fn label(self, config: &BundleAdjustmentConfig) -> String {
        match self {
            Self::Solver => solver_name(config.solver),
            Self::FromTruth => format!("{} from the truth", solver_name(config.solver)),
            Self::Photometric => "Algorithm 1, L_ph only".into(),
            Self::Silhouette => "Algorithm 1, L_CD only".into(),
            Self::Algorithm1 => "Algorithm 1, L_ph + λ L_CD".into(),
            Self::PerFrame => "per-frame regression".into(),
            Self::MeanShape => "mean shape".into(),
            Self::Retrieval => "nearest training shape".into(),
            Self::FreePoints => "free points".into(),
            Self::Colmap => "COLMAP on the object".into(),
            Self::ColmapUnmasked => "COLMAP on whole frames".into(),
        }
    }

    /// What it computes with, where `config` is the chosen solver's.
    pub fn config(self, config: &BundleAdjustmentConfig) -> BundleAdjustmentConfig {
        let paper = BundleAdjustmentConfig::paper;
        match self {
            Self::Algorithm1 => paper(),
            Self::Photometric => {
                let mut config = paper();
                config.objective.silhouette_weight = 0.0;
                config
            }
            Self::Silhouette => {
                let mut config = paper();
                config.objective.photometric_weight = 0.0;
                config
            }
            _ => config.clone(),
        }
    }

    /// Whether it starts as the paper does, with every Δp_l zero.
    pub fn starts_still(self) -> bool {
        matches!(self, Self::Photometric | Self::Silhouette | Self::Algorithm1)
    }
}

fn solver_name(solver: Solver) -> String {
    let value = solver.to_possible_value().expect("no solver is skipped");
    value.get_name().to_owned()
}

/// Several methods, as a user lists them: by name, or by that of a group.
#[derive(Clone, Debug, PartialEq)]
pub struct Methods(pub Vec<Method>);

impl FromStr for Methods {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        use Method::*;
        let mut methods = vec![Solver];
        for name in text.split(',').map(str::trim) {
            match name {
                "paper" => methods.extend([Photometric, Silhouette, Algorithm1, PerFrame]),
                "baselines" => methods.extend([PerFrame, MeanShape, Retrieval, FreePoints]),
                "all" => methods.extend([
                    FromTruth,
                    Photometric,
                    Silhouette,
                    Algorithm1,
                    PerFrame,
                    MeanShape,
                    Retrieval,
                    FreePoints,
                ]),
                name => methods.push(Method::from_str(name, false).map_err(|_| unknown(name))?),
            }
        }
        methods.sort();
        methods.dedup();
        Ok(Self(methods))
    }
}

fn unknown(name: &str) -> String {
    let names: Vec<String> = Method::value_variants().iter().map(|method| method.name()).collect();
    format!("{name} is neither paper, baselines, all nor one of {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_listed_once_and_the_solver_always() {
        let methods = |text: &str| text.parse::<Methods>().map(|methods| methods.0);
        assert_eq!(methods("solver"), Ok(vec![Method::Solver]));
        let listed = methods("paper,per-frame, retrieval").expect("they are methods");
        assert_eq!(listed.len(), 6);
        assert!(listed.contains(&Method::Solver) && listed.contains(&Method::Retrieval));
        assert!(methods("retreival").unwrap_err().contains("retrieval"));
    }
}
