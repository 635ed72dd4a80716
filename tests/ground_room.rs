//! Ground whose file has no room for an edit: the file is rewritten in the background, every edit follows in its order, and nothing that was told as saved is lost.

mod common;

use common::rugged;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use terrasoar::ground::Edited;
use terrasoar::{Crater, Edit, Error, Ground, StreamOptions, Terrain, View};
use terrasoar_layout::build::{BuildOptions, HeightRoom, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{EditSession, HeightWindow, SampleRect, history, room_for, widen};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain as TerrainFile;
use terrasoar_layout::verify::verify;

const SPACING_M: f64 = 10.0;
const SIDE: u32 = 257;

/// Land whose records hold its own heights and some metres more.
fn land(sample_type: SampleType) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([SIDE; 2], sample_type, |x, y| rugged(3, x, y));
    build(&dem, &path, &BuildOptions::default().spacing_m([SPACING_M; 2]), &Silent).unwrap();
    (folder, path)
}

fn streamed(path: &Path) -> Ground<'static> {
    Terrain::open(path).unwrap().stream(StreamOptions::default().cache_mib(4)).unwrap()
}

fn view() -> View {
    View::new([1280.0, 400.0, 1500.0], 0.0, -35.0).tolerance_px(1.0)
}

fn crater(x: f64, depth_m: f64) -> Edit {
    Edit::Crater(Crater { centre_m: [x, 1280.0], direction_deg: 0.0, radius_m: 200.0, depth_m })
}

/// So deep that no record of [`land`] holds it.
fn deep(x: f64) -> Edit {
    crater(x, 3000.0)
}

/// Heights of all samples in the file, edits included.
fn heights_in(path: &Path) -> HeightWindow {
    let mut session = EditSession::open(path).unwrap();
    let rect = SampleRect { west: 0, south: 0, east: SIDE - 1, north: SIDE - 1 };
    session.editor_mut().heights(rect).unwrap()
}

/// What these batches come to where somebody rewrites the file by hand before one that needs it.
fn by_hand(sample_type: SampleType, batches: &[&[Edit]]) -> HeightWindow {
    let (_folder, path) = land(sample_type);
    let mut session = EditSession::open(&path).unwrap();
    for batch in batches {
        while let Err(error) = session.apply(batch) {
            let Error::OutOfRange { heights_m, .. } = error else { panic!("{error}") };
            let room = room_for(session.header(), heights_m);
            drop(session);
            widen(&SystemDisk, &path, room, 512, &Silent).unwrap();
            session = EditSession::open(&path).unwrap();
        }
        session.commit("by hand").unwrap();
    }
    drop(session);
    heights_in(&path)
}

/// What edits come to in the file rewritten with room for anything.
fn in_a_wide_file(edits: &[Edit]) -> HeightWindow {
    let (_folder, path) = land(SampleType::I16);
    widen(&SystemDisk, &path, HeightRoom { lowest_m: -1e8, highest_m: 1e8 }, 512, &Silent).unwrap();
    let mut session = EditSession::open(&path).unwrap();
    session.apply(edits).unwrap();
    session.commit("all").unwrap();
    drop(session);
    heights_in(&path)
}

/// Updates until nothing is on its way.
fn settle(ground: &mut Ground<'_>) {
    let begun = Instant::now();
    while ground.update(&view()).work.late > 0 || ground.is_waiting() || ground.is_making_room() {
        assert!(begun.elapsed() < Duration::from_secs(120), "it does not come to an end");
        std::thread::yield_now();
    }
}

/// The ground shows what the file has.
fn check_shown(ground: &mut Ground<'_>, path: &Path) {
    let at: Vec<f64> = (0..40).map(|i| 30.0 + 60.0 * f64::from(i)).collect();
    let begun = Instant::now();
    while at.iter().any(|x| !ground.height_at(*x, 1280.0).is_exact) {
        at.iter().for_each(|x| ground.want_height(*x, 1280.0));
        ground.update(&view());
        assert!(begun.elapsed() < Duration::from_secs(60), "pages do not come");
    }
    let file = Terrain::open(path).unwrap();
    for x in at {
        let (shown, there) = (ground.height_at(x, 1280.0).height_m, file.height_m(x, 1280.0).unwrap());
        assert!((shown.unwrap() - there.unwrap()).abs() < 1e-9, "{x}: {shown:?}, {there:?}");
    }
    // So does its mesh: no drawn corner but of the file's heights.
    let records = file.file();
    let mut corners = 0;
    ground.for_each_triangle(&mut |triangle| {
        for corner in triangle {
            let height_m = records.height_m(corner.x, corner.y).unwrap().unwrap();
            let rounding_m = 1e-4 + 1e-7 * height_m.abs();
            assert!((corner.z - height_m).abs() < rounding_m, "{corner}: {height_m}");
            corners += 1;
        }
    });
    assert!(corners > 1000, "{corners}");
}

