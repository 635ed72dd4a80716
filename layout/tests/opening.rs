//! Opening a terrain file takes a few reads of its front, whatever its size; what these lead to is read and checked when it is needed.

mod common;

use common::hollow::absent_square;
use common::{MemoryDem, build_bytes, open_bytes};
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Edit, EditSession, SampleRect};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::source::{CountingSource, MemorySource, PreadSource, Source};
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::opening::{Opening, Step};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::packed_seeds;

const PAGE: usize = 4096;
/// What opening reads first.
const FRONT: u64 = 64 << 10;

/// A source that is still at hand after a terrain took it.
struct Shared<S>(Arc<CountingSource<S>>);

impl<S: Source> Source for Shared<S> {
    fn path(&self) -> &Path {
        self.0.path()
    }

    fn byte_count(&self) -> u64 {
        self.0.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.0.read_at(offset, buffer)
    }
}

/// A terrain over a source whose reads are counted.
fn counted<S: Source + 'static>(source: S) -> (Terrain, Arc<CountingSource<S>>) {
    let source = Arc::new(CountingSource::new(source));
    (Terrain::from_source(Box::new(Shared(Arc::clone(&source)))).unwrap(), source)
}

/// A terrain of several directory leaves, and packed.
fn both() -> [Vec<u8>; 2] {
    let dem = MemoryDem::from_fn([1025, 900], SampleType::I16, |x, y| f64::from(x * 7 % 300 + y * 11 % 401));
    let bytes = build_bytes(&dem, &BuildOptions::default().spacing_m([10.0; 2])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.path().join(name));
    std::fs::write(&plain, &bytes).unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    [bytes, std::fs::read(packed).unwrap()]
}

#[test]
fn opening_takes_few_reads() {
    let [plain, packed] = both();
    for (bytes, most) in [(plain, [2, FRONT + 16 * 64]), (packed, [1, FRONT])] {
        let (terrain, source) = counted(MemorySource::new("counted", bytes));
        assert!(terrain.page_count() > 1000);
        let (reads, read) = source.counts();
        assert!(reads <= most[0] && read <= most[1], "{reads}, {read}");
        terrain.check_directory().unwrap();
    }
}

/// 65,537 x 65,537 samples, 17 GB: all directory leaves are there, none of them has a page. Leaves are zeros, which the file has as a hole.
fn huge(path: &Path) -> u64 {
    let (mut bytes, leaves) = absent_square("compact", 65_537);
    let first = (bytes.len() / PAGE) as u32;
    let sum = crc32fast::hash(&[0; PAGE]);
    for (i, entry) in bytes[3 * PAGE..].chunks_exact_mut(16).take(leaves).enumerate() {
        [first + i as u32, sum, 1].iter().zip(entry.chunks_exact_mut(4)).for_each(|(field, place)| {
            place.copy_from_slice(&field.to_le_bytes());
        });
    }
    let claimed = 17u64 << 30;
    bytes[0x088..0x090].copy_from_slice(&claimed.to_le_bytes());
    let sum = crc32fast::hash(&bytes[3 * PAGE..3 * PAGE + 16 * leaves]);
    bytes[0x080..0x084].copy_from_slice(&sum.to_le_bytes());
    let sum = crc32fast::hash(&bytes[..0xffc]);
    bytes[0xffc..0x1000].copy_from_slice(&sum.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
    std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(claimed).unwrap();
    16 * leaves as u64
}

#[test]
fn a_large_file_opens_as_a_small_one_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.iqt");
    let root_bytes = huge(&path);
    let (terrain, source) = counted(PreadSource::open(&path).unwrap());
    assert_eq!(source.counts(), (2, FRONT + root_bytes));
    // A page takes its leaf, once.
    for page in [5_000_000, 5_000_001] {
        assert!(!terrain.entry(page).unwrap().is_present());
        assert_eq!(source.counts(), (3, FRONT + root_bytes + PAGE as u64));
    }
    terrain.check_directory().unwrap();
    assert!(source.counts().0 < 30, "leaves that lie one after the other are read together");
}

/// The largest square there is, in the largest records: a root with nodes is no larger than those of smaller squares.
#[test]
fn the_largest_square_opens_as_a_small_one_does() {
    let (bytes, nodes) = absent_square("exact 16", 1_048_577);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hollow.iqt");
    std::fs::write(&path, &bytes).unwrap();
    let (terrain, source) = counted(PreadSource::open(&path).unwrap());
    assert_eq!(source.counts(), (2, FRONT + 16 * nodes as u64));
    assert!(nodes == 109_227 && terrain.page_count() > u64::from(u32::MAX));
    for page in [0, 5_000_000_000, terrain.page_count() - 1, u64::MAX] {
        assert!(!terrain.entry(page).unwrap().is_present());
    }
    assert_eq!(source.counts().0, 2, "what is absent is not read");
}

