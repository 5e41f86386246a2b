//! The arms of each study: what is varied, and what else changes so that it is a fair one.

use object_pba::bundle_adjustment::{BundleAdjustmentConfig, Solver, unknowns::Parameterisation};

use super::{
    arm::{Arm, Shape},
    studies::Study,
};

impl Study {
    /// Arms that differ from `default` in one thing.
    pub fn arms(self, default: &Arm) -> Vec<Arm> {
        let arm = |name: &str, change: &dyn Fn(&mut Arm)| {
            let mut arm = Arm { name: name.into(), ..default.clone() };
            change(&mut arm);
            arm
        };
        let solver = |name: &str, solver| arm(name, &|arm| arm.config.solver = solver);
        match self {
            Self::Prior => prior_and_free_points(default),
            Self::Losses => vec![
                arm("L_ph", &|arm| arm.config.objective.silhouette_weight = 0.0),
                arm("L_CD", &|arm| arm.config.objective.photometric_weight = 0.0),
                arm("L_ph + λ L_CD", &|_| ()),
            ],
            Self::Views => {
                let views = |l: usize| arm(&l.to_string(), &|arm| arm.n_frames = Some(l));
                [1, 2, 5, 10, 15].map(views).into()
            }
            Self::Solvers => vec![
                solver("lm", Solver::Lm),
                solver("adam", Solver::Adam),
                solver("lbfgs", Solver::Lbfgs),
                solver("alternating", Solver::AlternatingLbfgs),
                arm("Algorithm 1", &|arm| {
                    let start = arm.config.start;
                    arm.config =
                        BundleAdjustmentConfig { start, ..BundleAdjustmentConfig::paper() };
                }),
            ],
            Self::Lambda => {
                let lambda = |factor: f32| {
                    arm(&factor.to_string(), &|arm| {
                        arm.config.objective.silhouette_weight *= factor
                    })
                };
                [0.0, 0.1, 0.3, 1.0, 3.0, 10.0].map(lambda).into()
            }
            Self::Parameterisation => {
                let centre =
                    |name, value| arm(name, &|arm| arm.config.objective.parameterisation = value);
                vec![
                    centre("object", Parameterisation::ObjectCentred),
                    centre("camera", Parameterisation::CameraCentred),
                ]
            }
            Self::Pyramid => {
                let levels: [&[f32]; 5] = [
                    &[0.0],
                    &[0.7, 0.0],
                    &[1.5, 0.7, 0.0],
                    &[3.0, 1.5, 0.7, 0.0],
                    &[6.0, 3.0, 1.5, 0.7, 0.0],
                ];
                let pyramid =
                    |blurs: &[f32]| arm(&span(blurs), &|arm| reblur(&mut arm.config, blurs));
                levels.map(pyramid).into()
            }
            Self::Hypotheses => {
                let tried = |n: usize| arm(&n.to_string(), &|arm| arm.config.n_hypotheses = n);
                [1, 2, 3].map(tried).into()
            }
            Self::Points => {
                let numbers = (0..).map(|i| default.n_judged_points >> i);
                let mut numbers: Vec<_> = numbers.take_while(|&n| n >= 1536).take(5).collect();
                numbers.reverse();
                numbers.into_iter().map(|n| arm(&n.to_string(), &|arm| arm.n_points = n)).collect()
            }
            Self::Beyond => {
                let modes = |n: usize| {
                    arm(&n.to_string(), &|arm| {
                        arm.config.displacement.n_modes = n;
                        arm.n_judged_points = arm.n_points;
                    })
                };
                [0, 20, 60].map(modes).into()
            }
            Self::All => unreachable!("it stands for the others"),
        }
    }
}

/// One solver that can do both, and one number of points by which both are judged.
fn prior_and_free_points(default: &Arm) -> Vec<Arm> {
    let arm = |name: &str, shape| {
        let mut arm = Arm { name: name.into(), shape, ..default.clone() };
        arm.n_judged_points = arm.n_points;
        if arm.config.solver == Solver::Lm {
            // It solves for few directions of a shape.
            arm.config.solver = Solver::Adam;
        }
        arm
    };
    vec![arm("shape prior", Shape::Prior), arm("free points", Shape::FreePoints)]
}

/// Other blurs, with as many iterations over all of them.
fn reblur(config: &mut BundleAdjustmentConfig, blurs: &[f32]) {
    let shared = |n: usize| (n * config.blurs.len()).div_ceil(blurs.len());
    let (lm, adam) = (shared(config.lm.iterations), shared(config.adam.iterations));
    let lbfgs = [config.lbfgs.iterations, config.lbfgs.evaluations].map(shared);
    let rounds = shared(config.alternating.max_rounds);
    config.lm.iterations = lm;
    config.adam.iterations = adam;
    [config.lbfgs.iterations, config.lbfgs.evaluations] = lbfgs;
    config.alternating.max_rounds = rounds;
    config.blurs = blurs.into();
}

/// "3 … 0", or the one that there is.
fn span(blurs: &[f32]) -> String {
    match blurs {
        [only] => only.to_string(),
        _ => format!("{} … {}", blurs[0], blurs[blurs.len() - 1]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arms(study: Study) -> Vec<Arm> {
        let base = BundleAdjustmentConfig::preset(Solver::Lm);
        study.comparison(&base, 6144, 24_576).arms
    }

    #[test]
    fn arms_of_a_study_have_names_of_their_own_and_are_judged_alike() {
        for study in Study::ALL {
            let arms = arms(study);
            for (i, arm) in arms.iter().enumerate() {
                assert!(arms[..i].iter().all(|other| other.name != arm.name), "{study:?}");
                assert_eq!(arm.n_judged_points, arms[0].n_judged_points, "{study:?}");
                assert!(
                    arms[..i]
                        .iter()
                        .all(|other| { Arm { name: arm.name.clone(), ..other.clone() } != *arm })
                );
            }
        }
    }

    #[test]
    fn pyramids_share_a_budget() {
        let budgets = arms(Study::Pyramid).into_iter().map(|arm| {
            let config = arm.config;
            (config.blurs.len() * config.lm.iterations, config.blurs.len() * config.adam.iterations)
        });
        let budgets: Vec<_> = budgets.collect();
        assert!(budgets.iter().all(|budget| *budget == (60, 240)), "{budgets:?}");
    }

    #[test]
    fn the_numbers_of_points_are_the_prior_s_and_below() {
        let numbers: Vec<_> = arms(Study::Points).iter().map(|arm| arm.n_points).collect();
        assert_eq!(numbers, [1536, 3072, 6144, 12_288, 24_576]);
    }
}
