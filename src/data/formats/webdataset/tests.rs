//! Shards as other programs read them, and how broken ones are refused.

use std::{
    fs::{self, File},
    path::PathBuf,
};

use image::{Luma, Rgb};
use serde_json::{Value, json};
use tar::Archive;
use tempfile::TempDir;

use super::*;

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn sample(idx: usize) -> Sample {
    let color = RgbImage::from_pixel(3, 2, Rgb([idx as u8, 20, 30]));
    let mask = GrayImage::from_pixel(3, 2, Luma([255]));
    Sample::new(&color, &mask, &json!({ "idx": idx }))
}

/// Writes samples of a dataset of six, and returns the tar.
fn write(folder: &TempDir, name: &str, dataset: &str, samples: Range<usize>) -> PathBuf {
    let path = folder.path().join(name).with_extension("tar");
    let contents = Contents { dataset: dataset.into(), samples: samples.clone(), total: 6 };
    let mut writer = ShardWriter::create(&path, contents).expect("it is writable");
    for idx in samples {
        writer.append(&sample(idx)).expect("it is writable");
    }
    writer.finish().expect("it is writable");
    path
}

#[track_caller]
fn check_refused(tars: &[PathBuf], expected: &str) {
    let out = folder();
    let error = merge_shards(tars, &out.path().join("all.tar")).expect_err("it is unusable");
    assert!(error.to_string().contains(expected), "{error}");
    assert_eq!(fs::read_dir(out.path()).expect("it is there").count(), 0, "something is left");
}

#[test]
fn a_sample_is_three_neighbouring_files_without_time_or_owner() {
    let folder = folder();
    let tar = write(&folder, "a", "cars", 1..3);
    let mut archive = Archive::new(File::open(tar).expect("it is there"));
    let mut names = vec![];
    for entry in archive.entries().expect("a tar").map(|entry| entry.expect("an entry")) {
        let header = entry.header();
        let zeros =
            [header.mtime(), header.uid(), header.gid()].map(|field| field.expect("a number"));
        assert_eq!(zeros, [0; 3]);
        names.push(String::from_utf8_lossy(&entry.path_bytes()).into_owned());
        if names.len() == 1 {
            let mut png = vec![];
            { entry }.read_to_end(&mut png).expect("it is whole");
            let picture = image::load_from_memory(&png).expect("a picture").into_rgb8();
            assert_eq!(picture.get_pixel(2, 1).0, [1, 20, 30]);
        } else if names.len() == 3 {
            let metadata: Value = serde_json::from_reader(entry).expect("it is JSON");
            assert_eq!(metadata["idx"], 1);
        }
    }
    let expected = [
        "00000001.color.png",
        "00000001.mask.png",
        "00000001.json",
        "00000002.color.png",
        "00000002.mask.png",
        "00000002.json",
    ];
    assert_eq!(names, expected);
}

#[test]
fn shards_merge_to_what_one_run_writes() {
    let folder = folder();
    let whole = write(&folder, "whole", "cars", 0..6);
    let parts = [(4..6, "c"), (0..3, "a"), (3..4, "b"), (3..3, "empty")]
        .map(|(samples, name)| write(&folder, name, "cars", samples));
    let out = folder.path().join("all.tar");
    merge_shards(&parts, &out).expect("all are there");
    assert_eq!(fs::read(&out).expect("it is there"), fs::read(whole).expect("it is there"));
}

#[test]
fn gaps_overlaps_and_foreign_shards_are_refused() {
    let folder = folder();
    let a = write(&folder, "a", "cars", 0..3);
    let b = write(&folder, "b", "cars", 3..6);
    let late = write(&folder, "late", "cars", 4..6);
    let early = write(&folder, "early", "cars", 2..6);
    let foreign = write(&folder, "foreign", "planes", 3..6);
    check_refused(&[], "no shards");
    check_refused(std::slice::from_ref(&a), "samples 3 to 5 are missing");
    check_refused(&[b], "samples 0 to 2 are missing");
    check_refused(&[a.clone(), late], "samples 3 to 3 are missing");
    check_refused(&[a.clone(), early], "in another shard as well");
    check_refused(&[a.clone(), a.clone()], "in another shard as well");
    check_refused(&[a, foreign], "another dataset");
}

/// Opens shards of six cars, and reads the third one's number and colours.
fn read_third(path: &Path) -> Result<(usize, RgbImage)> {
    let sample = ShardReader::open(path, "cars", 6)?.read::<Value>(2)?;
    Ok((sample.metadata["idx"].as_u64().expect("a number") as usize, sample.color))
}

