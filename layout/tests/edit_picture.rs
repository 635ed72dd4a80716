//! Edits and paint in one commit: on the disk together or not at all, undone and redone together, in files and overlays.

mod common;

use common::drape::{draped, land};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::HeightRoom;
use terrasoar_layout::edit::{Crater, Edit, EditSession, compact, widen};
use terrasoar_layout::file::disk::{Disk, FailingDisk, Failure, SystemDisk};
use terrasoar_layout::imagery::{
    DrapeOptions, Extent, Imagery, MemoryImage, Paint, Region, TileFormat, TileId,
};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::unused::unused_bytes;
use terrasoar_layout::verify::verify;

const SIZE: [u32; 2] = [600, 40];

/// A terrain with a picture of 2 m a texel.
fn made(folder: &Path) -> PathBuf {
    let path = folder.join("a.iqt");
    land(&path);
    drape_over(&path, 3);
    path
}

fn drape_over(path: &Path, seed: u32) {
    let image =
        MemoryImage::from_fn(SIZE, |x, y| [(x / 3) as u8, (4 * y) as u8, (x + seed * y) as u8 / 2 + 60, 255]);
    let extent = Some(Extent::Metres([0.0, 0.0, 1200.0, 80.0]));
    draped(path, image, &DrapeOptions::default().format(TileFormat::Bc1).extent(extent)).unwrap();
}

/// A crater and its scorch.
fn shell(i: u32) -> (Edit, Paint) {
    let centre_m = [60.0 + f64::from(i * 431 % 1080), 20.0 + f64::from(i * 17 % 40)];
    let crater = Crater { centre_m, direction_deg: 70.0, radius_m: 25.0, depth_m: 4.0 };
    (Edit::Crater(crater), Paint::scorch_of(&crater))
}

fn fire(session: &mut EditSession, shells: &[u32]) -> Result<(), LayoutError> {
    let (edits, paints): (Vec<_>, Vec<_>) = shells.iter().map(|i| shell(*i)).unzip();
    session.apply_and_paint(&edits, &paints).map(drop)
}

/// Record pages, and tiles with their mean colours.
#[derive(Debug, PartialEq)]
struct State {
    pages: Vec<u8>,
    tiles: Vec<(Option<[u8; 4]>, Vec<u8>)>,
}

impl State {
    fn of(terrain: &Terrain) -> Self {
        let report = verify(terrain, &|_| {}).unwrap();
        assert!(report.is_sound(), "{:?}", report.problems);
        let pages = (0..terrain.header().record_pages())
            .flat_map(|i| terrain.checked_page(i).unwrap().to_vec())
            .collect();
        let imagery = Imagery::open(terrain).unwrap().unwrap();
        let tile = |id: TileId| {
            let mut tile = Vec::new();
            imagery.read_tile(terrain, id, &mut tile).unwrap();
            (imagery.average(id), tile)
        };
        Self { pages, tiles: imagery.shape().ids().map(tile).collect() }
    }
}

/// The tiles that the session says it has.
fn painted(session: &EditSession) -> Vec<Vec<u8>> {
    let painter = session.painter().unwrap();
    let read = |id| {
        let mut tile = Vec::new();
        painter.read_tile(id, &mut tile).unwrap();
        tile
    };
    painter.shape().ids().map(read).collect()
}

fn open(path: &Path, overlay: Option<&Path>) -> Terrain {
    match overlay {
        Some(overlay) => Terrain::open_with_overlay(path, overlay).unwrap(),
        None => Terrain::open(path).unwrap(),
    }
}

fn session_on(
    disk: Arc<dyn Disk + Send>,
    path: &Path,
    overlay: Option<&Path>,
) -> Result<EditSession, LayoutError> {
    match overlay {
        Some(overlay) => EditSession::open_overlay_on(disk, path, overlay),
        None => EditSession::open_on(disk, path),
    }
}

/// Steps of one session; what is to be there after each.
fn script(session: &mut EditSession, mut after: impl FnMut(&mut EditSession)) -> Result<(), LayoutError> {
    for step in 0..5 {
        match step {
            0 => fire(session, &[1])?,
            1 => fire(session, &[2, 3])?,
            2 => drop(session.undo()?),
            3 => drop(session.redo()?),
            _ => drop(session.paint(&[shell(4).1])?),
        }
        session.commit(&format!("step {step}"))?;
        after(session);
    }
    Ok(())
}

