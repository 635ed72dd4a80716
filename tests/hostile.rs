//! Storage that fails, lies, stalls, or loses the file while a flight goes on: the mesh stays whole and coarse, what went wrong is told with the page it is about, and once
//! storage is well again nothing is missing.

mod common;

use common::checks::{check_conforming, keys, triangles, views};
use common::{frame, rugged_terrain};
use std::fs::OpenOptions;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{Fetch, Prefetch, Streamed, ThreadFetch};
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::file::source::{CountingSource, Fault, HostileSource, Hostility, MemorySource};
use terrasoar_layout::grid::record::{Compact, RecordCodec};
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;

/// Faults of each kind.
const FAULTS: u64 = 1000;
/// Longest that anything here may take.
const PATIENCE: Duration = Duration::from_secs(120);

/// The bytes of a terrain file of some 110 pages.
fn file_bytes() -> Vec<u8> {
    bytes_of(257)
}

/// The bytes of a terrain file of so many samples a side.
fn bytes_of(side: u32) -> Vec<u8> {
    let terrain = rugged_terrain([side, side], 6, false);
    let mut bytes = vec![0; terrain.source().byte_count() as usize];
    terrain.source().read_at(0, &mut bytes).unwrap();
    bytes
}

/// To and fro over the terrain.
fn path(terrain: &Terrain) -> Vec<View> {
    let there = (0..60).map(|i| 0.1 + 0.012 * f64::from(i));
    let and_back = there.clone().rev();
    views(there.chain(and_back).map(|t| frame(terrain, [t, 1.0 - t], 1250.0, 300.0 * t, -25.0)), 1.0)
}

fn compact(terrain: &Terrain) -> Records<'_, Compact> {
    match terrain.records() {
        Ok(ByKind::Compact(records)) => records,
        _ => panic!("the test terrain has compact records in memory"),
    }
}

/// A flight over few pages of memory.
fn flight(terrain: &Arc<Terrain>) -> Streamed<Compact, ThreadFetch> {
    let ByKind::Compact(pool) = terrain.pool(30 * PAGE_BYTES as u64).unwrap() else {
        panic!("compact records")
    };
    let loader = Loader::start(Arc::clone(terrain), 3).unwrap();
    Streamed::new(pool, ThreadFetch::from(loader), Culling::Vertices, Prefetch::Deadline)
}

/// Stays where it is until nothing is late, and compares with SOAR over the sound file.
fn catches_up<C: RecordCodec, F: Fetch>(streamed: &mut Streamed<C, F>, view: &View, sound: &Terrain) {
    let begun = Instant::now();
    while streamed.update(view, &mut Unobserved).work.late > 0 {
        assert!(begun.elapsed() < PATIENCE, "what was late does not come");
        std::thread::sleep(Duration::from_micros(200));
    }
    let mut soar = Soar::new(compact(sound), Culling::Vertices);
    soar.update(view, &mut Unobserved);
    assert!(keys(&triangles(streamed.engine())) == keys(&triangles(&soar)), "something is lost");
}

fn names_a_page(error: &LayoutError) -> bool {
    let text = error.to_string();
    text.contains("record page") || text.contains("directory leaf") || text.contains("injected failure")
}

fn withstands(fault: Fault) {
    let bytes = file_bytes();
    let sound = Terrain::from_source(Box::new(MemorySource::new("sound", bytes.clone()))).unwrap();
    let hostility = Arc::new(Hostility::default());
    let source = HostileSource::new(
        CountingSource::new(MemorySource::new("hostile", bytes)),
        fault,
        Arc::clone(&hostility),
    );
    let terrain = Arc::new(Terrain::from_source(Box::new(source)).unwrap());
    let mut streamed = flight(&terrain);
    let flown = path(&terrain);
    let begun = Instant::now();
    let (mut frames, mut failures, mut told, mut coarse) = (0u64, 0, 0, 0);
    hostility.one_in.store(2, Ordering::Relaxed);
    'flight: loop {
        for (i, view) in flown.iter().enumerate() {
            let frame = streamed.update(view, &mut Unobserved);
            frames += 1;
            failures += frame.failures;
            coarse += u64::from(frame.work.unread > 0);
            if i % 20 == 0 {
                check_conforming(&compact(&sound), &triangles(streamed.engine()));
            }
            while let Some(error) = streamed.take_error() {
                assert!(names_a_page(&error), "{error}");
                told += 1;
            }
            if hostility.injected() >= FAULTS {
                break 'flight;
            }
            assert!(begun.elapsed() < PATIENCE, "only {} faults", hostility.injected());
        }
    }
    hostility.one_in.store(0, Ordering::Relaxed);
    catches_up(&mut streamed, &flown[flown.len() / 3], &sound);
    println!(
        "{fault:?}: {} injected in {frames} frames, {failures} pages failed, {told} told, {coarse} frames coarse, 0 lost, 0 fatal",
        hostility.injected()
    );
    assert!(coarse > 0, "a fault that nobody notices");
    let is_failure = !matches!(fault, Fault::Slow(_));
    assert_eq!(failures > 0, is_failure);
    assert_eq!(told > 0, is_failure, "{told}");
}