#[test]
fn a_sample_is_read_by_its_number_from_a_tar_or_from_parts_or_from_both() {
    let folder = folder();
    let color = RgbImage::from_pixel(3, 2, Rgb([2, 20, 30]));
    let parts = [(4..6, "c"), (0..2, "a"), (2..4, "b")];
    for (samples, name) in parts {
        write(&folder, name, "cars", samples);
    }
    assert_eq!(read_third(folder.path()).expect("all are there"), (2, color.clone()));
    let whole = write(&folder, "whole", "cars", 0..6);
    for path in [folder.path(), &whole] {
        assert_eq!(read_third(path).expect("all are there"), (2, color.clone()));
    }
}

#[test]
fn shards_to_read_from_are_whole_and_of_the_dataset() {
    #[track_caller]
    fn check_unreadable(path: &Path, expected: &str) {
        let error = read_third(path).expect_err("it is unusable");
        assert!(error.to_string().contains(expected), "{error}");
    }
    let folder = folder();
    check_unreadable(folder.path(), "no shards");
    check_unreadable(&folder.path().join("missing"), "missing");
    let a = write(&folder, "a", "cars", 0..3);
    check_unreadable(folder.path(), "samples 3 to 5 are missing");
    check_unreadable(&a, "samples 3 to 5 are missing");
    let b = write(&folder, "b", "planes", 3..6);
    check_unreadable(
        folder.path(),
        "expected 6 samples of dataset cars, found 6 samples of dataset planes",
    );

    write(&folder, "b", "cars", 3..6);
    let bytes = fs::read(&b).expect("it is there");
    fs::write(&b, &bytes[..3 * 1024]).expect("writable");
    check_unreadable(folder.path(), "are not 3 samples");
    fs::remove_file(b.with_extension("json")).expect("it is there");
    check_unreadable(folder.path(), "unfinished");

    // Pictures have checksums of their own.
    let whole = write(&folder, "whole", "cars", 0..6);
    let mut bytes = fs::read(&whole).expect("it is there");
    bytes[2 * 6 * 512 + 512 + 20] ^= 1;
    fs::write(&whole, bytes).expect("writable");
    check_unreadable(&whole, "00000002");
}

#[test]
fn broken_shards_are_refused() {
    let folder = folder();
    let whole = write(&folder, "whole", "cars", 0..6);
    let bytes = fs::read(&whole).expect("it is there");

    let mut flipped = bytes.clone();
    flipped[512 + 40] ^= 1;
    fs::write(&whole, flipped).expect("writable");
    check_refused(std::slice::from_ref(&whole), "manifest");
    fs::write(&whole, &bytes[..bytes.len() / 2 / 512 * 512]).expect("writable");
    check_refused(std::slice::from_ref(&whole), "whole.tar");
    fs::write(&whole, &bytes[3 * 1024..]).expect("writable");
    check_refused(std::slice::from_ref(&whole), "not in its place");

    fs::write(whole.with_extension("json"), "{").expect("writable");
    check_refused(std::slice::from_ref(&whole), "whole.json");
    fs::remove_file(whole.with_extension("json")).expect("it is there");
    check_refused(&[whole], "unfinished");
}

#[test]
fn a_shard_is_finished_once_it_is_whole() {
    let folder = folder();
    let tar = write(&folder, "a", "cars", 0..2);
    let contents = Contents { dataset: "cars".into(), samples: 0..2, total: 6 };
    assert!(is_finished(&tar, &contents).expect("it is readable"));
    let other = Contents { dataset: "planes".into(), ..contents.clone() };
    assert!(is_finished(&tar, &other).is_err());

    let bytes = fs::read(&tar).expect("it is there");
    fs::write(&tar, &bytes[1..]).expect("writable");
    assert!(!is_finished(&tar, &contents).expect("it is readable"));
    fs::remove_file(&tar).expect("it is there");
    assert!(!is_finished(&tar, &contents).expect("it is readable"));
}

#[test]
fn a_shard_that_is_given_up_leaves_nothing() {
    let folder = folder();
    let contents = Contents { dataset: "cars".into(), samples: 0..2, total: 2 };
    let path = folder.path().join("a.tar");
    let mut writer = ShardWriter::create(&path, contents).expect("it is writable");
    writer.append(&sample(0)).expect("it is writable");
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).expect("it is there").count(), 0);
}
