//! Edits on the disk: whole batches whatever fails, undo and redo, overlays, readers that go on, files written anew.

mod common;

use common::edits::{Bench, pages, session_pages, set};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, HeightRoom};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, compact, history, widen};
use terrasoar_layout::file::disk::{Disk, FailingDisk, Failure, SystemDisk};
use terrasoar_layout::imagery::{DrapeOptions, MemoryImage};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// What a test edits: a terrain, or an overlay of it.
trait Target {
    /// Where edits go: the terrain itself or an overlay of it.
    fn session(&self, disk: Arc<dyn Disk + Send>, is_overlay: bool) -> Result<EditSession, LayoutError>;

    fn open(&self, is_overlay: bool) -> Terrain;
}

impl Target for Bench {
    fn session(&self, disk: Arc<dyn Disk + Send>, is_overlay: bool) -> Result<EditSession, LayoutError> {
        if is_overlay {
            EditSession::open_overlay_on(disk, &self.terrain(), &self.path("o.iqo"))
        } else {
            EditSession::open_on(disk, &self.terrain())
        }
    }

    fn open(&self, is_overlay: bool) -> Terrain {
        if is_overlay {
            Terrain::open_with_overlay(&self.terrain(), &self.path("o.iqo")).unwrap()
        } else {
            Terrain::open(&self.terrain()).unwrap()
        }
    }
}

