//! Pictures made to exhaust memory or time, and world files that are none: words before the terrain file is touched.

#[path = "../../layout/tests/common/mod.rs"]
mod common;
#[path = "pictures/hostile_formats.rs"]
mod hostile_formats;
#[path = "import_support/packing.rs"]
mod packing;
#[path = "import_support/peak.rs"]
mod peak;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use common::drape::land;
use packing::packed;
use peak::{alone, peak};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use terrasoar_import::{PictureOptions, open_image, open_images};
use terrasoar_layout::imagery::{DrapeOptions, Draped, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::{LayoutError, Remedy};
use tiff::{DATA_AT, DEFLATE, JPEG, LZW, PACK_BITS, RAW, Tag, ZSTD, claimed, longs, shorts, tiff};

const MIB: usize = 1 << 20;

struct Bench {
    folder: TempDir,
    before: Vec<u8>,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        land(&folder.path().join("a.iqt"));
        let before = std::fs::read(folder.path().join("a.iqt")).unwrap();
        Self { folder, before }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        std::fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    /// Drapes the picture on two threads; also gives the memory that took.
    fn drape(&self, image: &Path, memory_mib: u64) -> (Result<Draped, LayoutError>, usize) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let options = DrapeOptions::default().memory_mib(memory_mib);
        peak(|| {
            pool.install(|| {
                let images = [open_image(image)?];
                drape(&self.path("a.iqt"), &images, &options, &Silent)
            })
        })
    }

    /// The words with which the picture is refused, in little time and memory, the terrain as it was.
    fn refusal(&self, image: &Path) -> LayoutError {
        let start = Instant::now();
        let (done, bytes) = self.drape(image, 64);
        let error = done.expect_err("it was draped");
        assert!(bytes < 24 * MIB, "{bytes} bytes: {error}");
        assert!(start.elapsed() < Duration::from_secs(60), "{:?}: {error}", start.elapsed());
        assert!(std::fs::read(self.path("a.iqt")).unwrap() == self.before, "{error}");
        error
    }
}

/// Tags of an RGB picture in tiles that lie where told.
fn picture(size: [u32; 2], compression: u16, tile: [u32; 2], places: &[(u32, u32)]) -> Vec<Tag> {
    let (offsets, lengths): (Vec<u32>, Vec<u32>) = places.iter().copied().unzip();
    vec![
        longs(256, &[size[0]]),
        longs(257, &[size[1]]),
        shorts(258, &[8, 8, 8]),
        shorts(259, &[compression]),
        shorts(262, &[2]),
        shorts(277, &[3]),
        longs(322, &[tile[0]]),
        longs(323, &[tile[1]]),
        longs(324, &offsets),
        longs(325, &lengths),
    ]
}

const PROGRESSIVE: &[u8] = include_bytes!("image_fixtures/progressive.jpg");
const BASELINE: &[u8] = include_bytes!("image_fixtures/baseline.jpg");

/// Where a JPEG's last scan begins and ends.
fn last_scan(jpeg: &[u8]) -> std::ops::Range<usize> {
    let start = jpeg.windows(2).rposition(|pair| pair == [0xff, 0xda]).unwrap();
    start..jpeg.len() - 2
}

fn with_scans(jpeg: &[u8], scans: usize) -> Vec<u8> {
    let scan = last_scan(jpeg);
    [&jpeg[..scan.start], &jpeg[scan.clone()].repeat(scans), &jpeg[scan.end..]].concat()
}

#[test]
fn jpegs_of_scans_without_end_are_refused() {
    let _alone = alone();
    let bench = Bench::new();
    for jpeg in [PROGRESSIVE, BASELINE] {
        let said = bench.refusal(&bench.write("a.jpg", &with_scans(jpeg, 2000))).to_string();
        assert!(said.contains("more than 100 scans"), "{said}");
    }
    assert!(bench.drape(&bench.write("a.jpg", PROGRESSIVE), 512).0.is_ok());
}