#[test]
fn ground_and_picture_go_together_whatever_fails() {
    for is_overlay in [false, true] {
        let fresh = || {
            let folder = tempfile::tempdir().unwrap();
            let path = made(folder.path());
            let overlay = is_overlay.then(|| folder.path().join("a.iqo"));
            (folder, path, overlay)
        };
        let (_folder, path, overlay) = fresh();
        let mut states = vec![State::of(&open(&path, None))];
        let counting = Arc::new(FailingDisk::new(u64::MAX, Failure::Once));
        let mut session = session_on(Arc::clone(&counting) as _, &path, overlay.as_deref()).unwrap();
        script(&mut session, |session| {
            let there = State::of(&open(&path, overlay.as_deref()));
            let tiles: Vec<Vec<u8>> = there.tiles.iter().map(|(_, tile)| tile.clone()).collect();
            assert!(painted(session) == tiles, "the session and the file differ");
            states.push(there);
        })
        .unwrap();
        assert!(states[3] == states[1] && states[4] == states[2] && states[2] != states[1]);
        assert!(states[5].pages == states[4].pages && states[5].tiles != states[4].tiles);
        let calls = counting.calls();
        drop(session);
        for at in 0..calls {
            for failure in [
                Failure::Killed { quarters: 0 },
                Failure::Killed { quarters: 2 },
                Failure::Killed { quarters: 4 },
                Failure::Once,
            ] {
                let (_folder, path, overlay) = fresh();
                let disk = Arc::new(FailingDisk::new(at, failure));
                let mut session = match session_on(disk, &path, overlay.as_deref()) {
                    Ok(session) => session,
                    // Making the overlay failed: there is none, or one without edits.
                    Err(error) => {
                        let overlay = overlay.as_deref().unwrap_or_else(|| panic!("{error}"));
                        assert!(!overlay.exists() || State::of(&open(&path, Some(overlay))) == states[0]);
                        continue;
                    }
                };
                let mut done = 0;
                assert!(script(&mut session, |_| done += 1).is_err());
                let there = State::of(&open(&path, overlay.as_deref()));
                assert!(
                    there == states[done] || there == states[done + 1],
                    "{failure:?} at {at}, {done} done"
                );
                if failure == Failure::Once && !matches!(done, 2 | 3) {
                    // What failed is in the next commit.
                    session.commit("again").unwrap();
                    assert!(
                        State::of(&open(&path, overlay.as_deref())) == states[done + 1],
                        "{failure:?} at {at}"
                    );
                }
            }
        }
    }
}

#[test]
fn what_changed_is_told_and_undone() {
    let folder = tempfile::tempdir().unwrap();
    let path = made(folder.path());
    let before = State::of(&open(&path, None));
    let mut session = EditSession::open(&path).unwrap();
    assert!(session.painter().is_none());
    fire(&mut session, &[1]).unwrap();
    let told = session.take_repainted();
    assert!(!told.tiles.is_empty() && !told.is_another);
    session.discard();
    assert_eq!(session.take_repainted().tiles, told.tiles);
    assert!(session.is_committed());
    fire(&mut session, &[1]).unwrap();
    session.commit("one").unwrap();
    session.take_repainted();
    let other = session.undo().unwrap().unwrap();
    assert!(!other.pages.is_empty());
    assert_eq!(session.take_repainted().tiles, told.tiles);
    assert!(State::of(&open(&path, None)) == before);
    drop(session);
    // A session that has painted nothing tells of it too.
    let mut session = EditSession::open(&path).unwrap();
    session.redo().unwrap().unwrap();
    assert_eq!(session.take_repainted().tiles, told.tiles);
    // Restoring knows what was there before all commits.
    let everything = Region::Rect { from_m: [-1.0; 2], to_m: [2000.0; 2] };
    session.paint(&[Paint::Restore(everything)]).unwrap();
    session.commit("restored").unwrap();
    let there = State::of(&open(&path, None));
    assert!(there.tiles == before.tiles && there.pages != before.pages);
    // A picture draped anew is another one; undoing brings the old one back.
    drop(session);
    let smaller = MemoryImage::from_fn([30, 20], |x, y| [x as u8, y as u8, 0, 255]);
    draped(&path, smaller, &DrapeOptions::default()).unwrap();
    let mut session = EditSession::open(&path).unwrap();
    session.undo().unwrap().unwrap();
    assert!(session.take_repainted().is_another && session.painter().is_none());
    session.paint(&[shell(5).1]).unwrap();
    assert_eq!(session.painter().unwrap().shape().texels, SIZE);
}

