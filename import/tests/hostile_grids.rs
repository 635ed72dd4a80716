//! Grids of numbers made to exhaust memory or time: words, or the heights, in little memory, whatever they claim.

#[path = "mosaics/ground.rs"]
mod ground;
mod import_support;
#[path = "mosaics/hostile.rs"]
mod mosaics;
#[path = "import_support/peak.rs"]
mod peak;

use peak::{alone, peak};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{SampleSink, Window};

const MIB: usize = 1 << 20;

/// Files in a folder; the first is the one that is named. A file may go on with a hole.
fn files(all: &[(&str, &[u8], u64)]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, length) in all {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        if *length > 0 {
            std::fs::File::options().write(true).open(&path).unwrap().set_len(*length).unwrap();
        }
    }
    let path = folder.path().join(all[0].0);
    (folder, path)
}

/// Counts samples, up to a limit.
#[derive(Default)]
struct Count(AtomicU64);

impl SampleSink for Count {
    fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.0.fetch_add(samples.len() as u64, Ordering::Relaxed);
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.0.fetch_add(u64::from(window.width) * u64::from(window.height), Ordering::Relaxed);
        Ok(())
    }
}

fn read(path: &Path, options: &OpenOptions) -> (Result<u64, LayoutError>, usize) {
    let start = Instant::now();
    let done = peak(|| {
        let count = Count::default();
        open_with(&[path.to_owned()], options)?.stream(&count)?;
        Ok(count.0.into_inner())
    });
    assert!(start.elapsed() < Duration::from_secs(120), "{}: {:?}", path.display(), start.elapsed());
    done
}

fn refusal(all: &[(&str, &[u8], u64)], options: &OpenOptions) -> String {
    let (_folder, path) = files(all);
    let (done, bytes) = read(&path, options);
    let said = done.expect_err("it was read").to_string();
    assert!(bytes < 24 * MIB, "{bytes} bytes: {said}");
    assert!(said.len() < 800 && !said.contains(|c: char| c.is_control()), "{said:?}");
    said
}

#[test]
fn claims_beyond_the_file_take_no_memory() {
    let _alone = alone();
    let plain = OpenOptions::default();
    let long = 1 << 28;
    for (all, wanted) in [
        // Holes are bytes of zero, which are blanks to a text.
        (vec![("a.asc", &b"ncols 10000\nnrows 10000\n5 "[..], long)], "ends after 1 of"),
        (vec![("a.asc", b"ncols 4294967295\nnrows 4294967295\n5 ", long)], "do not fit"),
        (vec![("a.pgm", b"P2 10000 10000 255\n5 ", long)], "ends before"),
        (vec![("a.pgm", b"P5 4294967295 4294967295 255\n", long)], "cut short"),
        (vec![("a.bil", b"x", long), ("a.hdr", b"nrows 4294967295\nncols 4294967295\nnbits 64\nnbands 4294967295\nlayout bip\n", 0)], "beyond any file"),
        (vec![("a.bil", b"x", long), ("a.hdr", b"nrows 2\nncols 2\nnbits 64\nnbands 10000000\nlayout bip\n", 0)], "bytes apart"),
        (vec![("a.bil", b"x", long), ("a.hdr", b"nrows 2\nncols 2\n", long)], "unknown"),
        (vec![("a.dat", b"x", long), ("a.hdr", b"ENVI\nsamples = 99999\nlines = 99999\ndata type = 5\nheader offset = 18446744073709551615\n", 0)], "cut short"),
        (vec![("a.raw", b"x", long)], "state its shape"),
        (vec![("a.hgt", b"x", long)], "no tile"),
        (vec![("a.hgt.gz", b"\x1f\x8b\x08\0", long)], "no tile"),
        (vec![("a.zip", b"PK\x03\x04", long)], "zip archive"),
    ] {
        let said = refusal(&all, &plain);
        assert!(said.contains(wanted), "{said}");
    }
}

