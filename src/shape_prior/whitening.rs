//! The change of coordinates between the autoencoder's latent and the style **s**.

use burn::{
    module::{Module, Param},
    tensor::{Device, Tensor, TensorData},
};
use nalgebra::{DMatrix, SymmetricEigen};

/// Directions that vary less than this, relative to the most varying one, are dropped: the
/// generator has seen next to nothing along them.
const NEGLIGIBLE_DEVIATION: f64 = 0.01;

/// `latent = mean + style · basis`: style has unit variance over the training shapes, in order of
/// importance, and style 0 is the mean shape.
#[derive(Module, Debug)]
pub struct Whitening {
    mean: Param<Tensor<1>>,  // [k_latent]
    basis: Param<Tensor<2>>, // [k_style, k_latent]: orthogonal rows, as long as their deviations
}

impl Whitening {
    /// Style is the latent itself, until it is known how latents vary.
    pub fn identity(n_latent: usize, device: &Device) -> Self {
        Self::from_tensors(Tensor::zeros([n_latent], device), Tensor::eye(n_latent, device))
    }

    /// An affine map of these sizes, to be loaded over.
    pub fn zeros(n_style: usize, n_latent: usize, device: &Device) -> Self {
        let basis = Tensor::zeros([n_style, n_latent], device);
        Self::from_tensors(Tensor::zeros([n_latent], device), basis)
    }

    /// Principal components of `latents`, one row a training shape.
    pub fn fit(latents: &DMatrix<f64>, device: &Device) -> Self {
        let mean = latents.row_mean();
        let centred =
            DMatrix::from_fn(latents.nrows(), latents.ncols(), |i, j| latents[(i, j)] - mean[j]);
        let covariance = centred.transpose() * &centred / (latents.nrows().max(2) - 1) as f64;
        let eigen = SymmetricEigen::new(covariance);

        let deviation = |i: usize| eigen.eigenvalues[i].max(0.0).sqrt();
        let mut order: Vec<usize> = (0..latents.ncols()).collect();
        order.sort_by(|&i, &j| deviation(j).total_cmp(&deviation(i)));
        // One direction always stays, so that a style exists even where no shape differs.
        let threshold = NEGLIGIBLE_DEVIATION * deviation(order[0]);
        let n_style = order.iter().filter(|&&i| deviation(i) > threshold).count().max(1);
        order.truncate(n_style);

        let basis = order.iter().flat_map(|&i| {
            let length = deviation(i).max(f64::EPSILON);
            eigen
                .eigenvectors
                .column(i)
                .iter()
                .map(move |x| (x * length) as f32)
                .collect::<Vec<_>>()
        });
        let basis = TensorData::new(basis.collect(), [order.len(), latents.ncols()]);
        let mean: Vec<f32> = mean.iter().map(|&x| x as f32).collect();
        Self::from_tensors(
            Tensor::from_floats(mean.as_slice(), device),
            Tensor::from_data(basis, device),
        )
    }

    pub fn n_style(&self) -> usize {
        self.basis.dims()[0]
    }

    /// `[b, k_style]` to `[b, k_latent]`.
    pub fn latent_from_style(&self, style: Tensor<2>) -> Tensor<2> {
        style.matmul(self.basis.val()) + self.mean.val().unsqueeze()
    }

    /// `[b, k_latent]` to `[b, k_style]`; what lies outside the kept directions is lost.
    pub fn style_from_latent(&self, latent: Tensor<2>) -> Tensor<2> {
        let basis = self.basis.val();
        let variances = basis.clone().square().sum_dim(1).transpose(); // [1, k_style]
        (latent - self.mean.val().unsqueeze()).matmul(basis.transpose()) / variances
    }

    /// Standard deviations of the latent along each style direction, `[k_style]`.
    pub fn deviations(&self) -> Tensor<1> {
        self.basis.val().square().sum_dim(1).sqrt().squeeze_dim(1)
    }

    /// Statistics rather than weights: the optimiser leaves them alone.
    fn from_tensors(mean: Tensor<1>, basis: Tensor<2>) -> Self {
        Self { mean: Param::from_tensor(mean), basis: Param::from_tensor(basis) }.no_grad()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::keyed_rng;
    use burn::tensor::Tolerance;
    use rand::Rng;

    /// 500 latents of four numbers, of which the last is the sum of the first two.
    fn latents() -> DMatrix<f64> {
        let mut rng = keyed_rng(0, [0, 0]);
        let mut latents = DMatrix::from_fn(500, 4, |_, j| (j + 1) as f64 * rng.random::<f64>());
        let sum = latents.column(0) + latents.column(1);
        latents.set_column(3, &sum);
        latents
    }

    fn tensor(latents: &DMatrix<f64>, device: &Device) -> Tensor<2> {
        let rows: Vec<f32> = latents.transpose().iter().map(|&x| x as f32).collect();
        Tensor::from_data(TensorData::new(rows, [latents.nrows(), latents.ncols()]), device)
    }

    #[test]
    fn styles_are_white() {
        let device = Device::flex();
        let styles =
            Whitening::fit(&latents(), &device).style_from_latent(tensor(&latents(), &device));
        let covariance = styles.clone().transpose().matmul(styles) / 499.0;
        let identity = Tensor::<2>::eye(3, &device).into_data();
        covariance.into_data().assert_approx_eq::<f32>(&identity, Tolerance::absolute(1e-3));
    }

    #[test]
    fn a_latent_survives_the_way_to_style_and_back() {
        let device = Device::flex();
        let whitening = Whitening::fit(&latents(), &device);
        let there = tensor(&latents(), &device);
        let back = whitening.latent_from_style(whitening.style_from_latent(there.clone()));
        back.into_data().assert_approx_eq::<f32>(&there.into_data(), Tolerance::absolute(1e-4));
    }

    #[test]
    fn directions_without_variance_are_dropped() {
        assert_eq!(Whitening::fit(&latents(), &Device::flex()).n_style(), 3);
    }

    #[test]
    fn equal_latents_leave_a_finite_style() {
        let device = Device::flex();
        let equal = DMatrix::from_element(5, 4, 1.0);
        let whitening = Whitening::fit(&equal, &device);
        let styles = whitening.style_from_latent(tensor(&equal, &device));
        assert!(styles.into_data().iter::<f32>().all(f32::is_finite));
    }
}