#[test]
fn a_batch_that_cannot_be_painted_edits_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = made(folder.path());
    let mut session = EditSession::open(&path).unwrap();
    let (edit, paint) = shell(1);
    let Paint::Scorch(scorch) = paint else { panic!("no scorch") };
    let wrong = Paint::Scorch(terrasoar_layout::imagery::Scorch { strength: 7.0, ..scorch });
    assert!(session.apply_and_paint(std::slice::from_ref(&edit), &[paint, wrong]).is_err());
    let too_deep = Edit::Crater(Crater {
        centre_m: [600.0, 40.0],
        direction_deg: 0.0,
        radius_m: 25.0,
        depth_m: f64::NAN,
    });
    assert!(session.apply_and_paint(&[too_deep], &[paint]).is_err());
    assert!(session.is_committed() && session.take_repainted().tiles == BTreeSet::new());
    // Without a picture there is nothing to paint on.
    drop(session);
    land(&path);
    let mut session = EditSession::open(&path).unwrap();
    let error = session.apply_and_paint(&[edit], &[paint]).unwrap_err().to_string();
    assert!(error.contains("terrasoar drape"), "{error}");
    assert!(session.is_committed());
}

#[test]
fn compacting_keeps_the_paint_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = made(folder.path());
    let whole = unused_bytes(&open(&path, None)).unwrap();
    let mut session = EditSession::open(&path).unwrap();
    let before = std::fs::metadata(&path).unwrap().len();
    for i in 1..4 {
        fire(&mut session, &[i]).unwrap();
        session.commit("shell").unwrap();
    }
    drop(session);
    let terrain = open(&path, None);
    let unused = unused_bytes(&terrain).unwrap();
    let grown = std::fs::metadata(&path).unwrap().len() - before;
    assert!(unused > whole && unused <= whole + grown, "{unused} of {grown}");
    let out = folder.path().join("b.iqt");
    compact(&SystemDisk, &path, None, &out, &Silent).unwrap();
    let compacted = open(&out, None);
    assert!(State::of(&compacted) == State::of(&terrain));
    assert_eq!(unused_bytes(&compacted).unwrap(), 0);
}

/// As [`made`], with room for deep craters.
fn roomy(folder: &Path) -> PathBuf {
    let path = made(folder);
    let room = HeightRoom { lowest_m: 0.0, highest_m: 400.0 };
    widen(&SystemDisk, &path, room, 64, &Silent).unwrap();
    path
}

/// What is done to a base under its overlays.
fn change(path: &Path, step: u32) {
    let mut session = EditSession::open(path).unwrap();
    match step % 5 {
        0 | 3 => fire(&mut session, &[10 + step]).unwrap(),
        1 => {
            drop(session);
            return drape_over(path, 5 + step);
        }
        2 => drop(session.undo().unwrap().unwrap()),
        // The state that was undone before is left behind.
        _ => drop(session.undo().unwrap()),
    }
    session.commit(&format!("step {step}")).unwrap();
}

/// A base only grows: overlays begun over any of its states go on showing that state and their own edits, whatever it is given later, and can be edited on.
#[test]
fn overlays_outlive_what_their_base_is_given_later() {
    let folder = tempfile::tempdir().unwrap();
    let path = roomy(folder.path());
    let mut begun: Vec<(PathBuf, State)> = Vec::new();
    for step in 0..10 {
        let before = State::of(&open(&path, None));
        for (kind, edits) in [("plain", &[][..]), ("edited", &[step + 30, step + 31])] {
            let overlay = folder.path().join(format!("{kind}{step}.iqo"));
            let mut session = session_on(Arc::new(SystemDisk), &path, Some(&overlay)).unwrap();
            assert!(!session.editor().terrain().base_has_grown());
            fire(&mut session, edits).unwrap();
            session.commit("begun").unwrap();
            drop(session);
            let state = State::of(&open(&path, Some(&overlay)));
            assert_eq!(state == before, edits.is_empty());
            begun.push((overlay, state));
        }
        change(&path, step);
        let base = std::fs::read(&path).unwrap();
        for (i, (overlay, state)) in begun.iter_mut().enumerate() {
            for terrain in [
                Terrain::open_with_overlay(&path, overlay).unwrap(),
                Terrain::open_with_overlay_unmapped(&path, overlay).unwrap(),
            ] {
                assert!(terrain.base_has_grown());
                assert!(State::of(&terrain) == *state, "{} after step {step}", overlay.display());
                assert!(State::of(&terrain.open_again_unmapped().unwrap()) == *state);
            }
            // Some are edited on, by one batch that is undone and redone.
            if (i as u32 + step).is_multiple_of(4) {
                let mut session = session_on(Arc::new(SystemDisk), &path, Some(overlay)).unwrap();
                assert!(session.editor().terrain().base_has_grown());
                fire(&mut session, &[50 + step]).unwrap();
                session.commit("later").unwrap();
                let later = State::of(&open(&path, Some(overlay)));
                assert!(later != *state);
                session.undo().unwrap().unwrap();
                assert!(State::of(&open(&path, Some(overlay))) == *state);
                session.redo().unwrap().unwrap();
                *state = later;
            }
        }
        assert!(std::fs::read(&path).unwrap() == base);
    }
    // The two together, as a file of its own.
    let out = folder.path().join("out.iqt");
    for (overlay, state) in &begun {
        compact(&SystemDisk, &path, Some(overlay), &out, &Silent).unwrap();
        assert!(State::of(&open(&out, None)) == *state, "{}", overlay.display());
    }
    // A base that is written anew holds no older states, however much it grows afterwards.
    compact(&SystemDisk, &path, None, &path, &Silent).unwrap();
    for grown in 0..12 {
        for (overlay, _) in &begun {
            let error = Terrain::open_with_overlay(&path, overlay).unwrap_err().to_string();
            assert!(error.contains("was written anew after these edits were begun"), "{grown}: {error}");
            assert!(EditSession::open_overlay(&path, overlay).is_err());
        }
        change(&path, grown % 2);
    }
}