#[test]
fn jpegs_of_scans_without_end_inside_a_tiff_are_refused() {
    let _alone = alone();
    let bench = Bench::new();
    let sides = |jpeg: &[u8]| {
        let frame = jpeg.windows(2).position(|p| p[0] == 0xff && (p[1] == 0xc0 || p[1] == 0xc2)).unwrap();
        [7, 5].map(|at| u32::from(u16::from_be_bytes([jpeg[frame + at], jpeg[frame + at + 1]])))
    };
    let size = sides(BASELINE);
    let made = |jpeg: &[u8]| {
        let mut tags = picture(size, JPEG, size, &[(DATA_AT, jpeg.len() as u32)]);
        tags.push(shorts(262, &[6]));
        tiff(false, tags, jpeg)
    };
    assert!(bench.drape(&bench.write("a.tif", &made(BASELINE)), 512).0.is_ok());
    let bench = Bench::new();
    let said = bench.refusal(&bench.write("a.tif", &made(&with_scans(BASELINE, 2000)))).to_string();
    assert!(said.contains("tile 0 of 1") && said.contains("more than 100 scans"), "{said}");
}

/// A header of a few bytes that declares a picture of gigabytes.
#[test]
fn the_memory_of_a_jpeg_is_asked_for_before_it_is_taken() {
    let _alone = alone();
    let bench = Bench::new();
    for jpeg in [PROGRESSIVE, BASELINE] {
        let mut large = jpeg.to_vec();
        let frame = large.windows(2).position(|p| p[0] == 0xff && (p[1] == 0xc0 || p[1] == 0xc2)).unwrap();
        large[frame + 5..frame + 9].copy_from_slice(&[0xff, 0xdc, 0xff, 0xdc]);
        let error = bench.refusal(&bench.write("a.jpg", &large));
        let Some(Remedy::Memory { enough_mib: Some(enough) }) = error.remedy() else { panic!("{error}") };
        // All of a progressive picture, and some rows of another, which then turns out to be cut short.
        let is_whole = jpeg == PROGRESSIVE;
        assert!(if is_whole { enough > 18_000 } else { (64..1000).contains(&enough) }, "{error}");
        if !is_whole {
            let said = bench.drape(&bench.path("a.jpg"), enough).0.unwrap_err().to_string();
            assert!(said.contains("cut short"), "{said}");
        }
    }
}

/// What decoding takes is what was told, with threads or without.
#[test]
fn jpegs_take_no_more_memory_than_they_say() {
    let _alone = alone();
    let bench = Bench::new();
    // The fixtures, made larger: blocks that the stream does not have are grey.
    for jpeg in [PROGRESSIVE, BASELINE] {
        let mut large = jpeg.to_vec();
        let frame = large.windows(2).position(|p| p[0] == 0xff && (p[1] == 0xc0 || p[1] == 0xc2)).unwrap();
        large[frame + 5..frame + 9].copy_from_slice(&[8, 0, 8, 0]);
        let path = bench.write("a.jpg", &large);
        let image = open_image(&path).unwrap();
        let (_, bytes) = peak(|| image.rows().map(|mut rows| rows.read(&mut [0; 4 * 2048])));
        let told = image.info().memory_bytes as usize;
        assert!(bytes <= told + 2 * MIB, "{bytes} taken, {told} told");
    }
}

#[test]
fn tables_and_tiles_of_pictures_take_no_memory_before_it_is_allowed() {
    let _alone = alone();
    let bench = Bench::new();
    let long = |name: &str, bytes: &[u8], length: u64| {
        let path = bench.write(name, bytes);
        std::fs::File::options().write(true).open(&path).unwrap().set_len(length).unwrap();
        path
    };
    // A hundred million tiles of one texel.
    let side = 10_000u32;
    let mut tags = picture([side; 2], DEFLATE, [1, 1], &[]);
    tags.extend([claimed(324, 4, 100_000_000, 4096), claimed(325, 1, 100_000_000, 4096)]);
    let said = bench.refusal(&long("a.tif", &tiff(true, tags, &[]), 4096 + 400_000_000)).to_string();
    assert!(said.contains("none is stored"), "{said}");
    // One tile of 2^31 x 2^31 texels.
    let mut tags = picture([i32::MAX as u32; 2], DEFLATE, [i32::MAX as u32; 2], &[(DATA_AT, 64)]);
    tags.push(shorts(259, &[DEFLATE]));
    bench.refusal(&bench.write("b.tif", &tiff(false, tags, &[7; 64])));
    // Tiles that are far larger unpacked than the memory allowed.
    for compression in [DEFLATE, LZW, ZSTD, PACK_BITS] {
        let side = 8192;
        let tile = packed(compression, &vec![9; 3 * side as usize * side as usize]);
        let tags = picture([side; 2], compression, [side; 2], &[(DATA_AT, tile.len() as u32)]);
        let path = bench.write("c.tif", &tiff(false, tags, &tile));
        drop(tile);
        let error = bench.refusal(&path);
        let Some(Remedy::Memory { enough_mib: Some(enough) }) = error.remedy() else { panic!("{error}") };
        let (done, bytes) = Bench::new().drape(&path, enough);
        done.unwrap();
        assert!(bytes < (enough as usize + 8) * MIB, "{compression}: {bytes} bytes with {enough} MiB");
    }
    // One strip of raw texels in a hole: rows of it, as many as fit.
    let mut tags = picture([4096, 60_000], RAW, [4096, 60_000], &[(4096, 1)]);
    tags.push(longs(325, &[u32::MAX]));
    let path = long("d.tif", &tiff(false, tags, &[]), 4096 + 3 * 4096 * 60_000);
    let (done, bytes) = bench.drape(&path, 128);
    done.unwrap();
    assert!(bytes < 136 * MIB, "{bytes} bytes");
}

