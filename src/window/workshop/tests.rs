//! The workshop over disks that are slow, fail or panic, and threads that do not start.

use super::*;
use std::fs::File;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use terrasoar_layout::build::{BuildOptions, Silent, build};
use terrasoar_layout::bytes::Page;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::directory::Entry;
use terrasoar_layout::disk::{Disk, FailingDisk, Failure, SystemDisk};
use terrasoar_layout::edit::{Crater, Editor, history};

/// Longest that anything here may take.
const PATIENCE: Duration = Duration::from_secs(60);
/// What is at once even on a busy machine, and less than any commit on a slow disk takes.
const AT_ONCE: Duration = Duration::from_millis(500);

/// What a [`TestDisk`] does at a call.
#[derive(Debug, Default)]
struct Mood {
    /// Milliseconds that each call takes.
    slow_ms: AtomicU64,
    /// Calls until one panics; none while 0.
    panics_in: AtomicU64,
}

/// A disk that takes long, or panics.
#[derive(Debug, Default)]
struct TestDisk(Arc<Mood>);

impl TestDisk {
    fn call(&self) {
        std::thread::sleep(Duration::from_millis(self.0.slow_ms.load(Ordering::Relaxed)));
        let left = self.0.panics_in.load(Ordering::Relaxed);
        if left > 0 {
            self.0.panics_in.store(left - 1, Ordering::Relaxed);
            assert!(left > 1, "the disk panics, as it was asked to");
        }
    }
}

impl Disk for TestDisk {
    fn write_at(&self, file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.call();
        SystemDisk.write_at(file, bytes, offset)
    }

    fn read_at(&self, file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.call();
        SystemDisk.read_at(file, bytes, offset)
    }

    fn set_len(&self, file: &File, length: u64) -> io::Result<()> {
        self.call();
        SystemDisk.set_len(file, length)
    }

    fn sync(&self, file: &File) -> io::Result<()> {
        self.call();
        SystemDisk.sync(file)
    }

    fn link(&self, file: &File, to: &std::path::Path) -> io::Result<()> {
        self.call();
        SystemDisk.link(file, to)
    }

    fn rename(&self, from: &std::path::Path, to: &std::path::Path) -> io::Result<()> {
        self.call();
        SystemDisk.rename(from, to)
    }

    fn sync_folder(&self, folder: &std::path::Path) -> io::Result<()> {
        self.call();
        SystemDisk.sync_folder(folder)
    }
}

/// A terrain of some 60 pages with room for other heights.
struct Land {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Land {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        let dem = MemoryDem::from_fn([200, 200], SampleType::I16, |x, y| match (x, y) {
            (0, 0) => -2000.0,
            (1, 0) => 4000.0,
            _ => f64::from((x * 7 + y * 13) % 50 + 300),
        });
        let options = BuildOptions { spacing_m: Some([10.0; 2]), ..BuildOptions::default() };
        build(&dem, &path, &options, &Silent).unwrap();
        Self { _folder: folder, path }
    }

    fn open(&self) -> Terrain {
        Terrain::open_unmapped(&self.path).unwrap()
    }

    fn workshop_on(&self, disk: Arc<dyn Disk + Send>) -> Workshop {
        let path = self.path.clone();
        let disk = std::sync::Mutex::new(disk);
        let open = move || EditSession::open_on(Arc::clone(&*disk.lock().unwrap()), &path);
        Workshop::with(&self.open(), Arc::new(open), Arc::new(|| {}), spawn)
    }

    fn pages(&self) -> Vec<Box<Page>> {
        let terrain = self.open();
        (0..terrain.header().record_pages()).map(|page| terrain.checked_page(page).unwrap()).collect()
    }

    /// What the pages are after these edits of the land as it was built.
    fn pages_after(&self, edits: &[Edit]) -> Vec<Box<Page>> {
        let terrain = Arc::new(Terrain::open(&self.path).unwrap().into_original().unwrap());
        let mut editor = Editor::new(Arc::clone(&terrain));
        editor.apply(edits).unwrap();
        let count = terrain.header().record_pages();
        let page = |page| match editor.edited_page(page) {
            Some(bytes) => Box::new(*bytes),
            None => terrain.checked_page(page).unwrap(),
        };
        (0..count).map(page).collect()
    }
}

fn crater(i: u64) -> Edit {
    let at = |step: u64| 150.0 + (i * step % 1600) as f64;
    let centre_m = [at(370), at(530)];
    Edit::Crater(Crater { centre_m, direction_deg: 20.0, radius_m: 60.0, depth_m: 12.0 })
}

/// Waits for news.
fn wait(workshop: &mut Workshop) -> News {
    let begun = Instant::now();
    loop {
        match workshop.take() {
            Some(news) => return news,
            None => std::thread::sleep(Duration::from_millis(1)),
        }
        assert!(begun.elapsed() < PATIENCE, "no news");
    }
}