/// A base that was taken back to a copy, and edited otherwise than before, has the same beginnings and is another file all the same.
#[test]
fn an_overlay_is_refused_over_a_base_that_went_another_way() {
    let folder = tempfile::tempdir().unwrap();
    let (path, overlay) = (roomy(folder.path()), folder.path().join("o.iqo"));
    let copy = std::fs::read(&path).unwrap();
    change(&path, 0);
    let mut session = EditSession::open_overlay(&path, &overlay).unwrap();
    fire(&mut session, &[70]).unwrap();
    session.commit("over").unwrap();
    drop(session);
    let (edited, header) = (std::fs::read(&path).unwrap(), open(&path, None).header().clone());

    std::fs::write(&path, &copy).unwrap();
    let refused = || {
        let error = Terrain::open_with_overlay_unmapped(&path, &overlay).unwrap_err().to_string();
        assert!(error.contains("o.iqo") && error.contains("written anew"), "{error}");
    };
    refused();
    for step in [3, 3, 1] {
        change(&path, step);
        refused();
    }
    // The pages of the base's last commit are looked at: a directory that outlived them is not enough.
    std::fs::write(&path, &edited).unwrap();
    change(&path, 3);
    let grown = std::fs::read(&path).unwrap();
    Terrain::open_with_overlay_unmapped(&path, &overlay).unwrap();
    let newest = open_entries(&edited, folder.path(), header.generation);
    assert!(!newest.is_empty());
    for page in newest {
        let mut damaged = grown.clone();
        damaged[page as usize * 4096 + 77] ^= 0x20;
        std::fs::write(&path, damaged).unwrap();
        refused();
    }
}

/// A picture leaves records and directory alone: another one in its place is another base all the same.
#[test]
fn an_overlay_is_refused_over_a_base_with_another_picture() {
    let folder = tempfile::tempdir().unwrap();
    let (path, overlay) = (roomy(folder.path()), folder.path().join("o.iqo"));
    let bare = std::fs::read(&path).unwrap();
    drape_over(&path, 3);
    let mut session = EditSession::open_overlay(&path, &overlay).unwrap();
    fire(&mut session, &[70]).unwrap();
    session.commit("over").unwrap();
    drop(session);
    let draped = std::fs::read(&path).unwrap();
    // It is the base, grown.
    change(&path, 0);
    Terrain::open_with_overlay_unmapped(&path, &overlay).unwrap();
    // A copy from before, with a picture of the same size and format, and an edit.
    std::fs::write(&path, &bare).unwrap();
    drape_over(&path, 8);
    assert_eq!(std::fs::read(&path).unwrap().len(), draped.len(), "only colours differ");
    for _ in 0..2 {
        let error = Terrain::open_with_overlay_unmapped(&path, &overlay).unwrap_err().to_string();
        assert!(error.contains("o.iqo") && error.contains("written anew"), "{error}");
        let refused = EditSession::open_overlay(&path, &overlay).unwrap_err().to_string();
        assert!(refused.contains("written anew"), "{refused}");
        change(&path, 0);
    }
}

/// Pages of the record pages that a generation wrote.
fn open_entries(bytes: &[u8], folder: &Path, generation: u32) -> Vec<u32> {
    let path = folder.join("look.iqt");
    std::fs::write(&path, bytes).unwrap();
    let terrain = Terrain::open_unmapped(&path).unwrap();
    terrain
        .present_pages()
        .unwrap()
        .filter(|(_, e)| e.generation == generation)
        .map(|(_, e)| e.page)
        .collect()
}
