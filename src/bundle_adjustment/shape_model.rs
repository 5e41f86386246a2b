//! X = G(s), and what the ablation puts in its place.

use burn::tensor::{Tensor, TensorData};

use crate::shape_prior::Generator;

/// Step of the style for differences, in standard deviations.
const STEP: f32 = 0.05;

/// A cloud as a differentiable function of a vector.
pub trait ShapeModel: Sync {
    /// `[b, k]` to b clouds `[b, n, 3]`, in the world frame.
    fn points(&self, style: Tensor<2>) -> Tensor<3>;

    /// ∂X/∂s at a style `[1, k]` by its leading directions, `[n_directions, n, 3]`: by differences of
    /// decoded neighbours, since a network hides them.
    fn derivatives(&self, style: Tensor<2>, n_directions: usize) -> Tensor<3> {
        let [_, n_style] = style.dims();
        let mut steps = vec![0.0; (1 + n_directions) * n_style];
        (0..n_directions).for_each(|i| steps[(1 + i) * n_style + i] = STEP);
        let steps = TensorData::new(steps, [1 + n_directions, n_style]);
        // The style itself, then a row for each direction.
        let rows = style.clone() + Tensor::from_data(steps, &style.device());
        let clouds = self.points(rows);
        let here = clouds.clone().narrow(0, 0, 1);
        (clouds.narrow(0, 1, n_directions) - here) / STEP
    }
}

/// The shape prior: every point follows from the style.
impl ShapeModel for Generator {
    fn points(&self, style: Tensor<2>) -> Tensor<3> {
        self.forward(style)
    }
}

/// No prior (Fig. 7): the unknowns are the points themselves, `[b, 3n]`.
pub struct FreePoints;

impl ShapeModel for FreePoints {
    fn points(&self, style: Tensor<2>) -> Tensor<3> {
        let [b, _] = style.dims();
        style.reshape([b as i64, -1, 3])
    }
}

/// A shape that is known: nothing to solve for but the poses.
pub struct KnownPoints(pub Tensor<3>);

impl ShapeModel for KnownPoints {
    fn points(&self, _: Tensor<2>) -> Tensor<3> {
        self.0.clone()
    }
}