/// Waits until a piece of news is such.
fn wait_for(workshop: &mut Workshop, is_it: impl Fn(&News) -> bool) -> Vec<News> {
    let mut heard = Vec::new();
    while !heard.last().is_some_and(&is_it) {
        heard.push(wait(workshop));
    }
    heard
}

fn stroke(workshop: &mut Workshop, i: u64) -> Edit {
    workshop.apply(i, vec![crater(i)], Vec::new()).unwrap();
    crater(i)
}

fn is_saved(news: &News) -> bool {
    matches!(news, News::Saved { .. })
}

#[test]
fn the_window_never_waits_for_a_slow_disk_and_edits_are_seen_before_they_are_saved() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(250, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    let slow_open = Arc::clone(&workshop.open);
    workshop.open = Arc::new(move || {
        std::thread::sleep(Duration::from_millis(800));
        slow_open()
    });
    let mut edits = Vec::new();
    let (mut seen, mut seen_before_saved, mut saved) = (0, 0, 0);
    for i in 1..=30 {
        let begun = Instant::now();
        edits.push(stroke(&mut workshop, i));
        workshop.commit("a stroke");
        while let Some(news) = workshop.take() {
            match news {
                News::Edited(_) => seen += 1,
                News::Saved { .. } => saved += 1,
                other => panic!("{other:?}"),
            }
        }
        let took = begun.elapsed();
        assert!(took < AT_ONCE, "stroke {i} kept the window for {took:?}");
        if saved == 0 {
            seen_before_saved = seen;
        }
        std::thread::sleep(Duration::from_millis(60));
    }
    assert!(seen_before_saved >= 3, "only {seen_before_saved} strokes were seen while the first was written");
    assert!(workshop.is_unsaved());
    let (news, closed) = workshop.close();
    closed.unwrap();
    assert!(!workshop.is_unsaved() && workshop.in_flight() == 0);
    seen += news.iter().filter(|news| matches!(news, News::Edited(_))).count();
    assert_eq!(seen, 30);
    assert!(land.pages() == land.pages_after(&edits));
    assert!(history(&land.open()).unwrap().len() >= 2, "several commits");
}

#[test]
fn what_is_told_as_saved_is_on_the_disk_where_it_says() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let opened = land.open();
    let mut last = 0;
    for i in 1..8 {
        stroke(&mut workshop, 2 * i);
        stroke(&mut workshop, 2 * i + 1);
        workshop.commit("two");
        // One that is under way while the commit is.
        stroke(&mut workshop, 100 + i);
        for news in wait_for(&mut workshop, is_saved) {
            let News::Saved { places, .. } = news else { continue };
            let terrain = land.open();
            assert!(terrain.header().generation > last && terrain.header().generation == workshop.generation);
            last = terrain.header().generation;
            assert!(!places.is_empty());
            for (page, entry) in places {
                assert_eq!(terrain.entries()[page as usize], entry);
                // Whoever opened the file before can read it there.
                assert_eq!(opened.checked_page_at(page, entry).unwrap(), terrain.checked_page(page).unwrap());
            }
        }
    }
    workshop.close().1.unwrap();
}

#[test]
fn pages_that_were_edited_while_they_were_written_are_not_told_as_the_files() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(100, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(mood)));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    // The same place again, and another.
    workshop.apply(2, vec![crater(1)], Vec::new()).unwrap();
    let mut edited: Vec<Vec<u64>> = Vec::new();
    let mut told = Vec::new();
    for news in wait_for(&mut workshop, is_saved) {
        match news {
            News::Edited(seen) => {
                edited.push(seen.ground.pages.iter().map(|(page, _)| *page).collect());
                assert!(seen.ground.places.is_empty());
            }
            News::Saved { places, .. } => told = places,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(edited.len(), 2);
    assert!(told.iter().all(|(page, _)| !edited[1].contains(page)), "{told:?} {:?}", edited[1]);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(1)]));
}

#[test]
fn a_commit_that_panics_is_told_and_what_it_was_to_write_is_in_the_next() {
    for call in 1..=4 {
        let land = Land::new();
        let mood = Arc::new(Mood::default());
        let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
        stroke(&mut workshop, 1);
        assert!(matches!(wait(&mut workshop), News::Edited(_)));
        mood.panics_in.store(call, Ordering::Relaxed);
        workshop.commit("first");
        let News::NotSaved(error) = wait(&mut workshop) else { panic!("call {call}") };
        assert!(error.to_string().contains("land.iqt") && error.to_string().contains("unexpected end"));
        assert!(workshop.is_unsaved(), "it is not told as saved");
        stroke(&mut workshop, 2);
        workshop.commit("second");
        wait_for(&mut workshop, is_saved);
        assert!(!workshop.is_unsaved(), "and does not stay unsaved for good");
        workshop.close().1.unwrap();
        assert!(land.pages() == land.pages_after(&[crater(1), crater(2)]), "call {call}");
    }
}