#[test]
fn bombs_are_refused_or_read_in_strips() {
    let _alone = alone();
    let plain = OpenOptions::default();
    // 467 MB of zeros in half a megabyte, said to be a tile of 5 x 5.
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    let zeros = vec![0u8; MIB];
    (0..450).for_each(|_| packer.write_all(&zeros).unwrap());
    let mut bomb = packer.finish().unwrap();
    let at = bomb.len() - 4;
    bomb[at..].copy_from_slice(&50u32.to_le_bytes());
    assert!(refusal(&[("N01E001.hgt.gz", &bomb, 0)], &plain).contains("there are not the 50 bytes"));
    // Rows of a picture in seven passes that is far larger than a strip: 20,000 x 4,000 of 16 bits, all zero.
    let (wide, high) = (20_000u32, 4_000u32);
    let mut rows = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    for [left, across, top, down] in
        [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2u32]]
    {
        let row = vec![0u8; 1 + 2 * (wide - left).div_ceil(across) as usize];
        (0..(high - top).div_ceil(down)).for_each(|_| rows.write_all(&row).unwrap());
    }
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        let begins = png.len();
        png.extend(name);
        png.extend(data);
        let sum = crc32fast::hash(&png[begins..]);
        png.extend(sum.to_be_bytes());
    };
    chunk(b"IHDR", &[&wide.to_be_bytes()[..], &high.to_be_bytes(), &[16, 0, 0, 0, 1]].concat());
    chunk(b"IDAT", &rows.finish().unwrap());
    chunk(b"IEND", &[]);
    let (_folder, path) = files(&[("a.png", &png, 0)]);
    let (done, bytes) = read(&path, &plain);
    assert_eq!(done.unwrap(), u64::from(wide) * u64::from(high));
    assert!(bytes < 80 * MIB, "{bytes} bytes of 160 MB");
}

#[test]
fn texts_of_millions_of_numbers_take_little_memory() {
    let _alone = alone();
    let plain = OpenOptions::default();
    let threads = rayon::current_num_threads();
    let side = 2000u32;
    let numbers: String = (0..side * side).map(|i| format!("{} ", i % 10)).collect();
    let text = format!("ncols {side}\nnrows {side}\n{numbers}");
    let (_folder, path) = files(&[("a.asc", text.as_bytes(), 0)]);
    let (done, bytes) = read(&path, &plain);
    assert_eq!(done.unwrap(), u64::from(side) * u64::from(side));
    assert!(bytes < (8 + 4 * threads) * MIB, "{bytes} bytes");
    // Points in order, and in any order: at most a strip.
    let side = 1200u32;
    for (name, step, most) in [("rows", 1, 8 + 6 * threads), ("any", 7919, 24 + 6 * threads)] {
        let count = side * side;
        let points: String = (0..count)
            .map(|i| (u64::from(i) * step % u64::from(count)) as u32)
            .map(|i| format!("{} {} {}\n", i % side, i / side, i % 100))
            .collect();
        let (_folder, path) = files(&[("a.xyz", points.as_bytes(), 0)]);
        let (done, bytes) = read(&path, &plain);
        assert_eq!(done.unwrap(), u64::from(count), "{name}");
        assert!(bytes < most * MIB, "{name}: {bytes} bytes");
    }
    // Points that are everywhere are given up as soon as that is seen.
    let scattered: String = (0..400_000u32)
        .map(|i| format!("{}.{} {}.5 1\n", i.wrapping_mul(2_654_435_761), i, i.wrapping_mul(40_503)))
        .collect();
    let (_folder, path) = files(&[("a.xyz", scattered.as_bytes(), 0)]);
    let (done, bytes) = read(&path, &plain);
    assert!(done.unwrap_err().to_string().contains("no grid"));
    assert!(bytes < (32 + 6 * threads) * MIB, "{bytes} bytes");
}

