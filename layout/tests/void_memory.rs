//! What the tables of a terrain take: memory in proportion to the file, however large the square that it is of. Alone in its process, whose memory it looks at.
#![cfg(target_os = "linux")]

use std::sync::Arc;
use terrasoar_layout::edit::{Edit, EditSession, SampleRect};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::{Counts, reseal, seeds};
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

/// Bytes of this process that are in memory.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = status.split_whitespace().nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// A square of 2^16 steps in the largest records, all of it absent: 28 million logical pages, a root of 1.7 MB and nothing else.
fn void_square() -> Vec<u8> {
    let seed = seeds().into_iter().find(|seed| seed.name == "exact 16").unwrap();
    let mut bytes = seed.files.terrain;
    bytes.truncate(3 * PAGE_BYTES);
    let records = 4 + 5 * ((1u64 << 32) - 1) / 3;
    let root_bytes = records.div_ceil(256).div_ceil(256) as usize * 16;
    bytes.resize(3 * PAGE_BYTES + root_bytes.next_multiple_of(PAGE_BYTES), 0);
    let length = bytes.len() as u64;
    for at in [0x014, 0x018] {
        bytes[at..at + 4].copy_from_slice(&65_537u32.to_le_bytes());
    }
    bytes[0x078..0x07c].copy_from_slice(&3u32.to_le_bytes());
    bytes[0x088..0x090].copy_from_slice(&length.to_le_bytes());
    reseal(&mut bytes, Counts::Settle);
    bytes
}

#[test]
fn an_empty_square_takes_no_more_memory_than_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("void.iqt");
    let bytes = void_square();
    std::fs::write(&path, &bytes).unwrap();
    let before = resident_bytes();
    let taken = || resident_bytes().saturating_sub(before);
    let terrain = Arc::new(Terrain::open(&path).unwrap());
    assert_eq!(terrain.page_count(), 27_962_027);
    with_records!(terrain.records().unwrap(), records => {
        let edited = EditedRecords::new(records.clone());
        assert_eq!(records.page_count() as u64, terrain.page_count());
        drop(edited);
    });
    let pool = terrain.pool(1 << 20).unwrap();
    assert!(!verify(&terrain, &|_| {}).unwrap().is_sound(), "there is no height in it");
    let mut session = EditSession::open(&path).unwrap();
    let changes = session.apply(&[Edit::set(SampleRect { west: 9, south: 9, east: 12, north: 12 }, 5.0)]);
    assert!(changes.unwrap().vertices.is_empty(), "voids stay voids");
    assert!(taken() < 48 << 20, "{} bytes for a file of {}", taken(), bytes.len());
    drop((pool, session));
}
