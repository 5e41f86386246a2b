//! What is kept, what is computed anew, and that it makes no difference.

use std::{
    fs,
    path::Path,
    process::Stdio,
    time::{Duration, Instant},
};

use tempfile::TempDir;

use super::support::{Row, command, dataset, evaluate, rows};

/// All lines of a table but what the clock and the system say.
fn timeless(out: &Path) -> Vec<Row> {
    let mut rows = rows(out);
    rows.iter_mut().for_each(|row| drop(row.remove("seconds")));
    rows
}

fn messages(output: &std::process::Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_second_evaluation_says_the_same() {
    let cars = dataset(2);
    let [first, again] = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let extra = ["--methods", "mean-shape,retrieval,free-points,photometric"];
    evaluate(cars.path(), first.path(), &extra);
    let table = fs::read_to_string(first.path().join("table1.md")).unwrap();
    // In the same folder it is kept, to the last digit.
    let output = evaluate(cars.path(), first.path(), &extra);
    assert!(messages(&output).contains("10 results were there already"), "{}", messages(&output));
    assert_eq!(table, fs::read_to_string(first.path().join("table1.md")).unwrap());
    // In another it is computed anew.
    evaluate(cars.path(), again.path(), &extra);
    assert_eq!(timeless(first.path()), timeless(again.path()));
}

#[test]
fn a_killed_evaluation_goes_on_where_it_was() {
    let cars = dataset(4);
    let [whole, killed] = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    evaluate(cars.path(), whole.path(), &[]);

    let program = command(cars.path(), killed.path(), &[]);
    let mut child = std::process::Command::new(program.get_program())
        .args(program.get_args())
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let sequences = killed.path().join("sequences");
    let kept = || {
        let folders = fs::read_dir(&sequences).into_iter().flatten().map(Result::unwrap);
        folders.filter(|folder| folder.path().join("solver.json").is_file()).count()
    };
    while kept() == 0 {
        assert!(start.elapsed() < Duration::from_secs(300), "nothing is kept");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let n_kept = kept();
    let output = evaluate(cars.path(), killed.path(), &[]);
    let expected = format!("{n_kept} results were there already");
    assert!(messages(&output).contains(&expected), "{}", messages(&output));
    assert_eq!(timeless(whole.path()), timeless(killed.path()));
}

#[test]
fn what_follows_from_something_else_is_computed_anew_and_said() {
    let (cars, out) = (dataset(2), TempDir::new().unwrap());
    evaluate(cars.path(), out.path(), &[]);
    let before = timeless(out.path());

    let config = cars.path().join("other.toml");
    fs::write(&config, "blurs = [1.0]\nn_hypotheses = 1\n[lm]\niterations = 6\n").unwrap();
    let output = evaluate(cars.path(), out.path(), &["--config", config.to_str().unwrap()]);
    let said = messages(&output);
    assert!(said.contains("2 sequences had results of another config"), "{said}");
    assert_ne!(before, timeless(out.path()));

    evaluate(cars.path(), out.path(), &[]);
    let frame = cars.path().join("car_1-0/images/frame_002.png");
    let mut picture = image::open(&frame).unwrap().into_rgb8();
    picture.get_pixel_mut(30, 30).0[0] ^= 1;
    picture.save(&frame).unwrap();
    let said = messages(&evaluate(cars.path(), out.path(), &[]));
    assert!(said.contains("1 sequences had results of another sequence"), "{said}");

    // Half a file is no result.
    let result = out.path().join("sequences/car_0-0/solver.json");
    let text = fs::read_to_string(&result).unwrap();
    fs::write(&result, &text[..text.len() / 2]).unwrap();
    let said = messages(&evaluate(cars.path(), out.path(), &[]));
    assert!(said.contains("1 results were there already"), "{said}");
}

#[test]
fn an_evaluation_in_which_all_fail_is_an_error() {
    let (cars, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    fs::create_dir(cars.path().join("car_0-0")).unwrap();
    fs::write(cars.path().join("car_0-0/transforms.json"), "{}").unwrap();
    let output = command(cars.path(), out.path(), &[]).output().unwrap();
    assert!(!output.status.success());
    assert!(messages(&output).contains("all 1 sequences failed"), "{}", messages(&output));
    // And still it is written down.
    assert_eq!(rows(out.path()).iter().filter(|row| !row["failure"].is_empty()).count(), 2);
}