#[test]
fn edits_beyond_the_range_follow_in_their_order_while_flying_goes_on() {
    for sample_type in [SampleType::I16, SampleType::F32] {
        let (_folder, path) = land(sample_type);
        let mut ground = streamed(&path);
        settle(&mut ground);
        let (first_step, first_land) = (ground.step(), ground.land());
        let now = |edited: Edited| matches!(edited, Edited::Now(changes) if !changes.samples.is_empty());
        assert!(now(ground.edit(&[crater(500.0, 20.0)]).unwrap()));
        let first = ground.commit("first").unwrap();
        // In memory alone when the file is rewritten.
        assert!(now(ground.edit(&[crater(800.0, 20.0)]).unwrap()));
        assert_eq!(ground.edit(&[deep(1200.0)]).unwrap(), Edited::Later);
        // The same place, so that the order counts.
        let flat = Edit::set(SampleRect { west: 110, south: 120, east: 125, north: 130 }, 777.0);
        assert_eq!(ground.edit(std::slice::from_ref(&flat)).unwrap(), Edited::Later);
        assert!(ground.is_making_room() && !ground.is_saved());
        let second = ground.commit("second").unwrap();
        assert_eq!(ground.edit(&[crater(1250.0, 30.0)]).unwrap(), Edited::Later);
        // A ticket may be waited for without an update.
        let saved = second.wait().unwrap();
        assert!(saved.pages > 0 && first.wait().is_ok());
        settle(&mut ground);
        assert!(!ground.step().is_of_same_mesh(first_step) && ground.land() == first_land);
        assert!(!ground.is_saved(), "the last crater is in memory");
        assert!(now(ground.edit(&[crater(1900.0, 20.0)]).unwrap()));
        ground.commit("third").unwrap().wait().unwrap();
        settle(&mut ground);
        assert!(ground.is_saved());
        check_shown(&mut ground, &path);
        ground.end_editing().unwrap();
        assert!(ground.take_error().is_none());
        let second = [crater(800.0, 20.0), deep(1200.0), flat];
        let third = [crater(1250.0, 30.0), crater(1900.0, 20.0)];
        let wanted = by_hand(sample_type, &[&[crater(500.0, 20.0)], &second, &third]);
        assert!(heights_in(&path) == wanted);
        let file = TerrainFile::open(&path).unwrap();
        assert!(verify(&file, &|_| {}).unwrap().is_sound());
        let labels: Vec<_> = history(&file).unwrap().into_iter().map(|e| (e.label, e.edits)).collect();
        assert_eq!(labels, [("second".to_owned(), 3), ("third".to_owned(), 2)]);
    }
}

#[test]
fn a_crater_that_goes_deeper_and_deeper_is_made_at_every_depth() {
    let (_folder, path) = land(SampleType::I16);
    let mut ground = streamed(&path);
    ground.update(&view());
    let mut batches = Vec::new();
    let mut later = 0;
    for i in 0..12_u32 {
        let batch = [crater(300.0 + 160.0 * f64::from(i), 30.0 * 2_f64.powi(i as i32))];
        later += u32::from(ground.edit(&batch).unwrap() == Edited::Later);
        batches.push(batch);
        if i % 3 == 2 {
            ground.finish_edits();
            ground.update(&view());
        }
    }
    assert!(later > 3, "{later}");
    ground.commit("all").unwrap().wait().unwrap();
    settle(&mut ground);
    check_shown(&mut ground, &path);
    drop(ground);
    // What was not on the disk was made again in every file.
    assert!(heights_in(&path) == by_hand(SampleType::I16, &[&batches.concat()]));
}

#[test]
fn undo_goes_back_to_where_room_was_made_and_no_further() {
    let (_folder, path) = land(SampleType::I16);
    let before = heights_in(&path);
    let mut ground = streamed(&path);
    settle(&mut ground);
    ground.edit(&[crater(500.0, 20.0)]).unwrap();
    ground.commit("first").unwrap();
    assert_eq!(ground.edit(&[deep(1200.0)]).unwrap(), Edited::Later);
    ground.commit("second").unwrap();
    ground.edit(&[crater(1900.0, 20.0)]).unwrap();
    ground.commit("third").unwrap();
    // Waits for all that.
    assert!(ground.undo().unwrap() && ground.undo().unwrap());
    assert!(!ground.undo().unwrap(), "what was before has become the ground");
    settle(&mut ground);
    check_shown(&mut ground, &path);
    assert!(ground.redo().unwrap());
    settle(&mut ground);
    check_shown(&mut ground, &path);
    assert!(ground.undo().unwrap());
    drop(ground);
    let after = heights_in(&path);
    assert!(after != before && after == by_hand(SampleType::I16, &[&[crater(500.0, 20.0)]]));
}

