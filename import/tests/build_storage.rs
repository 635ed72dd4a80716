//! Builds on storage that fails: disks that break or fill at every single call, elevation data that is cut, changed or taken away before and
//! while it is read. Whatever happens is an error or a sound file; never a panic, never a file under the name that is not whole.

#[path = "../../layout/tests/common/mod.rs"]
mod common;
mod import_support;

use common::MemoryDem;
use import_support::{Random, data, fixtures, write_hgt};
use std::collections::BTreeMap;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use tempfile::TempDir;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build, build_on};
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, SampleType, Window};
use terrasoar_layout::file::disk::{FailingDisk, Failure};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// A folder to build in, and what must be in it afterwards.
struct Folder {
    folder: TempDir,
}

impl Folder {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn target(&self) -> PathBuf {
        self.folder.path().join("t.iqt")
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// After a failed build: nothing but `expected`.
    fn is_left(&self, expected: &[&str], what: &dyn Fn() -> String) {
        assert_eq!(self.names(), expected, "{}", what());
    }
}

/// Ground with a void, wide enough that 25 MiB hold no copy of its samples beside the work.
fn dem() -> MemoryDem {
    MemoryDem::from_fn([150, 110], SampleType::I16, |x, y| {
        let is_void = x.abs_diff(80) + y.abs_diff(20) < 12;
        if is_void { f64::NAN } else { f64::from((x * 31 + y * 57) % 23 + x) }
    })
}

fn options(memory_mib: u64) -> BuildOptions {
    BuildOptions::default().memory_mib(memory_mib).spacing_m([20.0, 25.0])
}

#[test]
fn every_call_of_the_disk_may_fail() {
    let dem = dem();
    let folder = Folder::new();
    let target = folder.target();
    let mut failures = 0;
    // With little memory the samples take the way through a temporary file.
    for (memory_mib, least_calls) in [(512, 30), (25, 300)] {
        for failure in [Failure::Once, Failure::Full { quarters: 0 }, Failure::Full { quarters: 2 }] {
            let mut n = 0;
            loop {
                let disk = FailingDisk::new(n, failure);
                let what = || format!("{memory_mib} MiB, {failure:?} at call {n}");
                let built = catch_unwind(AssertUnwindSafe(|| {
                    build_on(&disk, &dem, &target, &options(memory_mib), &Silent)
                }));
                let built = built.unwrap_or_else(|_| panic!("{}: panicked", what()));
                if disk.failed() == 0 {
                    // The build was through before the call came.
                    built.unwrap();
                    assert!(verify(&Terrain::open(&target).unwrap(), &|_| {}).unwrap().is_sound());
                    std::fs::remove_file(&target).unwrap();
                    if disk.calls() <= n {
                        break;
                    }
                } else {
                    let error = built.expect_err(&what());
                    let said = error.to_string();
                    assert!(matches!(error, LayoutError::Io { .. }), "{}: {said}", what());
                    assert!(said.contains(&target.display().to_string()), "{}: {said}", what());
                    if said.contains("the file is complete") {
                        // The last step alone failed, which brings the name to the disk.
                        assert!(verify(&Terrain::open(&target).unwrap(), &|_| {}).unwrap().is_sound());
                        std::fs::remove_file(&target).unwrap();
                    } else {
                        let remedy = if failure == Failure::Once { "injected failure" } else { "room" };
                        assert!(said.contains(remedy), "{}: {said}", what());
                        folder.is_left(&[], &what);
                    }
                    failures += 1;
                }
                n += 1;
            }
            assert!(n > least_calls, "{n}");
        }
    }
    println!("{failures} failing disks");
    assert!(failures > 1000);
}

#[test]
fn a_failing_disk_keeps_what_had_the_name() {
    let folder = Folder::new();
    std::fs::write(folder.target(), "what was there").unwrap();
    for n in (0..300).step_by(23) {
        let disk = FailingDisk::new(n, Failure::Full { quarters: 0 });
        build_on(&disk, &dem(), &folder.target(), &options(25), &Silent).unwrap_err();
        assert_eq!(std::fs::read_to_string(folder.target()).unwrap(), "what was there");
        folder.is_left(&["t.iqt"], &|| format!("call {n}"));
    }
}

/// Runs something when a number of windows have been read.
struct Meddling<'a> {
    dem: &'a dyn DemSource,
    after: u64,
    windows: AtomicU64,
    deed: &'a (dyn Fn() + Sync),
}

