//! Rows of the Jacobian of one frame's residuals.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Vector3};

use super::{linearisation::Linearisation, shape_jacobian::ShapeJacobian};

/// Rows of one frame's weighted Jacobian and their residuals; columns are [p_0 | s | Δp_l].
pub struct Rows<'a> {
    jacobian: Vec<f64>,
    residuals: Vec<f64>,
    points: &'a [[f32; 3]],
    shape: &'a ShapeJacobian,
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
        rows.extend(placed.turned[1].cross(&b).as_slice());
        rows.extend(b.as_slice());
        self.residuals.push(weight * residual);
    }

    /// JᵀJ and Jᵀr.
    pub fn squared(self) -> (DMatrix<f64>, DVector<f64>) {
        let residuals = DVector::from_vec(self.residuals);
        // Rows of J one after the other are the columns of Jᵀ.
        let n_columns = 12 + self.shape.n_directions();
        let transposed = DMatrix::from_vec(n_columns, residuals.len(), self.jacobian);
        (&transposed * transposed.transpose(), transposed * residuals)
    }
}
