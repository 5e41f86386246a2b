//! `pba-infer evaluate`: its numbers by other means, and what happens to it.

mod corrupted;
mod recompute;
mod resume;
mod support;

use std::fs;

use recompute::{cloud_errors, pose_errors, statistics};
use support::{dataset, estimate, evaluate, json, number, row, rows};
use tempfile::TempDir;

#[track_caller]
fn check_near(name: &str, actual: f64, expected: f64) {
    let tolerance = 1e-4 * expected.abs() + 2e-3 * f64::from(u8::from(name.contains("deg"))) + 1e-6;
    // Areas are summed in slices; angles near zero are hard on an arc cosine.
    let tolerance = if name.contains("auc") { 2e-3 } else { tolerance };
    assert!((actual - expected).abs() <= tolerance, "{name}: {actual} is not {expected}");
}

#[test]
fn every_number_is_recomputed_from_the_written_files() {
    let (cars, out) = (dataset(3), TempDir::new().unwrap());
    // A fourth one fails.
    let broken = cars.path().join("car_3-0");
    fs::create_dir(&broken).unwrap();
    fs::write(broken.join("transforms.json"), "{}").unwrap();
    let output = evaluate(cars.path(), out.path(), &["--methods", "mean-shape,per-frame"]);
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(table.contains("4 sequences, 1 failed"), "{table}");
    assert!(table.contains("failed: car_3-0: solver"), "{table}");

    let rows = rows(out.path());
    for sequence in ["car_0-0", "car_1-0", "car_2-0"] {
        let truth = cars.path().join(sequence);
        for state in ["initial", "solver", "mean-shape"] {
            let row = row(&rows, sequence, state);
            let folder = estimate(out.path(), sequence, state);
            let expected = [pose_errors(&folder, &truth), cloud_errors(&folder, &truth)].concat();
            for (key, expected) in expected {
                check_near(key, number(&row, key).unwrap(), expected);
            }
        }
        let per_frame = row(&rows, sequence, "per-frame");
        let folder = estimate(out.path(), sequence, "per-frame");
        for (key, expected) in pose_errors(&folder, &truth) {
            check_near(key, number(&per_frame, key).unwrap(), expected);
        }
    }

    let summary = json(&out.path().join("summary.json"));
    assert_eq!(summary["n_sequences"], 4);
    for state in summary["states"].as_array().unwrap() {
        let name = state["name"].as_str().unwrap();
        assert_eq!(state["n_failed"], 1, "{name}");
        let own = || rows.iter().filter(|row| row["state"] == name);
        assert_eq!(own().count(), 4, "{name}");
        for (key, found) in state["metrics"].as_object().unwrap() {
            let values: Vec<f64> = own().filter_map(|row| number(row, key)).collect();
            assert_eq!(found["n"], values.len(), "{name} {key}");
            if values.is_empty() {
                assert!(found["mean"].is_null() && name == "per-frame", "{name} {key}");
                continue;
            }
            let (_, expected) = statistics(&values);
            let names = ["mean", "median", "lower_quartile", "upper_quartile"];
            for (statistic, expected) in names.iter().zip(expected) {
                let found = found[statistic].as_f64().unwrap();
                assert!(
                    (found - expected).abs() <= 1e-9 * expected.abs(),
                    "{name} {key} {statistic}"
                );
            }
        }
        check_shares(state, &rows);
    }
}

/// Shares are of all four sequences, ratios of those that have both.
fn check_shares(state: &serde_json::Value, rows: &[support::Row]) {
    let name = state["name"].as_str().unwrap();
    let own: Vec<_> = rows.iter().filter(|row| row["state"] == name).collect();
    let below = own.iter().filter_map(|row| number(row, "rotation_error_deg_mean"));
    let below = below.filter(|error| *error < 5.0).count() as f64 / 4.0;
    assert_eq!(state["share_below_5_deg"].as_f64(), Some(below), "{name}");
    let turned = own.iter().filter_map(|row| number(row, "reference_rotation_error_deg"));
    let turned = turned.filter(|error| *error > 90.0).count() as f64 / 4.0;
    assert_eq!(state["share_turned_round"].as_f64(), Some(turned), "{name}");

    let (mut gap, mut gone, mut ratios) = (0.0, 0.0, Vec::new());
    for row in own.iter().filter(|row| row["failure"].is_empty()) {
        let of = |state: &str, key: &str| number(&support::row(rows, &row["sequence"], state), key);
        let style = |state: &str| of(state, "style_error").unwrap();
        gap += style("initial") - style("floor-at-truth");
        gone += style("initial") - style(name);
        let losses = (number(row, "silhouette_loss"), of("floor-at-truth", "silhouette_loss"));
        if let (Some(found), Some(truth)) = losses {
            ratios.push(found / truth);
        }
    }
    let found = state["style_gap_closed"].as_f64().unwrap();
    assert!((found - gone / gap).abs() < 1e-9, "{name}: {found} is not {}", gone / gap);
    let (n, [mean, ..]) = statistics(&ratios);
    assert_eq!(state["silhouette_over_truth"]["n"], n);
    let found = state["silhouette_over_truth"]["mean"].as_f64().unwrap();
    assert!((found - mean).abs() < 1e-9 * mean, "{name}: {found} is not {mean}");
}

#[test]
fn a_page_figures_and_tables_are_written_and_the_page_needs_no_other_file() {
    let (cars, out) = (dataset(2), TempDir::new().unwrap());
    evaluate(cars.path(), out.path(), &["--views", "1,2,5", "--reports"]);
    let read = |name: &str| fs::read_to_string(out.path().join(name)).unwrap();
    for name in ["success_pose.svg", "success_style.svg", "views.svg"] {
        let svg = read(name);
        assert!(svg.contains("<svg") && svg.contains("polyline"), "{name}");
    }
    let page = read("index.html");
    assert!(!page.contains("{{"), "a part of the page is missing");
    for part in ["car_0-0", "car_1-0", "data:image/jpeg;base64,", "<svg", "noise floor"] {
        assert!(page.contains(part), "{part}");
    }
    for elsewhere in ["src=\"http", "href=\"http", "<link rel=\"stylesheet", "src=\"sequences"] {
        assert!(!page.contains(elsewhere), "{elsewhere}");
    }
    // The one link of each sequence leads to a file that is there.
    for sequence in ["car_0-0", "car_1-0"] {
        let link = format!("sequences/{sequence}/report/index.html");
        assert!(page.contains(&link) && out.path().join(&link).is_file(), "{link}");
    }
    let lines = read("per_sequence.jsonl");
    assert_eq!(lines.lines().count(), 2);
    assert!(lines.contains("\"hypotheses\"") && lines.contains("\"failure\":null"), "{lines}");
    // Five frames are all there are: what the solver made of them.
    let rows = rows(out.path());
    let [all, first] = ["views-5", "views-1"].map(|state| row(&rows, "car_0-0", state));
    assert_eq!(all["style_error"], row(&rows, "car_0-0", "solver")["style_error"]);
    assert_eq!((&first["n_frames"], &first["rra_5"]), (&"1".to_string(), &String::new()));
}
