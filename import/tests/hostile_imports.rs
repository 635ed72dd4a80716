//! Elevation files made to exhaust memory, time or the program's good manners: words, or the heights, in proportion to the file.

mod import_support;
#[path = "import_support/packing.rs"]
mod packing;
#[path = "import_support/peak.rs"]
mod peak;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use import_support::Random;
use packing::packed;
use peak::{alone, peak};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{SampleSink, Window};
use tiff::{
    DATA_AT, DEFLATE, LZW, PACK_BITS, RAW, Tag, ZSTD, claimed, heights, longs, one_strip, reals, shorts,
    text, tiff,
};

const MIB: usize = 1 << 20;

/// A folder and a file in it, `length` bytes long, the end a hole.
fn file(name: &str, bytes: &[u8], length: u64) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    if length > 0 {
        std::fs::File::options().write(true).open(&path).unwrap().set_len(length).unwrap();
    }
    (folder, path)
}

/// Counts samples and adds up those that are not void.
#[derive(Default)]
struct Sum {
    samples: AtomicU64,
    voids: AtomicU64,
    sum: AtomicU64,
}

impl SampleSink for Sum {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.samples.fetch_add(samples.len() as u64, Ordering::Relaxed);
        let voids = samples.iter().filter(|v| v.is_nan()).count();
        self.voids.fetch_add(voids as u64, Ordering::Relaxed);
        let sum: f64 = samples.iter().filter(|v| !v.is_nan()).sum();
        self.sum.fetch_add(sum as u64, Ordering::Relaxed);
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        let count = u64::from(window.width) * u64::from(window.height);
        self.samples.fetch_add(count, Ordering::Relaxed);
        self.voids.fetch_add(count, Ordering::Relaxed);
        Ok(())
    }
}

/// Reads a whole file: number of samples, voids and sum, and the memory it took.
fn read(path: &Path) -> (Result<[u64; 3], LayoutError>, usize) {
    peak(|| {
        let sum = Sum::default();
        terrasoar_import::open(&[path.to_owned()])?.stream(&sum)?;
        Ok([sum.samples, sum.voids, sum.sum].map(AtomicU64::into_inner))
    })
}

/// The words with which the file is refused; all that must take little memory and time.
fn refusal(path: &Path) -> String {
    let start = Instant::now();
    let (done, bytes) = read(path);
    let said = done.expect_err("it was read").to_string();
    assert!(bytes < 16 * MIB, "{bytes} bytes: {said}");
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}: {said}", start.elapsed());
    assert!(said.len() < 600 && !said.contains(|c: char| c.is_control()), "{said:?}");
    said
}

const SIDE: u32 = 4;

/// A sound little file with some tags set otherwise.
fn with_tags(is_big: bool, other: Vec<Tag>) -> Vec<u8> {
    let data: Vec<u8> = (0..SIDE * SIDE).flat_map(|i| (i as u16).to_le_bytes()).collect();
    let tags = heights([SIDE; 2], RAW, SIDE, &[DATA_AT], &[data.len() as u32]);
    tiff(is_big, tags.into_iter().chain(other).collect(), &data)
}

/// Tags that are read, and such that are not.
const TAGS: [u16; 26] = [
    254, 256, 257, 258, 259, 262, 273, 277, 278, 279, 317, 322, 323, 324, 325, 338, 339, 320, 33550, 33922,
    34264, 34735, 34736, 34737, 42112, 42113,
];

/// One after the other claims nearly all of a file of 3 GiB, which is a hole, and all of them together do.
#[test]
fn tags_of_a_long_empty_file_take_no_memory() {
    let _alone = alone();
    let length = 3 << 30;
    let claims = |tag: u16, kind: u16, bytes: u64| claimed(tag, kind, (length - 4096) / bytes, 2048);
    for (kind, bytes) in [(1, 1), (2, 1), (3, 2), (4, 4), (12, 8), (16, 8)] {
        for tag in TAGS {
            let (_folder, path) = file("a.tif", &with_tags(false, vec![claims(tag, kind, bytes)]), length);
            let (done, taken) = read(&path);
            assert!(taken < 16 * MIB, "tag {tag} of type {kind}: {taken} bytes");
            if let Err(error) = done {
                assert!(error.to_string().len() > 20, "{error}");
            }
        }
        let all = TAGS.iter().map(|tag| claims(*tag, kind, bytes)).collect();
        let (_folder, path) = file("a.tif", &with_tags(kind == 16, all), length);
        assert!(read(&path).1 < 16 * MIB);
    }
    // The kind of an image says its size before anything else: this one is a mask, by its first value.
    let (_folder, path) = file("a.tif", &with_tags(false, vec![claims(254, 4, 4)]), length);
    assert_eq!(read(&path).0.unwrap(), [16, 0, 120]);
}

