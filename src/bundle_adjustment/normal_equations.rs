//! H step = −g, where frames meet only through p_0, the style and the focal length: an arrow of a matrix.
//!
//! [p_0 | s] stands for all that frames share: the focal length comes after the style, where it is refined.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Vector6};

/// A quadratic model of the objective around the current unknowns.
///
/// Its unknowns are [p_0 | s], which all frames share, and each Δp_l, which only its own frame knows.
pub struct NormalEquations {
    /// Among [p_0 | s].
    pub shared: DMatrix<f64>,
    pub shared_gradient: DVector<f64>,
    /// For each Δp_l: among itself, with [p_0 | s], and its gradient.
    frames: Vec<FrameBlock>,
}

#[derive(Clone)]
struct FrameBlock {
    own: Matrix6<f64>,
    with_shared: DMatrix<f64>,
    gradient: Vector6<f64>,
}

/// Keeps a direction that no residual depends on from having no solution.
const LEAST_CURVATURE: f64 = 1e-9;

impl NormalEquations {
    /// Adds up each frame's JᵀJ and Jᵀr, whose columns are `n_shared` of [p_0 | s], then Δp_l. The
    /// reference frame has no Δp: its last six are empty.
    pub fn from_frames(n_shared: usize, blocks: &[(DMatrix<f64>, DVector<f64>)]) -> Self {
        let mut equations = Self {
            shared: DMatrix::zeros(n_shared, n_shared),
            shared_gradient: DVector::zeros(n_shared),
            frames: Vec::new(),
        };
        for (frame, (squared, gradient)) in blocks.iter().enumerate() {
            equations.shared += squared.view((0, 0), (n_shared, n_shared));
            equations.shared_gradient += gradient.rows(0, n_shared);
            if frame > 0 {
                equations.frames.push(FrameBlock {
                    own: squared.fixed_view::<6, 6>(n_shared, n_shared).into(),
                    with_shared: squared.view((0, n_shared), (n_shared, 6)).into(),
                    gradient: gradient.fixed_rows::<6>(n_shared).into(),
                });
            }
        }
        equations
    }

    /// Adds a weighted mean of squares over a style, of which `n_directions` are solved for.
    pub fn add_style_prior(&mut self, weight: f32, style: &[f64], n_directions: usize) {
        let weight = f64::from(weight) / style.len().max(1) as f64;
        for (i, value) in (6..6 + n_directions).zip(style) {
            self.shared[(i, i)] += weight;
            self.shared_gradient[i] += weight * value;
        }
    }

