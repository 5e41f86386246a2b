//! Rows of the Jacobian of one frame's residuals.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Vector3};

use super::{linearisation::Linearisation, shape_jacobian::ShapeJacobian};

/// Rows of one frame's weighted Jacobian and their residuals; columns are
/// [p_0 | s | focal | Δp_l], of which the focal length may not be there.
pub struct Rows<'a> {
    jacobian: Vec<f64>,
    residuals: Vec<f64>,
    points: &'a [[f32; 3]],
    shape: &'a ShapeJacobian,
    refines_focal: bool,
    poses: [&'a Isometry3<f64>; 2],
    /// R_0, R_l and ΔR_l = R_l R_0ᵀ.
    rotations: [Matrix3<f64>; 2],
    relative: Matrix3<f64>,
}

/// A point in the cameras of the reference frame and of another.
pub struct Placed {
    point_idx: usize,
    /// R_0 X and R_l X, then with t_0 and t_l.
    turned: [Vector3<f64>; 2],
    pub in_reference: Vector3<f64>,
    pub in_frame: Vector3<f64>,
}

impl<'a> Rows<'a> {
    pub fn new(at: &'a Linearisation, frame: usize) -> Self {
        let poses = [&at.poses[0], &at.poses[frame]];
        let rotations = poses.map(|pose| pose.rotation.to_rotation_matrix().into_inner());
        Self {
            jacobian: Vec::new(),
            residuals: Vec::new(),
            points: &at.matches.points,
            shape: at.shape,
            refines_focal: at.refines_focal,
            poses,
            rotations,
            relative: rotations[1] * rotations[0].transpose(),
        }
    }

    pub fn place(&self, point_idx: usize) -> Placed {
        let in_world = Vector3::from(self.points[point_idx].map(f64::from));
        let turned = self.rotations.map(|rotation| rotation * in_world);
        let [in_reference, in_frame] = [0, 1].map(|i| turned[i] + self.poses[i].translation.vector);
        Placed { point_idx, turned, in_reference, in_frame }
    }

    /// A residual whose derivatives by the point in the reference camera and in the frame's are given:
    /// a and b. A turn moves a point by δω × R X, and a · (δω × y) = δω · (y × a).
    pub fn push(&mut self, placed: &Placed, [a, b]: [Vector3<f64>; 2], residual: f64, weight: f64) {
        let (a, b) = (a * weight, b * weight);
        let by_turned = a + self.relative.tr_mul(&b);
        let by_world = self.rotations[0].tr_mul(&by_turned);
        let rows = &mut self.jacobian;
        rows.extend(placed.turned[0].cross(&by_turned).as_slice());
        rows.extend((a + b).as_slice());
        let derivatives = self.shape.of_point(placed.point_idx);
        rows.extend(
            derivatives
                .iter()
                .map(|moved| (0..3).map(|i| by_world[i] * f64::from(moved[i])).sum::<f64>()),
        );
        if self.refines_focal {
            // A longer one moves pixels as [x, y] do: ∂u/∂(log f) = f x / z.
            let sideways = |by_point: &Vector3<f64>, at: &Vector3<f64>| by_point.xy().dot(&at.xy());
            rows.push(sideways(&a, &placed.in_reference) + sideways(&b, &placed.in_frame));
        }
        rows.extend(placed.turned[1].cross(&b).as_slice());
        rows.extend(b.as_slice());
        self.residuals.push(weight * residual);
    }

    /// Eliminates unknowns that only the rows so far depend on, and that are at their best: a column of
    /// J, weighted as its rows are, for each. What these rows can say of the others is what remains when
    /// they are projected off those columns, which is the Schur complement of JᵀJ. Of the residuals, Jᵀr
    /// then ignores what lies along those columns.
    pub fn eliminate(&mut self, columns: &[Vec<f64>]) {
        let n_columns = self.n_columns();
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for column in columns {
            let mut rest = DVector::from_column_slice(column);
            let norm = rest.norm();
            basis.iter().for_each(|done| rest -= done * done.dot(&rest));
            // A column that the others contain takes nothing more away.
            if rest.norm() > 1e-6 * norm {
                basis.push(rest.normalize());
            }
        }
        for unit in &basis {
            let mut along = vec![0.0; n_columns];
            for (row, share) in self.jacobian.chunks(n_columns).zip(unit.iter()) {
                along.iter_mut().zip(row).for_each(|(sum, value)| *sum += share * value);
            }
            for (row, share) in self.jacobian.chunks_mut(n_columns).zip(unit.iter()) {
                row.iter_mut().zip(&along).for_each(|(value, sum)| *value -= share * sum);
            }
        }
    }

    fn n_columns(&self) -> usize {
        12 + self.shape.n_directions() + usize::from(self.refines_focal)
    }

    /// JᵀJ and Jᵀr.
    pub fn squared(self) -> (DMatrix<f64>, DVector<f64>) {
        let n_columns = self.n_columns();
        let residuals = DVector::from_vec(self.residuals);
        // Rows of J one after the other are the columns of Jᵀ.
        let transposed = DMatrix::from_vec(n_columns, residuals.len(), self.jacobian);
        (&transposed * transposed.transpose(), transposed * residuals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use rand::Rng;

    const N_ROWS: usize = 40;
    const N_COLUMNS: usize = 12;

    /// The Schur complement of the normal equations of all unknowns, whose last are eliminated.
    #[test]
    fn eliminating_unknowns_is_their_schur_complement() {
        let mut rng = keyed_rng(6, [0, 0]);
        let mut random =
            |n: usize| -> Vec<f64> { (0..n).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (jacobian, residuals) = (random(N_ROWS * N_COLUMNS), random(N_ROWS));
        let columns = [random(N_ROWS), vec![0.7; N_ROWS]];
        let (shape, pose) = (ShapeJacobian::default(), Isometry3::identity());
        let mut rows = Rows {
            jacobian: jacobian.clone(),
            residuals: residuals.clone(),
            points: &[],
            shape: &shape,
            refines_focal: false,
            poses: [&pose, &pose],
            rotations: [Matrix3::identity(); 2],
            relative: Matrix3::identity(),
        };
        // A column twice is one unknown, not two.
        rows.eliminate(&[columns[0].clone(), columns[1].clone(), columns[0].clone()]);
        let (squared, gradient) = rows.squared();

        let kept = DMatrix::from_row_slice(N_ROWS, N_COLUMNS, &jacobian);
        let others = DMatrix::from_column_slice(N_ROWS, 2, &columns.concat());
        let residuals = DVector::from_vec(residuals);
        let inverse = (others.transpose() * &others).try_inverse().expect("regular");
        let share = kept.transpose() * &others * inverse;
        let expected = kept.transpose() * &kept - &share * others.transpose() * &kept;
        assert!((&squared - &expected).norm() < 1e-9, "{squared} is not {expected}");
        let expected = kept.transpose() * &residuals - &share * others.transpose() * &residuals;
        assert!((&gradient - &expected).norm() < 1e-9, "{gradient} is not {expected}");
    }
}