/// A hundred and twenty million chunks, of one sample each, which a table of 16 bytes a chunk would keep.
#[test]
fn tables_of_chunks_stay_in_the_file() {
    let _alone = alone();
    let side = 11_000;
    let chunks = u64::from(side) * u64::from(side);
    let tags = vec![
        longs(256, &[side]),
        longs(257, &[side]),
        longs(322, &[1]),
        longs(323, &[1]),
        claimed(324, 4, chunks, 4096),
        claimed(325, 1, chunks, 4096),
    ];
    let (_folder, path) = file("a.tif", &with_tags(true, tags), 4096 + 4 * chunks);
    let said = refusal(&path);
    assert!(said.contains("121000000 samples") && said.contains("none is stored"), "{said}");
}

#[test]
fn directories_without_end_are_left() {
    let _alone = alone();
    // Each is one byte behind the last and has 65,535 tags of the next ones' bytes.
    let mut bytes = vec![0u8; 3 << 20];
    bytes[..8].copy_from_slice(b"II\x2a\0\x08\0\0\0");
    for at in (8..bytes.len()).step_by(2) {
        bytes[at..at + 2].copy_from_slice(&[0xff, 0xff]);
    }
    let (_folder, path) = file("a.tif", &bytes, 0);
    refusal(&path);
    // Masks in a ring, each with as many tags as may be, none of which says a thing.
    let tags = 0xffffu16;
    let length = 2 + 12 * usize::from(tags) + 4;
    let mut bytes = b"II\x2a\0\x08\0\0\0".to_vec();
    for number in 1..=20u32 {
        let at = bytes.len();
        bytes.resize(at + length, 0);
        bytes[at..at + 2].copy_from_slice(&tags.to_le_bytes());
        bytes[at + 2..at + 14].copy_from_slice(b"\xfe\0\x04\0\x01\0\0\0\x04\0\0\0");
        let next = if number == 20 { 8 } else { at + length };
        bytes[at + length - 4..].copy_from_slice(&(next as u32).to_le_bytes());
    }
    let (_folder, path) = file("a.tif", &bytes, 0);
    assert!(refusal(&path).contains("262144 tags"));
    let ring = [&b"II\x2a\0\x08\0\0\0"[..], b"\x01\0\xfe\0\x04\0\x01\0\0\0\x01\0\0\0\x08\0\0\0"].concat();
    let (_folder, path) = file("a.tif", &ring, 0);
    assert!(refusal(&path).contains("no full-resolution image"));
}

/// What comes out of a chunk is longer than the file by the codec's greatest ratio; what is held is some rows.
#[test]
fn bombs_are_read_row_by_row() {
    let _alone = alone();
    let side = 8192;
    let zeros = vec![0u8; 2 * side as usize * side as usize];
    for (compression, longest) in [(DEFLATE, 150_000), (LZW, 200_000), (ZSTD, 20_000), (PACK_BITS, 3 << 20)] {
        let data = packed(compression, &zeros);
        assert!(data.len() < longest, "{compression}: {} bytes", data.len());
        let (_folder, path) = file("a.tif", &one_strip([side; 2], compression, &data), 0);
        let (done, taken) = read(&path);
        assert_eq!(done.unwrap(), [u64::from(side) * u64::from(side), 0, 0], "{compression}");
        assert!(taken < 16 * MIB, "{compression}: {taken} bytes");
    }
}

/// Noise does not pack: the chunk is as long as its samples.
#[test]
fn chunks_of_more_than_16_mib_packed_are_read() {
    let _alone = alone();
    let side = 3000;
    let mut random = Random(1);
    let noise: Vec<u8> = (0..2 * side * side).map(|_| random.below(256) as u8).collect();
    let sum = noise.as_chunks::<2>().0.iter().map(|pair| u64::from(u16::from_le_bytes(*pair))).sum();
    for compression in [DEFLATE, LZW, ZSTD] {
        let data = packed(compression, &noise);
        assert!(data.len() > 16 * MIB, "{compression}: {} bytes", data.len());
        let (_folder, path) = file("a.tif", &one_strip([side; 2], compression, &data), 0);
        let (done, taken) = read(&path);
        assert_eq!(done.unwrap(), [u64::from(side) * u64::from(side), 0, sum], "{compression}");
        assert!(taken < 16 * MIB, "{compression}: {taken} bytes");
    }
}