#[test]
fn a_disk_that_fails_once_or_is_full_is_told_and_nothing_is_lost_that_was_saved() {
    for call in 0..4 {
        let land = Land::new();
        let mut workshop = land.workshop_on(Arc::new(FailingDisk::new(call, Failure::Once)));
        stroke(&mut workshop, 1);
        workshop.commit("first");
        wait_for(&mut workshop, |news| matches!(news, News::NotSaved(_)));
        assert!(workshop.is_unsaved());
        workshop.commit("again");
        wait_for(&mut workshop, is_saved);
        workshop.close().1.unwrap();
        assert!(land.pages() == land.pages_after(&[crater(1)]), "call {call}");
    }
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(FailingDisk::new(4, Failure::Full { quarters: 2 })));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    wait_for(&mut workshop, is_saved);
    stroke(&mut workshop, 2);
    stroke(&mut workshop, 3);
    let (news, closed) = workshop.close();
    assert_eq!(news.len(), 2, "{news:?}");
    let words = closed.unwrap_err();
    assert!(
        words.contains("room") && words.contains("2 edits were not told as saved and may be gone"),
        "{words}"
    );
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    // The right to edit was given back.
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    stroke(&mut workshop, 4);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(4)]));
}

/// Whether threads of these names start.
static WORKSHOPS: AtomicBool = AtomicBool::new(true);
static COMMITS: AtomicBool = AtomicBool::new(true);

fn spawn_some(name: &str, work: Box<dyn FnOnce() + Send>) -> io::Result<JoinHandle<()>> {
    let starts = if name == "commit" { &COMMITS } else { &WORKSHOPS };
    if !starts.load(Ordering::Relaxed) {
        return Err(io::Error::from(io::ErrorKind::WouldBlock));
    }
    spawn(name, work)
}

#[test]
fn threads_that_cannot_start_are_words_and_the_next_edit_tries_again() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    workshop.spawn = spawn_some;
    WORKSHOPS.store(false, Ordering::Relaxed);
    let words = workshop.apply(1, vec![crater(1)], Vec::new()).unwrap_err();
    assert!(words.contains("land.iqt") && words.contains("no thread to edit with"), "{words}");
    assert!(!workshop.is_unsaved() && workshop.take().is_none());
    WORKSHOPS.store(true, Ordering::Relaxed);
    COMMITS.store(false, Ordering::Relaxed);
    for _ in 0..2 {
        stroke(&mut workshop, 1);
        workshop.commit("a stroke");
        let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
        assert!(error.to_string().contains("cannot start a thread that writes"), "{error}");
        assert!(!workshop.is_unsaved() && workshop.in_flight() == 0 && workshop.take().is_none());
    }
    COMMITS.store(true, Ordering::Relaxed);
    stroke(&mut workshop, 2);
    workshop.commit("a stroke");
    wait_for(&mut workshop, is_saved);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(2)]));
}

#[test]
fn a_thread_that_panics_is_words_and_the_terrain_can_be_opened_again() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    stroke(&mut workshop, 1);
    workshop.commit("first");
    wait_for(&mut workshop, is_saved);
    // An undo writes on the thread that edits. What comes after it is lost with that.
    mood.panics_in.store(1, Ordering::Relaxed);
    workshop.turn(true).unwrap();
    stroke(&mut workshop, 2);
    stroke(&mut workshop, 3);
    let News::Broken(words) = wait(&mut workshop) else { panic!() };
    assert!(words.contains("land.iqt") && words.contains("unexpected end"), "{words}");
    assert!(words.contains("2 edits were not told as saved and may be gone"), "{words}");
    assert!(!workshop.is_unsaved() && workshop.in_flight() == 0 && workshop.take().is_none());
    let refused = workshop.apply(4, vec![crater(4)], Vec::new()).unwrap_err();
    assert!(refused.contains("open the terrain again"), "{refused}");
    assert!(workshop.turn(true).is_err());
    workshop.commit("nothing");
    workshop.close().1.unwrap();
    // What was saved is there, and the right to edit was given back.
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    stroke(&mut workshop, 5);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(5)]));
}

