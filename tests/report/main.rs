//! The report, in a browser: that it opens without a network, draws, replays and can be used from a keyboard.
//!
//! Needs `chromedriver` and `chromium`. Where they are missing, these tests say so and pass, unless
//! `PBA_REQUIRE_BROWSER` is set.

mod browser;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
    thread::sleep,
    time::{Duration, Instant},
};

use assert_cmd::Command;
use object_pba::data::formats::ply;
use serde_json::{Value, json};

use browser::{Browser, keys};

/// A sequence whose name would be a tag, reconstructed in a few steps.
static RUN: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    let _ = fs::remove_dir_all(&folder);
    let sequence = folder.join("a <b>car");
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sample-sequence"), &sequence);
    let config = folder.join("quick.toml");
    fs::write(&config, "blurs = [1.0, 0.0]\n[lm]\niterations = 3\n").unwrap();
    let out = folder.join("out");
    let mut run = Command::cargo_bin("pba-infer").unwrap();
    run.arg("run").arg(sequence).arg("--out").arg(&out).arg("--config").arg(config);
    run.assert().success();
    out
});

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn page() -> PathBuf {
    RUN.join("report/index.html")
}

/// A browser that shows the report and is done with loading it.
fn open(page: &Path) -> Option<Browser> {
    let browser = Browser::start()?;
    browser.open(page);
    wait_until("the report is ready", || !ready_after(&browser).is_null());
    Some(browser)
}

fn ready_after(browser: &Browser) -> Value {
    browser.run("return document.documentElement.dataset.readyAfter ?? null")
}

fn snapshot(browser: &Browser) -> usize {
    let text = browser.run("return document.documentElement.dataset.snapshot");
    text.as_str().unwrap().parse().unwrap()
}

#[track_caller]
fn wait_until(what: &str, holds: impl Fn() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "not within a minute: {what}");
        sleep(Duration::from_millis(50));
    }
}

/// A picture of what `selector` shows once it moves no more.
fn at_rest(browser: &Browser, selector: &str) -> Vec<u8> {
    let mut last = browser.picture(selector);
    loop {
        sleep(Duration::from_millis(100));
        let next = browser.picture(selector);
        if next == last {
            return next;
        }
        last = next;
    }
}

/// That a picture of `selector` changes by `deed`.
#[track_caller]
fn check_changes(browser: &Browser, selector: &str, deed: impl FnOnce()) {
    let before = at_rest(browser, selector);
    deed();
    wait_until(&format!("{selector} changes"), || browser.picture(selector) != before);
}

#[test]
fn a_report_is_one_file_of_a_few_megabytes() {
    let size = page().metadata().unwrap().len();
    assert!((1_000_000..10_000_000).contains(&size), "{size} bytes");
    let files: Vec<_> = fs::read_dir(RUN.join("report")).unwrap().map(Result::unwrap).collect();
    assert_eq!(files.len(), 2);
    let thumbnail = image::open(RUN.join("report/thumb.png")).unwrap();
    assert_eq!((thumbnail.width(), thumbnail.height()), (224, 112));
}

#[test]
fn it_opens_from_disk_without_a_request_or_an_error() {
    let Some(browser) = open(&page()) else { return };
    let requests = "return performance.getEntriesByType('resource').map(entry => entry.name)
        .filter(name => !name.startsWith('data:'))";
    assert_eq!(browser.run(requests), json!([]));
    assert!(ready_after(&browser).as_str().unwrap().parse::<f64>().unwrap() < 10_000.0);
    assert_eq!(browser.text("h1"), "a <b>car");
    for layer in ["residual", "none"] {
        browser.click(&format!("input[name=layer][value={layer}]"));
    }
    for coloring in ["seen", "residual", "uncertainty"] {
        browser.click(&format!("input[value={coloring}]"));
    }
    assert_eq!(browser.errors(), Vec::<String>::new());
    browser.run("setTimeout(() => { throw new Error('on purpose') })");
    wait_until("an error is noticed", || !browser.errors().is_empty());
}

#[test]
fn the_cloud_is_drawn_and_turns_by_mouse_and_keys() {
    let Some(browser) = open(&page()) else { return };
    let picture = image::load_from_memory(&browser.picture("#view")).unwrap().to_rgb8();
    let background = picture.get_pixel(picture.width() / 2, 8);
    let drawn = picture.pixels().filter(|&pixel| pixel != background).count();
    let share = drawn as f64 / f64::from(picture.width() * picture.height());
    assert!((0.05..0.6).contains(&share), "{share} of the view is drawn on");

    // The focus by itself draws a line around it.
    browser.press("#view", "x");
    check_changes(&browser, "#view", || browser.press("#view", keys::LEFT));
    check_changes(&browser, "#view", || browser.drag("#view", 80, 10));
    for choice in ["input[value=seen]", "[data-viewpoint=cameras]", "[data-viewpoint=top]"] {
        check_changes(&browser, "#view", || browser.click(choice));
    }
}

