//! Packed files are what FORMAT.md says: a reader written from it alone, in another language, finds the same records.

mod common;

use common::packed::{Bench, dem, options};
use common::{MemoryDem, build_bytes};
use std::path::Path;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::{RecordCodec, RecordKind};
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Another reader, written from FORMAT.md alone, finds the same records.
#[test]
fn a_reader_written_from_the_specification_agrees() {
    let python = |args: &[&std::ffi::OsStr]| std::process::Command::new("python3").args(args).output();
    if python(&["--version".as_ref()]).is_err() {
        eprintln!("no Python here: not compared");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data-scripts/read_packed.py");
    for (size, roughness, voids, exact) in [
        ([150, 131], 4, 2, None),
        ([70, 9], 900, 0, None),
        ([3, 2], 0, 0, None),
        ([150, 131], 4, 2, Some(SampleType::F32)),
        ([140, 70], 4, 1, Some(SampleType::F64)),
        ([3, 2], 0, 0, Some(SampleType::F32)),
    ] {
        let bytes = match exact {
            None => build_bytes(&dem(size, roughness, voids), &options()),
            Some(sample_type) => build_bytes(
                &uneven(size, roughness, voids, sample_type),
                &options().record(Some(RecordKind::Exact8)),
            ),
        };
        compare(&script, &bytes.unwrap(), size, 0);
    }
    // A directory with nodes, in a square of 2^18 steps: void, but for both ends of a strip.
    let size = [131_100, 4];
    let ground = dem([60, 4], 4, 0);
    let strip = MemoryDem::from_fn(size, SampleType::I16, |x, y| match x {
        0..20 | 131_050.. => ground.sample(x % 131_050, y),
        _ => f64::NAN,
    });
    compare(&script, &build_bytes(&strip, &options()).unwrap(), size, 131_060);
}

/// Packs a terrain file and holds what the script reads against its records; as it is, and after edits from column `west` on and an undo.
fn compare(script: &Path, bytes: &[u8], size: [u32; 2], west: u32) {
    let bench = Bench::of(bytes).unwrap();
    let out = bench.plain.with_file_name("records");
    let read = || {
        let args = [script.as_os_str(), bench.packed.as_os_str(), out.as_os_str()];
        let ran = std::process::Command::new("python3").args(args).output().unwrap();
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        check_records(&bench.bytes(&out), &bench.plain, size);
    };
    read();
    // Edited, and back by one commit.
    for path in [&bench.plain, &bench.packed] {
        let mut session = EditSession::open(path).unwrap();
        for (i, height_m) in [(0, 901.0), (1, 950.0), (2, 1000.0)] {
            let rect = SampleRect {
                west: west + i,
                south: i,
                east: (west + i + 40).min(size[0] - 1),
                north: size[1] - 1,
            };
            if i < size[1] {
                session.apply(&[Edit::Set { area: Area::Rect(rect), height_m }]).unwrap();
                session.commit("set").unwrap();
            }
        }
        session.undo().unwrap();
    }
    read();
}

/// Heights that no step divides.
fn uneven(size: [u32; 2], roughness: u32, voids: u32, sample_type: SampleType) -> MemoryDem {
    let even = dem(size, roughness, voids);
    MemoryDem::from_fn(size, sample_type, |x, y| {
        let height = even.sample(x, y) / 7.0 - 130.0;
        if sample_type == SampleType::F32 { f64::from(height as f32) } else { height }
    })
}

/// Whether `found` is the record of each sample of the terrain file.
fn check_records(found: &[u8], plain: &Path, size: [u32; 2]) {
    let plain = Terrain::open(plain).unwrap();
    with_records!(plain.records().unwrap(), records => check_kind(found, &plain, records, size));
}

fn check_kind<C: RecordCodec>(found: &[u8], plain: &Terrain, records: Records<'_, C>, size: [u32; 2]) {
    for (i, record) in found.chunks_exact(C::BYTES).enumerate() {
        let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
        let slot = slot_of(plain.grid().k(), GridPoint::new(x, y));
        let mut expected = vec![0; C::BYTES];
        C::write(records.raw(slot), &mut expected);
        assert_eq!(record, expected, "{size:?}: {x}, {y}");
    }
    assert_eq!(found.len(), C::BYTES * (size[0] * size[1]) as usize);
}