#[test]
fn a_commit_under_way_is_written_although_its_thread_has_panicked() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    let mut workshop = land.workshop_on(Arc::new(TestDisk(Arc::clone(&mood))));
    let armed = Arc::new(AtomicBool::new(false));
    let arm = Arc::clone(&armed);
    // Whoever reports wakes the window, and panics at that.
    workshop.wake = Arc::new(move || assert!(!armed.swap(false, Ordering::Relaxed), "as it was asked to"));
    stroke(&mut workshop, 1);
    assert!(matches!(wait(&mut workshop), News::Edited(_)));
    mood.slow_ms.store(100, Ordering::Relaxed);
    workshop.commit("first");
    arm.store(true, Ordering::Relaxed);
    stroke(&mut workshop, 2);
    wait_for(&mut workshop, |news| matches!(news, News::Broken(_)));
    // The right to edit was given back after that was written, or another could have written in between.
    let mut next = EditSession::open(&land.path).unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1)]));
    next.apply(&[crater(3)]).unwrap();
    next.commit("another").unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert!(land.pages() == land.pages_after(&[crater(1), crater(3)]));
}

#[test]
fn undo_and_redo_come_after_everything_before_and_bring_pages_and_places() {
    let land = Land::new();
    let mood = Arc::new(Mood::default());
    mood.slow_ms.store(150, Ordering::Relaxed);
    let mut workshop = land.workshop_on(Arc::new(TestDisk(mood)));
    for i in 1..=3 {
        stroke(&mut workshop, i);
        workshop.commit("a stroke");
    }
    stroke(&mut workshop, 4);
    let begun = Instant::now();
    for back in [true, true, false] {
        workshop.turn(back).unwrap();
    }
    stroke(&mut workshop, 5);
    assert!(begun.elapsed() < AT_ONCE);
    let mut names = String::new();
    for _ in 0..20 {
        match wait(&mut workshop) {
            News::Edited(_) => names.push('e'),
            News::Saved { .. } => {}
            News::Turned { back, seen } => {
                names.push(if back { 'u' } else { 'r' });
                let terrain = land.open();
                let opened: Vec<(u64, Entry)> = seen
                    .ground
                    .pages
                    .iter()
                    .map(|(page, _)| (*page, terrain.entries()[*page as usize]))
                    .collect();
                assert_eq!(seen.ground.places, opened);
                assert!(!opened.is_empty() && seen.trouble.is_none());
                for (page, bytes) in &seen.ground.pages {
                    assert!(**bytes == *terrain.checked_page(*page).unwrap());
                }
            }
            other => panic!("{other:?}"),
        }
        if names.len() == 8 {
            break;
        }
    }
    assert_eq!(names, "eeeeuure");
    let all_back = |workshop: &mut Workshop| {
        for _ in 0..9 {
            workshop.turn(true).unwrap();
        }
        wait_for(workshop, |news| matches!(news, News::NothingToTurn { back: true }));
    };
    all_back(&mut workshop);
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[]));
    // Closed and opened again by the next order, on the same terrain on show.
    workshop.turn(false).unwrap();
    assert!(matches!(wait(&mut workshop), News::Turned { back: false, .. }));
    workshop.close().1.unwrap();
    assert!(land.pages() != land.pages_after(&[]));
}

#[test]
fn of_a_stroke_that_is_refused_nothing_more_is_applied() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let too_deep = Edit::Crater(Crater {
        centre_m: [900.0; 2],
        direction_deg: 0.0,
        radius_m: 300.0,
        depth_m: 100_000.0,
    });
    workshop.apply(1, vec![crater(1)], Vec::new()).unwrap();
    workshop.apply(1, vec![too_deep], Vec::new()).unwrap();
    workshop.apply(1, vec![crater(2)], Vec::new()).unwrap();
    workshop.apply(2, vec![crater(3)], Vec::new()).unwrap();
    workshop.commit("strokes");
    let heard = wait_for(&mut workshop, is_saved);
    let is = [
        matches!(heard[0], News::Edited(_)),
        matches!(heard[1], News::Refused(LayoutError::OutOfRange { .. })),
        matches!(heard[2], News::Nothing),
        matches!(heard[3], News::Edited(_)),
    ];
    assert_eq!(is, [true; 4], "{heard:?}");
    assert!(!workshop.is_unsaved());
    workshop.close().1.unwrap();
    assert!(land.pages() == land.pages_after(&[crater(1), crater(3)]));
}

#[test]
fn who_else_has_the_file_is_told() {
    let land = Land::new();
    let mut workshop = land.workshop_on(Arc::new(SystemDisk));
    let taken = EditSession::open(&land.path).unwrap();
    stroke(&mut workshop, 1);
    let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
    assert!(error.to_string().contains("another program is writing"), "{error}");
    drop(taken);
    stroke(&mut workshop, 2);
    assert!(matches!(wait(&mut workshop), News::Edited(_)));
    workshop.close().1.unwrap();
    let mut other = EditSession::open(&land.path).unwrap();
    other.apply(&[crater(3)]).unwrap();
    other.commit("elsewhere").unwrap();
    drop(other);
    stroke(&mut workshop, 4);
    let News::NotOpened(error) = wait(&mut workshop) else { panic!() };
    assert!(error.to_string().contains("another program has edited it"), "{error}");
}
