//! What a shape prior makes of shapes that it has not seen, and what its style directions do.

use std::{collections::BTreeMap, path::Path};

use burn::tensor::{Device, Tensor, TensorData};
use image::{RgbImage, imageops};
use nalgebra::{Point3, Vector3};
use object_pba::{
    Error, Result,
    checkpoint::{CONFIG_FILE, REGRESSORS_FILE, SHAPE_FILE, load_regressors, load_shape},
    data::{
        cloud_picture::{PAPER, draw_cloud},
        collection::Model,
        formats::write_atomically,
        viewpoint::look_at,
    },
    device::Backend,
    host::host_points,
    pseudo_render::surface::Surface,
    shape_prior::ShapePrior,
    training::{
        Measurements, Reconstruction, ReconstructionErrors, ReportedShapes, TrainingConfig,
        report_prior, report_regressors,
    },
};
use serde::Serialize;

/// Sides of the picture of a cloud and of its middle, which a tile shows, in pixels.
const PICTURE: u32 = 236;
const TILE: u32 = 180;
/// Shapes of the picture, at most: truth, reconstruction, fit and nearest training shape of each.
const MAX_SHAPES: usize = 12;
/// The walk: how many leading directions, and how far, in standard deviations.
const N_DIRECTIONS: usize = 6;
const STEPS: [f32; 8] = [-2.8, -2.0, -1.2, -0.4, 0.4, 1.2, 2.0, 2.8];

/// The contents of prior.json: means and every shape, in squared world units (diagonal 1).
#[derive(Serialize)]
struct Report<'a> {
    n_points: usize,
    n_style: usize,
    /// Mean over shapes of the error over the noise floor.
    ratio_mean: f64,
    means: ReconstructionErrors,
    shapes: Vec<&'a ReconstructionErrors>,
}

pub fn inspect(folder: &Path, models: Option<Vec<Model>>, out: &Path) -> Result<()> {
    let device = Backend::default().device();
    let config = TrainingConfig::read(&folder.join(CONFIG_FILE))?;
    let prior = load_shape(&config, &folder.join(SHAPE_FILE), &device)?;
    let own = models.is_none();
    let shapes = models.map_or(ReportedShapes::HeldOut, ReportedShapes::Models);
    let reconstructions = report_prior(&config, &prior, shapes, &device)?;

    let errors: Vec<_> = reconstructions.iter().map(|shape| &shape.errors).collect();
    let ratios = errors.iter().map(|errors| errors.decoded / errors.noise_floor);
    let report = Report {
        n_points: prior.generator.n_points(),
        n_style: prior.n_style(),
        ratio_mean: ratios.sum::<f64>() / errors.len() as f64,
        means: means(&errors),
        shapes: errors,
    };
    print_table(&report);
    let json = serde_json::to_string_pretty(&report).expect("a report is plain data");
    write_atomically(&out.join("prior.json"), json.as_bytes())?;
    let regressors = folder.join(REGRESSORS_FILE);
    if own && regressors.exists() {
        let regressors = load_regressors(&config, prior.n_style(), &regressors, &device)?;
        let measurements = report_regressors(&config, &prior, &regressors, &device)?;
        print_measurements(&measurements);
        let measurements: BTreeMap<_, _> = measurements.into_iter().collect();
        let json = serde_json::to_string_pretty(&measurements).expect("numbers have names");
        write_atomically(&out.join("regressors.json"), json.as_bytes())?;
    }

    let mut rows: Vec<Vec<RgbImage>> = Vec::new();
    for pair in reconstructions[..reconstructions.len().min(MAX_SHAPES)].chunks(2) {
        rows.push(pair.iter().flat_map(tiles).collect());
    }
    rows.extend(walk(&prior, &device));
    let path = out.join("prior.png");
    page(&rows).save(&path).map_err(Error::image(&path))
}

fn means(errors: &[&ReconstructionErrors]) -> ReconstructionErrors {
    let mean = |value: fn(&ReconstructionErrors) -> f64| {
        errors.iter().map(|errors| value(errors)).sum::<f64>() / errors.len() as f64
    };
    ReconstructionErrors {
        id: "mean".into(),
        decoded: mean(|errors| errors.decoded),
        fitted: mean(|errors| errors.fitted),
        noise_floor: mean(|errors| errors.noise_floor),
        retrieved: mean(|errors| errors.retrieved),
        mean_shape: mean(|errors| errors.mean_shape),
    }
}

