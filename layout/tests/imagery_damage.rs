//! Damaged, forged and absurd imagery sections: a clear error, before memory is taken; the terrain beneath stays readable.

mod common;

use common::drape::{draped, land};
use common::open_bytes;
use terrasoar_layout::imagery::{DrapeOptions, Imagery, MemoryImage, TileId};
use terrasoar_layout::verify::verify;

const PAGE: usize = 4096;

/// A file with imagery, and where header, directory and tiles lie.
fn file() -> (Vec<u8>, usize, usize, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let picture = MemoryImage::from_fn([700, 120], |x, y| [x as u8, y as u8, 90, 255]);
    let header = draped(&path, picture, &DrapeOptions::default()).unwrap().header;
    let section = header.imagery.unwrap().offset as usize;
    (std::fs::read(path).unwrap(), section, section + PAGE, section + 2 * PAGE)
}

fn resealed(mut bytes: Vec<u8>, page: usize) -> Vec<u8> {
    let sum = crc32fast::hash(&bytes[page..page + 0xffc]);
    bytes[page + 0xffc..page + PAGE].copy_from_slice(&sum.to_le_bytes());
    bytes
}

/// What opening the imagery says; the terrain itself must open.
fn complaint(bytes: Vec<u8>) -> Option<String> {
    let terrain = open_bytes(bytes).unwrap();
    let said = Imagery::open(&terrain).err().map(|error| error.to_string());
    if said.is_some() {
        // Verification tells it as a finding or, for what it does not know, as its error.
        assert!(verify(&terrain, &|_| {}).map_or(true, |report| !report.is_sound()));
        assert!(terrain.height_m(10.0, 10.0).unwrap().is_some());
    }
    said
}

#[test]
fn every_byte_of_header_and_directory_counts() {
    let (bytes, section, directory, _) = file();
    assert_eq!(complaint(bytes.clone()), None);
    let entries = 16 * 3;
    for at in (section..section + PAGE).chain(directory..directory + entries) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x40;
        let said = complaint(flipped).unwrap_or_else(|| panic!("byte {:#x} of the section", at - section));
        assert!(said.contains("imagery") && said.contains("drape"), "{said}");
    }
}

#[test]
fn absurd_fields_are_refused_before_memory_is_taken() {
    let (bytes, section, directory, _) = file();
    let forged = |page: usize, at: usize, value: &[u8]| {
        let mut forged = bytes.clone();
        forged[page + at..page + at + value.len()].copy_from_slice(value);
        forged
    };
    let nan = f64::NAN.to_le_bytes();
    let cases: [(usize, &[u8]); 16] = [
        (0x008, &[9, 0]),
        (0x00a, &[4]),
        (0x00b, &[2]),
        (0x00c, &[0, 4, 0, 0]),
        (0x010, &[0, 0, 0, 0]),
        (0x014, &[0, 0, 0, 0]),
        (0x014, &[255; 8]),
        (0x014, &[0, 0, 64, 0, 0, 0, 64, 0]),
        (0x01c, &[255; 4]),
        (0x020, &nan),
        (0x030, &[0; 8]),
        (0x040, &[255; 8]),
        (0x048, &[255; 8]),
        (0x050, &[255; 8]),
        (0x058, &[255; 4]),
        (0x200, &[255, 255]),
    ];
    for (at, value) in cases {
        let said = complaint(resealed(forged(section, at, value), section));
        assert!(said.is_some(), "{value:?} at {at:#x}");
    }
    // A directory that is whole and says nonsense.
    for (at, value) in [(0, [255; 4]), (4, [255; 4]), (0, [1, 0, 0, 0]), (4, [0; 4]), (16, [0; 4])] {
        let mut forged = forged(directory, at, &value);
        let sum = crc32fast::hash(&forged[directory..directory + 48]);
        forged[section + 0x05c..section + 0x060].copy_from_slice(&sum.to_le_bytes());
        assert!(complaint(resealed(forged, section)).is_some(), "{value:?} at {at} of the directory");
    }
    // A file header that sends readers astray: the terrain itself is refused then.
    for (at, value) in [(0x090, [1; 8]), (0x090, [0; 8]), (0x098, [255; 8]), (0x098, [0; 8])] {
        let forged = resealed(forged(PAGE, at, &value), PAGE);
        let terrain = open_bytes(forged).unwrap();
        assert_eq!(terrain.header().generation, 1, "the other slot counts");
    }
}

#[test]
fn damaged_tiles_are_named() {
    let (bytes, _, _, tiles) = file();
    let mut flipped = bytes;
    flipped[tiles + 5000] ^= 1;
    let terrain = open_bytes(flipped).unwrap();
    let imagery = Imagery::open(&terrain).unwrap().unwrap();
    let ids: Vec<TileId> = imagery.shape().ids().collect();
    let mut tile = Vec::new();
    let errors: Vec<String> = ids
        .iter()
        .filter_map(|id| imagery.read_tile(&terrain, *id, &mut tile).err())
        .map(|error| error.to_string())
        .collect();
    assert_eq!(errors.len(), 1);
    assert!(errors[0].contains("imagery tile") && errors[0].contains("checksum"), "{errors:?}");
    let report = verify(&terrain, &|_| {}).unwrap();
    assert_eq!(report.problem_count, 1);
    assert!(report.problems[0].place.starts_with("imagery tile"), "{:?}", report.problems);
    assert!(!imagery.read_tile(&terrain, TileId { level: 7, x: 0, y: 0 }, &mut tile).unwrap());
    assert!(tile.is_empty() && !imagery.has_tile(TileId { level: 0, x: 9, y: 0 }));
}
