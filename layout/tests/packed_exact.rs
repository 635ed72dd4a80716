//! Packed terrain with exact and with fine records: the same terrain file, byte for byte, in whatever way it is read, edited or damaged.

mod common;

use common::packed::{Bench, assert_same};
use common::{MemoryDem, build_bytes, open_bytes};
use proptest::prelude::*;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, compact, compact_packed};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::packing::{pack, unpack};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Hills that no step divides, around 0 m, as rough as asked, with voids.
fn dem(size: [u32; 2], sample_type: SampleType, rough_m: f64, voids: u32) -> MemoryDem {
    MemoryDem::from_fn(size, sample_type, move |x, y| {
        if voids > 0 && x + y > 0 && (x / 13 + 3 * (y / 17)) % 7 < voids {
            return f64::NAN;
        }
        let (u, v) = (f64::from(x), f64::from(y));
        let rough = f64::from(((x * 31 + y * 57) ^ (x * y)) % 977) / 977.0 * rough_m;
        let height = 20.0 * (u * 0.031).sin() + 15.0 * (v * 0.043).cos() + rough;
        if sample_type == SampleType::F32 { f64::from(height as f32) } else { height }
    })
}

fn options(record: RecordKind) -> BuildOptions {
    BuildOptions::default().record(Some(record)).spacing_m([20.0, 25.0])
}

/// Samples and the kind asked for: records of 4, 8 and 16 bytes come of them.
const KINDS: [(SampleType, RecordKind); 3] = [
    (SampleType::F32, RecordKind::Fine),
    (SampleType::F32, RecordKind::Exact8),
    (SampleType::F64, RecordKind::Exact8),
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn packed_terrain_is_the_terrain(
        wide in 2u32..300, high in 2u32..300, rough in prop_oneof![Just(0.0), Just(0.3), Just(9000.0)], voids in 0u32..8,
        sample_type in prop_oneof![Just(SampleType::F32), Just(SampleType::F64), Just(SampleType::I16)], is_step: bool,
        record in prop_oneof![Just(RecordKind::Fine), Just(RecordKind::Exact8)],
    ) {
        let error = if is_step { ErrorKind::Step } else { ErrorKind::Bounded };
        let options = options(record).error(error).z_scale(if is_step { -0.3 } else { 1.0 });
        let bytes = build_bytes(&dem([wide, high], sample_type, rough, voids), &options).unwrap();
        let bench = Bench::of(&bytes).unwrap();
        let back = bench.plain.with_file_name("back.iqt");
        unpack(&SystemDisk, &bench.packed, &back, &Silent).unwrap();
        prop_assert!(bench.bytes(&back) == bytes);
        assert_same(&Terrain::open(&bench.plain).unwrap(), &open_bytes(bench.bytes(&bench.packed)).unwrap());
    }
}

/// Made packed at once, as large as two groups of tiles, and smaller by what was promised.
#[test]
fn builds_pack_exact_records() {
    for ((sample_type, record), most) in KINDS.into_iter().zip([0.45, 0.45, 0.55]) {
        let dem = dem([700, 530], sample_type, 0.05, 1);
        let folder = tempfile::tempdir().unwrap();
        let [packed, back] = ["packed.iqt", "back.iqt"].map(|name| folder.path().join(name));
        build(&dem, &packed, &options(record).packed(true), &Silent).unwrap();
        let plain = build_bytes(&dem, &options(record)).unwrap();
        unpack(&SystemDisk, &packed, &back, &Silent).unwrap();
        assert!(std::fs::read(&back).unwrap() == plain);
        let share = std::fs::metadata(&packed).unwrap().len() as f64 / plain.len() as f64;
        assert!(share < most, "{sample_type:?} {record:?} {share}");
        let (plain, packed) = (open_bytes(plain).unwrap(), Terrain::open_unmapped(&packed).unwrap());
        assert_eq!(verify(&packed, &|_| {}).unwrap(), verify(&plain, &|_| {}).unwrap());
        for place in [[0.0, 0.0], [133.0, 207.0], [7777.0, 9999.0], [13_980.0, 13_225.0]] {
            let heights = [&plain, &packed].map(|t| t.height_m(place[0], place[1]).unwrap());
            assert_eq!(heights[0].map(f64::to_bits), heights[1].map(f64::to_bits));
        }
    }
}

