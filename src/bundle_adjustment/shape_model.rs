//! X = G(s), and what the ablation puts in its place.

use burn::tensor::Tensor;

use crate::shape_prior::Generator;

/// A cloud as a differentiable function of a vector.
pub trait ShapeModel: Sync {
    /// `[b, k]` to b clouds `[b, n, 3]`, in the world frame.
    fn points(&self, style: Tensor<2>) -> Tensor<3>;
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