impl<'a> Meddling<'a> {
    fn new(dem: &'a dyn DemSource, after: u64, deed: &'a (dyn Fn() + Sync)) -> Self {
        Self { dem, after, windows: AtomicU64::new(0), deed }
    }
}

/// The way from a meddled source to the true sink.
struct Between<'a>(&'a Meddling<'a>, &'a dyn SampleSink);

impl SampleSink for Between<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if self.0.windows.fetch_add(1, Ordering::Relaxed) == self.0.after {
            (self.0.deed)();
        }
        self.1.put(window, samples)
    }
}

impl DemSource for Meddling<'_> {
    fn info(&self) -> &DemInfo {
        self.dem.info()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.dem.stream(&Between(self, sink))
    }
}

#[test]
fn a_name_that_is_taken_or_gone_when_the_file_is_complete_is_an_error() {
    let folder = Folder::new();
    let take = || std::fs::create_dir(folder.target()).unwrap();
    let dem = dem();
    let error = build(&Meddling::new(&dem, 9, &take), &folder.target(), &options(512), &Silent).unwrap_err();
    assert!(error.to_string().contains("t.iqt: the output is a folder"), "{error}");
    folder.is_left(&["t.iqt"], &|| "a folder took the name".into());
    let inner = folder.folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let remove = || std::fs::remove_dir_all(&inner).unwrap();
    let target = inner.join("t.iqt");
    let error = build(&Meddling::new(&dem, 9, &remove), &target, &options(512), &Silent).unwrap_err();
    assert!(error.to_string().contains("t.iqt"), "{error}");
    folder.is_left(&["t.iqt"], &|| "the folder went away".into());
}

/// What befalls a file of elevation data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Cut(u64),
    Changed { at: u64, bits: u8 },
    Zeroed { at: u64, bytes: u64 },
    Removed,
}

impl Fate {
    fn of(random: &mut Random, length: u64) -> Self {
        let at = random.below(length);
        match random.below(8) {
            0..=2 => Self::Cut(at),
            // Headers are at the start, directories at either end.
            3 | 4 => Self::Changed { at, bits: 1 + random.below(255) as u8 },
            5 => Self::Changed { at: random.below(length.min(300)), bits: 1 << random.below(8) },
            6 => Self::Zeroed { at, bytes: 1 + random.below(600) },
            _ => Self::Removed,
        }
    }

    fn befall(self, path: &Path) {
        let file = || std::fs::OpenOptions::new().read(true).write(true).open(path).unwrap();
        let patch = |at: u64, change: &dyn Fn(u8) -> u8, bytes: u64| {
            let mut whole = std::fs::read(path).unwrap();
            let end = (at + bytes).min(whole.len() as u64) as usize;
            whole[at as usize..end].iter_mut().for_each(|byte| *byte = change(*byte));
            file().write_all(&whole).unwrap();
        };
        match self {
            Self::Cut(length) => file().set_len(length).unwrap(),
            Self::Changed { at, bits } => patch(at, &|byte| byte ^ bits, 1),
            Self::Zeroed { at, bytes } => patch(at, &|_| 0, bytes),
            Self::Removed => std::fs::remove_file(path).unwrap(),
        }
    }
}

