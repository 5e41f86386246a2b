//! Pictures in the manner of Fig. 5 and 7.

use std::path::Path;

use anyhow::{Context, Result};
use burn::tensor::Device;
use image::{Rgb, RgbImage, imageops};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Outcome},
    checkpoint::Prior,
    data::{ColorImage, sequence::Sequence},
    reconstruction::{Views, views},
};

/// Points that no frame saw are drawn in red, as in the paper's Fig. 1.
pub const UNSEEN: [u8; 3] = [200, 60, 50];
/// How much panels are magnified.
const ZOOM: u32 = 2;
const PAPER: Rgb<u8> = Rgb([255; 3]);

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
        let generator = &prior.shape.generator;
        let pseudo_render = &config.objective.pseudo_render;
        let views = views(sequence, generator, unknowns, pseudo_render, device);
        let row = stage(sequence, &views);
        save(&row, &folder.join(format!("{idx:02}_{}.png", name.replace(' ', "_"))))?;
        rows.push(row);
    }
    save(&stacked(&rows), &out.join("stages.png"))
}

fn stage(sequence: &Sequence, views: &Views) -> RgbImage {
    let last = sequence.frames.len() - 1;
    let [reference, target] = [0, last].map(|frame| &sequence.frames[frame].color);
    let size = sequence.size.map(|side| side as u32);
    let mut panels = [0; 4].map(|_| RgbImage::from_pixel(size[0], size[1], PAPER));
    for &point in &views.visible[0] {
        let [at, there] = [0, last].map(|frame| views.pixels[frame][point as usize]);
        let (a, b) = (nearest_color(reference, at), nearest_color(target, there));
        let residual = std::array::from_fn(|c| 1.0 - 2.0 * (a[c] - b[c]).abs());
        for (panel, color) in panels.iter_mut().zip([a, b, residual]) {
            splat(panel, at, rgb(color));
        }
    }
    panels[3] =
        overlay(target, views.visible[last].iter().map(|&i| views.pixels[last][i as usize]));
    side_by_side(&panels)
}

/// A frame with points drawn over it, so that silhouettes can be compared (Fig. 6).
fn overlay(frame: &ColorImage, points: impl Iterator<Item = [f32; 2]>) -> RgbImage {
    let mut panel =
        RgbImage::from_fn(frame.width(), frame.height(), |u, v| rgb(frame.get_pixel(u, v).0));
    for [u, v] in points {
        if let Some(pixel) = pixel_at(&mut panel, [u, v]) {
            let [r, g, b] = pixel.0;
            *pixel = Rgb([r / 2, g / 2, b / 2 + 127]);
        }
    }
    panel
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
    sequence: &Sequence,
    reference: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> Result<()> {
    save(&cloud_views(sequence, reference, points, colors), path)
}

/// The cloud from four sides, side by side.
pub fn cloud_views(
    sequence: &Sequence,
    reference: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> RgbImage {
    let views = [0.0, 90.0, 180.0, 270.0f32].map(|degrees| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
        let mut pose = *reference;
        pose.rotation *= turn;
        draw_cloud(sequence, &pose, points, colors)
    });
    side_by_side(&views)
}

/// Points as discs of their spacing, nearer ones over farther ones and darker with distance.
fn draw_cloud(
    sequence: &Sequence,
    camera_from_world: &Isometry3<f32>,
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
) -> RgbImage {
    let [width, height] = sequence.size.map(|side| side as u32 * ZOOM);
    let (focal, center) = (sequence.intrinsics.focal, sequence.intrinsics.center);
    let mut panel = RgbImage::from_pixel(width, height, PAPER);
    let mut placed: Vec<(f32, [f32; 2], [u8; 3])> = points
        .iter()
        .zip(colors)
        .map(|(&point, &color)| {
            let p = camera_from_world * Point3::from(point);
            let at = [0, 1].map(|i| ZOOM as f32 * (focal[i] * p[i] / p.z + center[i]));
            (p.z, at, color)
        })
        .filter(|(depth, ..)| *depth > 0.0)
        .collect();
    placed.sort_by(|a, b| b.0.total_cmp(&a.0));
    let distance = camera_from_world.translation.vector.norm();
    for (depth, at, color) in placed {
        let shade = (1.0 - 0.7 * (depth - distance + 0.3)).clamp(0.4, 1.0);
        let color = Rgb(color.map(|channel| (f32::from(channel) * shade) as u8));
        splat(&mut panel, at, color);
        for (du, dv) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            splat(&mut panel, [at[0] + du, at[1] + dv], color);
        }
    }
    imageops::resize(&panel, width / ZOOM, height / ZOOM, imageops::FilterType::Triangle)
}

/// Panels in a row, magnified, with a white seam.
pub fn side_by_side(panels: &[RgbImage]) -> RgbImage {
    let (width, height) = (panels[0].width() * ZOOM, panels[0].height() * ZOOM);
    let n = panels.len() as u32;
    let mut row = RgbImage::from_pixel(n * width + (n - 1) * 4, height, PAPER);
    for (i, panel) in (0..).zip(panels) {
        let panel = imageops::resize(panel, width, height, imageops::FilterType::Nearest);
        imageops::replace(&mut row, &panel, i * i64::from(width + 4), 0);
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

fn splat(panel: &mut RgbImage, at: [f32; 2], color: Rgb<u8>) {
    if let Some(pixel) = pixel_at(panel, at) {
        *pixel = color;
    }
}

fn pixel_at(panel: &mut RgbImage, [u, v]: [f32; 2]) -> Option<&mut Rgb<u8>> {
    (u >= 0.0 && v >= 0.0).then(|| panel.get_pixel_mut_checked(u as u32, v as u32)).flatten()
}

fn nearest_color(image: &ColorImage, [u, v]: [f32; 2]) -> [f32; 3] {
    let u = (u.max(0.0) as u32).min(image.width() - 1);
    let v = (v.max(0.0) as u32).min(image.height() - 1);
    image.get_pixel(u, v).0
}

fn rgb(color: [f32; 3]) -> Rgb<u8> {
    Rgb(color.map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8))
}