/// Packed terrain of 65,537 x 65,537 samples, all pages of which are said to be present: 28 GB unpacked. Only the front is there, the rest is a hole. Its bytes in front of the directory's blocks.
fn huge_packed(path: &Path) -> u64 {
    let seed = packed_seeds().into_iter().find(|seed| seed.name == "packed").unwrap().files.terrain;
    let number = |at: usize| u64::from_le_bytes(seed[at..at + 8].try_into().unwrap()) as usize;
    let records = 4 + 5 * ((1u64 << 32) - 1) / 3;
    let pages = records.div_ceil(1024);
    let leaves = pages.div_ceil(256);
    let root_page = 3 + pages + leaves;
    let root: Vec<u8> =
        (0..leaves).flat_map(|i| [(3 + pages + i) as u32, 0, 1, 0]).flat_map(u32::to_le_bytes).collect();
    // No bounds; tables as they are; one run of present leaves; how many pages each has; no tile. Groups have 1,024, 128, 16, 2 and 1 tiles a side, 16 x 16 of them a leaf.
    let tables = seed[number(0x128)..number(0x128) + number(0x130)].to_vec();
    let run = vec![0, leaves as u8 | 128, (leaves >> 7) as u8 | 128, (leaves >> 14) as u8];
    let last = pages - 256 * (leaves - 1);
    let index: Vec<u8> =
        (1..=leaves).flat_map(|i| [if i < leaves { 255 } else { (last - 1) as u8 }, 0, 0, 0, 0]).collect();
    let tiles = vec![0; 12 * (64 * 64 + 8 * 8 + 1 + 1 + 1)];
    let mut bytes = vec![0; 2 * PAGE];
    bytes[..PAGE].copy_from_slice(&seed[..PAGE]);
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    let (mut at, mut sections) = (2 * PAGE as u64, Vec::new());
    for (kind, section) in (1u32..).zip([&tables, &run, &index, &tiles]) {
        sections.push((kind, crc32fast::hash(section), at, section.len() as u64));
        at += section.len() as u64;
    }
    let blocks = 4 * pages + if last < 256 { 32 } else { 0 };
    sections.push((5, 0, at, blocks));
    let end = at + blocks;
    put(0x107, &[sections.len() as u8]);
    put(0x120, &[0; 24 * 8]);
    for (i, (kind, sum, offset, length)) in sections.into_iter().enumerate() {
        put(0x120 + 24 * i, &[kind.to_le_bytes(), sum.to_le_bytes()].concat());
        put(0x128 + 24 * i, &[offset.to_le_bytes(), length.to_le_bytes()].concat());
    }
    let file_bytes = root_page * PAGE as u64 + (root.len() as u64).next_multiple_of(PAGE as u64);
    put(0x010, &[16]);
    put(0x014, &[65_537u32.to_le_bytes(), 65_537u32.to_le_bytes()].concat());
    put(0x060, &0u64.to_le_bytes());
    put(0x068, &[pages.to_le_bytes(), pages.to_le_bytes()].concat());
    put(0x078, &[root_page as u32, leaves as u32, crc32fast::hash(&root)].map(u32::to_le_bytes).concat());
    put(0x088, &file_bytes.to_le_bytes());
    put(0x108, &[end.to_le_bytes(), pages.to_le_bytes()].concat());
    put(0x1e0, &end.to_le_bytes());
    let sum = crc32fast::hash(&bytes[..0xffc]);
    bytes[0xffc..0x1000].copy_from_slice(&sum.to_le_bytes());
    [tables, run, index, tiles].iter().for_each(|section| bytes.extend_from_slice(section));
    std::fs::write(path, bytes).unwrap();
    std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(end).unwrap();
    at
}

#[test]
fn a_large_packed_file_opens_as_a_small_one_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.iqt");
    let front = huge_packed(&path);
    let (terrain, source) = counted(PreadSource::open(&path).unwrap());
    assert!(terrain.header().file_bytes > 28_000_000_000 && front < 256 << 10, "{front}");
    assert_eq!(source.counts(), (2, front));
    // A page takes its leaf's block, which is no such one.
    assert!(terrain.entry(3_000_000).unwrap_err().to_string().contains("directory leaf 11718"));
    assert_eq!(source.counts(), (3, front + 1024));
}

