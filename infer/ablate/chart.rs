//! A study as a picture: medians and quartiles of the main metrics, arm by arm.

use anyhow::Result;
use plotters::{coord::Shift, prelude::*};

use super::results::{METRICS, Metric, Results, State};

/// Metrics that are drawn: the first ones of the table.
const N_PANELS: usize = 3;
/// Size of a panel, and of the title above them, in pixels.
const PANEL: (u32, u32) = (380, 320);
const TITLE: u32 = 34;
/// How far the marker of the start is left of its arm, in arms.
const ASIDE: f64 = 0.16;

const INK: RGBColor = RGBColor(40, 44, 52);
const GRID: RGBColor = RGBColor(222, 225, 230);
const START: RGBColor = RGBColor(150, 155, 165);
const END: RGBColor = RGBColor(31, 98, 190);

type Panel<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The text of an SVG file.
pub fn draw(results: &Results) -> Result<String> {
    let mut svg = String::new();
    {
        let size = (N_PANELS as u32 * PANEL.0, PANEL.1 + TITLE);
        let page = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        page.fill(&WHITE)?;
        let (head, body) = page.split_vertically(TITLE);
        let title = format!(
            "{}: medians and quartiles of {} sequences, in grey where they start",
            results.comparison.title,
            results.entries[0].len()
        );
        head.draw_text(&title, &("sans-serif", 16).into_font().color(&INK), (12, 10))?;
        for (panel, metric) in body.split_evenly((1, N_PANELS)).iter().zip(&METRICS) {
            draw_panel(panel, results, metric)?;
        }
        page.present()?;
    }
    Ok(svg)
}

/// One metric: each arm's start in grey, where it ends in blue.
fn draw_panel(panel: &Panel, results: &Results, metric: &Metric) -> Result<()> {
    let arms = &results.comparison.arms;
    let series = |of: State| -> Vec<(f64, [f64; 3])> {
        let quartiles = (0..arms.len()).map(|arm| results.quartiles(arm, metric, of));
        (0..).zip(quartiles).filter_map(|(x, q)| Some((f64::from(x), q?))).collect()
    };
    let (start, end) = (series(|outcome| &outcome.start), series(|outcome| &outcome.end));
    let highest = start.iter().map(|(_, [_, median, _])| *median);
    let highest = highest.chain(end.iter().map(|(_, [_, _, high])| *high)).fold(0.0, f64::max);

    let last = arms.len() as f64 - 0.5;
    let mut chart = ChartBuilder::on(panel)
        .margin(12)
        .caption(metric.name, ("sans-serif", 14).into_font().color(&INK))
        .x_label_area_size(40)
        .y_label_area_size(44)
        .build_cartesian_2d(-0.5..last, 0.0..1.08 * highest.max(1e-9))?;
    let name = |x: &f64| match (x.fract().abs() < 1e-6, arms.get(x.round() as usize)) {
        (true, Some(arm)) => arm.name.clone(),
        _ => String::new(),
    };
    let font = ("sans-serif", 11).into_font().color(&INK);
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(arms.len() + 1)
        .x_label_formatter(&name)
        .x_desc(results.comparison.axis)
        .y_labels(6)
        .label_style(font)
        .draw()?;

    if results.comparison.ordered {
        let medians = end.iter().map(|&(x, [_, median, _])| (x, median));
        chart.draw_series(LineSeries::new(medians, END.mix(0.5)))?;
    }
    chart.draw_series(
        start
            .iter()
            .map(|&(x, [_, median, _])| Circle::new((x - ASIDE, median), 3, START.stroke_width(1))),
    )?;
    chart.draw_series(end.iter().map(|&(x, [low, _, high])| {
        PathElement::new(vec![(x, low), (x, high)], END.stroke_width(2))
    }))?;
    chart.draw_series(
        end.iter().map(|&(x, [_, median, _])| Circle::new((x, median), 4, END.filled())),
    )?;
    Ok(())
}
