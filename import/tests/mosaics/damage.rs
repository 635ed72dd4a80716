//! Files that are missing, no elevation data, or damaged in the middle: named, left out whole, and an error where that is asked for.

use crate::ground::{at, inside};
use crate::import_support::collect;
use crate::priority::{height, read};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, Priority, open_with};

const UTM: &str = "EPSG:32632";

pub(crate) fn warnings(paths: &[PathBuf], options: &OpenOptions) -> Vec<String> {
    let dem = open_with(paths, options).unwrap();
    collect(&*dem).unwrap();
    dem.warnings().into_iter().map(|warning| warning.words).collect()
}

/// Spoils one of the last numbers of a text grid, which shows when the others were read.
fn damaged(path: &Path) {
    let text = std::fs::read_to_string(path).unwrap();
    let at = text.trim_end().rfind(' ').unwrap();
    std::fs::write(path, format!("{} x{}", &text[..at], &text[at + 2..])).unwrap();
}

#[test]
fn a_damaged_file_shows_what_lies_below_it() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(0.0, 1000.0, 10.0).write(file("a.asc"), UTM, |_, _| 1.0);
    let b = at(0.0, 1000.0, 10.0).write(file("b.asc"), UTM, |_, _| 2.0);
    let c = at(1000.0, 1000.0, 10.0).write(file("c.asc"), UTM, |_, _| 3.0);
    damaged(&b);
    damaged(&c);
    let missing = file("missing.asc");
    let notes = file("notes.md");
    std::fs::write(&notes, "no elevation data").unwrap();
    let files = [a.clone(), b.clone(), c.clone(), missing.clone(), notes.clone()];
    let options = OpenOptions { priority: Priority::Last, ..OpenOptions::default() };
    let grid = read(&files, &options);
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [200, 100]);
    // Nothing of b, whose upper rows could be read; all of c is void.
    assert!((0..100).all(|row| grid.at(50, row) == 1.0 && grid.at(150, row).is_nan()));
    assert_eq!(height(&grid, 5.0, 5.0), 1.0);
    let said = warnings(&files, &options);
    for path in [&b, &c, &missing, &notes] {
        let name = path.display().to_string();
        let named: Vec<&String> = said.iter().filter(|words| words.contains(&name)).collect();
        assert!(named.len() == 1 && named[0].contains("left out"), "{name}: {said:?}");
    }
    assert!(!said.iter().any(|words| words.contains("a.asc")), "{said:?}");
    for lost in [&b, &missing, &notes] {
        let strict = OpenOptions { strict: true, ..options.clone() };
        let result =
            open_with(&[a.clone(), lost.clone()], &strict).and_then(|dem| collect(&*dem).map(|_| ()));
        assert!(result.unwrap_err().to_string().contains(&lost.display().to_string()));
    }
    let none = open_with(&[c, b], &options).and_then(|dem| collect(&*dem).map(|_| ()));
    assert!(none.unwrap_err().to_string().starts_with("none of the files can be read"));
    let none = open_with(&[missing, notes], &options).err().unwrap();
    assert!(none.to_string().contains("none of the files can be read"), "{none}");
}

#[test]
fn what_cannot_be_laid_with_the_others_is_left_out() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(500_000.0, 5_000_000.0, 10.0).write(file("a.asc"), UTM, |_, _| 1.0);
    let moon = at(10.0, 5.0, 0.1).write(file("moon.asc"), "+proj=longlat +a=1737400 +b=1737400", |_, _| 2.0);
    let site =
        at(0.0, 1000.0, 10.0).write(file("site.asc"), "LOCAL_CS[\"site\",UNIT[\"metre\",1]]", |_, _| 3.0);
    let b = at(501_000.0, 5_000_000.0, 10.0).write(file("b.asc"), UTM, |_, _| 4.0);
    let files = [a, moon, site, b];
    let said = warnings(&files, &OpenOptions::default());
    assert!(
        said.iter().any(|words| words.contains("moon.asc") && words.contains("another body")),
        "{said:?}"
    );
    assert!(
        said.iter().any(|words| words.contains("site.asc") && words.contains("not tied to the ground")),
        "{said:?}"
    );
    let grid = read(&files, &OpenOptions::default());
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [200, 100]);
    let far = at(900_000.0, 9_000_000.0, 0.01).write(file("far.asc"), UTM, |_, _| 5.0);
    let refused = open_with(&[files[0].clone(), far], &OpenOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("1,048,577"), "{refused}");
}

/// A file on the other side of the globe has no place in a zone's system; the others have.
#[test]
fn what_the_system_does_not_cover_is_named_and_left_out() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    let a = at(500_000.0, 5_000_000.0, 10.0).write(file("a.asc"), UTM, |_, _| 1.0);
    let b = at(501_000.0, 5_000_000.0, 10.0).write(file("b.asc"), UTM, |_, _| 2.0);
    let far = at(99.0, 0.01, 0.0001).write(file("far.asc"), "EPSG:4326", |_, _| 3.0);
    let files = [a, far, b];
    let elsewhere = OpenOptions { reproject: Some("EPSG:32633".into()), ..OpenOptions::default() };
    for options in [OpenOptions::default(), elsewhere] {
        let said = warnings(&files, &options);
        let named: Vec<&String> = said.iter().filter(|words| words.contains("far.asc")).collect();
        assert!(named.len() == 1 && named[0].contains("left out"), "{said:?}");
        let grid = read(&files, &options);
        assert!([1.0, 2.0].iter().all(|height| grid.samples.contains(height)));
        let strict = OpenOptions { strict: true, ..options };
        let refused = open_with(&files, &strict).err().unwrap().to_string();
        assert!(refused.contains("far.asc") && refused.contains("does not cover"), "{refused}");
    }
    // A satellite over the Pacific sees none of them.
    let none = OpenOptions {
        reproject: Some("+proj=geos +h=35785831 +lon_0=-171 +datum=WGS84".into()),
        ..OpenOptions::default()
    };
    let refused = open_with(&files, &none).err().unwrap().to_string();
    assert!(refused.contains("a.asc") && refused.contains("does not cover"), "{refused}");
}

#[test]
fn folders_take_what_has_a_place_and_patterns_what_fits() {
    let folder = tempdir().unwrap();
    let file = |name: &str| inside(folder.path(), name);
    at(0.0, 1000.0, 10.0).write(file("in/deep/a.asc"), UTM, |_, _| 1.0);
    at(1000.0, 1000.0, 10.0).write(file("in/b.asc"), UTM, |_, _| 2.0);
    std::fs::write(file("in/readme.txt"), "words").unwrap();
    std::fs::copy(crate::import_support::data("puget_sound_1025.png"), file("in/preview.png")).unwrap();
    let grid = read(&[file("in")], &OpenOptions::default());
    assert_eq!([grid.at(0, 0), grid.at(199, 0)], [1.0, 2.0]);
    assert!(warnings(&[file("in")], &OpenOptions::default()).is_empty());
    let grid = read(&[file("in/*.asc"), file("*/d*p/[a-c].asc")], &OpenOptions::default());
    assert_eq!(grid.info.samples_wide, 200);
    let none = open_with(&[file("in/*.tif")], &OpenOptions::default()).err().unwrap().to_string();
    assert!(none.contains("no file has a name that fits"), "{none}");
}
