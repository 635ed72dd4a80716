//! Everything that a program does with a terrain file, and with an overlay over it.
//!
//! What holds of any file: nothing panics, memory stays in proportion, refusals are words, and **a file that opened opens after whatever was done or refused**. What holds of
//! one that `verify` calls sound: all of its past can be gone through, its tiles can be read, it can be written anew, and every engine draws the same over it.

use crate::fly::{flies, frames_over};
use crate::image::reads_tiles;
use crate::land::{burn, dent, level};
use crate::take_out::takes_out;
use crate::words::{refused, told};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::HeightRoom;
use terrasoar_layout::edit::{Area, Compacted, Edit, EditSession, compact, history, widen};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::imagery::{DrapeOptions, MemoryImage, TileFormat, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::Sealed;
use terrasoar_layout::verify::unused::unused_bytes;
use terrasoar_layout::verify::verify;

/// Steps of a file's past that are gone through.
const MOST_STEPS: usize = 5;
/// Largest side that is rebuilt: 2^7 + 1 samples.
const MOST_K: u32 = 7;

/// The files under trial on the disk.
struct Trial {
    base: PathBuf,
    overlay: Option<PathBuf>,
}

impl Trial {
    fn open(&self) -> Result<Terrain, LayoutError> {
        match &self.overlay {
            Some(overlay) => Terrain::open_with_overlay(&self.base, overlay),
            None => Terrain::open(&self.base),
        }
    }

    fn session(&self) -> Result<EditSession, LayoutError> {
        match &self.overlay {
            Some(overlay) => EditSession::open_overlay(&self.base, overlay),
            None => EditSession::open(&self.base),
        }
    }

    fn still_opens(&self, after: &str) {
        if let Err(error) = self.open() {
            panic!("after {after} the file does not open: {error}");
        }
    }
}

/// Opens, looks, flies, edits, goes back and forth, writes anew.
pub(crate) fn uses(files: &Sealed) {
    let folder = crate::scratch::folder();
    let (base, overlay) = files.write(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    let trial = Trial { base, overlay };
    let Some(terrain) = told(trial.open()) else { return };
    let terrain = Arc::new(terrain);
    let is_sound = looks(&terrain);
    flies(&terrain, &frames_over(&terrain), is_sound);
    takes_out(&terrain, folder.path(), is_sound);
    writes_anew(&terrain, folder.path(), is_sound);
    edits(&trial, is_sound);
    if is_sound {
        trial.still_opens("edits");
    }
    if trial.overlay.is_none() {
        drapes(&trial);
        widens(&trial);
    }
}

/// Whether `verify` calls it sound, and whether all else that only reads agrees.
fn looks(terrain: &Terrain) -> bool {
    let is_sound = told(verify(terrain, &|_| {})).is_some_and(|report| {
        for problem in &report.problems {
            let text = problem.to_string();
            assert!(text.len() < 1600 && !text.chars().any(char::is_control), "{text:?}");
        }
        report.is_sound()
    });
    let past = told(history(terrain));
    assert!(past.is_some() || !is_sound, "called sound, and its history cannot be read");
    reads_tiles(terrain, is_sound);
    told(unused_bytes(terrain));
    let [east, north] = terrain.grid().extent_m();
    for (x, y) in [(0.0, 0.0), (0.37 * east, 0.61 * north), (east, north), (-1.0, 0.0), (f64::NAN, 1.0)] {
        let height = told(terrain.height_m(x, y));
        assert!(height.is_some() || !is_sound, "called sound, and a height cannot be read");
    }
    let original = terrain.base_path().is_none().then(|| told(Terrain::open_original(terrain.path())));
    assert!(
        original.is_none_or(|original| original.is_some()) || !is_sound,
        "called sound, and what was before does not open"
    );
    is_sound
}

/// Compacts into another file.
fn writes_anew(terrain: &Terrain, folder: &Path, is_sound: bool) {
    let out = folder.join("anew.iqt");
    let (file, overlay) = match terrain.base_path() {
        Some(base) => (base, Some(terrain.path())),
        None => (terrain.path(), None),
    };
    match compact(&SystemDisk, file, overlay, &out, &Silent) {
        Ok(Compacted { header, .. }) => {
            let anew =
                Terrain::open(&out).unwrap_or_else(|error| panic!("compacted and does not open: {error}"));
            assert!(anew.header().to_page() == header.to_page(), "what was written is not what was told");
            let (before, after) = (terrain.source().byte_count(), anew.source().byte_count());
            assert!(after <= 2 * before + (1 << 20), "{before} bytes became {after}");
            let report =
                verify(&anew, &|_| {}).unwrap_or_else(|error| panic!("compacted and not readable: {error}"));
            assert!(
                report.is_sound() || !is_sound,
                "sound and compacted, and no longer sound: {:?}",
                report.problems
            );
        }
        Err(error) => {
            refused(&error);
            assert!(!is_sound, "called sound, and cannot be compacted: {error}");
            assert!(!out.exists(), "refused, and something was published: {error}");
        }
    }
}

/// Goes through the past, adds to it, goes back again.
fn edits(trial: &Trial, is_sound: bool) {
    let opened = trial.session();
    assert!(opened.is_ok() || !is_sound, "called sound, and cannot be edited: {:?}", opened.err());
    let Some(mut session) = told(opened) else { return };
    turns(trial, &mut session, is_sound);
    let grid = *session.editor().terrain().grid();
    let [east, north] = grid.extent_m();
    let [low, high] = session.header().height_range_m;
    let place = [0.4 * east, 0.6 * north];
    let batches = [
        vec![dent(place), level(3, 4, 0.5 * (low + high))],
        vec![level(0, 0, low), Edit::Restore(Area::Disc { centre_m: place, radius_m: 40.0 })],
    ];
    for batch in batches {
        if told(session.apply_and_paint(&batch, &[burn(place)])).is_none()
            && told(session.apply(&batch)).is_none()
        {
            session.discard();
        }
        if told(session.commit("a try")).is_none() {
            session.discard();
        }
        trial.still_opens("a commit");
    }
    turns(trial, &mut session, false);
}

/// Back as far as it goes, and forth.
fn turns(trial: &Trial, session: &mut EditSession, is_sound: bool) {
    for turn in [EditSession::undo, EditSession::redo] {
        for _ in 0..MOST_STEPS {
            let turned = turn(session);
            assert!(
                turned.is_ok() || !is_sound,
                "called sound, and its past cannot be gone through: {:?}",
                turned.err()
            );
            let turned = told(turned);
            trial.still_opens("going back or forth");
            if turned.flatten().is_none() {
                break;
            }
        }
    }
}

/// Another picture over it.
fn drapes(trial: &Trial) {
    let image = MemoryImage::from_fn([30, 20], |x, y| [x as u8, y as u8, 7, 255]);
    let options = DrapeOptions::default().format(TileFormat::Rgba8);
    told(drape(&trial.base, &[Box::new(image)], &options, &Silent));
    trial.still_opens("draping");
}

/// Written anew with room for other heights.
fn widens(trial: &Trial) {
    let Some(terrain) = told(trial.open()) else { return };
    if terrain.grid().k() > MOST_K {
        return;
    }
    let [low, high] = terrain.header().height_range_m;
    let room = HeightRoom { lowest_m: low - 100.0, highest_m: high + 100.0 };
    told(widen(&SystemDisk, &trial.base, room, 48, &Silent));
    trial.still_opens("widening");
}