#[test]
fn a_large_picture_that_is_hardly_there_is_refused() {
    let _alone = alone();
    let bench = Bench::new();
    let tiles = 4u32 << 20 >> 6;
    let row = [9u8; 3 * 64 * 64];
    let mut places = vec![(0, 0); tiles as usize];
    places[7] = (DATA_AT, row.len() as u32);
    let tags = picture([64, 4 << 20], RAW, [64, 64], &places);
    let said = bench.refusal(&bench.write("a.tif", &tiff(false, tags, &row))).to_string();
    assert!(said.contains("only 4096 are stored") && said.contains("-projwin"), "{said}");
    // A thousandth of it is enough.
    places[..70].fill((DATA_AT, row.len() as u32));
    let tags = picture([64, 4 << 20], RAW, [64, 64], &places);
    assert!(open_image(&bench.write("a.tif", &tiff(false, tags, &row))).is_ok());
}

#[test]
fn tags_of_a_picture_take_no_memory() {
    let _alone = alone();
    let bench = Bench::new();
    let length = 3u64 << 30;
    let texels = vec![9; 3 * 16];
    for tag in [
        254, 256, 257, 258, 259, 262, 277, 284, 317, 320, 322, 323, 324, 325, 338, 339, 347, 34735, 34737,
        42113,
    ] {
        for (kind, bytes) in [(1, 1), (3, 2), (4, 4), (12, 8)] {
            let mut tags = picture([4, 4], RAW, [4, 4], &[(DATA_AT, texels.len() as u32)]);
            tags.push(claimed(tag, kind, (length - 4096) / bytes, 2048));
            let path = bench.write("a.tif", &tiff(false, tags, &texels));
            std::fs::File::options().write(true).open(&path).unwrap().set_len(length).unwrap();
            let (_, taken) = peak(|| open_image(&path).err());
            assert!(taken < 16 * MIB, "tag {tag} of type {kind}: {taken} bytes");
        }
    }
}

/// Chunks of a PNG in a row: a length, a name, the bytes, a checksum.
fn png(wide: u32, high: u32, chunks: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let header = [&wide.to_be_bytes()[..], &high.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, data) in [(b"IHDR", header)].iter().chain(chunks) {
        bytes.extend_from_slice(&(data.len() as u32).to_be_bytes());
        bytes.extend_from_slice(&name[..]);
        bytes.extend_from_slice(data);
        bytes.extend_from_slice(&crc32fast::hash(&[&name[..], data].concat()).to_be_bytes());
    }
    bytes
}

