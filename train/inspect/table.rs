//! A report for people.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{Report, Summary};

/// Warnings and reasons are listed up to this many of each; inspect.json has all.
const MAX_LISTED: usize = 20;

/// Several lines: counts, sizes, then what is missing and what failed.
pub fn table(report: &Report) -> String {
    let Report { folder, models, unusable } = report;
    let mut text = format!(
        "{}: {} models, {} of them usable\n",
        folder.display(),
        models.len() + unusable.len(),
        models.len()
    );
    if !models.is_empty() {
        text += &counts("synsets", models, |model| model.synset.clone());
        text += &counts("turned", models, |model| Some(model.axes.clone()));
        text += &counts("longest side", models, |model| Some(longest_side(model).into()));
        let textured = models.iter().filter(|model| model.n_textures > 0).count();
        text += &line("textured", &format!("{textured}"));
        text += &line("", &format!("{:>10}{:>10}{:>10}", "least", "median", "most"));
        text += &spread("triangles", models, 0, |model| model.n_triangles as f32);
        text += &spread("textures", models, 0, |model| model.n_textures as f32);
        for (axis, name) in ["width (x)", "height (y)", "length (z)"].into_iter().enumerate() {
            text += &spread(name, models, 3, |model| model.extents[axis]);
        }
    }
    let warned: Vec<String> = models
        .iter()
        .filter(|model| !model.warnings.is_empty())
        .map(|model| format!("{}: {}", model.id, model.warnings.join("; ")))
        .collect();
    text += &list("with warnings", &warned);
    let reasons: Vec<String> = unusable.iter().map(|model| model.reason.clone()).collect();
    text + &list("unusable", &reasons)
}

/// How many models have each value, the most frequent first.
fn counts(name: &str, models: &[Summary], value: impl Fn(&Summary) -> Option<String>) -> String {
    let mut counts = BTreeMap::new();
    for value in models.iter().filter_map(value) {
        *counts.entry(value).or_insert(0) += 1;
    }
    if counts.is_empty() {
        return String::new();
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let parts: Vec<_> = counts.iter().map(|(value, count)| format!("{value} ({count})")).collect();
    line(name, &parts.join(", "))
}

/// The least, the median and the most of a quantity.
fn spread(
    name: &str,
    models: &[Summary],
    digits: usize,
    value: impl Fn(&Summary) -> f32,
) -> String {
    let mut values: Vec<f32> = models.iter().map(value).collect();
    values.sort_by(f32::total_cmp);
    let picked = [0, values.len() / 2, values.len() - 1].map(|idx| values[idx]);
    line(name, &picked.map(|value| format!("{value:>10.digits$}")).concat())
}

fn list(name: &str, lines: &[String]) -> String {
    let mut text = line(name, &lines.len().to_string());
    for entry in lines.iter().take(MAX_LISTED) {
        let _ = writeln!(text, "    {entry}");
    }
    if lines.len() > MAX_LISTED {
        let _ = writeln!(text, "    and {} more, in inspect.json", lines.len() - MAX_LISTED);
    }
    text
}

fn line(name: &str, value: &str) -> String {
    format!("  {name:<14}{value}\n")
}

/// Cars are longest from front to back: another axis says that `--up` or `--front` is wrong.
fn longest_side(model: &Summary) -> &'static str {
    let [x, y, z] = model.extents;
    if z >= x && z >= y {
        "z"
    } else if x >= y {
        "x"
    } else {
        "y"
    }
}
