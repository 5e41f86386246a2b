//! I(u) and its slope, on the host.

use crate::data::ColorImage;

/// The bilinear colour at a location and its derivative by [u, v], a row for each channel.
///
/// Beyond the outermost centres the border's colour continues, without a slope across it.
pub fn color_and_slope(image: &ColorImage, [u, v]: [f32; 2]) -> ([f64; 3], [[f64; 2]; 3]) {
    let axis = |location: f32, side: u32| {
        let last = side.saturating_sub(1) as f32;
        let at = (location - 0.5).clamp(0.0, last);
        let first = at.floor().min((last - 1.0).max(0.0));
        let inside = location - 0.5 > 0.0 && location - 0.5 < last;
        (first as u32, f64::from(at - first), if inside { 1.0 } else { 0.0 })
    };
    let (x, fx, inside_x) = axis(u, image.width());
    let (y, fy, inside_y) = axis(v, image.height());
    let (right, below) = ((x + 1).min(image.width() - 1), (y + 1).min(image.height() - 1));
    let [a, b, c, d] = [(x, y), (right, y), (x, below), (right, below)]
        .map(|(x, y)| image.get_pixel(x, y).0.map(f64::from));
    let color = std::array::from_fn(|i| {
        (1.0 - fy) * ((1.0 - fx) * a[i] + fx * b[i]) + fy * ((1.0 - fx) * c[i] + fx * d[i])
    });
    let slope = std::array::from_fn(|i| {
        let along_u = (1.0 - fy) * (b[i] - a[i]) + fy * (d[i] - c[i]);
        let along_v = (1.0 - fx) * (c[i] - a[i]) + fx * (d[i] - b[i]);
        [along_u * inside_x, along_v * inside_y]
    });
    (color, slope)
}