#[test]
fn the_scrubber_goes_through_the_optimisation() {
    let Some(browser) = open(&page()) else { return };
    let last = snapshot(&browser);
    assert!(last >= 3, "{last} steps");
    let selectors = ["#view", "#frame", "#chart", "#now"];
    browser.click("input[name=layer][value=residual]");
    for selector in selectors {
        browser.press("#scrubber", keys::END);
        check_changes(&browser, selector, || browser.press("#scrubber", keys::HOME));
    }
    assert_eq!(snapshot(&browser), 0);
    browser.press("#scrubber", keys::RIGHT);
    assert_eq!(snapshot(&browser), 1);
    let value = browser.attribute("#scrubber", "aria-valuetext");
    assert!(value.contains("Step 1 of") && value.contains("pose error"), "{value}");
    browser.press("#scrubber", " ");
    wait_until("the replay plays to its end", || snapshot(&browser) == last);
    browser.press("#scrubber", "[");
    assert_eq!(snapshot(&browser), last - 1);
}

#[test]
fn frames_are_chosen_with_arrow_keys() {
    let Some(browser) = open(&page()) else { return };
    check_changes(&browser, "#frame", || browser.press("#strip input", keys::RIGHT));
    let chosen = browser.run("return document.querySelector('input[name=frame]:checked').value");
    assert_eq!(chosen, "1");
}

#[test]
fn every_control_has_a_name() {
    let Some(browser) = open(&page()) else { return };
    let labels = browser.labels("button, input, canvas");
    assert!(labels.len() > 25, "{labels:?}");
    for label in &labels {
        assert!(!label.is_empty(), "{labels:?}");
    }
}

#[test]
fn colours_follow_the_reader_and_a_phone_shows_the_whole_width() {
    let Some(browser) = open(&page()) else { return };
    let brightness = || {
        let picture = image::load_from_memory(&browser.picture("header")).unwrap().to_luma8();
        picture.get_pixel(1, 1).0[0]
    };
    browser.prefer("dark");
    wait_until("the page is dark", || brightness() < 60);
    browser.click("#theme");
    wait_until("the page is bright", || brightness() > 200);
    browser.size(390, 844);
    let widths = browser.run("return [document.documentElement.scrollWidth, innerWidth]");
    assert_eq!(widths, json!([390, 390]));
    assert_eq!(browser.errors(), Vec::<String>::new());
}

/// The same cloud and visibility as in `points.ply`; its colours are of the nearest pixels, not in between.
#[test]
fn the_page_measures_what_the_run_wrote() {
    let Some(browser) = open(&page()) else { return };
    let measured = browser.run(
        "const data = JSON.parse(document.getElementById('data').textContent);
        return decodeReport(data).then(report => {
            const { cloud } = report.snapshots.at(-1);
            const { counts, colors } = measure(report, report.snapshots.at(-1));
            return [cloud, counts, colors].map(values => Array.from(values));
        })",
    );
    let [cloud, counts, colors]: [Vec<f64>; 3] = serde_json::from_value(measured).unwrap();
    let written = ply::read_cloud(&RUN.join("points.ply")).unwrap();
    let (visible, written_colors) = (written.visible.unwrap(), written.colors.unwrap());
    assert_eq!(counts.len(), written.points.len());
    let mut difference = 0.0;
    for (i, point) in written.points.iter().enumerate() {
        for axis in 0..3 {
            assert!((cloud[3 * i + axis] - f64::from(point[axis])).abs() < 2e-5);
        }
        assert_eq!(counts[i] > 0.0, visible[i], "point {i}");
        if visible[i] {
            let apart = |c: usize| (colors[3 * i + c] - f64::from(written_colors[i][c])).abs();
            difference += (0..3).map(apart).sum::<f64>() / 3.0;
        }
    }
    difference /= visible.iter().filter(|&&seen| seen).count() as f64;
    assert!(difference < 5.0, "colours differ by {difference} of 255");
}

#[test]
fn what_is_not_known_is_not_offered() {
    let html = fs::read_to_string(page()).unwrap();
    let (before, rest) = html.split_once("id=\"data\">").unwrap();
    let (data, after) = rest.split_once("</script>").unwrap();
    let mut data: Value = serde_json::from_str(data).unwrap();
    for key in ["truth", "sigmas"] {
        data[key] = Value::Null;
    }
    data["report"]["uncertainty"] = Value::Null;
    for step in data["hypotheses"].as_array_mut().unwrap().iter_mut().flat_map(|h| h.as_array_mut())
    {
        step.iter_mut().for_each(|step| step["poseError"] = Value::Null);
    }
    let data = data.to_string().replace('<', "\\u003c");
    let bare = RUN.join("bare.html");
    fs::write(&bare, format!("{before}id=\"data\">{data}</script>{after}")).unwrap();

    let Some(browser) = open(&bare) else { return };
    let hidden = |selector: &str| {
        browser.run(&format!("return !document.querySelector('{selector}').checkVisibility()"))
    };
    for selector in ["#true-cameras", "#true-cloud", "[value=uncertainty]", "[value=poseError]"] {
        assert_eq!(hidden(selector), true, "{selector}");
    }
    assert_eq!(hidden("#cameras"), false);
    assert_eq!(browser.errors(), Vec::<String>::new());
}