/// An encoder of the highest level asks for 128 MiB to look back on, however little there is.
#[test]
fn large_windows_of_small_chunks_take_no_memory() {
    use std::io::Write;
    let _alone = alone();
    let rows: Vec<u8> = (0..256u32 * 256).flat_map(|i| (i as u16).to_le_bytes()).collect();
    let mut encoder = zstd::Encoder::new(Vec::new(), 22).unwrap();
    encoder.write_all(&rows).unwrap();
    encoder.flush().unwrap();
    let strip = encoder.finish().unwrap();
    let strips = 40u32;
    let offsets: Vec<u32> = (0..strips).map(|i| DATA_AT + i * strip.len() as u32).collect();
    let lengths = vec![strip.len() as u32; strips as usize];
    let tags = heights([256, 256 * strips], ZSTD, 256, &offsets, &lengths);
    let (_folder, path) = file("a.tif", &tiff(false, tags, &strip.repeat(strips as usize)), 0);
    let (done, taken) = read(&path);
    assert_eq!(done.unwrap(), [u64::from(strips) << 16, 0, u64::from(strips) * (65_535 * 32_768)]);
    assert!(taken < 16 * MIB, "{taken} bytes");
    // A long chunk has its window, and says so.
    let rows = vec![7u8; 20 * MIB];
    let mut encoder = zstd::Encoder::new(Vec::new(), 22).unwrap();
    encoder.write_all(&rows).unwrap();
    encoder.flush().unwrap();
    let data = encoder.finish().unwrap();
    let (_folder, path) = file("a.tif", &one_strip([1024, 10 * 1024], ZSTD, &data), 0);
    let told = terrasoar_import::open(std::slice::from_ref(&path)).unwrap().memory_bytes();
    let (done, taken) = read(&path);
    done.unwrap();
    assert!(told > 100 << 20 && taken as u64 <= told + (16 << 20), "{told} told, {taken} taken");
}

/// Hours as heights of zero, and next to nothing as voids.
#[test]
fn a_large_file_that_stores_no_chunk_is_refused_at_once() {
    let _alone = alone();
    let side = 65_537;
    for compression in [RAW, DEFLATE, ZSTD] {
        for other in [vec![], vec![longs(322, &[65_552]), longs(323, &[65_552])]] {
            let mut tags = heights([side; 2], compression, side, &[0], &[0]);
            tags.extend([longs(324, &[0]), longs(325, &[0])]);
            tags.extend(other);
            let (_folder, path) = file("a.tif", &tiff(false, tags.clone(), &[]), 0);
            let said = refusal(&path);
            assert!(said.contains("none is stored") && said.contains("-a_nodata"), "{said}");
            tags.push(text(42113, "-9999"));
            let (_folder, path) = file("a.tif", &tiff(false, tags, &[]), 0);
            let samples = u64::from(side) * u64::from(side);
            assert_eq!(read(&path).0.unwrap(), [samples, samples, 0]);
        }
    }
}

/// One row of 65,537: the rest costs hours as heights of zero, and next to nothing as voids.
#[test]
fn a_large_file_that_is_hardly_there_says_whether_the_rest_is_void() {
    let _alone = alone();
    let side = 65_537u32;
    for compression in [RAW, ZSTD] {
        let row = packed(compression, &[3, 0].repeat(side as usize));
        let mut tags = heights([side; 2], compression, side - 1, &[0, DATA_AT], &[0, row.len() as u32]);
        let (_folder, path) = file("a.tif", &tiff(false, tags.clone(), &row), 0);
        let said = refusal(&path);
        assert!(said.contains("4295098369 samples") && said.contains("only 65537 are stored"), "{said}");
        tags.push(text(42113, "-9999"));
        let (_folder, path) = file("a.tif", &tiff(false, tags, &row), 0);
        let start = Instant::now();
        let [rows, cols] = [u64::from(side); 2];
        assert_eq!(read(&path).0.unwrap(), [rows * cols, (rows - 1) * cols, 3 * cols]);
        assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
    }
}

/// As GDAL has it: a chunk left out is void where a void value is declared, else zero.
#[test]
fn chunks_left_out_beside_others_are_zero_or_void() {
    let _alone = alone();
    let rows: Vec<u8> = [7u16; 8].iter().flat_map(|v| v.to_le_bytes()).collect();
    for compression in [RAW, DEFLATE] {
        let data = packed(compression, &rows);
        let mut tags = heights([4, 6], compression, 2, &[0, DATA_AT, 0], &[0, data.len() as u32, 0]);
        let (_folder, path) = file("a.tif", &tiff(false, tags.clone(), &data), 0);
        assert_eq!(read(&path).0.unwrap(), [24, 0, 56]);
        tags.push(text(42113, "9999"));
        let (_folder, path) = file("a.tif", &tiff(false, tags, &data), 0);
        assert_eq!(read(&path).0.unwrap(), [24, 16, 56]);
    }
}

