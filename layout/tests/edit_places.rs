//! Pages that commits, undos and redos put elsewhere, seen by those who opened the file before: read from where they lie by now, never from where they lay.

mod common;

use common::MemoryDem;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Changes, Edit, EditSession, SampleRect};
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::file::source::{Fault, HostileSource, Hostility, PreadSource};
use terrasoar_layout::grid::record::{Compact, RecordCodec};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::loader::{Arrival, Loader, Outcome, PageRequest};
use terrasoar_layout::read::store::RecordStore;
use terrasoar_layout::read::terrain::Terrain;

const PATIENCE: Duration = Duration::from_secs(60);

/// Some 40 pages.
fn terrain_in(folder: &tempfile::TempDir) -> PathBuf {
    let path = folder.path().join("t.iqt");
    let dem = MemoryDem::from_fn([150, 120], SampleType::I16, |x, y| {
        f64::from((x * 7 + y * 13) % 100 + x / 3 + y / 2)
    });
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
    path
}

fn set(i: u32) -> Edit {
    let (west, south) = (i * 37 % 120, i * 53 % 100);
    let rect = SampleRect { west, south, east: west + 12, north: south + 9 };
    Edit::Set { area: Area::Rect(rect), height_m: f64::from(20 + i % 60) }
}

/// Where pages lie that an undo or a redo changed.
fn places_of(session: &EditSession, changes: &Changes) -> Vec<(u64, Entry)> {
    changes.pages.iter().map(|page| (*page, session.place_of(*page))).collect()
}

/// Everything that is in the file, opened anew.
fn now(path: &Path, overlay: Option<&Path>) -> Vec<Box<Page>> {
    let terrain = match overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(path, overlay).unwrap(),
        None => Terrain::open_unmapped(path).unwrap(),
    };
    (0..terrain.header().record_pages()).map(|page| terrain.checked_page(page).unwrap()).collect()
}

/// Asks for all pages and waits for them.
fn load_all(loader: &Loader, count: usize, frame: u64) -> Vec<Box<Page>> {
    let requests: Vec<PageRequest> = (0..count as u64).map(|page| PageRequest { page, due: frame }).collect();
    loader.ask(frame, &requests);
    let mut pages: Vec<Option<Box<Page>>> = vec![None; count];
    while pages.iter().any(Option::is_none) {
        match loader.take_within(PATIENCE) {
            Some(Arrival { page, outcome: Outcome::Read(bytes) }) => pages[page as usize] = Some(bytes),
            other => panic!("{other:?}"),
        }
    }
    pages.into_iter().flatten().collect()
}

/// Edits, commits, undoes and redoes while `opened` is open, which was opened before; it reads every state as one that opens the file anew.
fn follows(opened: Terrain, mut session: EditSession, path: &Path, overlay: Option<&Path>) {
    let first = opened.source().byte_count();
    let loader = Loader::start(Arc::new(opened), 2).unwrap();
    let count = session.header().record_pages() as usize;
    let original = load_all(&loader, count, 0);
    for i in 1..6 {
        session.apply(&[set(2 * i), set(2 * i + 1)]).unwrap();
        let committed = session.commit("two").unwrap();
        assert_eq!(committed.places.len() as u64, committed.pages);
        assert!(committed.places.iter().all(|(_, entry)| u64::from(entry.page) * 4096 >= first), "appended");
        loader.relocate(&committed.places);
        assert!(load_all(&loader, count, i.into()) == now(path, overlay), "commit {i}");
    }
    assert!(now(path, overlay) != original);
    for (frame, back) in (10..).zip([true, true, false, true, true, true, true]) {
        let changes = if back { session.undo() } else { session.redo() }.unwrap().unwrap();
        loader.relocate(&places_of(&session, &changes));
        assert!(load_all(&loader, count, frame) == now(path, overlay), "back: {back}");
    }
    assert!(load_all(&loader, count, 20) == original, "all is undone");
}

#[test]
fn a_file_opened_before_is_read_where_its_pages_lie_by_now() {
    let folder = tempfile::tempdir().unwrap();
    let path = terrain_in(&folder);
    follows(Terrain::open_unmapped(&path).unwrap(), EditSession::open(&path).unwrap(), &path, None);
    let path = terrain_in(&folder);
    follows(Terrain::open(&path).unwrap(), EditSession::open(&path).unwrap(), &path, None);
}

#[test]
fn an_overlay_opened_before_is_read_where_its_pages_lie_by_now() {
    let folder = tempfile::tempdir().unwrap();
    let (path, overlay) = (terrain_in(&folder), folder.path().join("o.iqo"));
    let session = EditSession::open_overlay(&path, &overlay).unwrap();
    let opened = Terrain::open_with_overlay_unmapped(&path, &overlay).unwrap();
    follows(opened, session, &path, Some(&overlay));
}

#[cfg(target_os = "linux")]
#[test]
fn a_ring_reads_what_was_appended_since_it_was_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = terrain_in(&folder);
    match terrasoar_layout::file::source::UringSource::open(&path) {
        Ok(source) => {
            let opened = Terrain::from_source(Box::new(source)).unwrap();
            follows(opened, EditSession::open(&path).unwrap(), &path, None);
        }
        Err(error) => println!("not tried: {error}"),
    }
}