/// The terrain file and the packed one lead the same life.
#[test]
fn edited_packed_terrain_is_the_edited_terrain() {
    for (sample_type, record) in KINDS {
        let bytes = build_bytes(&dem([210, 160], sample_type, 0.3, 2), &options(record)).unwrap();
        let bench = Bench::of(&bytes).unwrap();
        let (plain, packed, back) = (&bench.plain, &bench.packed, bench.plain.with_file_name("back.iqt"));
        let both = || [plain, packed].map(|path| EditSession::open(path).unwrap());
        let same = || assert_same(&Terrain::open(plain).unwrap(), &Terrain::open(packed).unwrap());
        let set = |i: u32| {
            let rect = SampleRect { west: 20 * i, south: 10 * i, east: 20 * i + 15, north: 10 * i + 12 };
            // Codes of height have room for a quarter more than the ground has.
            let most_m = if record == RecordKind::Fine { 36.0 } else { 540.0 };
            Edit::Set { area: Area::Rect(rect), height_m: most_m / 42.0 * f64::from(i) }
        };
        for mut session in both() {
            for i in 1..5 {
                session.apply(&[set(i)]).unwrap();
                session.commit("set").unwrap();
            }
            session.undo().unwrap();
        }
        same();
        unpack(&SystemDisk, packed, &back, &Silent).unwrap();
        assert!(bench.bytes(&back) == bench.bytes(plain));
        for path in [plain, packed] {
            compact(&SystemDisk, path, None, path, &Silent).unwrap();
        }
        same();
        assert!(
            Terrain::open_unmapped(packed).unwrap().source().byte_count() > bench.bytes(packed).len() as u64
        );
        for mut session in both() {
            session.apply(&[set(6)]).unwrap();
            session.commit("set").unwrap();
        }
        same();
        compact_packed(&SystemDisk, plain, None, &back, &Silent).unwrap();
        pack(&SystemDisk, plain, &back, &Silent).unwrap();
        unpack(&SystemDisk, &back, packed, &Silent).unwrap();
        assert!(bench.bytes(packed) == bench.bytes(plain));
    }
}

fn seal(bytes: &mut [u8]) {
    let sum = crc32fast::hash(&bytes[..0xffc]);
    bytes[0xffc..0x1000].copy_from_slice(&sum.to_le_bytes());
}

/// Cuts and flipped bits anywhere are told, or do no harm; nothing panics. Compact records that claim to be exact, and the other way round, are told.
#[test]
fn damage_is_told() {
    for (sample_type, record) in KINDS {
        let bytes = build_bytes(&dem([200, 150], sample_type, 0.3, 1), &options(record)).unwrap();
        let bench = Bench::of(&bytes).unwrap();
        let (packed, plain) = (bench.bytes(&bench.packed), open_bytes(bytes).unwrap());
        let look = |damaged: Vec<u8>| -> Result<(), terrasoar_layout::LayoutError> {
            let terrain = open_bytes(damaged)?;
            for page in 0..terrain.page_count() {
                let read = terrain.checked_page(page)?;
                assert!(
                    terrain.page_count() != plain.page_count() || read == plain.checked_page(page).unwrap()
                );
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
        for round in 0..400 {
            let mut damaged = packed.clone();
            match round % 3 {
                0 => damaged.truncate(below(packed.len())),
                1 => damaged[8192 + below(packed.len() - 8192)] ^= 1 << below(8),
                _ => {
                    damaged[0x10 + below(0x120)] = below(256) as u8;
                    seal(&mut damaged);
                }
            }
            told += usize::from(look(damaged).is_err());
        }
        assert!(told > 250, "{told}");
        for kind in 1..=4 {
            let mut other = packed.clone();
            other[0x011] = kind;
            seal(&mut other);
            assert_eq!(look(other).is_ok(), kind == packed[0x011]);
        }
    }
}

/// The bytes that the specification says: the same on every machine.
#[test]
fn packed_bytes_are_what_they_were() {
    for ((sample_type, record), length, sum) in [
        (KINDS[0], 24_671, 3_290_930_637),
        (KINDS[1], 51_600, 842_953_989),
        (KINDS[2], 134_324, 3_145_352_256),
    ] {
        // By whole numbers alone, so that every machine makes the same.
        let dem = MemoryDem::from_fn([150, 110], sample_type, |x, y| {
            if (x / 11 + y / 9) % 13 == 4 {
                return f64::NAN;
            }
            let height = f64::from(x * x) / 64.0 - f64::from(y * (x + 3)) / 129.0
                + f64::from(((x * 37) ^ (y * 11)) % 64) / 1021.0;
            if sample_type == SampleType::F32 { f64::from(height as f32) } else { height }
        });
        let bench = Bench::of(&build_bytes(&dem, &options(record)).unwrap()).unwrap();
        let bytes = bench.bytes(&bench.packed);
        assert_eq!((bytes.len(), crc32fast::hash(&bytes)), (length, sum), "{sample_type:?} {record:?}");
    }
}