    /// The step [p_0 | s | Δp_1 | …] of the damped equations: the Schur complement on the Δp_l leaves
    /// those of [p_0 | s], and time grows with the number of frames. `None` where they are singular or
    /// not finite.
    pub fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut shared = damped(self.shared.clone(), damping);
        let mut gradient = self.shared_gradient.clone();
        let mut factors = Vec::with_capacity(self.frames.len());
        for frame in &self.frames {
            let own = factor(frame, damping)?;
            let solved = own.solve(&frame.with_shared.transpose()); // [6, shared]
            gradient -= solved.tr_mul(&frame.gradient);
            shared -= &frame.with_shared * solved;
            factors.push(own);
        }
        let shared = -shared.cholesky()?.solve(&gradient);
        self.completed(shared, &factors)
    }

    /// The step of the Δp_l alone.
    pub fn relative_step(&self, damping: f64) -> Option<DVector<f64>> {
        let factors: Option<Vec<_>> = self.frames.iter().map(|f| factor(f, damping)).collect();
        self.completed(DVector::zeros(self.shared.nrows()), &factors?)
    }

    /// The Δp_l that belong to a step of [p_0 | s].
    fn completed(
        &self,
        shared: DVector<f64>,
        factors: &[Cholesky<f64, Dyn>],
    ) -> Option<DVector<f64>> {
        let mut step = shared.as_slice().to_vec();
        for (frame, own) in self.frames.iter().zip(factors) {
            let right = DVector::from_column_slice(frame.gradient.as_slice())
                + frame.with_shared.tr_mul(&shared);
            step.extend((-own.solve(&right)).as_slice());
        }
        step.iter().all(|x| x.is_finite()).then(|| DVector::from_vec(step))
    }

    /// Numbers in a step.
    pub fn size(&self) -> usize {
        self.shared.nrows() + 6 * self.frames.len()
    }

    /// H as one matrix.
    pub fn hessian(&self) -> DMatrix<f64> {
        let (n_shared, size) = (self.shared.nrows(), self.size());
        let mut hessian = DMatrix::zeros(size, size);
        hessian.view_mut((0, 0), (n_shared, n_shared)).copy_from(&self.shared);
        for (start, frame) in (n_shared..).step_by(6).zip(&self.frames) {
            hessian.view_mut((start, start), (6, 6)).copy_from(&frame.own);
            hessian.view_mut((0, start), (n_shared, 6)).copy_from(&frame.with_shared);
            hessian.view_mut((start, 0), (6, n_shared)).copy_from(&frame.with_shared.transpose());
        }
        hessian
    }

    /// g as one vector.
    #[cfg(test)]
    pub fn gradient(&self) -> DVector<f64> {
        let of_frames = self.frames.iter().flat_map(|frame| frame.gradient.as_slice());
        let gradient: Vec<f64> = self.shared_gradient.iter().chain(of_frames).copied().collect();
        DVector::from_vec(gradient)
    }
}

fn damped(mut hessian: DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    for i in 0..hessian.nrows() {
        hessian[(i, i)] += damping * hessian[(i, i)] + LEAST_CURVATURE;
    }
    hessian
}

fn factor(frame: &FrameBlock, damping: f64) -> Option<Cholesky<f64, Dyn>> {
    let own = DMatrix::from_column_slice(6, 6, frame.own.as_slice());
    damped(own, damping).cholesky()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    const N_SHARED: usize = 9;

    fn random(n_frames: usize) -> NormalEquations {
        let mut rng = keyed_rng(4, [0, 0]);
        let mut block = |frame: usize| {
            let mut rows = DMatrix::from_fn(40, N_SHARED + 6, |_, _| rng.random_range(-1.0..1.0));
            if frame == 0 {
                rows.columns_mut(N_SHARED, 6).fill(0.0);
            }
            let residuals = DVector::from_fn(40, |_, _| rng.random_range(-1.0..1.0));
            (rows.transpose() * &rows, rows.transpose() * residuals)
        };
        NormalEquations::from_frames(N_SHARED, &(0..n_frames).map(&mut block).collect::<Vec<_>>())
    }

    #[test]
    fn the_schur_complement_solves_the_whole_matrix() {
        for n_frames in [1, 2, 5] {
            let equations = random(n_frames);
            for damping in [0.0, 0.3] {
                let whole = damped(equations.hessian(), damping);
                let expected = -whole.lu().solve(&equations.gradient()).expect("regular");
                let step = equations.step(damping).expect("positive definite");
                assert!((&step - &expected).norm() < 1e-9, "{step} is not {expected}");
            }
        }
    }

    #[test]
    fn relative_poses_alone_solve_their_own_blocks() {
        let equations = random(3);
        let step = equations.relative_step(0.1).expect("positive definite");
        let own = equations.hessian().view((N_SHARED, N_SHARED), (12, 12)).into_owned();
        let residual =
            damped(own, 0.1) * step.rows(N_SHARED, 12) + equations.gradient().rows(N_SHARED, 12);
        assert!(step.rows(0, N_SHARED).norm() == 0.0 && residual.norm() < 1e-9);
    }

    #[test]
    fn equations_that_are_not_finite_have_no_step() {
        let mut equations = random(3);
        equations.shared_gradient[0] = f64::NAN;
        assert!(equations.step(0.1).is_none());
    }
}
