//! Bounds of errors in packed terrain: no error exceeds them, whatever was edited since; a file without them, or with damaged ones, is the same ground; and one that is too low is found.

mod common;

use common::packed::{Bench, assert_bounded, assert_same, dem, options};
use common::{MemoryDem, build_bytes};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect};
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

fn open(bytes: Vec<u8>) -> Terrain {
    Terrain::from_source(Box::new(MemorySource::new("packed", bytes))).unwrap()
}

fn seal(bytes: &mut [u8], range: std::ops::Range<usize>) {
    let sum = crc32fast::hash(&bytes[range.clone()]);
    bytes[range.end..range.end + 4].copy_from_slice(&sum.to_le_bytes());
}

fn number(bytes: &[u8], at: usize, count: usize) -> usize {
    bytes[at..at + count].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
}

/// Where the header lists a section of this kind.
fn section(bytes: &[u8], kind: usize) -> usize {
    (0..8).map(|i| 0x120 + 24 * i).find(|at| number(bytes, *at, 4) == kind).expect("the section")
}

const BOUNDS: usize = 0x8000_0006;

#[test]
fn no_error_exceeds_its_bound_whatever_was_edited() {
    let kinds = [
        (SampleType::I16, RecordKind::Compact),
        (SampleType::I16, RecordKind::Fine),
        (SampleType::F32, RecordKind::Exact8),
        (SampleType::F64, RecordKind::Exact8),
    ];
    for (i, (sample_type, kind)) in (0..).zip(kinds) {
        let hills = dem([211, 170], 6, i % 2);
        let uneven = MemoryDem::from_fn([211, 170], sample_type, |x, y| {
            let uneven = if sample_type == SampleType::I16 { 1.0 } else { 1.000_1 };
            f64::from((hills.sample(x, y) * uneven) as f32)
        });
        let bytes = build_bytes(&uneven, &options().record(Some(kind)).spacing_m([90.0, 100.0])).unwrap();
        let bench = Bench::of(&bytes).unwrap();
        let before = Terrain::open_unmapped(&bench.packed).unwrap();
        let told = assert_bounded(&before);
        assert!(told > 40_000, "{kind:?}: {told}");
        assert_eq!(assert_bounded(&Terrain::open(&bench.plain).unwrap()), 0);
        // A cliff where the ground was flat: errors grow, on pages that bounds say nothing of any more.
        let rect = SampleRect { west: 90, south: 60, east: 100, north: 66 };
        let overlay = bench.plain.with_file_name("o.iqo");
        let cliff = Edit::Set { area: Area::Rect(rect), height_m: 1290.0 };
        let mut over = EditSession::open_overlay(&bench.packed, &overlay).unwrap();
        let mut session = EditSession::open(&bench.packed).unwrap();
        for session in [&mut over, &mut session] {
            session.apply(std::slice::from_ref(&cliff)).unwrap();
            session.commit("cliff").unwrap();
        }
        let edited = Terrain::open_unmapped(&bench.packed).unwrap();
        let fewer = assert_bounded(&edited);
        assert!(0 < fewer && fewer < told, "{fewer} of {told}");
        let layered = Terrain::open_with_overlay_unmapped(&bench.packed, &overlay).unwrap();
        assert_eq!(assert_bounded(&layered), fewer);
        assert_eq!(verify(&edited, &|_| {}).unwrap().problems, []);
        // As it was before, it is told as before.
        session.undo().unwrap().unwrap();
        drop(session);
        assert_eq!(assert_bounded(&Terrain::open_unmapped(&bench.packed).unwrap()), told);
    }
}

#[test]
fn bounds_are_left_out_where_they_are_damaged_or_not_there() {
    let bench = Bench::of(&build_bytes(&dem([200, 150], 3, 1), &options()).unwrap()).unwrap();
    let packed = bench.bytes(&bench.packed);
    let sound = open(packed.clone());
    let told = assert_bounded(&sound);
    assert!(verify(&sound, &|_| {}).unwrap().is_sound());
    // A program of before knows no such section, and passes over it.
    let mut older = packed.clone();
    older[section(&packed, BOUNDS)] = 7;
    seal(&mut older, 0..0xffc);
    let older = open(older);
    assert_same(&older, &sound);
    assert_eq!(assert_bounded(&older), 0);
    assert!(verify(&older, &|_| {}).unwrap().is_sound());
    // The finest group's leaf, the second, has 16 tiles.
    let root = number(&packed, section(&packed, 4) + 8, 8);
    let leaf = number(&packed, root + 12, 6);
    let bounds = leaf + 16 * 24;
    for at in [bounds, bounds + 47, bounds + 50] {
        let mut damaged = packed.clone();
        damaged[at] ^= 1;
        let damaged = open(damaged);
        assert_same(&damaged, &sound);
        let left = assert_bounded(&damaged);
        assert!(left < told, "{left} of {told}");
        let report = verify(&damaged, &|_| {}).unwrap();
        assert_eq!(report.problem_count, 1, "{:?}", report.problems);
        assert_eq!(report.problems[0].place, "tile directory leaf 1");
        assert!(report.problems[0].problem.contains("checksum of its bounds"));
    }
    // One that is too low, under a checksum that is right.
    let tile = (0..48).find(|i| packed[bounds + i] > 20 && packed[bounds + i] < 255).unwrap();
    let mut low = packed.clone();
    low[bounds + tile] -= 1;
    seal(&mut low, leaf..bounds + 48);
    let report = verify(&open(low), &|_| {}).unwrap();
    assert_eq!(report.problem_count, 1, "{:?}", report.problems);
    assert!(
        report.problems[0].place.starts_with("tile ")
            && report.problems[0].problem.contains("a bound is below")
    );
}
