//! The page's data, and the page around them.

use anyhow::Result;
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Exposure},
    checkpoint::Prior,
    data::sequence::{Frame, Sequence, Truth},
    device::Backend,
    silhouette::Silhouette,
};
use serde::Serialize;

use super::{
    encode::{self, Bounds},
    replay::{ChartStep, Replay, Snapshot, rows},
};
use crate::{
    output,
    run::{Reconstruction, Report},
};

/// Most points of the true cloud that a page holds.
const MOST_TRUE_POINTS: usize = 8192;
/// Figures that a reader looks for first, as rows of `output::ROWS`; the first that are known are shown large.
const HEADLINES: [usize; 6] = [1, 2, 5, 6, 7, 0];
const N_HEADLINES: usize = 4;

/// What the page's scripts read. Lengths are in world units (diagonal 1), pixels in those of the frames.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Data<'a> {
    name: &'a str,
    /// `[width, height]` of the frames, of which pictures may be shrunk.
    size: [usize; 2],
    center: [f32; 2],
    frames: Vec<FrameData>,
    bounds: Bounds,
    /// Which hypothesis the snapshots are of.
    kept: usize,
    hypotheses: Vec<Vec<ChartStep>>,
    snapshots: Vec<Snapshot>,
    /// Standard deviations of the last cloud's points.
    sigmas: Option<Sigmas>,
    exposures: &'a Option<Vec<Exposure>>,
    truth: Option<TruthData>,
    rows: Vec<Row>,
    headlines: Vec<usize>,
    report: &'a Report,
}

#[derive(Serialize)]
struct FrameData {
    name: String,
    picture: String,
    /// Where coverage crosses one half, u v by turns, as shares of width and height.
    outline: String,
}

#[derive(Serialize)]
struct Sigmas {
    most: f64,
    /// As shares of the largest.
    values: String,
}

#[derive(Serialize)]
struct TruthData {
    /// Where the true world is the canonical one.
    poses: Option<Vec<[f32; 12]>>,
    bounds: Option<Bounds>,
    cloud: Option<String>,
}

/// A figure with its unit, before and after.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    initial: Option<String>,
    last: Option<String>,
}

impl<'a> Data<'a> {
    pub fn new(
        prior: &Prior,
        sequence: &'a Sequence,
        config: &BundleAdjustmentConfig,
        backend: Backend,
        reconstruction: &'a Reconstruction,
    ) -> Result<Self> {
        let Reconstruction { outcome, report, .. } = reconstruction;
        let Replay { kept, hypotheses, snapshots, bounds } =
            Replay::new(prior, sequence, config, &backend.device(), reconstruction);
        let rows: Vec<Row> = output::ROWS.iter().map(|row| figure(row, report)).collect();
        let known = HEADLINES.into_iter().filter(|&row| rows[row].last.is_some());
        Ok(Self {
            name: &sequence.name,
            size: sequence.size,
            center: sequence.intrinsics.center,
            frames: sequence
                .frames
                .iter()
                .map(|frame| frame_data(frame, sequence.size))
                .collect::<Result<_>>()?,
            bounds,
            kept,
            hypotheses,
            snapshots,
            sigmas: outcome.uncertainty.as_ref().map(|found| sigmas(&found.points)),
            exposures: &outcome.exposures,
            truth: sequence.truth.as_ref().map(true_data),
            headlines: known.take(N_HEADLINES).collect(),
            rows,
            report,
        })
    }
}

fn figure(&(name, value): &(&'static str, output::Figure), report: &Report) -> Row {
    let cell = |scores| value(scores).map(output::significant);
    Row { name, initial: cell(&report.initial), last: cell(&report.last) }
}

fn frame_data(frame: &Frame, [width, height]: [usize; 2]) -> Result<FrameData> {
    let outline = Silhouette::new(&frame.mask).map(|found| found.outline).unwrap_or_default();
    // Samples lie a quarter of a pixel apart, which is more than is seen of a large picture.
    let stride = width.max(height).div_ceil(512);
    let outline = outline.iter().step_by(stride);
    let outline = outline.flat_map(|[u, v]| [u / width as f32, v / height as f32]);
    Ok(FrameData {
        name: frame.path.file_name().unwrap_or_default().to_string_lossy().into(),
        picture: encode::picture(&frame.color)?,
        outline: encode::shares(outline),
    })
}

fn sigmas(points: &[f64]) -> Sigmas {
    let most = points.iter().copied().filter(|s| s.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
    Sigmas { most, values: encode::shares(points.iter().map(|sigma| (sigma / most) as f32)) }
}

fn true_data(truth: &Truth) -> TruthData {
    let points: Option<Vec<[f32; 3]>> = truth.points.as_ref().map(|points| {
        let stride = points.len().div_ceil(MOST_TRUE_POINTS).max(1);
        points.iter().step_by(stride).map(|point| point.coords.into()).collect()
    });
    let bounds = points.as_ref().map(|points| encode::bounds([points.as_slice()]));
    TruthData {
        poses: truth.canonical.then(|| truth.camera_from_world.iter().map(rows).collect()),
        cloud: points.zip(bounds).map(|(points, bounds)| encode::cloud(&points, &bounds)),
        bounds,
    }
}

/// The template with everything in it. Its marks stand in the order of these parts.
pub fn html(data: &Data) -> Result<String> {
    // A sequence may be named after a tag.
    let data = serde_json::to_string(data)?.replace('<', "\\u003c");
    let parts = [
        ("/*style*/", STYLE),
        ("/*data*/", data.as_str()),
        ("/*libraries*/", LIBRARIES),
        ("/*scripts*/", SCRIPTS),
    ];
    let mut rest = TEMPLATE;
    let mut page = String::with_capacity(data.len() + LIBRARIES.len() + 100_000);
    for (mark, part) in parts {
        let (before, after) = rest.split_once(mark).expect("the template has this mark");
        page += before;
        page += part;
        rest = after;
    }
    Ok(page + rest)
}

const TEMPLATE: &str = include_str!("../../assets/report/index.html");
const STYLE: &str = concat!(
    include_str!("../../assets/report/vendor/uplot.min.css"),
    include_str!("../../assets/report/style.css")
);
/// With their licences, which every copy must hold.
const LIBRARIES: &str = concat!(
    "/*! three.js\n",
    include_str!("../../assets/report/vendor/three.LICENSE"),
    "*/\n",
    include_str!("../../assets/report/vendor/three.min.js"),
    "\n/*! uPlot\n",
    include_str!("../../assets/report/vendor/uplot.LICENSE"),
    "*/\n",
    include_str!("../../assets/report/vendor/uplot.min.js"),
);
const SCRIPTS: &str = concat!(
    include_str!("../../assets/report/js/decode.js"),
    include_str!("../../assets/report/js/measure.js"),
    include_str!("../../assets/report/js/palette.js"),
    include_str!("../../assets/report/js/cameras.js"),
    include_str!("../../assets/report/js/scene.js"),
    include_str!("../../assets/report/js/viewpoints.js"),
    include_str!("../../assets/report/js/frame.js"),
    include_str!("../../assets/report/js/chart.js"),
    include_str!("../../assets/report/js/tables.js"),
    include_str!("../../assets/report/js/player.js"),
    include_str!("../../assets/report/js/main.js"),
);
