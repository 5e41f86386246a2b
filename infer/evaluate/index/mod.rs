//! `index.html`: one page that says how an evaluation went, and shows every sequence.

use std::{io::Cursor, path::Path};

use base64::{Engine, prelude::BASE64_STANDARD};
use image::ImageFormat;

use super::{
    floors::THUMBNAIL_FILE,
    grid::{Grid, escaped},
    measured::Metric,
    plan::{Entry, Plan, REPORT},
    states::{INITIAL, Scored, State},
    summary::{StateSummary, Summary},
    table::{headline, number, percent},
};

const PAGE: &str = include_str!("page.html");

/// A column of the list: its name in the script, its heading, and whether narrow screens leave it out.
struct Column {
    key: &'static str,
    heading: String,
    less: bool,
}

/// Numbers of the list after the initial pose error: metric, and whether narrow screens leave it out.
const LISTED: [(&str, bool); 7] = [
    ("rotation_error_deg_mean", false),
    ("relative_rotation_error_deg_mean", true),
    ("reference_rotation_error_deg", true),
    ("style_error", false),
    ("f_score", true),
    ("photometric_loss", true),
    ("silhouette_loss", true),
];

/// The page; `figures` are SVG with what they show.
pub fn page(
    plan: &Plan,
    entries: &[Entry],
    states: &[State],
    summary: &Summary,
    tables: &[Grid],
    figures: &[(&str, String)],
) -> String {
    let title =
        format!("{}: {}", summary.dataset, summary.state("solver").map_or("", |s| &s.label));
    let figure = |(caption, svg): &(&str, String)| {
        format!("<figure>{svg}<figcaption>{}</figcaption></figure>\n", escaped(caption))
    };
    let find = |key: &str| states.iter().find(|state| state.key == key);
    let rows: String = match (find(INITIAL), find("solver")) {
        (Some(initial), Some(last)) => (0..entries.len())
            .map(|idx| row(plan, &entries[idx], &initial.scored[idx], &last.scored[idx]))
            .collect(),
        _ => String::new(),
    };
    let parts = [
        ("title", escaped(&title)),
        ("headline", escaped(&format!("{}, {} points", headline(summary), summary.n_points))),
        ("cards", cards(summary)),
        ("figures", figures.iter().map(figure).collect()),
        ("methods", tables.iter().take(1).map(Grid::html).collect()),
        ("tables", tables.iter().skip(1).map(Grid::html).collect()),
        ("headings", columns().iter().map(heading).collect()),
        ("rows", rows),
    ];
    parts
        .iter()
        .fold(PAGE.to_owned(), |page, (name, text)| page.replace(&format!("{{{{{name}}}}}"), text))
}

/// What one wants to know first.
fn cards(summary: &Summary) -> String {
    let (Some(initial), Some(last)) = (summary.state(INITIAL), summary.state("solver")) else {
        return String::new();
    };
    let card = |name: &str, value: String, more: String| {
        format!("<div><dt>{name}</dt><dd>{value}<small>{}</small></dd></div>\n", escaped(&more))
    };
    let of = |key: &str, name: &str| {
        let metric = Metric::of(key);
        let median = |state: &StateSummary| metric.cell(state.metrics[key].median);
        let heading = metric.heading();
        let unit = heading.rsplit_once('(').map_or("", |(_, unit)| unit.trim_end_matches(')'));
        card(name, median(last), format!("{unit}, median; {} at the start", median(initial)))
    };
    let started = |share: Option<f64>| format!("{} at the start", percent(share));
    [
        of("rotation_error_deg_mean", "pose error"),
        of("relative_rotation_error_deg_mean", "relative rotation error"),
        card("under 5°", percent(last.share_below_5_deg), started(initial.share_below_5_deg)),
        card("turned round", percent(last.share_turned_round), started(initial.share_turned_round)),
        of("style_error", "style error"),
        of("f_score", "F-score at 1 %"),
        card("seconds a sequence", number(last.seconds.mean), "mean".into()),
    ]
    .concat()
}

fn columns() -> Vec<Column> {
    let column = |key, heading: &str, less| Column { key, heading: heading.into(), less };
    let mut columns =
        vec![column("name", "sequence", false), column("initial", "pose error, start (deg)", true)];
    columns.extend(LISTED.iter().map(|&(key, less)| {
        let name = if key == "rotation_error_deg_mean" { "pose" } else { key };
        Column { key: name, heading: Metric::of(key).heading(), less }
    }));
    columns.extend([column("seconds", "seconds", true), column("report", "", false)]);
    columns
}

fn heading(column: &Column) -> String {
    let Column { key, heading, less } = column;
    let class = if *less { " class=\"less\"" } else { "" };
    if heading.is_empty() {
        return format!("<td{class}></td>");
    }
    let heading = escaped(heading);
    format!(
        "<th scope=\"col\" data-key=\"{key}\"{class}><button type=\"button\">{heading}</button></th>"
    )
}

fn row(
    plan: &Plan,
    entry: &Entry,
    initial: &Result<Scored, String>,
    last: &Result<Scored, String>,
) -> String {
    let folder = plan.folder(&entry.sequence);
    let name = escaped(&entry.sequence);
    let mut cells = format!(
        "<td>{}</td><td class=\"name\" data-value=\"{name}\">{name}</td>",
        thumbnail(&folder, &name)
    );
    let cell = |value: Option<f64>, text: String, less: bool| {
        let class = if less { " class=\"less\"" } else { "" };
        let value = value.map(|value| value.to_string()).unwrap_or_default();
        format!("<td{class} data-value=\"{value}\">{text}</td>")
    };
    let number_of = |scored: &Result<Scored, String>, key: &str, less: bool| {
        let metric = Metric::of(key);
        let value = scored.as_ref().ok().and_then(|scored| (metric.value)(&scored.measured));
        cell(value, metric.cell(value), less)
    };
    cells += &number_of(initial, "rotation_error_deg_mean", true);
    LISTED.iter().for_each(|(key, less)| cells += &number_of(last, key, *less));
    let seconds = last.as_ref().ok().and_then(|scored| scored.seconds);
    cells += &cell(seconds, number(seconds), true);
    cells += &match last {
        Err(failure) => format!("<td class=\"failed\">failed: {}</td>", escaped(failure)),
        Ok(scored) if scored.faulty => "<td class=\"failed\">ended in a fault</td>".into(),
        Ok(_) => format!("<td>{}</td>", link(&folder, &entry.sequence)),
    };
    format!("<tr>{cells}</tr>\n")
}

/// To the sequence's own report, where one was written.
fn link(folder: &Path, sequence: &str) -> String {
    match folder.join(REPORT).is_file() {
        true => format!("<a href=\"sequences/{}/{REPORT}\">report</a>", escaped(sequence)),
        false => String::new(),
    }
}

/// The reference frame, beside the cloud where a report drew it.
fn thumbnail(folder: &Path, name: &str) -> String {
    let of_report = image::open(folder.join("report/thumb.png"));
    let picture = of_report.or_else(|_| image::open(folder.join(THUMBNAIL_FILE)));
    let mut bytes = Cursor::new(Vec::new());
    let written =
        picture.and_then(|picture| picture.into_rgb8().write_to(&mut bytes, ImageFormat::Jpeg));
    if written.is_err() {
        return String::new();
    }
    let data = BASE64_STANDARD.encode(bytes.into_inner());
    format!("<img alt=\"{name}\" loading=\"lazy\" src=\"data:image/jpeg;base64,{data}\">")
}