fn is_sound(terrain: &Terrain) -> bool {
    let report = verify(terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    true
}

/// Three batches, then one undone, one redone; the pages after each step.
fn script(
    session: &mut EditSession,
    mut seen: impl FnMut(usize, &mut EditSession),
) -> Result<(), LayoutError> {
    for step in 0..5 {
        match step {
            0 => session.apply(&[set(1), set(2)])?,
            1 => session.apply(&[set(3)])?,
            2 => session.undo()?.unwrap_or_default(),
            3 => session.redo()?.unwrap_or_default(),
            _ => session.apply(&[set(4), set(5), set(6)])?,
        };
        session.commit(&format!("step {step}"))?;
        seen(step, session);
    }
    Ok(())
}

/// Killed, out of room, or failing once at every call of the disk: what is there then verifies and is one of the states that commits lead to, none before the last that
/// was reported durable, none after the one under way.
#[test]
fn whatever_fails_a_whole_number_of_batches_is_there() {
    for (is_overlay, bench) in [false, true].into_iter().flat_map(|is| Bench::both().map(move |b| (is, b))) {
        let bytes = std::fs::read(bench.terrain()).unwrap();
        let mut states = vec![pages(&Terrain::open(&bench.terrain()).unwrap())];
        let counting = Arc::new(FailingDisk::new(u64::MAX, Failure::Once));
        let mut session = bench.session(Arc::clone(&counting) as Arc<dyn Disk + Send>, is_overlay).unwrap();
        script(&mut session, |_, session| states.push(session_pages(session))).unwrap();
        drop(session);
        let calls = counting.calls();
        assert!(calls >= 2 * 2 + 3 * 4, "{calls}");
        assert!(pages(&bench.open(is_overlay)) == states[5]);
        for at in 0..calls {
            for quarters in 0..=4 {
                for failure in [Failure::Killed { quarters }, Failure::Full { quarters }, Failure::Once] {
                    std::fs::write(bench.terrain(), &bytes).unwrap();
                    std::fs::remove_file(bench.path("o.iqo")).ok();
                    let disk = Arc::new(FailingDisk::new(at, failure));
                    let mut session = match bench.session(disk, is_overlay) {
                        Ok(session) => session,
                        // Making the overlay failed: there is none, or one without edits.
                        Err(error) => {
                            assert!(is_overlay, "{error}");
                            if bench.path("o.iqo").exists() {
                                assert!(pages(&bench.open(true)) == states[0]);
                            }
                            continue;
                        }
                    };
                    let mut done = 0;
                    let ended = script(&mut session, |step, _| done = step + 1);
                    assert!(ended.is_err() || matches!(failure, Failure::Full { .. }), "{failure:?} at {at}");
                    let there = bench.open(is_overlay);
                    assert!(is_sound(&there));
                    let there = pages(&there);
                    let expected = [&states[done], &states[(done + 1).min(5)]];
                    assert!(
                        expected.contains(&&there),
                        "{failure:?} at {at} of {calls}, overlay: {is_overlay}"
                    );
                    // What failed once may be tried again, from where it stands.
                    if ended.is_err() && failure == Failure::Once {
                        session.commit("again").unwrap();
                        let now = session_pages(&mut session);
                        drop(session);
                        let again = bench.open(is_overlay);
                        assert!(is_sound(&again) && pages(&again) == now, "{at} of {calls}");
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Commits, undos, redos and openings in any order against a list of states.
    #[test]
    fn history_is_a_list_of_states(steps in prop::collection::vec(0u8..6, 1..24), is_overlay in any::<bool>(), is_packed in any::<bool>()) {
        let bench = if is_packed { Bench::packed() } else { Bench::new() };
        let base = std::fs::read(bench.terrain()).unwrap();
        let mut session = bench.session(Arc::new(SystemDisk), is_overlay).unwrap();
        let mut states = vec![session_pages(&mut session)];
        let mut at = 0;
        for (i, step) in (0u32..).zip(steps) {
            match step {
                0..=2 => {
                    let changes = session.apply(&[set(i)]).unwrap();
                    let committed = session.commit("set").unwrap();
                    prop_assert_eq!(committed.pages as usize, changes.pages.len());
                    if committed.pages > 0 {
                        states.truncate(at + 1);
                        states.push(session_pages(&mut session));
                        at += 1;
                    }
                }
                3 => {
                    let undone = session.undo().unwrap();
                    prop_assert_eq!(undone.is_some(), at > 0);
                    at = at.saturating_sub(1);
                }
                4 => {
                    let redone = session.redo().unwrap();
                    prop_assert_eq!(redone.is_some(), at + 1 < states.len());
                    at = (at + 1).min(states.len() - 1);
                }
                _ => {
                    drop(session);
                    session = bench.session(Arc::new(SystemDisk), is_overlay).unwrap();
                }
            }
            prop_assert!(session_pages(&mut session) == states[at]);
            let there = bench.open(is_overlay);
            prop_assert!(pages(&there) == states[at]);
            let told = history(&there).unwrap();
            prop_assert_eq!(told.len(), states.len() - 1);
            prop_assert_eq!(told.iter().position(|entry| entry.is_current).map_or(0, |i| i + 1), at);
        }
        prop_assert!(is_sound(&bench.open(is_overlay)));
        prop_assert!(!is_overlay || std::fs::read(bench.terrain()).unwrap() == base);
    }
}

/// Whoever opened the file before goes on reading what was there.
/// A batch that is refused halfway through leaves nothing: what is undone next is the batch before it, and there is nothing to commit.
#[test]
fn after_a_refused_batch_there_is_nothing_to_commit_and_undo_goes_on() {
    for bench in Bench::both() {
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        let built = session_pages(&mut session);
        session.apply(&[set(1)]).unwrap();
        session.commit("one").unwrap();
        let (one, header) = (session_pages(&mut session), session.header().clone());
        let too_high = Edit::Set {
            height_m: 1e6,
            area: Area::Rect(SampleRect { west: 90, south: 80, east: 95, north: 85 }),
        };
        // Pages of the batch before and pages that nobody has written to.
        assert!(matches!(
            session.apply(&[set(1), set(2), set(5), too_high.clone()]),
            Err(LayoutError::OutOfRange { .. })
        ));
        assert!(session.is_committed() && session.editor().uncommitted().is_empty());
        assert!(session_pages(&mut session) == one);
        assert_eq!(session.commit("nothing").unwrap().pages, 0);
        assert_eq!(*session.header(), header);
        assert!(session.undo().unwrap().is_some());
        assert!(session_pages(&mut session) == built);
        // What was applied before it stays to be committed, and no more than that.
        session.apply(&[set(3)]).unwrap();
        let (three, waiting) = (session_pages(&mut session), session.editor().uncommitted());
        session.apply(&[set(2), set(4), too_high]).unwrap_err();
        assert!(session_pages(&mut session) == three && session.editor().uncommitted() == waiting);
        session.discard();
        assert!(session_pages(&mut session) == built && session.is_committed());
    }
}

#[test]
fn readers_keep_what_they_opened() {
    for bench in Bench::both() {
        let mapped = Terrain::open(&bench.terrain()).unwrap();
        let read = Terrain::open_unmapped(&bench.terrain()).unwrap();
        let before = pages(&mapped);
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        for i in 0..20 {
            session.apply(&[set(i)]).unwrap();
            session.commit("set").unwrap();
            assert!(pages(&mapped) == before && pages(&read) == before);
        }
        let told = EditSession::open(&bench.terrain()).unwrap_err().to_string();
        assert!(told.contains("another program is writing"), "{told}");
        assert!(pages(&Terrain::open_original(&bench.terrain()).unwrap()) == before);
    }
}

/// A restored area is as it was before all edits, also those of earlier sessions.
#[test]
fn restoring_goes_back_to_the_original() {
    for bench in Bench::both() {
        let before = pages(&Terrain::open(&bench.terrain()).unwrap());
        for i in 0..4 {
            let mut session = EditSession::open(&bench.terrain()).unwrap();
            session.apply(&[set(i)]).unwrap();
            session.commit("set").unwrap();
        }
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        let all = SampleRect { west: 0, south: 0, east: 149, north: 119 };
        session.apply(&[Edit::Restore(Area::Rect(all))]).unwrap();
        assert!(session_pages(&mut session) == before);
    }
}

/// Written anew, an edited terrain is the same in less room; one that was not edited is the same file.
#[test]
fn compacting_drops_what_edits_replaced() {
    for bench in Bench::both() {
        let out = bench.path("c.iqt");
        compact(&SystemDisk, &bench.terrain(), None, &out, &Silent).unwrap();
        assert!(std::fs::read(&out).unwrap() == std::fs::read(bench.terrain()).unwrap());
        for is_overlay in [false, true] {
            let mut session = bench.session(Arc::new(SystemDisk), is_overlay).unwrap();
            for i in 0..9 {
                session.apply(&[set(i)]).unwrap();
                session.commit("set").unwrap();
            }
            let edited = session_pages(&mut session);
            drop(session);
            let there = bench.open(is_overlay);
            let overlay = is_overlay.then(|| bench.path("o.iqo"));
            compact(&SystemDisk, &bench.terrain(), overlay.as_deref(), &out, &Silent).unwrap();
            let compacted = Terrain::open(&out).unwrap();
            assert!(is_sound(&compacted) && pages(&compacted) == edited);
            assert!(compacted.header().file_bytes < there.header().file_bytes);
            assert!(history(&compacted).unwrap().is_empty());
            assert!(compacted.present_pages().unwrap().map(|(_, entry)| entry.page).is_sorted());
        }
        // In its own place, while somebody reads it.
        let reader = Terrain::open(&bench.terrain()).unwrap();
        let before = pages(&reader);
        compact(&SystemDisk, &bench.terrain(), None, &bench.terrain(), &Silent).unwrap();
        assert!(pages(&reader) == before && pages(&Terrain::open(&bench.terrain()).unwrap()) == before);
    }
}

/// A picture draped over an edited terrain is a commit of its own.
#[test]
fn a_picture_is_undone_like_an_edit() {
    for bench in Bench::both() {
        let plain = pages(&Terrain::open(&bench.terrain()).unwrap());
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        session.apply(&[set(3)]).unwrap();
        session.commit("set").unwrap();
        let edited = session_pages(&mut session);
        drop(session);
        let picture = MemoryImage::from_fn([300, 200], |x, y| [x as u8, y as u8, 9, 255]);
        common::drape::draped(&bench.terrain(), picture, &DrapeOptions::default()).unwrap();
        let draped = Terrain::open(&bench.terrain()).unwrap();
        assert!(is_sound(&draped) && pages(&draped) == edited);
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        let mut expect = |undo: bool, has_picture: bool, wanted: &[u8]| {
            let changes = if undo { session.undo() } else { session.redo() };
            assert!(changes.unwrap().is_some());
            let there = Terrain::open(&bench.terrain()).unwrap();
            assert!(is_sound(&there) && pages(&there) == wanted);
            assert_eq!(there.header().imagery.is_some(), has_picture);
        };
        expect(true, false, &edited);
        expect(true, false, &plain);
        expect(false, false, &edited);
        expect(false, true, &edited);
        assert!(common::drape::same_picture(&draped, &Terrain::open(&bench.terrain()).unwrap()));
    }
}

/// Heights beyond the file's are kept: it is rewritten with room for them, and nothing else changes.
#[test]
fn widening_keeps_every_height_and_the_picture() {
    for bench in Bench::both() {
        let picture =
            MemoryImage::from_fn([700, 600], |x, y| [x as u8, y as u8, (x / 16 + y / 16) as u8, 255]);
        common::drape::draped(&bench.terrain(), picture, &DrapeOptions::default()).unwrap();
        let heights = |terrain: &Terrain| -> Vec<Option<f64>> {
            let grid = *terrain.grid();
            let [wide, high] = grid.samples();
            let points = (0..high).flat_map(|y| (0..wide).map(move |x| [x, y]));
            points
                .map(|p| terrain.height_m(f64::from(p[0]) * 10.0, f64::from(p[1]) * 10.0).unwrap())
                .collect()
        };
        let before = Terrain::open(&bench.terrain()).unwrap();
        let abyss = Edit::Set {
            area: Area::Rect(SampleRect { west: 30, south: 30, east: 50, north: 40 }),
            height_m: -2500.0,
        };
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        let error = session.apply(std::slice::from_ref(&abyss)).unwrap_err();
        assert!(matches!(error, LayoutError::OutOfRange { .. }), "{error}");
        drop(session);
        for lowest_m in [-3000.0, -300_000.0] {
            let room = HeightRoom { lowest_m, highest_m: 0.0 };
            widen(&SystemDisk, &bench.terrain(), room, 512, &Silent).unwrap();
            let after = Terrain::open(&bench.terrain()).unwrap();
            assert!(is_sound(&after) && heights(&after) == heights(&before));
            assert_eq!(after.header().record_kind.bytes(), if lowest_m < -70_000.0 { 8 } else { 4 });
            assert!(common::drape::same_picture(&before, &after));
        }
        let mut session = EditSession::open(&bench.terrain()).unwrap();
        session.apply(&[abyss]).unwrap();
        session.commit("abyss").unwrap();
        let after = Terrain::open(&bench.terrain()).unwrap();
        assert!(is_sound(&after));
        assert_eq!(after.height_m(400.0, 350.0).unwrap(), Some(-2500.0));
        assert_eq!(after.header().height_range_m[0], -2500.0);
    }
}

/// An overlay belongs to one terrain, and never writes to it.
#[test]
fn overlays_are_held_to_their_base() {
    for bench in Bench::both() {
        let (base, overlay) = (bench.terrain(), bench.path("o.iqo"));
        let read_only = |path: &Path, yes| {
            let mut rights = std::fs::metadata(path).unwrap().permissions();
            rights.set_readonly(yes);
            std::fs::set_permissions(path, rights).unwrap();
        };
        read_only(&base, true);
        let mut session = EditSession::open_overlay(&base, &overlay).unwrap();
        session.apply(&[set(1)]).unwrap();
        session.commit("set").unwrap();
        let edited = session_pages(&mut session);
        drop(session);
        assert!(pages(&Terrain::open_with_overlay_unmapped(&base, &overlay).unwrap()) == edited);
        let records = Terrain::open_with_overlay(&base, &overlay).unwrap();
        let records = records.records().unwrap();
        terrasoar_layout::with_records!(records, records => {
            let p = terrasoar_layout::grid::GridPoint::new(40, 55);
            assert_eq!(records.vertex_at(p).height_m, 21.0);
        });
        read_only(&base, false);

        let other = Bench::new();
        let dem = common::MemoryDem::from_fn([50, 60], SampleType::I16, |x, y| f64::from(x * y % 90));
        std::fs::write(other.terrain(), common::build_bytes(&dem, &BuildOptions::default()).unwrap())
            .unwrap();
        for error in [
            Terrain::open_with_overlay(&other.terrain(), &overlay).unwrap_err(),
            EditSession::open_overlay(&other.terrain(), &overlay).unwrap_err(),
        ] {
            let error = error.to_string();
            assert!(
                error.contains("these edits were made over another terrain, which was called t.iqt"),
                "{error}"
            );
        }
        let error = Terrain::open_with_overlay(&base, &base).unwrap_err();
        assert!(error.to_string().contains("no overlay of edits"), "{error}");
        let error = Terrain::open(&overlay).unwrap_err();
        assert!(error.to_string().contains("not a terrain file"), "{error}");
        assert!(Terrain::open_with_overlay(&bench.path("none.iqt"), &overlay).is_err());
        assert!(Terrain::open_with_overlay(&base, &bench.path("none.iqo")).is_err());
    }
}

/// Each byte of journal and header in turn: an error that says where, or no difference; no panic.
#[test]
fn damage_of_the_journal_is_told() {
    let bench = Bench::new();
    let mut session = EditSession::open(&bench.terrain()).unwrap();
    for i in 0..2 {
        session.apply(&[set(i)]).unwrap();
        session.commit("set").unwrap();
    }
    let (edited, header) = (session_pages(&mut session), session.header().clone());
    drop(session);
    let bytes = std::fs::read(bench.terrain()).unwrap();
    let journal = header.history.unwrap().commit_page as usize * 4096;
    let mut told = 0;
    for at in
        (journal..journal + 4096).step_by(7).chain([journal + 4095, 0xe8, 0xec, 4096 + 0xe8, 4096 + 0xec])
    {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        std::fs::write(bench.terrain(), &damaged).unwrap();
        // The ground itself does not depend on its journal.
        let terrain = Terrain::open(&bench.terrain()).unwrap();
        if at >= journal {
            assert!(pages(&terrain) == edited);
            let error = history(&terrain).unwrap_err().to_string();
            assert!(error.contains("journal") && error.contains("compact"), "{error}");
            assert!(EditSession::open(&bench.terrain()).is_err());
            assert!(!verify(&terrain, &|_| {}).unwrap().is_sound());
            told += 1;
        }
    }
    assert!(told > 500);
}
