//! What the tables of a terrain take: memory in proportion to the file, however large the square that it is of. Alone in its process, whose memory it looks at.
#![cfg(target_os = "linux")]

mod common;

use common::hollow::absent_square;
use std::sync::Arc;
use terrasoar_layout::edit::{Edit, EditSession, SampleRect};
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

/// Bytes of this process that are in memory.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = status.split_whitespace().nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// In the largest records: 28 million, and seven thousand million logical pages, each time a root of 1.7 MB and nothing else.
#[test]
fn an_empty_square_takes_no_more_memory_than_its_file() {
    for (side, pages) in [(65_537, 27_962_027), (1_048_577, 7_158_278_827)] {
        check(side, pages);
    }
}

fn check(side: u32, pages: u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("void.iqt");
    let (bytes, _) = absent_square("exact 16", side);
    std::fs::write(&path, &bytes).unwrap();
    let before = resident_bytes();
    let taken = || resident_bytes().saturating_sub(before);
    let terrain = Arc::new(Terrain::open(&path).unwrap());
    assert_eq!(terrain.page_count(), pages);
    with_records!(terrain.records().unwrap(), records => {
        let edited = EditedRecords::new(records.clone());
        assert_eq!(records.page_count(), terrain.page_count());
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
