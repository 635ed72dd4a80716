//! Packed terrain: the same terrain file, read in whatever way, and damage that is told.

mod common;

use common::drape::{draped, land, same_picture};
use common::packed::{Bench, assert_same, dem, options};
use common::{MemoryDem, build_bytes};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::build;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, compact};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::source::{MemorySource, PackedNeed};
use terrasoar_layout::imagery::{DrapeOptions, MemoryImage};
use terrasoar_layout::packing::{pack, unpack};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::loader::{Loader, Outcome, PageRequest};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

fn open(bytes: Vec<u8>) -> Result<Terrain, LayoutError> {
    Terrain::from_source(Box::new(MemorySource::new("packed", bytes)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn packed_terrain_is_the_terrain(
        wide in 2u32..300, high in 2u32..300, roughness in prop_oneof![Just(0u32), Just(5), Just(9000)], voids in 0u32..8,
    ) {
        let bytes = build_bytes(&dem([wide, high], roughness, voids), &options()).unwrap();
        let bench = Bench::of(&bytes).unwrap();
        let back = bench.plain.with_file_name("back.iqt");
        unpack(&SystemDisk, &bench.packed, &back, &Silent).unwrap();
        prop_assert!(bench.bytes(&back) == bytes);
        assert_same(&Terrain::open(&bench.plain).unwrap(), &open(bench.bytes(&bench.packed)).unwrap());
    }
}

/// So many tiles that tables are made of a sample of them, and ground in few that is as no other: all of it comes back, packed while it is built and afterwards.
#[test]
fn what_a_sample_lacks_comes_back() {
    let dem = MemoryDem::from_fn([2200, 2100], SampleType::I16, |x, y| {
        let tile = x / 64 + 34 * (y / 64);
        match tile {
            77 | 500 | 911 => f64::from((x * 7919 + y * 104_729) % 60_001) - 30_000.0,
            _ if tile % 9 == 0 => f64::from(x / 3 + y / 2),
            _ => f64::NAN,
        }
    });
    let bytes = build_bytes(&dem, &options()).unwrap();
    let bench = Bench::of(&bytes).unwrap();
    let [built, back] = ["built.iqt", "back.iqt"].map(|name| bench.plain.with_file_name(name));
    build(&dem, &built, &options().packed(true), &Silent).unwrap();
    assert!(bench.bytes(&built) == bench.bytes(&bench.packed));
    unpack(&SystemDisk, &built, &back, &Silent).unwrap();
    assert!(bench.bytes(&back) == bytes);
}

/// One step of a life of a terrain.
#[derive(Debug, Clone)]
enum Step {
    Set {
        at: [u32; 2],
        size: [u32; 2],
        height_m: f64,
    },
    Undo,
    Redo,
    /// Opened again.
    Reopen,
    Compact,
}

fn step() -> impl Strategy<Value = Step> {
    let set = (0u32..300, 0u32..300, 1u32..70, 1u32..50, 700i32..1300);
    prop_oneof![
        4 => set.prop_map(|(x, y, wide, high, h)| Step::Set { at: [x, y], size: [wide, high], height_m: h.into() }),
        1 => Just(Step::Undo),
        1 => Just(Step::Redo),
        1 => Just(Step::Reopen),
        1 => Just(Step::Compact),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Packed terrain and the terrain file lead the same life: after every step each record is the same, for a reader that was there before, too; and unpacked it is that file.
    #[test]
    fn edited_packed_terrain_is_the_edited_terrain(
        wide in 2u32..300, high in 2u32..300, voids in 0u32..3, steps in prop::collection::vec(step(), 1..14),
    ) {
        let bench = Bench::of(&build_bytes(&dem([wide, high], 40, voids), &options()).unwrap()).unwrap();
        let (plain, packed, back) = (&bench.plain, &bench.packed, bench.plain.with_file_name("back.iqt"));
        let mut sessions = [plain, packed].map(|path| EditSession::open(path).unwrap());
        let mut reader = Terrain::open_unmapped(packed).unwrap();
        for (i, step) in steps.iter().enumerate() {
            match step {
                Step::Set { at, size, height_m } => {
                    let [west, south] = [at[0].min(wide - 1), at[1].min(high - 1)];
                    let [east, north] = [(west + size[0]).min(wide - 1), (south + size[1]).min(high - 1)];
                    let rect = SampleRect { west, south, east, north };
                    let edit = Edit::Set { area: Area::Rect(rect), height_m: *height_m };
                    let done = sessions.each_mut().map(|session| {
                        session.apply(std::slice::from_ref(&edit)).map(drop).map_err(|e| e.to_string().len() > 9)
                    });
                    prop_assert_eq!(done[0], done[1]);
                    let [a, b] = sessions.each_mut().map(|session| session.commit(&format!("{i}")).unwrap());
                    prop_assert_eq!(&a.places, &b.places);
                    prop_assert!(b.bytes <= a.bytes + 200);
                    // Where a commit says that pages lie, a reader from before finds them.
                    for (page, entry) in b.places {
                        reader.checked_page_at(page, entry).unwrap();
                    }
                }
                Step::Undo => {
                    let [a, b] = sessions.each_mut().map(|session| session.undo().unwrap());
                    prop_assert_eq!(a, b);
                }
                Step::Redo => {
                    let [a, b] = sessions.each_mut().map(|session| session.redo().unwrap());
                    prop_assert_eq!(a, b);
                }
                Step::Reopen | Step::Compact => {
                    drop(sessions);
                    if matches!(step, Step::Compact) {
                        for path in [plain, packed] {
                            compact(&SystemDisk, path, None, path, &Silent).unwrap();
                        }
                    }
                    reader = Terrain::open_unmapped(packed).unwrap();
                    prop_assert!(reader.appended_bytes().is_some());
                    sessions = [plain, packed].map(|path| EditSession::open(path).unwrap());
                }
            }
            assert_same(&Terrain::open(plain).unwrap(), &Terrain::open(packed).unwrap());
        }
        drop(sessions);
        unpack(&SystemDisk, packed, &back, &Silent).unwrap();
        prop_assert!(bench.bytes(&back) == bench.bytes(plain));
        let again = plain.with_file_name("again.iqt");
        pack(&SystemDisk, plain, &again, &Silent).unwrap();
        unpack(&SystemDisk, &again, &back, &Silent).unwrap();
        prop_assert!(bench.bytes(&back) == bench.bytes(plain));
        let report = verify(&Terrain::open_unmapped(packed).unwrap(), &|_| {}).unwrap();
        prop_assert!(report.is_sound());
    }
}

/// Larger than a tile of the second group, in every way of reading.
#[test]
fn packed_terrain_is_read_in_every_way() {
    let bytes = build_bytes(&dem([700, 530], 3, 2), &options()).unwrap();
    let bench = Bench::of(&bytes).unwrap();
    let (plain, packed) = (Terrain::open(&bench.plain).unwrap(), Terrain::open(&bench.packed).unwrap());
    assert_same(&plain, &packed);
    assert!(packed.source().bytes() == Some(&bytes[..]));
    assert!(packed.bytes_per_sample() < 0.6 * plain.bytes_per_sample());
    let packed = Terrain::open_unmapped(&bench.packed).unwrap();
    assert!(packed.records().is_err());
    let report = verify(&packed, &|_| {}).unwrap();
    assert_eq!(report.problems, []);
    assert_eq!(report, verify(&plain, &|_| {}).unwrap());
    for place in [[0.0, 0.0], [133.0, 207.0], [7777.0, 9999.0], [13_980.0, 13_225.0]] {
        assert_eq!(plain.height_m(place[0], place[1]).unwrap(), packed.height_m(place[0], place[1]).unwrap());
    }
    // By a loader's threads.
    let packed = Arc::new(packed);
    let loader = Loader::start(Arc::clone(&packed), 3).unwrap();
    let pages = packed.page_count();
    loader.ask(1, &(0..pages).map(|page| PageRequest { page, due: 1 }).collect::<Vec<_>>());
    for _ in 0..pages {
        let arrival = loader.take_within(std::time::Duration::from_secs(60)).unwrap();
        let Outcome::Read(page) = arrival.outcome else { panic!("{arrival:?}") };
        assert!(page == plain.checked_page(arrival.page).unwrap());
    }
}

/// What cannot be packed, and what packed terrain cannot do, is said.
#[test]
fn what_is_not_supported_is_refused() {
    let bytes = build_bytes(&dem([90, 70], 3, 0), &options()).unwrap();
    let bench = Bench::of(&bytes).unwrap();
    let out = bench.plain.with_file_name("out.iqt");
    let error = pack(&SystemDisk, &bench.packed, &out, &Silent).unwrap_err().to_string();
    assert!(error.contains("packed already"), "{error}");
    let error = unpack(&SystemDisk, &bench.plain, &out, &Silent).unwrap_err().to_string();
    assert!(error.contains("not packed"), "{error}");
    let error = Terrain::open_with_overlay(&bench.packed, &bench.packed).err().unwrap().to_string();
    assert!(error.contains("no overlay"), "{error}");
    assert!(!out.exists());
    // Compacted it is the same.
    compact(&SystemDisk, &bench.packed, None, &out, &Silent).unwrap();
    assert!(bench.bytes(&out) == bench.bytes(&bench.packed));
}

/// A picture comes along.
#[test]
fn pictures_are_packed_too() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed, back] = ["plain.iqt", "packed.iqt", "back.iqt"].map(|name| folder.path().join(name));
    land(&plain);
    draped(
        &plain,
        MemoryImage::from_fn([210, 100], |x, y| [x as u8, y as u8, 7, 255]),
        &DrapeOptions::default(),
    )
    .unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    let (a, b) = (Terrain::open(&plain).unwrap(), Terrain::open_unmapped(&packed).unwrap());
    assert!(same_picture(&a, &b));
    assert_same(&a, &b);
    unpack(&SystemDisk, &packed, &back, &Silent).unwrap();
    assert!(std::fs::read(&back).unwrap() == std::fs::read(&plain).unwrap());
    // Draped again, it holds a picture that nothing leads to.
    draped(&plain, MemoryImage::from_fn([21, 10], |_, _| [1, 2, 3, 255]), &DrapeOptions::default()).unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    unpack(&SystemDisk, &packed, &back, &Silent).unwrap();
    assert!(std::fs::read(&back).unwrap() == std::fs::read(&plain).unwrap());
}

/// Other versions and ways of packing are refused in words, with a sound checksum.
#[test]
fn what_is_not_known_is_refused() {
    let bytes = build_bytes(&dem([90, 70], 3, 0), &options()).unwrap();
    let bench = Bench::of(&bytes).unwrap();
    let packed = bench.bytes(&bench.packed);
    for (at, value, word) in
        [(0x00a, 1, "version 2.1"), (0x100, 2, "scheme 2"), (0x105, 7, "tiles"), (0x120, 9, "kind 9")]
    {
        let mut other = packed.clone();
        other[at] = value;
        seal(&mut other);
        let error = open(other).err().unwrap().to_string();
        assert!(error.contains(word) && error.contains("newer terrasoar"), "{error}");
    }
    // A section that may be left out is.
    let mut more = packed.clone();
    more[0x107] += 1;
    let at = 0x120 + 24 * usize::from(packed[0x107]);
    more[at..at + 4].copy_from_slice(&0x8000_0009u32.to_le_bytes());
    seal(&mut more);
    assert_same(&open(more).unwrap(), &open(packed).unwrap());
}

fn seal(bytes: &mut [u8]) {
    let sum = crc32fast::hash(&bytes[..0xffc]);
    bytes[0xffc..0x1000].copy_from_slice(&sum.to_le_bytes());
}

fn number(bytes: &[u8], at: usize, count: usize) -> usize {
    bytes[at..at + count].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
}

/// Makes all checksums right again: of tiles, leaves, sections and the header, where they lie in the file.
fn seal_all(bytes: &mut [u8], leaf_tiles: &[usize]) {
    let put = |bytes: &mut [u8], at: usize, range: std::ops::Range<usize>| {
        if let Some(part) = bytes.get(range) {
            let sum = crc32fast::hash(part).to_le_bytes();
            bytes[at..at + 4].copy_from_slice(&sum);
        }
    };
    let sections: Vec<usize> = (0..usize::from(bytes[0x107]).min(8)).map(|i| 0x120 + 24 * i).collect();
    for at in sections {
        let (kind, from, count) = (number(bytes, at, 4), number(bytes, at + 8, 6), number(bytes, at + 16, 6));
        if kind == 4 && from + count <= bytes.len() {
            for (i, tiles) in leaf_tiles.iter().enumerate().filter(|(i, _)| 12 * i + 12 <= count) {
                let leaf = number(bytes, from + 12 * i, 6);
                if leaf + 24 * tiles > bytes.len() {
                    continue;
                }
                for tile in (0..*tiles).map(|t| leaf + 24 * t) {
                    let mut segment = number(bytes, tile, 6);
                    for s in 0..3 {
                        let length = number(bytes, tile + 6 + 2 * s, 2);
                        put(bytes, tile + 12 + 4 * s, segment..segment + length);
                        segment += length;
                    }
                }
                put(bytes, from + 12 * i + 8, leaf..leaf + 24 * tiles);
            }
        }
        put(bytes, at + 4, from..from + count);
    }
    seal(bytes);
}

/// Cuts and flipped bits anywhere are told, or do no harm; nothing panics. With checksums made right again pages still have theirs.
#[test]
fn damage_is_told() {
    // 200 x 150 in a square of 256: the group of stride 1 has 4 x 4 tiles, of which the data reach 4 x 4; the other one tile.
    let bytes = build_bytes(&dem([200, 150], 3, 1), &options()).unwrap();
    let bench = Bench::of(&bytes).unwrap();
    let packed = bench.bytes(&bench.packed);
    let plain = open(bytes).unwrap();
    let look = |damaged: Vec<u8>| -> Result<(), LayoutError> {
        let terrain = open(damaged)?;
        for page in 0..terrain.page_count() {
            let read = terrain.checked_page(page)?;
            assert!(plain.page_count() != terrain.page_count() || read == plain.checked_page(page).unwrap());
        }
        Ok(())
    };
    look(packed.clone()).unwrap();
    let mut random = 7u64;
    let mut below = |end: usize| {
        random = random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        ((random >> 33) as usize) % end
    };
    let mut told = 0;
    for round in 0..1200 {
        let mut damaged = packed.clone();
        match round % 4 {
            0 => damaged.truncate(below(packed.len())),
            1 => damaged[(8192 + below(packed.len() - 4096)) % packed.len()] ^= 1 << below(8),
            // Behind the header, and sealed.
            2 => {
                damaged[8192 + below(packed.len() - 8192)] ^= 1 << below(8);
                seal_all(&mut damaged, &[1, 16]);
            }
            _ => {
                let at = 0x100 + below(0x80);
                damaged[at] = below(256) as u8;
                seal_all(&mut damaged, &[1, 16]);
            }
        }
        told += usize::from(look(damaged).is_err());
    }
    assert!(told > 900, "{told}");
}

/// An overlay made over a terrain file is one over the packed terrain, and the other way round; also once the packed terrain was edited itself.
#[test]
fn overlays_lie_over_either() {
    let bench = Bench::of(&build_bytes(&dem([200, 150], 3, 0), &options()).unwrap()).unwrap();
    let overlay = bench.plain.with_file_name("o.iqo");
    let set = |i: u32| {
        let rect = SampleRect { west: 20 * i, south: 10 * i, east: 20 * i + 15, north: 10 * i + 12 };
        Edit::Set { area: Area::Rect(rect), height_m: f64::from(900 + i) }
    };
    for (i, base) in (1..).zip([&bench.plain, &bench.packed, &bench.plain, &bench.packed]) {
        let mut session = EditSession::open_overlay(base, &overlay).unwrap();
        session.apply(&[set(i)]).unwrap();
        session.commit("set").unwrap();
        drop(session);
        let over = |base: &Path| Terrain::open_with_overlay(base, &overlay).unwrap();
        assert_same(&over(&bench.plain), &over(&bench.packed));
        assert_eq!(
            over(&bench.packed).height_m(f64::from(400 * i), f64::from(250 * i)).unwrap(),
            Some(f64::from(900 + i))
        );
    }
    let before = Terrain::open_with_overlay(&bench.plain, &overlay).unwrap();
    let mut session = EditSession::open(&bench.packed).unwrap();
    session.apply(&[set(1), set(6)]).unwrap();
    session.commit("set").unwrap();
    drop(session);
    for after in [Terrain::open_with_overlay, Terrain::open_with_overlay_unmapped] {
        let after = after(&bench.packed, &overlay).unwrap();
        assert!(after.base_has_grown());
        assert_same(&before, &after);
    }
}

/// What records are said to take is what reading their page unpacks: the same tiles, and as many bytes where none was unpacked twice.
#[test]
fn what_records_take_is_what_is_unpacked() {
    let bench = Bench::of(&build_bytes(&dem([700, 421], 5, 2), &options()).unwrap()).unwrap();
    let bytes = bench.bytes(&bench.packed);
    let terrain = open(bytes.clone()).unwrap();
    let per_page = terrain.header().records_per_page();
    let need = |slots: std::ops::Range<u64>| {
        terrain.source().unpacking().unwrap().need_of(&slots.collect::<Vec<u64>>(), &[]).unwrap()
    };
    let (mut once, mut pages) = (0, 0);
    for page in 0..terrain.header().record_pages() {
        let fresh = open(bytes.clone()).unwrap();
        // Absent pages are not unpacked, though the tiles that their records would lie in may be there.
        if !fresh.entry(page).unwrap().is_present() {
            continue;
        }
        assert_eq!(fresh.source().unpacking().unwrap().unpacked().tiles, 0);
        fresh.checked_page(page).unwrap();
        let unpacked = fresh.source().unpacking().unwrap().unpacked();
        let need = need(page * per_page..(page + 1) * per_page);
        assert!(
            need.tiles <= unpacked.tiles && need.bytes <= unpacked.bytes,
            "{page}: {need:?} {unpacked:?}"
        );
        if need.tiles == unpacked.tiles {
            assert_eq!(need.bytes, unpacked.bytes, "{page}");
            once += 1;
        }
        pages += 1;
    }
    assert!(once > pages / 2, "{once} of {pages}");
    assert_eq!(need(0..0), PackedNeed::default());
    let all = need(0..terrain.header().record_pages() * per_page);
    assert!(all.bytes < bytes.len() as u64 && all.bytes > bytes.len() as u64 / 2, "{all:?}");
    assert!(Terrain::open(&bench.plain).unwrap().source().unpacking().is_none());
}

/// Whoever needs all records hears which tile is damaged, and of a file that is whole nothing is read before it is asked for.
#[test]
fn a_damaged_tile_is_named_to_whoever_needs_all_records() {
    let bench = Bench::of(&build_bytes(&dem([700, 421], 5, 2), &options()).unwrap()).unwrap();
    let terrain = Terrain::open(&bench.packed).unwrap();
    assert!(terrain.lends_records());
    assert_eq!(terrain.source().unpacking().unwrap().unpacked().tiles, 0);
    assert!(terrain.records().is_ok());
    let mut bytes = bench.bytes(&bench.packed);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x40;
    std::fs::write(&bench.packed, bytes).unwrap();
    let terrain = Terrain::open(&bench.packed).unwrap();
    // Again and again: it is not taken for a terrain without records.
    for _ in 0..2 {
        let error = terrain.records().map(drop).unwrap_err();
        assert!(matches!(error, LayoutError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains(": tile "), "{error}");
    }
    assert!(!Terrain::open_unmapped(&bench.packed).unwrap().lends_records());
}