#[test]
fn surfer_grids_of_any_claim_end_in_words() {
    let _alone = alone();
    let options = OpenOptions::default();
    let sides =
        [0.0f64, 1.0, 0.0, 1.0, 0.0, 1.0].iter().flat_map(|side| side.to_le_bytes()).collect::<Vec<_>>();
    let binary_6 = [&b"DSBB\xff\x7f\xff\x7f"[..], &sides].concat();
    let grid = |rows: i32, columns: i32| {
        let counts = [rows, columns].into_iter().flat_map(|count| count.to_le_bytes());
        let reals = [0.0f64, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1e38];
        let content: Vec<u8> = counts.chain(reals.iter().flat_map(|real| real.to_le_bytes())).collect();
        [&b"DSRB\x04\0\0\0\x01\0\0\0GRID\x48\0\0\0"[..], &content, b"DATA\xff\xff\xff\x7f"].concat()
    };
    let endless = [&b"DSRB\0\0\0\0"[..], &b"FLTI\0\0\0\0".repeat(1 << 16)].concat();
    let negative = b"DSRB\x04\0\0\0\x01\0\0\0FLTI\xff\xff\xff\xff".to_vec();
    for bytes in [
        b"DSAA 2000000000 2000000000 0 1 0 1 0 1 5 6 7".to_vec(),
        b"DSAA 3 2 0 1 1 1 0 9 1 2 3 4 5 6".to_vec(),
        b"DSAA 3 2 nan 1 0 1 0 9 1 2 3 4 5 6".to_vec(),
        b"DSAA 3 2 0 1 0 1 0 9 1 2 3 4 5 6 7".to_vec(),
        b"DSAA 3 2 0 1 0 1 0 9 1 2 3 4 x 6".to_vec(),
        b"DSAA 3 2 0 1 0 1 0".to_vec(),
        b"DSAA".repeat(3000),
        b"DSBB".to_vec(),
        binary_6,
        grid(i32::MAX, i32::MAX),
        grid(-1, 5),
        grid(1, 5),
        endless,
        negative,
    ] {
        let said = refusal(&[("a.grd", &bytes, 0)], &options);
        assert!(said.contains("a.grd"), "{said}");
    }
    // What is there is read, and the rest of a text is not held.
    let rows = "7 ".repeat(1 << 20);
    let text = format!("DSAA 1024 1024 0 20460 0 20460 0 9 {rows}");
    let (_folder, path) = files(&[("b.grd", text.as_bytes(), 0)]);
    let (count, bytes) = read(&path, &options);
    assert!(count.unwrap() == 1 << 20 && bytes < 24 * MIB, "{bytes}");
}

#[test]
fn openexr_of_any_claim_ends_in_words() {
    let _alone = alone();
    let options = OpenOptions::default();
    let sound = include_bytes!("format_fixtures/float-zip.exr");
    let tiles = include_bytes!("format_fixtures/tiles.exr");
    let find =
        |bytes: &[u8], wanted: &[u8]| bytes.windows(wanted.len()).position(|part| part == wanted).unwrap();
    let window = |bytes: &[u8], corners: [i32; 4]| {
        let mut bytes = bytes.to_vec();
        let at = find(&bytes, b"dataWindow\0box2i\0") + 21;
        for (number, corner) in corners.iter().enumerate() {
            bytes[at + 4 * number..at + 4 * number + 4].copy_from_slice(&corner.to_le_bytes());
        }
        bytes
    };
    let tile = |sides: [u32; 2]| {
        let mut bytes = tiles.to_vec();
        let at = find(&bytes, b"tiles\0tiledesc\0") + 19;
        bytes[at..at + 4].copy_from_slice(&sides[0].to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&sides[1].to_le_bytes());
        bytes
    };
    for bytes in [
        window(sound, [0, 0, i32::MAX - 1, i32::MAX - 1]),
        window(sound, [i32::MIN, i32::MIN, i32::MAX, i32::MAX]),
        window(sound, [0, 0, 1 << 24, 36]),
        window(sound, [0, 0, 42, 1 << 26]),
        window(sound, [5, 5, 4, 4]),
        window(sound, [0, 0, 0, 36]),
        window(tiles, [0, 0, 1 << 20, 1 << 20]),
        tile([u32::MAX; 2]),
        tile([1 << 15; 2]),
        tile([0, 0]),
        sound[..9].to_vec(),
    ] {
        let (said, bytes) = peak(|| refusal(&[("a.exr", &bytes, 0)], &options));
        assert!(said.contains("a.exr") && bytes < 8 * MIB, "{bytes} bytes; {said}");
    }
}
