//! Thousands of craters, committed while a flight goes on over a small pool: what is kept of them in memory is what is not in the file yet, and what is drawn is what the file holds.

mod common;

use common::checks::{keys, triangles, views};
use common::{frame, noise, rugged};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{Fetch, GroundPatch, ModelDisk, Prefetch, Streamed, ThreadFetch};
use terrasoar::view::View;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Changes, Crater, Edit, EditSession};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::grid::record::Compact;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::terrain::Terrain;

/// Pages of the pool, of some 450 that the file has.
const CACHE_PAGES: u64 = 80;
/// Craters a batch.
const CRATERS: u32 = 12;
/// Commits; each has two batches.
const COMMITS: u32 = 100;
/// Longest that pages may take to come.
const PATIENCE: Duration = Duration::from_secs(120);

fn terrain_at(path: &Path) {
    let dem = MemoryDem::from_fn([513; 2], SampleType::I16, |x, y| match (x, y) {
        (0, 0) => -2000.0,
        (1, 0) => 4000.0,
        _ => rugged(3, x, y),
    });
    build(&dem, path, &BuildOptions::default().spacing_m([10.0, 12.0]), &Silent).unwrap();
}

fn craters(batch: u32) -> Vec<Edit> {
    let crater = |i: u32| {
        let centre_m = [200.0 + 4700.0 * noise(1, batch, i), 200.0 + 5700.0 * noise(2, batch, i)];
        let radius_m = 20.0 + 60.0 * noise(3, batch, i);
        Edit::Crater(Crater { centre_m, direction_deg: 40.0, radius_m, depth_m: radius_m / 5.0 })
    };
    (0..CRATERS).map(crater).collect()
}

/// A flight, and the edits under it.
struct Flight<F> {
    streamed: Streamed<Compact, F>,
    session: EditSession,
    terrain: Arc<Terrain>,
}

impl<F: Fetch> Flight<F> {
    fn begin(path: &Path, fetch: impl FnOnce(&Arc<Terrain>) -> F) -> Self {
        let terrain = Arc::new(Terrain::open_unmapped(path).unwrap());
        let ByKind::Compact(pool) = terrain.pool(CACHE_PAGES * PAGE_BYTES as u64).unwrap() else {
            unreachable!("whole metres make compact records")
        };
        let streamed = Streamed::new(pool, fetch(&terrain), Culling::Vertices, Prefetch::Deadline);
        Self { streamed, session: EditSession::open(path).unwrap(), terrain }
    }

    fn view(&self, i: u32) -> View {
        let turn = f64::from(i) * 0.13;
        let at = [0.5 + 0.35 * turn.sin(), 0.5 + 0.35 * turn.cos()];
        let flown = frame(&self.terrain, at, 1500.0, 57.3 * turn, -30.0);
        views([flown], 1.0)[0]
    }

    fn edit(&mut self, batch: u32) -> usize {
        let changes = self.session.apply(&craters(batch)).unwrap();
        self.streamed.take_ground(GroundPatch::of(&changes, self.session.editor())).unwrap();
        changes.pages.len()
    }

    /// Goes back or forth, all of which is in the file.
    fn turn(&mut self, back: bool) {
        let turned = if back { self.session.undo() } else { self.session.redo() };
        let changes: Changes = turned.unwrap().unwrap();
        let places: Vec<_> = changes.pages.iter().map(|page| (*page, self.session.place_of(*page))).collect();
        let page = |(page, entry): &(u64, _)| (*page, self.terrain.checked_page_at(*page, *entry).unwrap());
        let pages = places.iter().map(page).collect();
        let height_range_m = self.session.editor().header().height_range_m;
        let patch = GroundPatch { samples: changes.samples, pages, height_range_m, places };
        self.streamed.take_ground(patch).unwrap();
    }

    fn fly(&mut self, i: u32) {
        let told = self.streamed.update(&self.view(i), &mut Unobserved);
        assert_eq!(told.failures, 0, "{:?}", self.streamed.take_error());
        assert!(self.streamed.engine().store().pages_held() as u64 <= CACHE_PAGES);
    }

    /// Stays until nothing is late, and compares with an engine over the file as it is now.
    fn check(&mut self, path: &Path, i: u32) {
        let (view, begun) = (self.view(i), Instant::now());
        loop {
            let told = self.streamed.update(&view, &mut Unobserved);
            if told.work.late == 0 {
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "{} stay late", told.work.late);
            self.streamed.fill(&view, Duration::from_secs(1), &mut Unobserved);
        }
        let reopened = Terrain::open(path).unwrap();
        let Ok(ByKind::Compact(records)) = reopened.records() else { unreachable!() };
        let mut soar = Soar::new(records, Culling::Vertices);
        soar.update(&view, &mut Unobserved);
        let mesh = triangles(&soar);
        assert!(mesh.len() > 500, "{}", mesh.len());
        assert!(
            keys(&triangles(self.streamed.engine())) == keys(&mesh),
            "view {i}: not the mesh of the file"
        );
    }
}

/// Edits go on while commits are written, as in a window.
fn bombard<F: Fetch>(mut flight: Flight<F>, path: &Path) {
    let (mut edited, mut most_held) = (0, 0);
    for i in 0..COMMITS {
        edited += flight.edit(2 * i);
        flight.fly(i);
        let job = flight.session.prepare_commit("craters").unwrap().unwrap();
        edited += flight.edit(2 * i + 1);
        flight.fly(i);
        most_held = most_held.max(flight.streamed.held_pages());
        let outcome = job.run();
        let mut places = flight.session.finish_commit(job, outcome).unwrap().places;
        let again = flight.session.editor().uncommitted();
        places.retain(|(page, _)| again.binary_search(page).is_err());
        flight.streamed.relocate(&places);
        assert_eq!(flight.streamed.held_pages(), again.len(), "kept is what is not in the file");
        flight.fly(i);
    }
    let places = flight.session.commit("the rest").unwrap().places;
    flight.streamed.relocate(&places);
    assert_eq!(flight.streamed.held_pages(), 0);
    let total = flight.terrain.header().record_pages() as usize;
    println!("{edited} pages were edited, {most_held} of {total} kept at most");
    assert!(edited > 20 * most_held, "{edited} {most_held}");
    for i in [0, 17, 31] {
        flight.check(path, COMMITS + i);
    }
    // Back and forth through what is in the file; nothing is kept of it.
    for (i, back) in (0..).zip([true, true, true, false, true, false, false]) {
        flight.turn(back);
        assert_eq!(flight.streamed.held_pages(), 0);
        flight.fly(200 + i);
        if i % 3 == 0 {
            flight.check(path, 200 + i);
        }
    }
    // The engine may be made anew at any time; the pool stays, and so do edits that are not in the file.
    flight.edit(9000);
    assert!(flight.streamed.held_pages() > 0);
    flight.streamed.set_culling(Culling::Vertices);
    let places = flight.session.commit("last").unwrap().places;
    flight.check(path, 230);
    flight.streamed.relocate(&places);
    assert_eq!(flight.streamed.held_pages(), 0);
    flight.check(path, 251);
}

#[test]
fn edited_pages_are_kept_until_they_are_in_the_file_and_then_read_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    terrain_at(&path);
    let threads = |terrain: &Arc<Terrain>| ThreadFetch::from(Loader::start(Arc::clone(terrain), 3).unwrap());
    bombard(Flight::begin(&path, threads), &path);
}

#[test]
fn on_a_model_disk_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    terrain_at(&path);
    bombard(Flight::begin(&path, |terrain| ModelDisk::new(Arc::clone(terrain), 8, 2)), &path);
}