/// Small files of every format, and of every way in which GeoTIFF packs its samples.
fn subjects(folder: &Path) -> BTreeMap<&'static str, Vec<PathBuf>> {
    let mut bt = std::fs::read(data("crater_lake_1025.bt")).unwrap();
    bt[10..14].copy_from_slice(&40i32.to_le_bytes());
    bt[14..18].copy_from_slice(&30i32.to_le_bytes());
    bt.truncate(256 + 40 * 30 * 2);
    let [bt_path, hgt, png] = ["small.bt", "N10E010.hgt", "small.png"].map(|name| folder.join(name));
    std::fs::write(&bt_path, bt).unwrap();
    write_hgt(&hgt, 40, |col, row| (col * row) as i16);
    let options = terrasoar_import::synth::SynthOptions::default().size(33).seed(3).spacing_m(30.0);
    terrasoar_import::synth::write(&options, &png, &|_| ()).unwrap();
    let tiffs = [
        "int16-strips",
        "int16-tiles-big-endian",
        "int16-tiles-deflate-p2",
        "int16-tiles-lzw-p2",
        "int16-strips-packbits",
        "int16-strips-bigtiff-deflate",
        "int16-sparse-nodata",
        "float32-tiles-zstd-p3",
    ];
    let tiffs = tiffs.map(|name| fixtures().join(name).with_extension("tif")).into();
    BTreeMap::from([("BT", vec![bt_path]), ("GeoTIFF", tiffs), ("HGT", vec![hgt]), ("PNG", vec![png])])
}

#[test]
fn elevation_data_that_fails_makes_an_error_or_a_sound_file() {
    // Panics inside the decoders are caught and become errors; their reports would drown the test's own.
    std::panic::set_hook(Box::new(|panic| {
        if panic.location().is_some_and(|location| location.file().ends_with("build_storage.rs")) {
            eprintln!("{panic}");
        }
    }));
    let inputs = tempfile::tempdir().unwrap();
    let folder = Folder::new();
    let mut random = Random(11);
    for (format, paths) in subjects(inputs.path()) {
        let [mut before, mut opened, mut reading, mut refused, mut built] = [0; 5];
        for round in 0..1000 {
            let path = &paths[round % paths.len()];
            let victim = inputs.path().join("N20E020").with_extension(path.extension().unwrap());
            std::fs::copy(path, &victim).unwrap();
            let fate = Fate::of(&mut random, std::fs::metadata(path).unwrap().len());
            let after = random.below(40);
            let stage = random.below(3);
            let what = || format!("{path:?}, {fate:?}, stage {stage}, window {after}");
            let result = catch_unwind(AssertUnwindSafe(|| {
                if stage == 0 {
                    fate.befall(&victim);
                }
                let dem = terrasoar_import::open(std::slice::from_ref(&victim))?;
                if stage == 1 {
                    fate.befall(&victim);
                }
                let deed = || fate.befall(&victim);
                let meddled = Meddling::new(&*dem, if stage == 2 { after } else { u64::MAX }, &deed);
                build(&meddled, &folder.target(), &BuildOptions::default(), &Silent)
            }));
            *[&mut before, &mut opened, &mut reading][stage as usize] += 1;
            match result.unwrap_or_else(|_| panic!("{}: panicked", what())) {
                Ok(_) => {
                    built += 1;
                    let report = verify(&Terrain::open(&folder.target()).unwrap(), &|_| {}).unwrap();
                    assert!(report.is_sound(), "{}: {:?}", what(), report.problems);
                    std::fs::remove_file(folder.target()).unwrap();
                }
                Err(error) => {
                    refused += 1;
                    let said = error.to_string();
                    assert!(said.len() > 10 && said.len() < 700, "{}: {said}", what());
                    let is_named = said.contains("N20E020")
                        || matches!(error, LayoutError::Usage(_) | LayoutError::Unmet { .. });
                    assert!(is_named, "{}: {said}", what());
                }
            }
            folder.is_left(&[], &what);
        }
        println!(
            "{format}: {before} files damaged before opening, {opened} before reading, {reading} while read; {refused} refused, {built} \
             built and sound"
        );
        assert!(refused > 100 && built > 10);
    }
    drop(std::panic::take_hook());
}
