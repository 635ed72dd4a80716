//! Damaged, cut, foreign and forged files, storage that fails: a clear error or a report, never a panic.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use std::sync::atomic::{AtomicU64, Ordering};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::file::source::{FailingSource, MemorySource};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::{RecordKind, VertexClass};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::{VerifyReport, verify};
use terrasoar_layout::with_records;

const PAGE: usize = 4096;

/// A small terrain with padding and voids.
fn dem() -> MemoryDem {
    MemoryDem::from_fn([50, 37], SampleType::I16, |x, y| {
        if x.abs_diff(20) + y.abs_diff(11) < 5 || x + y > 83 {
            return f64::NAN;
        }
        (400.0 + 90.0 * (f64::from(x) * 0.3).sin() + f64::from((x * 31 + y * 57) % 23)).round()
    })
}

fn options(record: Option<RecordKind>) -> BuildOptions {
    BuildOptions::default().record(record).spacing_m([20.0, 25.0])
}

fn file(record: Option<RecordKind>) -> Vec<u8> {
    build_bytes(&dem(), &options(record)).unwrap()
}

/// Numbers that repeat for a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        ((self.0 >> 33) as usize) % end
    }
}

/// Everything a program does with an opened file.
fn use_terrain(terrain: &Terrain) -> Result<VerifyReport, LayoutError> {
    let grid = *terrain.grid();
    let n = grid.side_steps();
    if let Ok(records) = terrain.records() {
        let mut sum = 0.0;
        with_records!(records, records => {
            for y in 0..=n {
                for x in 0..=n {
                    let v = records.vertex_at(GridPoint::new(x, y));
                    assert!(v.error_m >= 0.0 && v.radius_m >= 0.0 && v.height_m.is_finite());
                    sum += v.height_m;
                }
            }
        });
        assert!(!sum.is_nan());
    }
    let [dx, dy] = grid.spacing_m();
    for (x, y) in [(0.0, 0.0), (10.5 * dx, 3.25 * dy), (-1.0, 0.0), (f64::NAN, 1.0), (1e300, 0.0)] {
        // Damage is an answer here; only a panic is a fault.
        let _ = terrain.height_m(x, y);
    }
    verify(terrain, &|_| {})
}

