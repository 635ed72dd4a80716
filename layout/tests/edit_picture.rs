//! Edits and paint in one commit: on the disk together or not at all, undone and redone together, in files and overlays.

mod common;

use common::drape::{draped, land};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Crater, Edit, EditSession, compact};
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
