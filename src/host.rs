//! Values between the device and the host, where decisions are taken.

use burn::tensor::{Int, Tensor, TensorData};

/// A float tensor's values in row-major order, as single precision, detached from the graph.
pub fn host_values<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    let data = tensor.clone().inner().into_data().convert::<f32>();
    data.try_into_vec::<f32>().expect("converted to f32")
}

/// The points of a batch of clouds `[b, n, 3]`, one after the other.
pub fn host_points(points: &Tensor<3>) -> Vec<[f32; 3]> {
    host_values(points).as_chunks::<3>().0.to_vec()
}

/// The locations of each frame, `[b, n, 2]` as b lists of n.
pub fn host_pixels(pixels: &Tensor<3>) -> Vec<Vec<[f32; 2]>> {
    let [_, n, _] = pixels.dims();
    host_values(pixels).as_chunks::<2>().0.chunks(n).map(<[_]>::to_vec).collect()
}

/// Indices on the device of `like`, for `select`.
pub fn index_tensor<const D: usize>(indices: Vec<i64>, like: &Tensor<D>) -> Tensor<1, Int> {
    let n_indices = indices.len();
    Tensor::from_data(TensorData::new(indices, [n_indices]), &like.device().inner())
}
