//! Packed files are what FORMAT.md says: a reader written from it alone, in another language, finds the same records.

mod common;

use common::packed::{Bench, dem, options};
use common::{MemoryDem, build_bytes};
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::{RecordCodec, RecordKind, VertexClass};
use terrasoar_layout::read::kinds::ByKind;
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
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data-scripts");
    for size in [[150, 131], [3, 2]] {
        // Far enough apart for the cliffs of the edits.
        let fine = options().record(Some(RecordKind::Fine)).spacing_m([40.0, 50.0]);
        compare(&scripts, &build_bytes(&dem(size, 4, 2 * u32::from(size[0] > 3)), &fine).unwrap(), size, 0);
    }
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
        compare(&scripts, &bytes.unwrap(), size, 0);
    }
    // A directory with nodes, in a square of 2^18 steps: void, but for both ends of a strip.
    let size = [131_100, 4];
    let ground = dem([60, 4], 4, 0);
    let strip = MemoryDem::from_fn(size, SampleType::I16, |x, y| match x {
        0..20 | 131_050.. => ground.sample(x % 131_050, y),
        _ => f64::NAN,
    });
    compare(&scripts, &build_bytes(&strip, &options()).unwrap(), size, 131_060);
}

/// Packs a terrain file and holds what both readers read against its records, the small one where it can; as it is, and after edits from column `west` on and an undo.
fn compare(scripts: &Path, bytes: &[u8], size: [u32; 2], west: u32) {
    let bench = Bench::of(bytes).unwrap();
    let out = bench.plain.with_file_name("records");
    let run = |args: &[&OsStr]| Command::new("python3").arg("-B").args(args).output().unwrap();
    let [small, whole] = ["read_packed.py", "read_packed_all.py"].map(|name| scripts.join(name));
    let read = || {
        let args = [whole.as_os_str(), bench.packed.as_os_str(), out.as_os_str()];
        let ran = run(&args);
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        check_records(&bench.bytes(&out), &bench.plain, size);
    };
    read();
    let read_small = || run(&[small.as_os_str(), bench.packed.as_os_str()]);
    let words = "which read_packed_all.py reads";
    let is_compact = Terrain::open(&bench.plain).unwrap().header().record_kind == RecordKind::Compact;
    let ran = read_small();
    if is_compact {
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        check_samples(&String::from_utf8(ran.stdout).unwrap(), &bench.plain, size);
    } else {
        assert!(!ran.status.success() && String::from_utf8_lossy(&ran.stderr).contains(words));
    }
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
    let ran = read_small();
    assert!(!ran.status.success() && String::from_utf8_lossy(&ran.stderr).contains(words));
}

/// Whether the lines that the small reader wrote are the samples of a terrain file of compact records: codes, and metres to the last bit.
fn check_samples(lines: &str, plain: &Path, size: [u32; 2]) {
    let plain = Terrain::open(plain).unwrap();
    let records = plain.records().unwrap();
    let ByKind::Compact(records) = records else { panic!("other records") };
    let mut count = 0;
    for (line, i) in lines.lines().skip(1).zip(0u32..) {
        let [x, y, height, error, radius, codes @ ..] = &line.split(',').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let point = GridPoint::new(i % size[0], i / size[0]);
        assert_eq!([x.parse(), y.parse()], [Ok(point.x()), Ok(point.y())]);
        let vertex = records.vertex_at(point);
        let [low, high, error_code, radius_code] =
            records.raw(slot_of(plain.grid().k(), point)).to_le_bytes();
        let wanted = [u16::from_le_bytes([low, high]), error_code.into(), radius_code.into()];
        assert_eq!(codes, wanted.map(|code| code.to_string()), "{line}");
        let is_void = !matches!(vertex.class, VertexClass::Plain | VertexClass::Fringe);
        let height_m = (!is_void).then_some(vertex.height_m);
        assert_eq!(
            [height.parse().ok(), error.parse().ok(), radius.parse().ok()],
            [height_m, Some(vertex.error_m), Some(vertex.radius_m)],
            "{line}"
        );
        count += 1;
    }
    assert_eq!(count, size[0] * size[1]);
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
