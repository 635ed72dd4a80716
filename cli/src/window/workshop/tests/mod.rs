//! The workshop over disks that are slow, fail or panic, and threads that do not start.

mod orders;
mod room;
mod troubles;

use super::*;
use std::fs::File;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Editor};
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::file::disk::{Disk, SystemDisk};
use terrasoar_layout::progress::Silent;

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

    fn link(&self, file: &File, to: &Path) -> io::Result<()> {
        self.call();
        SystemDisk.link(file, to)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.call();
        SystemDisk.rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
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
        Self::between([-2000.0, 4000.0], true)
    }

    /// With heights up to these; with room for others, or without any.
    fn between([lowest_m, highest_m]: [f64; 2], head_room: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        let dem = MemoryDem::from_fn([200, 200], SampleType::I16, |x, y| match (x, y) {
            (0, 0) => lowest_m,
            (1, 0) => highest_m,
            _ => f64::from((x * 7 + y * 13) % 50 + 300),
        });
        let options = BuildOptions::default().spacing_m([10.0; 2]).head_room(head_room);
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

/// One letter for each piece of news.
fn letters(news: &[News]) -> String {
    let letter = |news: &News| match news {
        News::Edited(_) => 'e',
        News::Saved { .. } => 's',
        News::Widening { .. } => 'w',
        News::Widened(_) => 'W',
        News::Refused(_) => 'r',
        News::Turned { .. } => 't',
        News::NothingToTurn { .. } => 'n',
        News::Nothing => '-',
        other => panic!("{other:?}"),
    };
    news.iter().map(letter).collect()
}
