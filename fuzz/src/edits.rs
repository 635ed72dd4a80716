//! Scripts of edits: read, written again, done on the disk batch by batch, undone, done again, and replayed along a flight.

use crate::land::PLAIN;
use crate::seeds::{self, Inputs};
use crate::words::{refused, told};
use std::path::Path;
use std::sync::Arc;
use terrasoar::edits::{LoadedBatch, Loader, Script, Step, timed};
use terrasoar::flyover::{EngineKind, Quality, replay_edited};
use terrasoar::view::Viewport;
use terrasoar_layout::edit::EditSession;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Batches that are done.
const MOST_BATCHES: usize = 6;
/// Edits that are done.
const MOST_EDITS: u64 = 40;

pub(crate) fn seeds() -> Inputs {
    seeds::scripts()
}

pub(crate) fn body(data: &[u8]) {
    let folder = crate::scratch::folder();
    let path = folder.path().join("s.edits");
    let Some(mut script) = told(Script::parse(data, &path)) else { return };
    let text = match script.to_text(&path) {
        Ok(text) => text,
        Err(error) => panic!("read and cannot be written: {error}"),
    };
    let again = Script::parse(text.as_bytes(), &path)
        .unwrap_or_else(|error| panic!("written and cannot be read: {error}\n{text}"));
    assert_eq!(again, script, "what is written reads back as another script");
    if script.edits() > MOST_EDITS {
        return;
    }
    script.batches.truncate(MOST_BATCHES);
    bring_stamps(&mut script, folder.path());
    let Some(batches) = told(Loader::new(&path, terrasoar_import::open_file).script(&script)) else {
        return;
    };
    does(&batches, folder.path());
    replays(&batches, folder.path());
}

/// Whatever file a stamp names, it is this one: a script of a stranger's must not make a test read a stranger's files.
fn bring_stamps(script: &mut Script, folder: &Path) {
    let heights: Vec<u8> = (0..36i16).flat_map(|i| (100 + i % 6 * 3).to_be_bytes()).collect();
    seeds::write(&folder.join("stamp.hgt"), &heights);
    for step in script.batches.iter_mut().flat_map(|batch| &mut batch.steps) {
        if let Step::Stamp(stamp) = step {
            stamp.file = "stamp.hgt".into();
        }
    }
}

/// All record pages.
fn pages(terrain: &Terrain) -> Vec<u8> {
    let page = |i| terrain.checked_page(i).unwrap_or_else(|error| panic!("a page of a sound file: {error}"));
    (0..terrain.header().record_pages()).flat_map(|i| page(i).to_vec()).collect()
}

fn open(path: &Path) -> Terrain {
    Terrain::open(path).unwrap_or_else(|error| panic!("committed and does not open: {error}"))
}

fn does(batches: &[LoadedBatch], folder: &Path) {
    let path = folder.join("land.iqt");
    seeds::write(&path, &PLAIN);
    let before = pages(&open(&path));
    let Some(mut session) = told(EditSession::open(&path)) else {
        panic!("a sound terrain cannot be edited")
    };
    let mut states = vec![before];
    for batch in batches {
        if told(session.apply(&batch.edits)).is_none() {
            assert!(session.is_committed(), "a batch was refused and has changed something");
            continue;
        }
        let written =
            session.commit(&batch.label).unwrap_or_else(|error| panic!("a commit on a sound disk: {error}"));
        if written.pages > 0 {
            states.push(pages(&open(&path)));
        }
    }
    let report =
        verify(&open(&path), &|_| {}).unwrap_or_else(|error| panic!("committed and cannot be read: {error}"));
    assert!(report.is_sound(), "committed and not sound: {:?}", report.problems);
    for state in states.iter().rev().skip(1) {
        let undone = session.undo().unwrap_or_else(|error| panic!("an undo on a sound disk: {error}"));
        assert!(undone.is_some() && pages(&open(&path)) == *state, "undoing leads to another state");
    }
    assert!(matches!(session.undo(), Ok(None)), "there is more to undo than was done");
    for state in &states[1..] {
        let redone = session.redo().unwrap_or_else(|error| panic!("a redo on a sound disk: {error}"));
        assert!(redone.is_some() && pages(&open(&path)) == *state, "redoing leads to another state");
    }
}

/// Kinetic and SOAR draw the same over ground that changes.
fn replays(batches: &[LoadedBatch], folder: &Path) {
    let terrain = Arc::new(open(&folder.join("land.iqt")));
    let frames = crate::fly::frames_over(&terrain);
    let quality = Quality::default().viewport(Viewport { width_px: 64, height_px: 48 }).tolerance_px(4.0);
    let batches = timed(batches, &frames);
    let fly = |engine| replay_edited(&terrain, &frames, quality, engine, &batches, &mut |_| {});
    match (fly(EngineKind::Soar), fly(EngineKind::Kinetic)) {
        (Ok(soar), Ok(kinetic)) => {
            let same = soar.iter().zip(&kinetic).all(|(a, b)| a.triangles == b.triangles);
            assert!(same, "kinetic draws another mesh than soar over edited ground");
        }
        (Err(one), Err(other)) => {
            refused(&one);
            refused(&other);
        }
        (soar, kinetic) => {
            panic!("one engine refuses what the other flies: {:?} {:?}", soar.err(), kinetic.err())
        }
    }
}
