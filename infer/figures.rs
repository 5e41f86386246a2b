//! Pictures in the manner of Fig. 5 and 7.

use std::path::Path;

use anyhow::{Context, Result};
use burn::tensor::Device;
use image::{Rgb, RgbImage, imageops};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Outcome},
    checkpoint::Prior,
    data::{
        ColorImage,
        cloud_picture::{PAPER, draw_cloud, splat},
        crop::silhouette_box,
        sequence::Sequence,
    },
    reconstruction::{Views, views},
    silhouette::MASK_THRESHOLD,
};

/// Points that no frame saw are drawn in red, as in the paper's Fig. 1.
pub const UNSEEN: [u8; 3] = [200, 60, 50];
/// Colour of the points drawn over a frame.
const OVERLAY: Rgb<u8> = Rgb([60, 110, 255]);
/// Side of a panel, in pixels.
const PANEL: u32 = 240;
/// Share of the object's extent that a panel shows around it.
const MARGIN: f32 = 0.12;

/// The square part of a frame that a panel shows, in pixels of the frame.
#[derive(Clone, Copy)]
struct Window {
    left: f32,
    top: f32,
    side: f32,
}

impl Window {
    /// Around the object in some frames.
    fn around(sequence: &Sequence, frames: &[usize]) -> Self {
        let boxes =
            frames.iter().filter_map(|&f| silhouette_box(&sequence.frames[f].mask, MASK_THRESHOLD));
        let whole = [0.0, 0.0, sequence.size[0] as f32, sequence.size[1] as f32];
        let union =
            boxes.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
        let [left, top, right, bottom] = union.unwrap_or(whole);
        let side = (right - left).max(bottom - top) * (1.0 + 2.0 * MARGIN);
        let center = [(left + right) / 2.0, (top + bottom) / 2.0];
        Self { left: center[0] - side / 2.0, top: center[1] - side / 2.0, side }
    }

    fn zoom(&self) -> f32 {
        PANEL as f32 / self.side
    }

    /// Where a location of the frame lies in the panel.
    fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        [(u - self.left) * self.zoom(), (v - self.top) * self.zoom()]
    }

    /// The frame, magnified.
    fn show(&self, frame: &ColorImage) -> RgbImage {
        RgbImage::from_fn(PANEL, PANEL, |x, y| {
            let [u, v] = [x, y].map(|i| (i as f32 + 0.5) / self.zoom());
            let at = [u + self.left, v + self.top];
            let inside = at[0] >= 0.0 && at[1] >= 0.0;
            let inside = inside && at[0] < frame.width() as f32 && at[1] < frame.height() as f32;
            if inside { rgb(nearest_color(frame, at)) } else { PAPER }
        })
    }
}

/// Writes a picture for each stage, and all of them as one strip.
///
/// A stage shows the reference frame at the points it sees, the last frame at where those points
/// land, the difference of the two, and the last frame with the points it sees drawn over it.
pub fn write_stages(
    out: &Path,
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    device: &Device,
    outcome: &Outcome,
) -> Result<()> {
    let folder = out.join("stages");
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let mut rows = Vec::new();
    for (idx, (name, unknowns)) in outcome.stages.iter().enumerate() {
        let shape = outcome.shape(&prior.shape.generator);
        let pseudo_render = &config.objective.pseudo_render;
        let views = views(sequence, &shape, unknowns, pseudo_render, device);
        let row = stage(sequence, &views);
        save(&row, &folder.join(format!("{idx:02}_{}.png", name.replace(' ', "_"))))?;
        rows.push(row);
    }
    save(&stacked(&rows), &out.join("stages.png"))
}

fn stage(sequence: &Sequence, views: &Views) -> RgbImage {
    let last = sequence.frames.len() - 1;
    let window = Window::around(sequence, &[0, last]);
    let [reference, target] = [0, last].map(|frame| &sequence.frames[frame].color);
    let mut panels = [0; 3].map(|_| RgbImage::from_pixel(PANEL, PANEL, PAPER));
    for &point in &views.visible[0] {
        let [at, there] = [0, last].map(|frame| views.pixels[frame][point as usize]);
        let (a, b) = (nearest_color(reference, at), nearest_color(target, there));
        let residual = std::array::from_fn(|c| 1.0 - 2.0 * (a[c] - b[c]).abs());
        for (panel, color) in panels.iter_mut().zip([a, b, residual]) {
            splat(panel, window.place(at), window.zoom() * 1.8, rgb(color));
        }
    }
    let mut overlay = window.show(target);
    for &point in &views.visible[last] {
        splat(&mut overlay, window.place(views.pixels[last][point as usize]), 2.0, OVERLAY);
    }
    let [reference, target, residual] = panels;
    side_by_side(&[reference, target, residual, overlay])
}

/// The colour of each point, averaged over the frames that see it; `None` where none does.
pub fn point_colors(sequence: &Sequence, views: &Views) -> Vec<Option<[u8; 3]>> {
    let mut sums = vec![([0.0; 3], 0.0); views.pixels[0].len()];
    for (frame, (pixels, visible)) in
        sequence.frames.iter().zip(views.pixels.iter().zip(&views.visible))
    {
        for &point in visible {
            let color = nearest_color(&frame.color, pixels[point as usize]);
            let (sum, count) = &mut sums[point as usize];
            (0..3).for_each(|c| sum[c] += color[c]);
            *count += 1.0;
        }
    }
    let mean = |(sum, count): ([f32; 3], f32)| (count > 0.0).then(|| rgb(sum.map(|x| x / count)).0);
    sums.into_iter().map(mean).collect()
}

/// Writes the cloud as the reference camera sees it, and from three quarter turns about it.
pub fn write_cloud(
    path: &Path,
    reference: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> Result<()> {
    save(&cloud_views(reference, points, colors), path)
}

/// The cloud from four sides, side by side.
pub fn cloud_views(
    reference: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> RgbImage {
    let views = [0.0, 90.0, 180.0, 270.0f32].map(|degrees| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
        let mut pose = *reference;
        pose.rotation *= turn;
        draw_cloud(&pose, points, colors, PANEL)
    });
    side_by_side(&views)
}

/// Panels in a row, with a white seam.
pub fn side_by_side(panels: &[RgbImage]) -> RgbImage {
    let n = panels.len() as u32;
    let mut row = RgbImage::from_pixel(n * PANEL + (n - 1) * 4, PANEL, PAPER);
    for (i, panel) in (0..).zip(panels) {
        imageops::replace(&mut row, panel, i * i64::from(PANEL + 4), 0);
    }
    row
}

/// Rows under one another.
pub fn stacked(rows: &[RgbImage]) -> RgbImage {
    let width = rows.iter().map(RgbImage::width).max().unwrap_or(1);
    let height = rows.iter().map(|row| row.height() + 4).sum::<u32>().max(1);
    let mut page = RgbImage::from_pixel(width, height, PAPER);
    let mut top = 0;
    for row in rows {
        imageops::replace(&mut page, row, 0, top);
        top += i64::from(row.height() + 4);
    }
    page
}

pub fn save(image: &RgbImage, path: &Path) -> Result<()> {
    image.save(path).with_context(|| format!("cannot write {}", path.display()))
}

fn nearest_color(image: &ColorImage, [u, v]: [f32; 2]) -> [f32; 3] {
    let u = (u.max(0.0) as u32).min(image.width() - 1);
    let v = (v.max(0.0) as u32).min(image.height() - 1);
    image.get_pixel(u, v).0
}

fn rgb(color: [f32; 3]) -> Rgb<u8> {
    Rgb(color.map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8))
}