/// A file opened from bytes that are handed over is the file opened from the disk, and no byte is asked for that it has not.
#[test]
fn opening_reads_nothing_itself() {
    let [plain, packed] = both();
    let mut edited = Vec::new();
    let folder = tempfile::tempdir().unwrap();
    for bytes in [&plain, &packed] {
        let path = folder.path().join("edited.iqt");
        std::fs::write(&path, bytes).unwrap();
        let mut session = EditSession::open(&path).unwrap();
        session.apply(&[Edit::set(SampleRect { west: 9, south: 9, east: 300, north: 40 }, 5.0)]).unwrap();
        session.commit("set").unwrap();
        drop(session);
        edited.push(std::fs::read(&path).unwrap());
    }
    for bytes in [plain, packed].into_iter().chain(edited) {
        let mut opening = Opening::new("given", bytes.len() as u64);
        let mut turns = 0;
        while let Step::Need(ranges) = opening.next().unwrap() {
            for range in ranges {
                opening.give(range.start, bytes[range.start as usize..range.end as usize].to_vec());
            }
            turns += 1;
        }
        assert!((1..8).contains(&turns), "{turns}");
        let terrain = Terrain::opened(opening, Box::new(MemorySource::new("given", bytes.clone()))).unwrap();
        let read = open_bytes(bytes).unwrap();
        assert!(terrain.header().to_page() == read.header().to_page());
        assert!(terrain.present_pages().unwrap().eq(read.present_pages().unwrap()));
        for page in (0..terrain.page_count()).step_by(37) {
            assert!(terrain.checked_page(page).unwrap() == read.checked_page(page).unwrap());
        }
    }
}

/// What cannot be opened is told when the bytes that show it have been given; a terrain is not there before it is opened.
#[test]
fn opening_refuses_what_is_none() {
    let mut opening = Opening::new("text", 20_000);
    let Step::Need(ranges) = opening.next().unwrap() else { panic!("nothing was given yet") };
    assert_eq!((ranges.len(), ranges[0].clone()), (1, 0..20_000));
    opening.give(0, vec![b'a'; 20_000]);
    assert!(opening.next().unwrap_err().to_string().contains("text"));
    let [plain, _] = both();
    let mut opening = Opening::new("cut", plain.len() as u64 / 2);
    opening.next().unwrap();
    opening.give(0, plain[..FRONT as usize].to_vec());
    assert!(opening.next().unwrap_err().to_string().contains("cut short"));
    let early = Terrain::opened(Opening::new("early", 9), Box::new(MemorySource::new("early", plain)));
    assert!(early.unwrap_err().to_string().contains("not opened yet"));
}

/// A file that is appended to while it is opened: the header says more than the length that was measured before.
#[test]
fn a_file_may_grow_while_it_is_opened() {
    let [plain, packed] = both();
    for bytes in [plain, packed] {
        let mut opening = Opening::new("growing", bytes.len() as u64 - 5000);
        let Step::Need(front) = opening.next().unwrap() else { panic!("nothing was given yet") };
        opening.give(front[0].start, bytes[..front[0].end as usize].to_vec());
        opening.grown_to(bytes.len() as u64);
        while let Step::Need(ranges) = opening.next().unwrap() {
            let range = ranges[0].start as usize..ranges[0].end as usize;
            opening.give(ranges[0].start, bytes[range].to_vec());
        }
        Terrain::opened(opening, Box::new(MemorySource::new("growing", bytes))).unwrap();
    }
}

/// Damage of a directory leaf is told when one of its pages is needed, by everything that needs one; pages of other leaves read.
#[test]
fn a_damaged_leaf_is_told_where_it_is_needed() {
    let [plain, packed] = both();
    let number = |bytes: &[u8], at: usize, count: usize| {
        bytes[at..at + count].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
    };
    let root = number(&plain, 0x078, 4) * PAGE;
    let leaf = number(&plain, root + 16, 4) * PAGE;
    // The block of leaf 1 follows that of leaf 0.
    let sections: Vec<usize> = (0..6).map(|i| 0x120 + 24 * i).collect();
    let section = |kind| *sections.iter().find(|at| number(&packed, **at, 4) == kind).unwrap();
    let [index, blocks] = [3, 5].map(|kind| number(&packed, section(kind) + 8, 8));
    let pages = usize::from(packed[index]) + 1;
    let block = blocks + 4 * pages + if pages < 256 { 32 } else { 0 };
    for (mut bytes, at) in [(plain, leaf + 20), (packed, block + 40)] {
        bytes[at] ^= 1;
        let terrain = open_bytes(bytes).unwrap();
        let words = "directory leaf 1: the checksum does not match";
        terrain.checked_page(255).unwrap();
        terrain.checked_page(512).unwrap();
        let told = [
            terrain.entry(256).unwrap_err(),
            terrain.checked_page(511).unwrap_err(),
            terrain.check_directory().unwrap_err(),
            terrain.records().err().unwrap(),
        ];
        assert!(told.iter().all(|error| error.to_string().contains(words)), "{told:?}");
    }
}
