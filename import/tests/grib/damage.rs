//! Damaged GRIB files, and such that ask for more than there is: words, or heights as they were packed.

use super::fixture;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

const NAMES: [&str; 10] = [
    "simple-voids",
    "complex-voids",
    "differences-1",
    "differences-2-voids",
    "jpeg",
    "png",
    "ccsds-voids",
    "reals",
    "lambert",
    "mercator",
];

/// Counts samples.
struct Count(AtomicU64);

impl SampleSink for Count {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.0.fetch_add(samples.len() as u64, Ordering::Relaxed);
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.0.fetch_add(u64::from(window.width) * u64::from(window.height), Ordering::Relaxed);
        Ok(())
    }
}

/// A folder in memory where there is one: a file that is written anew thousands of times waits for a disk.
fn in_memory() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// Reads bytes; what is read has as many samples as it says.
fn read(folder: &Path, bytes: &[u8]) -> Result<(), String> {
    let path = folder.join("a.grib2");
    std::fs::write(&path, bytes).unwrap();
    let count = Count(AtomicU64::new(0));
    let opened = terrasoar_import::open(&[path]);
    match opened
        .and_then(|dem| dem.stream(&count).map(|()| [dem.info().samples_wide, dem.info().samples_high]))
    {
        Ok([wide, high]) => {
            assert_eq!(count.0.into_inner(), u64::from(wide) * u64::from(high));
            Ok(())
        }
        Err(error) => {
            let words = error.to_string();
            assert!(words.contains("a.grib2"), "{words}");
            Err(words)
        }
    }
}

#[test]
fn every_cut_and_every_turned_bit_ends_in_words_or_heights() {
    let folder = in_memory();
    let begin = Instant::now();
    let (mut were_read, mut were_refused) = (0, 0);
    for name in NAMES {
        let sound = std::fs::read(fixture(&format!("{name}.grib2"))).unwrap();
        assert_eq!(read(folder.path(), &sound), Ok(()));
        for cut in (4..sound.len()).step_by(7) {
            assert!(read(folder.path(), &sound[..cut]).is_err(), "{name} of {cut} bytes");
        }
        // Headers are bit by bit of most interest; numbers behind them now and then.
        for at in (0..sound.len().min(330)).chain((330..sound.len()).step_by(41)) {
            let mut bytes = sound.clone();
            bytes[at] ^= 1 << (at % 8);
            match read(folder.path(), &bytes) {
                Ok(()) => were_read += 1,
                Err(_) => were_refused += 1,
            }
        }
    }
    assert!(were_read > 200 && were_refused > 200, "{were_read} {were_refused}");
    assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", begin.elapsed());
}

/// Where a section with a number begins.
fn section(bytes: &[u8], number: u8) -> usize {
    let mut at = 16;
    while bytes[at + 4] != number {
        at += u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    }
    at
}

/// Small files that state that they hold much.
#[test]
fn bombs_are_refused_at_once() {
    let folder = in_memory();
    let put =
        |bytes: &mut [u8], at: usize, number: u32| bytes[at..at + 4].copy_from_slice(&number.to_be_bytes());
    let grown = |name: &str, more: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = std::fs::read(fixture(&format!("{name}.grib2"))).unwrap();
        // 60,000 x 60,000 samples.
        let (grid, packing) = (section(&bytes, 3), section(&bytes, 5));
        put(&mut bytes, grid + 6, 3_600_000_000);
        put(&mut bytes, grid + 30, 60_000);
        put(&mut bytes, grid + 34, 60_000);
        put(&mut bytes, packing + 5, 3_600_000_000);
        // Steps are those of the corners.
        bytes[grid + 54] = 0;
        more(&mut bytes);
        bytes
    };
    for name in ["simple", "complex", "differences-2", "jpeg", "png", "ccsds", "reals"] {
        let begin = Instant::now();
        let said = read(folder.path(), &grown(name, &|_| {})).unwrap_err();
        assert!(said.contains("field 1"), "{name}: {said}");
        assert!(begin.elapsed() < Duration::from_secs(5), "{name}: {:?}", begin.elapsed());
    }
    // A picture of as many numbers is one that memory is not taken for.
    let picture = grown("jpeg", &|bytes| {
        let size = bytes.windows(4).position(|four| four == b"\xff\x4f\xff\x51").unwrap();
        [8, 12, 24, 28].iter().for_each(|at| put(bytes, size + at, 60_000));
    });
    assert!(read(folder.path(), &picture).unwrap_err().contains("allow more memory"));
    // Groups without an end and without a number.
    let empty = grown("complex", &|bytes| {
        let packing = section(bytes, 5);
        put(bytes, packing + 31, u32::MAX);
        bytes[packing + 46] = 0;
    });
    assert!(read(folder.path(), &empty).unwrap_err().contains("groups"));
    // A group of four thousand million numbers of no bits.
    let long = {
        let mut bytes = std::fs::read(fixture("complex.grib2")).unwrap();
        let packing = section(&bytes, 5);
        put(&mut bytes, packing + 37, u32::MAX);
        bytes
    };
    let begin = Instant::now();
    let _ = read(folder.path(), &long);
    assert!(begin.elapsed() < Duration::from_secs(5));
    // A section of four thousand million bytes, and one of none.
    for length in [0, 4, u32::MAX] {
        let mut bytes = std::fs::read(fixture("simple.grib2")).unwrap();
        let grid = section(&bytes, 3);
        put(&mut bytes, grid, length);
        assert!(read(folder.path(), &bytes).unwrap_err().contains("section"), "{length}");
    }
}
