//! Edits and other processes, by the real program: second writers, kills, readers.

use crate::edit::{heights, read, with_script, write};
use std::path::Path;
use std::time::Duration;
use terrasoar_layout::read::terrain::Terrain;

#[test]
fn a_second_writer_is_told() {
    let bench = with_script("set rect 10,10,20,20 to 100\n");
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    let writer = terrasoar_layout::edit::EditSession::open(&bench.path("land.iqt")).unwrap();
    let before = read(&bench, "land.iqt");
    for args in [
        &["edit", "land.iqt", "--script", "a.edits"][..],
        &["crater", "land.iqt", "--at", "900,900", "--radius", "50", "--depth", "5"],
        &["undo", "land.iqt"],
        &["compact", "land.iqt"],
    ] {
        let message = bench.bad(1, args);
        assert!(message.contains("another program is writing"), "{args:?}: {message}");
    }
    assert!(read(&bench, "land.iqt") == before);
    // Looking and an overlay need no lock of the terrain.
    bench.good(&["edit", "land.iqt", "--script", "a.edits", "--dry-run"]);
    bench.good(&["edit", "land.iqt", "--script", "a.edits", "--overlay", "o.iqo"]);
    drop(writer);
    bench.good(&["undo", "land.iqt"]);
}

/// Rectangles that every batch sets to one same height, far from each other.
const RECTS: [[u32; 4]; 4] = [[3, 3, 6, 6], [60, 5, 70, 9], [100, 100, 103, 110], [8, 90, 8, 100]];

/// A script of `batches` that each set all of [`RECTS`] to another height, from 10 m on, a tenth of a metre up each.
fn in_step(batches: u32) -> String {
    let mut lines = String::new();
    for i in 0..batches {
        for [west, south, east, north] in RECTS {
            lines +=
                &format!("set rect {west},{south},{east},{north} to {}\n", 10.0 + f64::from(i % 300) / 10.0);
        }
        lines.push('\n');
    }
    lines
}

/// A script of batches that each set all of [`RECTS`] to one height.
pub fn batches_in_step(heights_m: impl IntoIterator<Item = f64>) -> String {
    let batch = |height_m: f64| {
        let edit = |[west, south, east, north]: [u32; 4]| {
            format!("set rect {west},{south},{east},{north} to {height_m}\n")
        };
        RECTS.into_iter().map(edit).collect::<String>() + "\n"
    };
    heights_m.into_iter().map(batch).collect()
}

/// The one height of all rectangles.
pub fn height_in_step(path: &Path) -> f64 {
    let terrain = Terrain::open(path).unwrap();
    let at = |x: u32, y: u32| terrain.height_m(f64::from(x) * 20.0, f64::from(y) * 20.0).unwrap().unwrap();
    let first = at(RECTS[0][0], RECTS[0][1]);
    for [west, south, east, north] in RECTS {
        for (x, y) in (west..=east).flat_map(|x| (south..=north).map(move |y| (x, y))) {
            assert_eq!(at(x, y), first, "a batch is seen in part");
        }
    }
    first
}

/// Killed at twenty moments: the file is sound, as before or after a whole batch, and the next edit goes on from there.
#[test]
fn a_killed_edit_leaves_whole_batches() {
    let bench = with_script(&in_step(400));
    write(&bench, "one.edits", &in_step(1));
    bench.good(&["edit", "land.iqt", "--script", "one.edits"]);
    let mut commits = 1;
    for moment in 0..20_u64 {
        let mut child = bench
            .command(&["edit", "land.iqt", "--script", "a.edits"])
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(3 + moment * 7));
        let _ = child.kill();
        child.wait().unwrap();
        height_in_step(&bench.path("land.iqt"));
        bench.good(&["verify", "land.iqt"]);
        let now = bench.json(&["history", "land.iqt", "--json"])["commit"].as_u64().unwrap();
        assert!(now >= commits);
        commits = now;
    }
    assert!(commits > 20, "the kills came too early: {commits}");
    // A killed writer's lock ended with it; what it left can be undone.
    bench.good(&["undo", "land.iqt", "5"]);
    height_in_step(&bench.path("land.iqt"));
    bench.good(&["undo", "land.iqt", "100000"]);
    bench.good(&["compact", "land.iqt"]);
    assert_eq!(bench.names(), ["a.edits", "land.iqt", "land.tif", "one.edits"]);
}

/// A reader in another process that opens the file again and again while batches are committed sees each whole.
#[test]
fn a_reader_sees_whole_batches_while_another_process_commits() {
    let bench = with_script(&in_step(250));
    write(&bench, "one.edits", &in_step(1));
    bench.good(&["edit", "land.iqt", "--script", "one.edits"]);
    let mut child = bench
        .command(&["edit", "land.iqt", "--script", "a.edits"])
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let kept = Terrain::open(&bench.path("land.iqt")).unwrap();
    let view = heights(&kept);
    let mut seen = std::collections::BTreeSet::new();
    let mut looks = 0;
    while child.try_wait().unwrap().is_none() {
        seen.insert((height_in_step(&bench.path("land.iqt")) * 10.0).round() as i64);
        looks += 1;
    }
    assert!(child.wait().unwrap().success());
    assert!(looks > 10 && seen.len() > 5, "{looks} looks, {} states", seen.len());
    // Decimetres are sums of binary fractions.
    let last_m = height_in_step(&bench.path("land.iqt"));
    assert!((last_m - 34.9).abs() < 1e-9, "{last_m}");
    // What was opened before goes on being what it was.
    assert!(heights(&kept) == view);
}