/// A megabyte of nothing before the samples of each of a hundred thousand chunks, all of which are the same bytes.
#[test]
fn chunks_that_lie_over_each_other_are_refused() {
    let _alone = alone();
    // Empty stored blocks of DEFLATE.
    let mut data = vec![0x78, 0x01];
    data.extend([0, 0, 0, 0xff, 0xff].repeat(200_000));
    data.extend([1, 8, 0, 0xf7, 0xff, 1, 0, 2, 0, 3, 0, 4, 0, 0, 0, 0, 0]);
    let rows = 60_000;
    let tags = heights(
        [4, rows],
        DEFLATE,
        1,
        &vec![DATA_AT; rows as usize],
        &vec![data.len() as u32; rows as usize],
    );
    let (_folder, path) = file("a.tif", &tiff(false, tags, &data), 0);
    assert!(refusal(&path).contains("over each other"));
    // Equal chunks stored once are sound.
    let data = packed(DEFLATE, &[5, 0].repeat(4));
    let tags = heights(
        [4, rows],
        DEFLATE,
        1,
        &vec![DATA_AT; rows as usize],
        &vec![data.len() as u32; rows as usize],
    );
    let (_folder, path) = file("a.tif", &tiff(false, tags, &data), 0);
    assert_eq!(read(&path).0.unwrap()[2], 20 * u64::from(rows));
}

/// Of tiles a million times as wide as the image only the image is read.
#[test]
fn tiles_much_wider_than_the_image_take_no_memory() {
    let _alone = alone();
    let wide = 16u32 << 20;
    let tile = |compression: u16, data: &[u8]| {
        let mut tags = heights([4, 4], compression, 4, &[0], &[0]);
        tags.extend([longs(322, &[wide]), longs(323, &[16]), longs(324, &[4096]), longs(325, &[64])]);
        tags.push(shorts(259, &[compression]));
        tiff(false, tags, data)
    };
    let (_folder, path) = file("a.tif", &tile(RAW, &[]), 4096 + 2 * 16 * u64::from(wide));
    let (done, taken) = read(&path);
    assert_eq!(done.unwrap(), [16, 0, 0]);
    assert!(taken < 16 * MIB, "{taken} bytes");
    let (_folder, path) = file("a.tif", &tile(ZSTD, &[]), 1 << 20);
    read(&path).0.unwrap_err();
    // A row that is too long to unpack.
    let mut tags = heights([4, 4], DEFLATE, 4, &[0], &[0]);
    tags.extend([longs(322, &[1 << 30]), longs(323, &[16]), longs(324, &[4096]), longs(325, &[64])]);
    let (_folder, path) = file("a.tif", &tiff(false, tags, &[]), 1 << 20);
    assert!(refusal(&path).contains("2048 MiB"));
}

#[test]
fn texts_of_files_come_without_what_a_terminal_acts_on() {
    let _alone = alone();
    let name = "WGS\u{1b}[2J 84\u{7}\u{202e}|";
    let keys = [1, 1, 0, 2, 1024, 0, 1, 1, 1026, 34737, name.len() as u16, 0];
    let bytes = with_tags(false, vec![shorts(34735, &keys), text(34737, name)]);
    let (_folder, path) = file("a.tif", &bytes, 0);
    let dem = terrasoar_import::open(std::slice::from_ref(&path)).unwrap();
    assert_eq!(dem.info().georeference.crs_name, "WGS[2J 84");
    let (_folder, path) = file("a.tif", &with_tags(false, vec![text(42113, "\u{1b}]0;\u{7}a\u{9b}b")]), 0);
    assert!(refusal(&path).contains("\"]0;ab\" is no number"));
    let mut bt = std::fs::read(import_support::data("crater_lake_1025.bt")).unwrap();
    bt[7..10].copy_from_slice(b"\x1b[J");
    let (_folder, path) = file("a.bt", &bt, 0);
    refusal(&path);
    // Far too long for what they are.
    let long = "1".repeat(5 * MIB);
    for tag in [42112, 42113, 34737] {
        let (_folder, path) = file("a.tif", &with_tags(false, vec![text(tag, &long)]), 0);
        let said = refusal(&path);
        assert!(said.contains(&format!("tag {tag} has more than")), "{said}");
    }
}

/// A model tie point and pixel size of which only the first values count.
#[test]
fn lists_of_which_the_first_values_count_may_be_long() {
    let _alone = alone();
    let ties = [1.0, 2.0, 0.0, 500.0, 900.0, 0.0].repeat(10_000);
    let (_folder, path) = file("a.tif", &with_tags(false, vec![reals(33922, &ties)]), 0);
    let dem = terrasoar_import::open(std::slice::from_ref(&path)).unwrap();
    assert_eq!(dem.info().georeference.pixel_to_crs, Some([495.0, 10.0, 0.0, 915.0, 0.0, -10.0]));
}
