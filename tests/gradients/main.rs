//! Every differentiable step meets central differences, in double precision.
//!
//! A device's precision is set once, before its first tensor: so these tests are a process of their
//! own. Data are made in double precision too, since `from_floats` rounds through single.

mod objective;
mod steps;

use std::sync::LazyLock;

use burn::tensor::{DType, Device, FloatDType, Tensor, TensorData};
use object_pba::device::Backend;

/// A differentiating device that computes in double precision.
static DEVICE: LazyLock<Device> = LazyLock::new(|| {
    let mut device = Backend::Flex.device();
    device.configure(FloatDType::F64).expect("no tensor exists yet");
    device.autodiff()
});

/// Half the distance over which differences are taken.
const STEP: f64 = 1e-6;
/// Largest error of a derivative, relative to the largest of the gradient.
const TOLERANCE: f64 = 1e-7;

/// Holds the gradient that `function` gives along with its value against the values around `x`.
#[track_caller]
fn check_gradient(x: &[f64], function: impl Fn(&[f64]) -> (f64, Vec<f64>)) {
    let (_, gradient) = function(x);
    let largest = gradient.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
    assert!(largest > 1e-6, "nothing depends on anything: {gradient:?}");
    for (i, actual) in gradient.iter().enumerate() {
        let beside = |offset: f64| {
            let mut x = x.to_vec();
            x[i] += offset;
            function(&x).0
        };
        let expected = (beside(STEP) - beside(-STEP)) / (2.0 * STEP);
        let error = (actual - expected).abs() / largest;
        assert!(error < TOLERANCE, "d/dx_{i} is {actual}, differences say {expected}");
    }
}

/// A function of one vector on the graph, as a value and a gradient; see [`check_gradient`].
fn on_graph(function: impl Fn(Tensor<1>) -> Tensor<1>) -> impl Fn(&[f64]) -> (f64, Vec<f64>) {
    move |x| {
        let x = vector(x).require_grad();
        let value = function(x.clone());
        let gradient = x.grad(&value.clone().backward()).expect("the value depends on x");
        let gradient = gradient.into_data().convert_dtype(DType::F64).try_into_vec();
        (value.into_scalar::<f64>(), gradient.expect("f64"))
    }
}

fn vector(values: &[f64]) -> Tensor<1> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len()]), &*DEVICE)
}

/// One number that depends on every entry, and on each differently: `[1]`.
fn mixed<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    let n_entries = tensor.dims().iter().product::<usize>();
    let weights: Vec<f64> = (0..n_entries).map(|i| (1.7 * i as f64 + 0.3).sin()).collect();
    (tensor.reshape([n_entries]) * vector(&weights)).sum()
}

/// Fixed numbers in [−1, 1) without a pattern.
fn scattered(n_values: usize, seed: u64) -> Vec<f64> {
    use rand::Rng;
    let mut rng = object_pba::data::keyed_rng(seed, [0, 0]);
    (0..n_values).map(|_| rng.random_range(-1.0..1.0)).collect()
}
