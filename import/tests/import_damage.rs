//! Damaged files: whatever is cut or flipped, the readers return. They never panic, and never take
//! memory that the file's length does not justify.

mod import_support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use import_support::{Random, data, fixtures, write_hgt};
use tempfile::tempdir;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Remembers the largest allocation.
struct Watching;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

#[expect(unsafe_code, reason = "the trait of allocators is unsafe; every call is handed on unchanged")]
// SAFETY: the system's allocator does the work and keeps the contract.
unsafe impl GlobalAlloc for Watching {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's contract is the system allocator's.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.realloc(block, layout, size) }
    }
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Watching = Watching;

/// A damaged header may declare a grid of any size; a sink that refuses the absurd ones, as a builder would.
struct Bounded(AtomicUsize);

impl SampleSink for Bounded {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if self.0.fetch_add(samples.len(), Ordering::Relaxed) > 4_000_000 {
            return Err(LayoutError::Usage("enough".into()));
        }
        Ok(())
    }
}

/// Reads `bytes` as a file; only a panic or a monstrous allocation is wrong. Tells whether it was read.
fn survives(path: &Path, bytes: &[u8], what: &dyn Fn() -> String) -> bool {
    std::fs::write(path, bytes).unwrap();
    LARGEST.store(0, Ordering::Relaxed);
    let read = catch_unwind(AssertUnwindSafe(|| {
        terrasoar_import::open(&[path.to_owned()]).and_then(|dem| dem.stream(&Bounded(AtomicUsize::new(0))))
    }));
    let largest = LARGEST.load(Ordering::Relaxed);
    assert!(largest <= 520 << 20, "{}: {largest} bytes at once", what());
    match read {
        Ok(result) => {
            if let Err(error) = &result {
                let message = error.to_string();
                assert!(message.len() > 10 && message.len() < 700, "{}: {message}", what());
            }
            result.is_ok()
        }
        Err(_) => panic!("{}: panicked", what()),
    }
}

fn subjects(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(fixtures())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "tif"))
        .collect();
    paths.sort();
    // A small cut of the BT file is a BT file with other sides.
    let mut bt = std::fs::read(data("crater_lake_1025.bt")).unwrap();
    bt[10..14].copy_from_slice(&40i32.to_le_bytes());
    bt[14..18].copy_from_slice(&30i32.to_le_bytes());
    bt.truncate(256 + 40 * 30 * 2);
    std::fs::write(folder.join("small.bt"), bt).unwrap();
    write_hgt(&folder.join("N10E010.hgt"), 40, |col, row| (col * row) as i16);
    let options = terrasoar_import::synth::SynthOptions::default().size(65).seed(3).spacing_m(30.0);
    terrasoar_import::synth::write(&options, &folder.join("small.png"), &|_| ()).unwrap();
    terrasoar_import::synth::write(&options, &folder.join("small.tif"), &|_| ()).unwrap();
    paths.extend(["small.bt", "N10E010.hgt", "small.png", "small.tif"].map(|name| folder.join(name)));
    paths
}

#[test]
fn cut_and_flipped_files_are_refused_or_read() {
    // Panics inside the decoders are caught and become errors; their reports would drown the test's own.
    std::panic::set_hook(Box::new(|panic| {
        if panic.location().is_some_and(|location| location.file().ends_with("import_damage.rs")) {
            eprintln!("{panic}");
        }
    }));
    let folder = tempdir().unwrap();
    let mut random = Random(7);
    let (mut cut, mut flipped, mut flipped_read) = (0, 0, 0);
    for path in subjects(folder.path()) {
        let whole = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_owned();
        let victim = folder.path().join("victim").with_extension(path.extension().unwrap());
        let refused = path.to_string_lossy().contains("refused-");
        assert_eq!(survives(&victim, &whole, &|| format!("{name:?}")), !refused);
        for step in 0..40 {
            let length = if step < 20 { step * 13 } else { random.below(whole.len() as u64) as usize };
            survives(&victim, &whole[..length.min(whole.len())], &|| {
                format!("{name:?} cut to {length} bytes")
            });
            cut += 1;
        }
        for round in 0..80 {
            let mut bytes = whole.clone();
            // Mostly the header and the directory, which are at the file's start or end.
            let places: Vec<usize> = (0..1 + round % 3)
                .map(|_| {
                    let near = random.below(400.min(bytes.len() as u64)) as usize;
                    match random.below(4) {
                        0 => random.below(bytes.len() as u64) as usize,
                        1 => bytes.len() - 1 - near,
                        _ => near,
                    }
                })
                .collect();
            for place in &places {
                bytes[*place] = match random.below(3) {
                    0 => 0xff,
                    1 => 0,
                    _ => random.below(256) as u8,
                };
            }
            flipped_read +=
                u32::from(survives(&victim, &bytes, &|| format!("{name:?} with {places:?} flipped")));
            flipped += 1;
        }
    }
    drop(std::panic::take_hook());
    println!("{cut} cuts, {flipped} flips, {flipped_read} of them read");
    assert!(flipped > 5000);
}