/// Reads of the old places are under way, or have ended and were not taken yet, while pages move.
#[test]
fn what_was_read_before_a_page_moved_is_never_handed_over() {
    let folder = tempfile::tempdir().unwrap();
    for wait in [0, 5, 40, 150] {
        let path = terrain_in(&folder);
        let hostility = Arc::new(Hostility::default());
        let slow = Fault::Slow(Duration::from_millis(30));
        let source = HostileSource::new(PreadSource::open(&path).unwrap(), slow, Arc::clone(&hostility));
        let opened = Terrain::from_source(Box::new(source)).unwrap();
        hostility.one_in.store(1, Ordering::Relaxed);
        let loader = Loader::start(Arc::new(opened), 2).unwrap();
        let mut session = EditSession::open(&path).unwrap();
        let count = session.header().record_pages() as usize;
        let requests: Vec<PageRequest> = (0..count as u64).map(|page| PageRequest { page, due: 0 }).collect();
        loader.ask(0, &requests);
        std::thread::sleep(Duration::from_millis(wait));
        session.apply(&[set(1), set(2), set(3)]).unwrap();
        let committed = session.commit("three").unwrap();
        loader.relocate(&committed.places);
        let expected = now(&path, None);
        let mut come = vec![0; count];
        for _ in 0..count {
            match loader.take_within(PATIENCE) {
                Some(Arrival { page, outcome: Outcome::Read(bytes) }) => {
                    assert!(bytes == expected[page as usize], "page {page} after {wait} ms");
                    come[page as usize] += 1;
                }
                other => panic!("{other:?}"),
            }
        }
        assert!(come.iter().all(|times| *times == 1), "each comes once: {come:?}");
        assert!(loader.take_within(Duration::from_millis(100)).is_none());
    }
}

/// A page that fails where it lay says so only while it lies there; one that is damaged where it lies now is told with that place.
#[test]
fn damage_is_that_of_the_newest_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = terrain_in(&folder);
    let loader = Loader::start(Arc::new(Terrain::open_unmapped(&path).unwrap()), 1).unwrap();
    let mut session = EditSession::open(&path).unwrap();
    session.apply(&[set(1)]).unwrap();
    let places = session.commit("one").unwrap().places;
    let (page, entry) = places[0];
    loader.relocate(&[(page, Entry { checksum: !entry.checksum, ..entry }), (1 << 40, entry)]);
    loader.ask(0, &[PageRequest { page, due: 0 }]);
    match loader.take_within(PATIENCE).unwrap().outcome {
        Outcome::Failed(error @ LayoutError::Damaged { .. }) => {
            assert!(error.to_string().contains(&format!("file page {}", entry.page)), "{error}");
        }
        other => panic!("{other:?}"),
    }
    loader.relocate(&places);
    loader.ask(1, &[PageRequest { page, due: 1 }]);
    assert!(matches!(loader.take_within(PATIENCE).unwrap().outcome, Outcome::Read(_)));
    // One that another state of the file has not.
    loader.relocate(&[(page, Entry::default())]);
    loader.ask(2, &[PageRequest { page, due: 2 }]);
    let Outcome::Read(absent) = loader.take_within(PATIENCE).unwrap().outcome else { panic!() };
    assert!(absent != now(&path, None)[page as usize], "an inert page");
    assert!(Terrain::open_unmapped(&path).unwrap().checked_page_at(1 << 40, entry).is_err());
}

/// A pool learns that a page has come to be in the file, or is no longer.
#[test]
fn a_pool_follows_pages_that_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let terrain = Terrain::open_unmapped(&terrain_in(&folder)).unwrap();
    let ByKind::Compact(mut pool) = terrain.pool(1 << 20).unwrap() else { panic!() };
    let count = terrain.header().record_pages();
    assert!(count > 20);
    for page in 1..count {
        pool.install(page, &terrain.checked_page(page).unwrap()).unwrap();
    }
    let per_page = terrain.header().records_per_page();
    // One that says something, unlike those of padding.
    let mut slots = per_page..count * per_page;
    let slot = slots.find(|slot| pool.get(*slot) != Some(Compact::INERT)).unwrap();
    let (page, record) = (slot / per_page, pool.get(slot));
    let held = pool.pages_held();
    pool.set_present(page, false);
    assert!(pool.is_resident(page) && pool.get(slot) == Some(Compact::INERT));
    pool.set_present(page, true);
    assert!(!pool.is_resident(page) && pool.get(slot).is_none());
    pool.install(page, &terrain.checked_page(page).unwrap()).unwrap();
    assert_eq!(pool.get(slot), record);
    pool.set_present(page, true);
    pool.set_present(1 << 40, true);
    assert_eq!(pool.get(slot), record);
    // The frames of pages that are gone are used again, and no other page is lost with them.
    let mut small = match terrain.pool(0).unwrap() {
        ByKind::Compact(pool) => pool,
        _ => panic!(),
    };
    for round in 0..200 {
        let page = 1 + round * 7 % (count - 1);
        small.install(page, &terrain.checked_page(page).unwrap()).unwrap();
        assert!(small.is_resident(page) && small.pages_held() <= held);
        if round % 3 == 0 {
            small.set_present(page, false);
            small.set_present(page, true);
            assert!(!small.is_resident(page));
        }
    }
}
