//! Success curves (Fig. 3) and errors over the number of views (Fig. 4), as SVG.

use anyhow::{Result, anyhow};
use plotters::{coord::Shift, prelude::*};

use super::{measured::Metric, states::State, statistics::quantile};

const SIZE: (u32, u32) = (720, 440);
const FONT: &str = "sans-serif";
/// Share of all values that the horizontal axis reaches.
const REACHED: f64 = 0.95;
/// Colours that are told apart without red and green, on white and on black.
const COLORS: [RGBColor; 10] = [
    RGBColor(0, 114, 178),
    RGBColor(140, 140, 140),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(150, 110, 60),
    RGBColor(130, 80, 200),
    RGBColor(180, 180, 60),
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The share of sequences whose error is under a threshold, for each state. Failures never are.
pub fn success(metric: &Metric, states: &[State]) -> Result<String> {
    let curves: Vec<(&State, Vec<f64>)> = states
        .iter()
        .filter(|state| state.n_views.is_none())
        .map(|state| {
            let values = state.values(metric.value).into_iter().flatten();
            let mut values: Vec<f64> = values.map(|value| metric.drawn(value)).collect();
            values.sort_by(f64::total_cmp);
            (state, values)
        })
        .filter(|(_, values)| !values.is_empty())
        .collect();
    let mut all: Vec<f64> = curves.iter().flat_map(|(_, values)| values.clone()).collect();
    all.sort_by(f64::total_cmp);
    let end = round_up(quantile(&all, REACHED).unwrap_or(1.0));
    drawn(|root| {
        let mut chart = ChartBuilder::on(&root)
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(58)
            .build_cartesian_2d(0.0..end, 0.0..100.0)?;
        chart
            .configure_mesh()
            .x_desc(metric.heading())
            .y_desc("sequences under it (%)")
            .label_style((FONT, 14))
            .axis_desc_style((FONT, 15))
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (idx, (state, values)) in curves.iter().enumerate() {
            let color = color_of(idx, state);
            let width = if state.key == "solver" { 3 } else { 2 };
            let line = steps(values, state.scored.len(), end);
            chart
                .draw_series(LineSeries::new(line, color.stroke_width(width)))?
                .label(state.label.clone())
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 18, y)], color.stroke_width(width))
                });
        }
        chart
            .configure_series_labels()
            .label_font((FONT, 14))
            .border_style(BLACK.mix(0.15))
            .background_style(WHITE.mix(0.85))
            .position(SeriesLabelPosition::LowerRight)
            .draw()?;
        Ok(())
    })
}

/// Pose and style error over the number of frames; `None` where no views were left out.
pub fn views(states: &[State]) -> Result<Option<String>> {
    let mut states: Vec<(usize, &State)> =
        states.iter().filter_map(|state| Some((state.n_views?, state))).collect();
    states.sort_by_key(|(n_views, _)| *n_views);
    if states.len() < 2 {
        return Ok(None);
    }
    let metrics = ["rotation_error_deg_mean", "style_error"].map(Metric::of);
    let svg = drawn(|root| {
        for (panel, metric) in root.split_evenly((1, 2)).iter().zip(metrics) {
            panel_of_views(panel, metric, &states)?;
        }
        Ok(())
    })?;
    Ok(Some(svg))
}

fn panel_of_views(panel: &Area, metric: &Metric, states: &[(usize, &State)]) -> Result<()> {
    let of = |share: Option<f64>| -> Vec<(f64, f64)> {
        let point = |(n_views, state): &(usize, &State)| {
            let values = state.values(metric.value).into_iter().flatten();
            let mut values: Vec<f64> = values.map(|value| metric.drawn(value)).collect();
            values.sort_by(f64::total_cmp);
            let value = match share {
                Some(share) => quantile(&values, share),
                None => super::statistics::mean(&values),
            };
            value.map(|value| (*n_views as f64, value))
        };
        states.iter().filter_map(point).collect()
    };
    let lines = [("mean", COLORS[0], of(None)), ("median", COLORS[4], of(Some(0.5)))];
    let band: Vec<(f64, f64)> =
        of(Some(0.25)).into_iter().chain(of(Some(0.75)).into_iter().rev()).collect();
    let drawn = lines.iter().flat_map(|(_, _, line)| line).chain(&band);
    let most = drawn.map(|(_, value)| *value).fold(0.0, f64::max);
    let last = states.last().map_or(1, |(n_views, _)| *n_views) as f64;
    let mut chart = ChartBuilder::on(panel)
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(62)
        .build_cartesian_2d(0.0..last + 0.5, 0.0..1.1 * most.max(1e-9))?;
    chart
        .configure_mesh()
        .x_desc("views L")
        .y_desc(metric.heading())
        .label_style((FONT, 13))
        .axis_desc_style((FONT, 14))
        .light_line_style(TRANSPARENT)
        .draw()?;
    chart.draw_series([Polygon::new(band, COLORS[4].mix(0.15))])?;
    for (label, color, line) in lines {
        let dots = line.iter().map(|&at| Circle::new(at, 3, color.filled()));
        chart.draw_series(dots)?;
        chart
            .draw_series(LineSeries::new(line.clone(), color.stroke_width(2)))?
            .label(label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .label_font((FONT, 13))
        .border_style(BLACK.mix(0.15))
        .background_style(WHITE.mix(0.85))
        .position(SeriesLabelPosition::UpperRight)
        .draw()?;
    Ok(())
}

fn drawn(draw: impl FnOnce(Area) -> Result<()>) -> Result<String> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
    root.fill(&WHITE).map_err(|error| anyhow!("a figure cannot be drawn: {error}"))?;
    draw(root)?;
    Ok(svg)
}

/// The chosen solver is always of one colour.
fn color_of(idx: usize, state: &State) -> RGBColor {
    match state.key.as_str() {
        "solver" => COLORS[0],
        "initial" => COLORS[1],
        _ => COLORS[2 + (idx + COLORS.len() - 4) % (COLORS.len() - 2)],
    }
}

/// A stair through sorted values, in per cent of n.
fn steps(values: &[f64], n: usize, end: f64) -> Vec<(f64, f64)> {
    let share = |count: usize| 100.0 * count as f64 / n as f64;
    let below: Vec<f64> = values.iter().copied().filter(|&value| value <= end).collect();
    let stairs =
        below.iter().enumerate().flat_map(|(idx, &at)| [(at, share(idx)), (at, share(idx + 1))]);
    [(0.0, 0.0)].into_iter().chain(stairs).chain([(end, share(below.len()))]).collect()
}

/// The next of 1, 1.5, 2, 3, 5, 7.5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-6).log10().floor());
    let factors = [1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0];
    power * factors.into_iter().find(|factor| factor * power >= value).unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_rises_at_each_error_and_failures_keep_it_low() {
        let curve = steps(&[1.0, 2.0, 9.0], 4, 5.0);
        let expected = [(0.0, 0.0), (1.0, 0.0), (1.0, 25.0), (2.0, 25.0), (2.0, 50.0), (5.0, 50.0)];
        assert_eq!(curve, expected);
    }

    #[test]
    fn axes_end_at_round_numbers() {
        for (value, expected) in [(4.2, 5.0), (14.0, 15.0), (0.31, 0.5), (100.0, 100.0)] {
            assert!((round_up(value) - expected).abs() < 1e-9, "{value}");
        }
    }
}