/// Whoever drops the ground in the middle has waited for all commits.
#[test]
fn ground_that_goes_meanwhile_leaves_all_that_was_ordered_on_the_disk() {
    for wait_ms in [0, 1, 3, 10, 40] {
        let (_folder, path) = land(SampleType::I16);
        let mut ground = streamed(&path);
        ground.update(&view());
        ground.edit(&[crater(500.0, 20.0)]).unwrap();
        let first = ground.commit("first").unwrap();
        ground.edit(&[deep(1200.0)]).unwrap();
        let second = ground.commit("second").unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        ground.edit(&[crater(1900.0, 20.0)]).unwrap();
        drop(ground);
        assert!(first.outcome().unwrap().is_ok() && second.outcome().unwrap().is_ok());
        let wanted = by_hand(SampleType::I16, &[&[crater(500.0, 20.0)], &[deep(1200.0)]]);
        assert!(heights_in(&path) == wanted, "after {wait_ms} ms");
    }
}

#[test]
fn what_cannot_be_made_is_told_and_all_else_is() {
    let (_folder, path) = land(SampleType::I16);
    let mut ground = streamed(&path);
    settle(&mut ground);
    ground.edit(&[crater(500.0, 20.0)]).unwrap();
    // Heights that no file holds.
    let mut abyss = vec![crater(1300.0, 20.0)];
    abyss.extend(std::iter::repeat_n(crater(1200.0, 1e7), 150));
    let edited = ground.edit(&abyss).unwrap();
    assert_eq!(edited, Edited::Later);
    ground.edit(&[crater(1900.0, 20.0)]).unwrap();
    let failed = ground.commit("all").unwrap().wait().unwrap_err();
    assert!(failed.to_string().contains("land.iqt"), "{failed}");
    let told = ground.take_error().unwrap();
    assert_eq!(told.to_string(), failed.to_string());
    assert!(ground.take_error().is_none());
    // What was refused has been told by that ticket, and not by others.
    ground.edit(&[crater(1900.0, 20.0)]).unwrap();
    ground.commit("once more").unwrap().wait().unwrap();
    settle(&mut ground);
    check_shown(&mut ground, &path);
    drop(ground);
    // The file was rewritten before that came out, and its records round no height any more.
    let edits = [crater(500.0, 20.0), crater(1900.0, 20.0), crater(1900.0, 20.0)];
    assert!(heights_in(&path) == in_a_wide_file(&edits));
}

#[test]
fn no_file_is_rewritten_under_overlays_or_where_the_options_say_so() {
    let (_folder, path) = land(SampleType::I16);
    let overlay = path.with_extension("iqo");
    let refused = |mut ground: Ground<'_>, word: &str| {
        ground.update(&view());
        let error = ground.edit(&[deep(1200.0)]).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { .. }) && error.to_string().contains(word), "{error}");
        ground.edit(&[crater(500.0, 20.0)]).unwrap();
        assert!(!ground.is_making_room());
    };
    let before = std::fs::read(&path).unwrap();
    let options = StreamOptions::default().cache_mib(4);
    refused(Terrain::open(&path).unwrap().stream(options.room_mib(0)).unwrap(), "rewrite it");
    drop(EditSession::open_overlay(&path, &overlay).unwrap());
    refused(streamed(&path), "land.iqo");
    let over = Terrain::open_with_overlay(&path, &overlay).unwrap();
    refused(over.stream(options).unwrap(), "land.iqt");
    assert!(std::fs::read(&path).unwrap() == before);
}

/// A file that was rewritten begins its generations anew; ground of the file before takes no edits of it.
#[test]
fn ground_of_the_file_before_takes_no_edits() {
    let (_folder, path) = land(SampleType::I16);
    let opened = Terrain::open(&path).unwrap();
    let stream = || opened.stream(StreamOptions::default().cache_mib(4)).unwrap();
    let (mut first, mut second) = (stream(), stream());
    first.edit(&[deep(1200.0)]).unwrap();
    first.finish_edits();
    drop(first);
    assert_eq!(TerrainFile::open(&path).unwrap().header().generation, opened.file().header().generation);
    let said = second.edit(&[crater(500.0, 20.0)]).unwrap_err().to_string();
    assert!(said.contains("open it again"), "{said}");
}