#[test]
fn pngs_hold_nothing_but_rows() {
    let _alone = alone();
    let bench = Bench::new();
    let row = packed(DEFLATE, &[0; 13].repeat(4));
    let end = |middle: Vec<(&'static [u8; 4], Vec<u8>)>| {
        let tail: [(&'static [u8; 4], Vec<u8>); 2] = [(b"IDAT", row.clone()), (b"IEND", vec![])];
        png(4, 4, &middle.into_iter().chain(tail).collect::<Vec<_>>())
    };
    let zeros = packed(DEFLATE, &vec![0; 200 * MIB]);
    let sound = [
        end(vec![(b"iCCP", [b"a\0\0", &zeros[..]].concat())]),
        end(vec![(b"zTXt", [b"a\0\0", &zeros[..]].concat())]),
        end(vec![(b"iTXt", [b"a\0\x01\0\0\0", &zeros[..]].concat())]),
        end(vec![(b"tEXt", [b"a\0", &vec![b' '; 30 * MIB][..]].concat())]),
        end((0..3000).map(|_| (b"tEXt", [b"a\0", &[b' '; 10_000][..]].concat())).collect()),
    ];
    drop(zeros);
    for bytes in sound {
        let path = bench.write("a.png", &bytes);
        drop(bytes);
        let (opened, taken) = peak(|| open_image(&path).and_then(|image| image.rows()?.read(&mut [0; 64])));
        opened.unwrap();
        assert!(taken < 8 * MIB, "{taken} bytes");
    }
    // A row of 16 GiB, and one that only the budget forbids.
    let said =
        bench.refusal(&bench.write("b.png", &png(i32::MAX as u32, 1, &[(b"IDAT", row.clone())]))).to_string();
    assert!(said.contains("a row of 2147483647 texels"), "{said}");
    let error = bench.refusal(&bench.write("c.png", &png(4 << 20, 9, &[(b"IDAT", row.clone())])));
    assert!(matches!(error.remedy(), Some(Remedy::Memory { .. })), "{error}");
    // What is beside the picture in one piece, and is no text.
    let bytes = end(vec![(b"eXIf", vec![0; 30 * MIB])]);
    let said = bench.refusal(&bench.write("d.png", &bytes)).to_string();
    assert!(said.contains("more than 4 MiB"), "{said}");
}

#[test]
fn world_files_that_are_none_are_told() {
    let _alone = alone();
    let bench = Bench::new();
    let picture = bench.write("a.jpg", BASELINE);
    let world = bench.path("a.jgw");
    for text in [
        &b"1 0 0 -1 0"[..],
        b"1\n0\n0\n-1\n0\n0\n7\n",
        b"1 0 0 -1 nan 0",
        b"1 0 0 -1 0 x",
        b"\xff\xfe1",
        &b" ".repeat(4097),
        b"",
    ] {
        std::fs::write(&world, text).unwrap();
        let error = bench.refusal(&picture);
        let said = error.to_string();
        assert!(said.contains("a.jgw") && said.contains("six numbers"), "{said}");
        assert_eq!(error.remedy(), Some(Remedy::Extent));
    }
    std::fs::write(&world, "2 0 0 -2 1001 4799\n").unwrap();
    let map = open_image(&picture).unwrap().info().georeference.pixel_to_crs;
    assert_eq!(map, Some([1001.0, 2.0, 0.0, 4799.0, 0.0, -2.0]));
    // Of several the first in order counts, and one that leads nowhere is none.
    std::fs::write(bench.path("a.wld"), "nonsense").unwrap();
    open_image(&picture).unwrap();
}

#[cfg(unix)]
#[test]
fn world_files_and_pictures_that_are_no_files_are_refused_without_waiting() {
    use std::os::unix::fs::symlink;
    let _alone = alone();
    let bench = Bench::new();
    let pipe =
        |path: &Path| assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    for (name, world) in [("a.jpg", "a.jgw"), ("b.jpg", "b.wld"), ("c.png", "c.pgw")] {
        let bytes = if name.ends_with("png") {
            let rows = packed(DEFLATE, &[0; 13].repeat(4));
            png(4, 4, &[(b"IDAT", rows), (b"IEND", vec![])])
        } else {
            BASELINE.to_vec()
        };
        let picture = bench.write(name, &bytes);
        let world = bench.path(world);
        symlink("/dev/zero", &world).unwrap();
        assert!(bench.refusal(&picture).to_string().contains("device"));
        std::fs::remove_file(&world).unwrap();
        pipe(&world);
        assert!(bench.refusal(&picture).to_string().contains("pipe"));
        std::fs::remove_file(&world).unwrap();
        std::fs::create_dir(&world).unwrap();
        assert!(bench.refusal(&picture).to_string().contains("folder"));
        std::fs::remove_dir(&world).unwrap();
        symlink("nowhere", &world).unwrap();
        open_image(&picture).unwrap();
    }
    for name in ["pipe.tif", "pipe.png", "pipe.jpg"] {
        pipe(&bench.path(name));
        assert!(bench.refusal(&bench.path(name)).to_string().contains("pipe"));
    }
    assert!(bench.refusal(Path::new("/dev/zero")).to_string().contains("device"));
}