/// Whether opening or verifying a file says that something is wrong.
fn is_found(bytes: Vec<u8>) -> bool {
    match open_bytes(bytes) {
        Err(_) => true,
        Ok(terrain) => !use_terrain(&terrain).is_ok_and(|report| report.is_sound()),
    }
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// The bytes that nothing depends on: the header slot that is not current, and what follows the root's last entry.
fn is_spare(bytes: &[u8], at: usize) -> bool {
    let root = u32_at(bytes, 0x078) * PAGE;
    let root_end = root + 16 * u32_at(bytes, 0x07c);
    (PAGE..2 * PAGE).contains(&at) || (root_end..root_end.next_multiple_of(PAGE)).contains(&at)
}

#[test]
fn sound_files_are_sound() {
    for record in [None, Some(RecordKind::Fine), Some(RecordKind::Exact8)] {
        for sample_type in [SampleType::I16, SampleType::F64] {
            for samples in [[50, 37], [2, 2], [3, 2], [65, 65], [2, 90], [130, 70]] {
                for holes in [false, true] {
                    let dem = MemoryDem::from_fn(samples, sample_type, |x, y| {
                        let hole = holes && (x * 7 + y * 13) % 11 == 3;
                        if hole { f64::NAN } else { f64::from(x * 17 % 29) * 1.37 + f64::from(y) }
                    });
                    let dem = if sample_type == SampleType::I16 {
                        MemoryDem::from_fn(samples, sample_type, |x, y| dem.sample(x, y).round())
                    } else {
                        dem
                    };
                    let terrain = open_bytes(build_bytes(&dem, &options(record)).unwrap()).unwrap();
                    let done = AtomicU64::new(0);
                    let report = verify(&terrain, &|n| _ = done.fetch_add(n, Ordering::Relaxed)).unwrap();
                    assert!(report.is_sound(), "{samples:?} {:?}", report.problems);
                    assert_eq!(report.pages_checked, terrain.header().stored_pages);
                    assert_eq!(
                        done.load(Ordering::Relaxed),
                        terrasoar_layout::verify::verify_pages(&terrain)
                    );
                }
            }
        }
    }
}

#[test]
fn a_cut_file_is_refused_at_every_length() {
    let bytes = file(None);
    let mut lengths: Vec<usize> = (0..bytes.len()).step_by(17).collect();
    lengths.extend((0..bytes.len()).step_by(PAGE).flat_map(|at| [at, at + 1, at + PAGE - 1]));
    lengths.retain(|length| *length < bytes.len());
    assert!(lengths.len() > 2000);
    for length in lengths {
        let error = open_bytes(bytes[..length].to_vec()).unwrap_err();
        let expected = if length == 0 {
            matches!(error, LayoutError::NotThisFormat { .. })
        } else {
            matches!(error, LayoutError::Damaged { .. })
        };
        assert!(expected, "{length}: {error}");
        assert!(length == 0 || error.to_string().contains("cut short"), "{length}: {error}");
    }
}

#[test]
fn every_changed_byte_that_matters_is_found() {
    for (seed, record) in [(1, None), (2, Some(RecordKind::Exact8)), (3, Some(RecordKind::Fine))] {
        let bytes = file(record);
        let mut random = Random(seed);
        for round in 0..2500 {
            // Every page, and the header more often than its share.
            let at = if round % 4 == 0 { random.below(PAGE) } else { random.below(bytes.len()) };
            let mut changed = bytes.clone();
            changed[at] ^= if round % 2 == 0 { 1 << random.below(8) } else { 1 + random.below(255) as u8 };
            let found = is_found(changed);
            assert_eq!(found, !is_spare(&bytes, at), "byte {at:#x}");
        }
    }
}

#[test]
fn torn_and_swapped_pages_are_found() {
    let bytes = file(None);
    let pages = bytes.len() / PAGE;
    for page in (0..pages).filter(|p| *p != 1) {
        let at = page * PAGE;
        for fill in [0x00, 0xff, 0x5a] {
            let mut changed = bytes.clone();
            changed[at..at + PAGE].fill(fill);
            assert!(is_found(changed), "page {page} filled with {fill:#x}");
        }
        let mut torn = bytes.clone();
        torn.copy_within(2 * PAGE + 512..3 * PAGE, at + 512);
        let matters = (0..bytes.len()).any(|i| torn[i] != bytes[i] && !is_spare(&bytes, i));
        assert!(!matters || is_found(torn), "page {page} torn");
        let other = 3 + (page + 1) % 3;
        let mut swapped = bytes.clone();
        swapped.copy_within(other * PAGE..(other + 1) * PAGE, at);
        assert!(swapped == bytes || is_found(swapped), "page {page} holds page {other}");
    }
}

/// Where the bytes of a file lie, and checksums put right after a change that a broken or hostile writer might make.
struct Forger {
    bytes: Vec<u8>,
}

impl Forger {
    fn root(&self) -> usize {
        u32_at(&self.bytes, 0x078) * PAGE
    }

    fn leaf(&self) -> usize {
        u32_at(&self.bytes, self.root()) * PAGE
    }

    fn put(&mut self, at: usize, value: u32) {
        self.bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }

    fn page_sum(&self, at: usize) -> u32 {
        crc32fast::hash(&self.bytes[at..at + PAGE])
    }

    /// Puts every checksum right: record pages, the one leaf, root, header.
    fn seal(mut self) -> Vec<u8> {
        let (leaf, root) = (self.leaf(), self.root());
        for entry in 0..256 {
            let page = u32_at(&self.bytes, leaf + 16 * entry);
            if page != 0 && (page + 1) * PAGE <= self.bytes.len() {
                self.put(leaf + 16 * entry + 4, self.page_sum(page * PAGE));
            }
        }
        self.put(root + 4, self.page_sum(leaf));
        let root_end = root + 16 * u32_at(&self.bytes, 0x07c);
        self.put(0x080, crc32fast::hash(&self.bytes[root..root_end]));
        self.put(0xffc, crc32fast::hash(&self.bytes[..0xffc]));
        self.bytes
    }
}

#[test]
fn records_that_break_their_promises_are_found_behind_right_checksums() {
    let bytes = file(None);
    let terrain = open_bytes(bytes.clone()).unwrap();
    let grid = *terrain.grid();
    let place = |p: GridPoint| {
        let slot = slot_of(grid.k(), p) as usize;
        let page = slot / 1024;
        (page, terrain.entry(page as u64).unwrap().page as usize * PAGE + slot % 1024 * 4)
    };
    let mut tried = 0;
    for y in (0..37).step_by(4) {
        for x in (0..50).step_by(4) {
            let p = GridPoint::new(x, y);
            let v = terrain.checked_vertex(p).unwrap();
            if grid.is_corner(p) || v.class == VertexClass::Inert || v.error_m == 0.0 {
                continue;
            }
            let (page, at) = place(p);
            // No error, no radius, another height beyond the range, another class.
            let changes: [(usize, &[u8]); 4] = [(2, &[0]), (3, &[0]), (0, &[0xff, 0xff]), (2, &[0xff])];
            for (offset, change) in changes {
                let mut forged = Forger { bytes: bytes.clone() };
                if v.class == VertexClass::FringeVoid && (offset == 0 || change == [0xff]) {
                    continue;
                }
                forged.bytes[at + offset..at + offset + change.len()].copy_from_slice(change);
                let forged = open_bytes(forged.seal()).unwrap();
                let report = use_terrain(&forged).unwrap();
                // Numbers are wrong where they stand; a void that is none is wrong for the vertices around it.
                let name = if change == [0xff] { String::new() } else { format!("record page {page} ") };
                assert!(
                    report.problems.iter().any(|problem| problem.place.starts_with(&name)),
                    "{p:?} {v:?} byte {offset}: {:?}",
                    report.problems
                );
                tried += 1;
            }
        }
    }
    assert!(tried > 200, "{tried}");
}

#[test]
fn a_page_used_twice_and_a_lost_page_are_found() {
    let bytes = file(None);
    let forged = |change: &dyn Fn(&mut Forger)| {
        let mut forged = Forger { bytes: bytes.clone() };
        change(&mut forged);
        open_bytes(forged.seal())
    };
    let report = |change: &dyn Fn(&mut Forger)| use_terrain(&forged(change).unwrap()).unwrap();
    let says = |report: &VerifyReport, words: &str| {
        assert!(report.problems.iter().any(|p| p.to_string().contains(words)), "{:?}", report.problems);
    };
    let leaf = Forger { bytes: bytes.clone() }.leaf();
    let stored = open_bytes(bytes.clone()).unwrap().header().stored_pages as u32;
    let first = u32_at(&bytes, leaf) as u32;
    // Record pages, the leaf itself, the root.
    for page in [first, (leaf / PAGE) as u32, u32_at(&bytes, 0x078) as u32] {
        let terrain = forged(&|f| f.put(leaf + 16, page)).unwrap();
        let words = format!("record page 1: file page {page} has another use as well");
        // Whoever takes all of it is told, and nobody gets records before.
        let told = [terrain.check_directory().unwrap_err(), terrain.records().err().unwrap()];
        assert!(told.iter().all(|error| error.to_string().contains(&words)), "{told:?}");
        says(&verify(&terrain, &|_| {}).unwrap(), &words);
    }
    let error = forged(&|f| f.put(0x070, stored - 1)).unwrap().check_directory().unwrap_err().to_string();
    assert!(error.contains("directory: it holds another number of pages than the header says"), "{error}");
    says(&report(&|f| f.put(leaf + 8, 7)), "generation 7 wrote it");
    says(&report(&|f| f.put(leaf + 8, 0)), "generation 0 wrote it");
    // The last stored page disappears: its parents' records and the count of heights know.
    let last = (0..256).rev().find(|i| u32_at(&bytes, leaf + 16 * i) != 0).unwrap();
    let lost = report(&|f| {
        f.bytes[leaf + 16 * last..leaf + 16 * last + 16].fill(0);
        f.put(0x070, stored - 1);
    });
    says(&lost, "samples have a height");
    says(&report(&|f| f.bytes[0x013] &= !1), "it says that voids exist: false");
    // A parent's page disappears while its children stay.
    let lost = report(&|f| {
        f.bytes[leaf..leaf + 16].fill(0);
        f.put(0x070, stored - 1);
    });
    says(&lost, "on the absent record page 0");
}

/// Headers and directories of nonsense behind right checksums: refused, or used without a panic.
#[test]
fn forged_headers_and_directories_do_not_panic() {
    let bytes = file(None);
    let mut random = Random(3);
    let mut opened = 0;
    for round in 0..3000 {
        let mut forged = Forger { bytes: bytes.clone() };
        let (leaf, root) = (forged.leaf(), forged.root());
        for _ in 0..1 + random.below(3) {
            let at = match round % 3 {
                0 => 8 + random.below(0x300),
                1 => leaf + random.below(16 * 8),
                _ => root + random.below(16),
            };
            forged.bytes[at] = [0, 1, 0x7f, 0x80, 0xff, random.below(256) as u8][random.below(6)];
        }
        // A forged place may lie outside the file; then there is nothing to put right there.
        let inside = |at: usize| at + PAGE <= forged.bytes.len();
        if !(inside(forged.root()) && inside(forged.leaf()) && u32_at(&forged.bytes, 0x07c) <= 256) {
            forged.put(0xffc, crc32fast::hash(&forged.bytes[..0xffc]));
            let _ = open_bytes(forged.bytes);
            continue;
        }
        if let Ok(terrain) = open_bytes(forged.seal()) {
            opened += 1;
            let _ = use_terrain(&terrain);
        }
    }
    assert!(opened > 100, "{opened}");
}

#[test]
fn foreign_files_are_called_foreign() {
    let png = include_bytes!("../../tests/data/puget_sound_1025.png");
    let newer = {
        let mut bytes = file(None);
        bytes[8] = 3;
        bytes
    };
    let foreign: [(&str, Vec<u8>); 6] = [
        ("empty", Vec::new()),
        ("a byte", vec![7]),
        ("text", b"ncols 5\nnrows 4\n".repeat(2000)),
        ("zeros", vec![0; 1 << 16]),
        ("ones", vec![0xff; 1 << 16]),
        ("PNG", png.to_vec()),
    ];
    for (name, bytes) in foreign {
        let error = open_bytes(bytes).unwrap_err();
        assert!(matches!(error, LayoutError::NotThisFormat { .. }), "{name}: {error}");
        assert!(error.to_string().contains("terrasoar build"), "{name}: {error}");
    }
    let error = open_bytes(newer).unwrap_err();
    assert!(matches!(error, LayoutError::Unsupported { .. }), "{error}");
}

#[test]
fn every_read_may_fail() {
    for record in [None, Some(RecordKind::Exact8)] {
        let bytes = file(record);
        let mut n = 0;
        loop {
            let source = FailingSource::new(MemorySource::new("memory", bytes.clone()), n);
            let result = Terrain::from_source(Box::new(source)).and_then(|terrain| {
                terrain.height_m(30.5, 40.5)?;
                verify(&terrain, &|_| {})
            });
            match result {
                Ok(report) => {
                    assert!(report.is_sound());
                    break;
                }
                Err(error) => assert!(error.to_string().contains("injected failure"), "{n}: {error}"),
            }
            n += 1;
        }
        assert!(n > 15, "{n}");
    }
}
