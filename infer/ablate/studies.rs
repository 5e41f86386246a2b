//! The comparisons that there are.

use clap::ValueEnum;
use object_pba::bundle_adjustment::BundleAdjustmentConfig;

use super::arm::{Arm, Shape};

/// One thing that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Study {
    /// The shape prior, and points that move freely (Fig. 7).
    Prior,
    /// L_ph, L_CD, and both (Fig. 3 and 6).
    Losses,
    /// The number of frames (Fig. 4).
    Views,
    /// How the objective is minimised, and Algorithm 1 as printed.
    Solvers,
    /// λ, the weight of the silhouettes.
    Lambda,
    /// What a relative pose turns the object about (Eq. 4).
    Parameterisation,
    /// The blurs from coarse to fine, with as many iterations in all.
    Pyramid,
    /// How many initial poses are tried.
    Hypotheses,
    /// N, the points of the cloud.
    Points,
    /// Smooth displacements beyond the prior's manifold, and none.
    Beyond,
    /// Each of these in turn.
    All,
}

/// Arms, and how to show them.
pub struct Comparison {
    pub title: String,
    /// What the names of the arms are values of.
    pub axis: &'static str,
    /// Whether the arms stand in an order, along which a line makes sense.
    pub ordered: bool,
    pub arms: Vec<Arm>,
}

impl Study {
    pub const ALL: [Self; 10] = [
        Self::Prior,
        Self::Losses,
        Self::Views,
        Self::Solvers,
        Self::Lambda,
        Self::Parameterisation,
        Self::Pyramid,
        Self::Hypotheses,
        Self::Points,
        Self::Beyond,
    ];

    /// Those that were asked for.
    pub fn chosen(asked: &[Self]) -> Vec<Self> {
        let all = asked.contains(&Self::All);
        Self::ALL.into_iter().filter(|study| all || asked.contains(study)).collect()
    }

    /// As on the command line, and of its folder.
    pub fn name(self) -> String {
        self.to_possible_value().expect("none is skipped").get_name().into()
    }

    /// Its arms, which differ from `base` at `n_points` in one thing.
    pub fn comparison(
        self,
        base: &BundleAdjustmentConfig,
        n_points: usize,
        n_prior: usize,
    ) -> Comparison {
        let default = Arm {
            name: String::new(),
            n_frames: None,
            n_points,
            n_judged_points: n_prior,
            shape: Shape::Prior,
            config: base.clone(),
        };
        let (title, axis, ordered) = self.labels();
        Comparison { title: title.into(), axis, ordered, arms: self.arms(&default) }
    }

    fn labels(self) -> (&'static str, &'static str, bool) {
        match self {
            Self::Prior => ("Shape prior against free points (Fig. 7)", "unknowns", false),
            Self::Losses => ("Losses (Fig. 3 and 6)", "objective", false),
            Self::Views => ("Number of views (Fig. 4)", "frames, L", true),
            Self::Solvers => ("Solvers", "solver", false),
            Self::Lambda => ("Weight of the silhouettes, λ", "λ over its default", true),
            Self::Parameterisation => {
                ("Parameterisation: what Δp turns about (Eq. 4)", "centre", false)
            }
            Self::Pyramid => ("Pyramid of blurs", "blurs (px)", true),
            Self::Hypotheses => ("Initial poses", "initial poses tried, at most", true),
            Self::Points => ("Number of points", "points, N", true),
            Self::Beyond => ("Beyond the prior's manifold", "modes of displacement", true),
            Self::All => unreachable!("it stands for the others"),
        }
    }
}