#[test]
fn a_thousand_reads_fail() {
    withstands(Fault::Fail);
}

#[test]
fn a_thousand_reads_are_short() {
    withstands(Fault::Short);
}

#[test]
fn a_thousand_pages_are_damaged() {
    withstands(Fault::Damage);
}

#[test]
fn a_thousand_reads_are_slow() {
    withstands(Fault::Slow(Duration::from_millis(3)));
}

/// The file loses all but its first pages while it is flown over, and gets them back.
#[test]
fn a_file_cut_short_and_restored() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("t.iqt");
    let bytes = file_bytes();
    std::fs::write(&name, &bytes).unwrap();
    let sound = Terrain::from_source(Box::new(MemorySource::new("sound", bytes.clone()))).unwrap();
    let terrain = Arc::new(Terrain::open_unmapped(&name).unwrap());
    let mut streamed = flight(&terrain);
    let flown = path(&terrain);
    streamed.fill(&flown[0], PATIENCE, &mut Unobserved);
    let file = OpenOptions::new().write(true).open(&name).unwrap();
    file.set_len(8 * PAGE_BYTES as u64).unwrap();
    let begun = Instant::now();
    let mut told = Vec::new();
    while told.is_empty() {
        for view in &flown {
            streamed.update(view, &mut Unobserved);
            std::thread::sleep(Duration::from_micros(100));
        }
        told.extend(std::iter::from_fn(|| streamed.take_error()));
        check_conforming(&compact(&sound), &triangles(streamed.engine()));
        assert!(begun.elapsed() < PATIENCE, "nobody has noticed");
    }
    let text = told[0].to_string();
    assert!(text.contains("t.iqt") && text.contains("shorter than it was"), "{text}");
    (&file).write_all(&bytes).unwrap();
    catches_up(&mut streamed, &flown[20], &sound);
}

/// Another file takes the name while the first is flown over, which goes on as if nothing had happened.
#[test]
fn a_file_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("t.iqt");
    let bytes = file_bytes();
    std::fs::write(&name, &bytes).unwrap();
    let sound = Terrain::from_source(Box::new(MemorySource::new("sound", bytes))).unwrap();
    let terrain = Arc::new(Terrain::open_unmapped(&name).unwrap());
    let mut streamed = flight(&terrain);
    let other = folder.path().join("other");
    std::fs::write(&other, b"something else").unwrap();
    std::fs::rename(&other, &name).unwrap();
    for view in path(&terrain) {
        assert_eq!(streamed.update(&view, &mut Unobserved).failures, 0);
    }
    catches_up(&mut streamed, &path(&terrain)[30], &sound);
    assert!(streamed.take_error().is_none());
}

/// A directory leaf is damaged. Ground whose pages it leads to stays coarse, and that is told each time such a page is needed: it never counts as ground without detail.
#[test]
fn a_damaged_directory_leaf_is_told() {
    let mut bytes = bytes_of(513);
    let sound = Terrain::from_source(Box::new(MemorySource::new("sound", bytes.clone()))).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let root = word(0x078) * PAGE_BYTES;
    let leaf = word(root + 16) * PAGE_BYTES;
    assert!(leaf > 0, "it has a second leaf");
    bytes[leaf + 4] ^= 1;
    let terrain = Arc::new(Terrain::from_source(Box::new(MemorySource::new("damaged", bytes))).unwrap());
    let mut streamed = flight(&terrain);
    let (mut told, mut unread) = (0, 0);
    for view in path(&terrain) {
        streamed.fill(&view, PATIENCE, &mut Unobserved);
        unread += u64::from(streamed.update(&view, &mut Unobserved).work.unread > 0);
        while let Some(error) = streamed.take_error() {
            assert!(error.to_string().contains("directory leaf 1: the checksum does not match"), "{error}");
            told += 1;
        }
        check_conforming(&compact(&sound), &triangles(streamed.engine()));
    }
    assert!(told > 0 && unread > 0, "{told} told, {unread} frames coarse");
}
