//! The objective at some unknowns, and whether these can be trusted.

use super::{correspondences::Correspondences, progress::Status};

/// Share of the points that may lie behind a camera.
const MOST_BEHIND: f64 = 0.01;
/// Share of the points that must land in every frame.
const LEAST_IN_FRAME: f64 = 0.05;
/// Share of the points that the reference frame must see.
const LEAST_VISIBLE: f64 = 0.005;

/// The objective and its gradient at some unknowns, on the host.
#[derive(Clone, Debug)]
pub struct Evaluation {
    pub objective: f64,
    pub photometric: f64,
    pub silhouette: f64,
    /// Points of the cloud, and those that the reference frame sees.
    pub n_points: usize,
    pub n_visible: usize,
    /// Points that land in the frame where the fewest do, and that lie behind the worst camera.
    pub least_in_frame: usize,
    pub most_behind: usize,
    /// In the order of [`Unknowns::values`](super::unknowns::Unknowns); empty where nothing depends on
    /// them.
    pub gradient: Vec<f64>,
}

impl Evaluation {
    /// `[objective, photometric, silhouette]` of what was compared.
    pub(super) fn new(
        [objective, photometric, silhouette]: [f64; 3],
        matches: &Correspondences,
        gradient: Vec<f64>,
    ) -> Self {
        Self {
            // Locations that are no numbers take part in nothing, and would cost nothing.
            objective: if matches.are_finite() { objective } else { f64::NAN },
            photometric,
            silhouette,
            n_points: matches.points.len(),
            n_visible: matches.visible[0].len(),
            least_in_frame: matches.n_in_frame.iter().copied().min().unwrap_or(0),
            most_behind: matches.n_behind.iter().copied().max().unwrap_or(0),
            gradient,
        }
    }

    /// What is wrong with the unknowns, if anything.
    pub fn fault(&self) -> Option<Status> {
        let share = |n: usize| n as f64 / self.n_points.max(1) as f64;
        if !self.objective.is_finite() || !self.gradient.iter().all(|g| g.is_finite()) {
            Some(Status::NotFinite)
        } else if share(self.most_behind) > MOST_BEHIND {
            Some(Status::BehindCamera)
        } else if share(self.least_in_frame) < LEAST_IN_FRAME {
            Some(Status::OutOfFrame)
        } else if share(self.n_visible) < LEAST_VISIBLE {
            Some(Status::VisibleSetShrank)
        } else {
            None
        }
    }

    /// Why a solver must not go on to `next`, though it costs less. From unknowns that are at fault
    /// themselves, any way down is right.
    pub(super) fn refuses(&self, next: &Self) -> Option<Status> {
        if self.fault().is_some() {
            return next.fault().filter(|&fault| fault == Status::NotFinite);
        }
        let shrank = 2 * next.n_visible < self.n_visible;
        next.fault().or(shrank.then_some(Status::VisibleSetShrank))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound() -> Evaluation {
        Evaluation {
            objective: 1.0,
            photometric: 0.0,
            silhouette: 0.0,
            n_points: 1000,
            n_visible: 300,
            least_in_frame: 900,
            most_behind: 0,
            gradient: vec![1.0],
        }
    }

    #[test]
    fn each_fault_is_named() {
        let faults = [
            (sound(), None),
            (Evaluation { objective: f64::NAN, ..sound() }, Some(Status::NotFinite)),
            (Evaluation { gradient: vec![f64::INFINITY], ..sound() }, Some(Status::NotFinite)),
            (Evaluation { most_behind: 500, ..sound() }, Some(Status::BehindCamera)),
            (Evaluation { least_in_frame: 3, ..sound() }, Some(Status::OutOfFrame)),
            (Evaluation { n_visible: 1, ..sound() }, Some(Status::VisibleSetShrank)),
        ];
        for (evaluation, fault) in faults {
            assert_eq!(evaluation.fault(), fault, "{evaluation:?}");
        }
    }

    #[test]
    fn a_step_may_not_hide_most_of_what_is_seen() {
        let shrunk = Evaluation { n_visible: 100, ..sound() };
        assert_eq!(sound().refuses(&shrunk), Some(Status::VisibleSetShrank));
        assert_eq!(shrunk.refuses(&sound()), None);
    }

    #[test]
    fn any_finite_step_leads_out_of_a_fault() {
        let out = Evaluation { least_in_frame: 0, n_visible: 0, ..sound() };
        assert_eq!(out.refuses(&out), None);
        let nan = Evaluation { objective: f64::NAN, ..out.clone() };
        assert_eq!(out.refuses(&nan), Some(Status::NotFinite));
    }
}