fn print_table(report: &Report) {
    println!("Chamfer distance (Eq. 7), 1e-3 squared diagonals at {} points", report.n_points);
    println!(
        "{:32} {:>9} {:>9} {:>9} {:>7} {:>9} {:>10}",
        "shape", "decoded", "fitted", "floor", "ratio", "retrieved", "mean shape"
    );
    for errors in report.shapes.iter().copied().chain([&report.means]) {
        let ReconstructionErrors { id, decoded, fitted, noise_floor, retrieved, mean_shape } =
            errors;
        let ratio = if id == "mean" { report.ratio_mean } else { decoded / noise_floor };
        let errors = [decoded, fitted, noise_floor, retrieved, mean_shape];
        let [decoded, fitted, floor, retrieved, mean_shape] = errors.map(|error| error * 1e3);
        println!(
            "{id:32} {decoded:9.4} {fitted:9.4} {floor:9.4} {ratio:7.2} {retrieved:9.4} {mean_shape:10.4}"
        );
    }
}

fn print_measurements(measurements: &Measurements) {
    println!("\nRegressors, on pictures of these shapes (clouds: 1e-3 squared diagonals)");
    for (name, value) in measurements {
        println!("{name:34} {value:9.4}");
    }
}

/// Truth, reconstruction, fit and nearest training shape.
fn tiles(shape: &Reconstruction) -> [RgbImage; 4] {
    let colors = [[190, 190, 190], [90, 160, 250], [150, 130, 240], [250, 175, 90]];
    let clouds = [&shape.truth, &shape.decoded, &shape.fitted, &shape.retrieved];
    [0, 1, 2, 3].map(|i| tile(clouds[i], colors[i]))
}

/// A row for each leading direction of the style, all others at their mean.
fn walk(prior: &ShapePrior, device: &Device) -> Vec<Vec<RgbImage>> {
    let n_style = prior.n_style();
    let directions = 0..N_DIRECTIONS.min(n_style);
    let row = |direction: usize| {
        let step = |deviations: f32| {
            let mut style = vec![0.0; n_style];
            style[direction] = deviations;
            let style = Tensor::from_data(TensorData::new(style, [1, n_style]), device);
            tile(&host_points(&prior.generator.forward(style)), [120, 220, 160])
        };
        STEPS.map(step).to_vec()
    };
    directions.map(row).collect()
}

/// A cloud from its front left, slightly from above, in the light of a lamp above its front.
fn tile(points: &[[f32; 3]], color: [u8; 3]) -> RgbImage {
    let camera_from_world = look_at(Point3::new(-1.2, 0.8, -1.6), Point3::origin());
    let points_in_world: Vec<Point3<f32>> = points.iter().copied().map(Point3::from).collect();
    let lamp = Vector3::new(-0.3, 0.8, -0.5);
    let patches = Surface::of_cloud(&points_in_world).patches;
    let shaded = points_in_world.iter().zip(patches).map(|(point, patch)| {
        // Seen from the middle of a car, its surface faces away.
        let outward = patch.normal * point.coords.dot(&patch.normal).signum();
        let light = 0.45 + 0.55 * outward.dot(&lamp).max(0.0);
        color.map(|channel| (f32::from(channel) * light) as u8)
    });
    let picture = draw_cloud(&camera_from_world, points, &shaded.collect::<Vec<_>>(), PICTURE);
    let margin = (PICTURE - TILE) / 2;
    imageops::crop_imm(&picture, margin, margin, TILE, TILE).to_image()
}

fn page(rows: &[Vec<RgbImage>]) -> RgbImage {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(1) as u32;
    let mut page = RgbImage::from_pixel(columns * TILE, rows.len() as u32 * TILE, PAPER);
    for (row, tiles) in (0..).zip(rows) {
        for (column, tile) in (0..).zip(tiles) {
            let [x, y] = [column, row].map(|i: i64| i * i64::from(TILE));
            imageops::replace(&mut page, tile, x, y);
        }
    }
    page
}
