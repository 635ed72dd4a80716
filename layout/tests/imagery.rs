//! Pictures draped over terrain: every texel of every level against a reference, the file against the text, places, atomicity for readers.

mod common;

use common::drape::{Opened, draped, land, raw};
use std::sync::atomic::{AtomicUsize, Ordering};
use terrasoar_layout::file::source::PreadSource;
use terrasoar_layout::imagery::{
    DrapeOptions, Extent, ImageSource, Imagery, MemoryImage, PlaceOrigin, TileFormat, TileId, drape,
};
use terrasoar_layout::progress::Progress;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::unused::unused_bytes;
use terrasoar_layout::verify::verify;

const INNER: i64 = 504;

/// A colour of sRGB in linear light, by the standard's own formulas.
fn linear(byte: f64) -> f64 {
    let value = byte / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn srgb(intensity: f64) -> f64 {
    255.0
        * if intensity <= 0.003_130_8 { intensity * 12.92 } else { 1.055 * intensity.powf(1.0 / 2.4) - 0.055 }
}

/// A level in floating point: colour times alpha in linear light, and alpha; rows from the south.
struct Level {
    wide: usize,
    high: usize,
    texels: Vec<[f64; 4]>,
}

impl Level {
    fn of(wide: usize, high: usize, texel: impl Fn(u32, u32) -> [u8; 4]) -> Self {
        let mut texels = Vec::new();
        for y in (0..high as u32).rev() {
            for x in 0..wide as u32 {
                let [r, g, b, a] = texel(x, y).map(f64::from);
                let alpha = a / 255.0;
                texels.push([linear(r) * alpha, linear(g) * alpha, linear(b) * alpha, alpha]);
            }
        }
        Self { wide, high, texels }
    }

    fn at(&self, x: i64, y: i64) -> [f64; 4] {
        let x = x.clamp(0, self.wide as i64 - 1) as usize;
        let y = y.clamp(0, self.high as i64 - 1) as usize;
        self.texels[y * self.wide + x]
    }

    /// Bytes at a place, which may lie outside; colours as unrounded values of sRGB.
    fn seen(&self, x: i64, y: i64) -> [f64; 4] {
        let [r, g, b, a] = self.at(x, y);
        if a == 0.0 { [0.0; 4] } else { [srgb(r / a), srgb(g / a), srgb(b / a), 255.0 * a] }
    }

    fn halved(&self) -> Self {
        let (wide, high) = (self.wide.div_ceil(2), self.high.div_ceil(2));
        let mut texels = Vec::new();
        for y in 0..high as i64 {
            for x in 0..wide as i64 {
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| (2 * x + dx, 2 * y + dy));
                let there: Vec<[f64; 4]> = four
                    .iter()
                    .filter(|(x, y)| *x < self.wide as i64 && *y < self.high as i64)
                    .map(|(x, y)| self.at(*x, *y))
                    .collect();
                texels.push(std::array::from_fn(|c| {
                    there.iter().map(|t| t[c]).sum::<f64>() / there.len() as f64
                }));
            }
        }
        Self { wide, high, texels }
    }
}

/// A picture with sharp edges, darkness, light and, if asked for, holes and veils.
fn texel(x: u32, y: u32, has_alpha: bool) -> [u8; 4] {
    let hash = (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)).wrapping_mul(0x7feb_352d) >> 24;
    let alpha = match (x / 40 + y / 56) % 5 {
        0 if has_alpha => 0,
        1 if has_alpha => (x * 3 + y) as u8,
        _ => 255,
    };
    [(x / 3) as u8, hash as u8, if (x / 8 + y / 8).is_multiple_of(2) { 3 } else { 250 }, alpha]
}

#[test]
fn every_texel_of_every_level_is_within_one_of_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    for ([wide, high], has_alpha) in
        [([1201, 1013], false), ([530, 1009], true), ([3, 2], false), ([1, 700], true), ([504, 504], false)]
    {
        land(&path);
        draped(&path, MemoryImage::from_fn([wide, high], |x, y| texel(x, y, has_alpha)), &raw()).unwrap();
        let opened = Opened::new(&path);
        let shape = opened.imagery.shape();
        let mut level = Level::of(wide as usize, high as usize, |x, y| texel(x, y, has_alpha));
        for l in 0..shape.levels {
            assert_eq!(shape.level_texels(l), [level.wide as u32, level.high as u32]);
            for id in shape.ids().filter(|id| id.level == l) {
                let [from_x, from_y] = [id.x, id.y].map(|tile| i64::from(tile) * INNER - 4);
                let Some(tile) = opened.tile(id) else {
                    let [covered_x, covered_y] = shape.covered_texels(id).map(i64::from);
                    let places = (4..4 + covered_y).flat_map(|v| (4..4 + covered_x).map(move |u| (u, v)));
                    for (u, v) in places {
                        assert!(level.seen(from_x + u, from_y + v)[3] < 1.0, "{id:?} is absent");
                    }
                    continue;
                };
                let mut sums = [0.0; 4];
                // Also beyond the picture, where its rim is repeated, and over the neighbours' borders: no seam.
                for (i, found) in (0i64..).zip(&tile) {
                    let (u, v) = (i % 512, i / 512);
                    let wanted = level.seen(from_x + u, from_y + v);
                    assert!(
                        (f64::from(found[3]) - wanted[3]).abs() <= 1.0,
                        "{id:?} {u} {v}: {found:?} {wanted:?}"
                    );
                    // A colour under a thin veil has few bits of its own.
                    let veil = if wanted[3] < 32.0 { 255.0 / wanted[3].max(1.0) } else { 1.0 };
                    for c in 0..3 {
                        let difference = (f64::from(found[c]) - wanted[c]).abs();
                        assert!(found[3] == 0 || difference <= veil, "{id:?} {u} {v}: {found:?} {wanted:?}");
                    }
                    let [covered_x, covered_y] = shape.covered_texels(id).map(i64::from);
                    if (4..4 + covered_x).contains(&u) && (4..4 + covered_y).contains(&v) {
                        let texel = level.at(from_x + u, from_y + v);
                        sums.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value);
                    }
                }
                let [r, g, b, a] = sums;
                let count: u32 = shape.covered_texels(id).iter().product();
                let mean = [srgb(r / a), srgb(g / a), srgb(b / a), 255.0 * a / f64::from(count)];
                let average = opened.imagery.average(id).unwrap();
                for c in 0..4 {
                    assert!((f64::from(average[c]) - mean[c]).abs() <= 1.0, "{id:?}: {average:?} {mean:?}");
                }
            }
            level = level.halved();
        }
        let report = verify(&opened.terrain, &|_| {}).unwrap();
        assert!(report.is_sound(), "{:?}", report.problems);
        assert_eq!(report.tiles_checked, opened.imagery.stored_tiles());
    }
}

#[test]
fn blocks_have_no_seam_beyond_their_own_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    let smooth = |x: u32, y: u32| {
        let wave = |f: f64| (f64::from(x) * f).sin() * 40.0 + (f64::from(y) * f * 0.7).cos() * 40.0 + 110.0;
        [wave(0.02) as u8, wave(0.021) as u8, wave(0.018) as u8, 255]
    };
    for format in [TileFormat::Bc1, TileFormat::Bc7] {
        land(&path);
        let options = DrapeOptions::default().format(format);
        if draped(&path, MemoryImage::from_fn([1500, 1100], smooth), &options).is_err() {
            assert_eq!(format, TileFormat::Bc7, "only Bc7 may lack an encoder");
            continue;
        }
        let opened = Opened::new(&path);
        let shape = opened.imagery.shape();
        let reference = Level::of(1500, 1100, smooth);
        let tiles: Vec<(TileId, Vec<[u8; 4]>)> =
            shape.ids().filter(|id| id.level == 0).map(|id| (id, opened.tile(id).unwrap())).collect();
        let error = |id: &TileId, tile: &[[u8; 4]], u: i64, v: i64| {
            let [x, y] = [i64::from(id.x) * INNER + u - 4, i64::from(id.y) * INNER + v - 4];
            let found = tile[(v * 512 + u) as usize];
            let wanted = reference.seen(x, y);
            (0..3).map(|c| (f64::from(found[c]) - wanted[c]).powi(2)).sum::<f64>() / 3.0
        };
        let mean = |places: &mut dyn Iterator<Item = (i64, i64)>, id: &TileId, tile: &[[u8; 4]]| {
            let errors: Vec<f64> = places.map(|(u, v)| error(id, tile, u, v)).collect();
            errors.iter().sum::<f64>() / errors.len() as f64
        };
        for (id, tile) in &tiles {
            let [covered_x, covered_y] = shape.covered_texels(*id).map(i64::from);
            let all =
                mean(&mut (4..4 + covered_y).flat_map(|v| (4..4 + covered_x).map(move |u| (u, v))), id, tile);
            let psnr_db = 10.0 * (255.0f64.powi(2) / all).log10();
            assert!(psnr_db > 40.0, "{format:?} {id:?}: {psnr_db:.1} dB");
            let east =
                mean(&mut (4..4 + covered_y).flat_map(|v| (0..8).map(move |u| (covered_x + u, v))), id, tile);
            let south = mean(&mut (4..4 + covered_x).flat_map(|u| (0..8).map(move |v| (u, v))), id, tile);
            assert!(
                east <= 2.0 * all + 0.5 && south <= 2.0 * all + 0.5,
                "{format:?} {id:?}: {all} {east} {south}"
            );
        }
    }
}

/// Section 8 of FORMAT.md, read with nothing but its offsets.
#[test]
fn imagery_decodes_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let old = std::fs::read(&path).unwrap();
    let colour = |x: u32, y: u32| [(10 * x) as u8, (20 * y) as u8, 7, 255];
    let options = raw().extent(Extent::Metres([-10.0, 100.0, 95.0, 130.0]));
    draped(&path, MemoryImage::from_fn([21, 10], colour), &options).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u16_at = |at: usize| u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap());
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let f64_at = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());

    // Slot B is current, slot A and everything else is as it was.
    assert_eq!(bytes[..4096], old[..4096]);
    assert_eq!(bytes[8192..old.len()], old[8192..]);
    let header = 4096;
    assert_eq!((u16_at(header + 0x008), u16_at(header + 0x00a), u32_at(header + 0x01c)), (1, 1, 2));
    assert_eq!(crc32fast::hash(&bytes[header..header + 0xffc]), u32_at(header + 0xffc));
    // Behind everything the mark of what was saved.
    let mark = bytes.len() - 64;
    assert_eq!(u64_at(header + 0x088), mark);
    assert_eq!((&bytes[mark..mark + 8], u32_at(mark + 0x08), u32_at(mark + 0x0c)), (&b"IQTSAVED"[..], 2, 2));
    assert!(bytes[mark + 0x10..mark + 0x3c].iter().all(|byte| *byte == 0));
    assert_eq!(crc32fast::hash(&bytes[mark..mark + 0x3c]), u32_at(mark + 0x3c));
    let section = u64_at(header + 0x090);
    assert_eq!(section, old.len().next_multiple_of(4096));
    assert_eq!(section + u64_at(header + 0x098), mark);

    assert_eq!(&bytes[section..section + 8], b"IQTIMAGE");
    assert_eq!((u16_at(section + 8), bytes[section + 0x0a], bytes[section + 0x0b]), (1, 3, 1));
    let fields: Vec<u32> = (0..5).map(|i| u32_at(section + 0x00c + 4 * i)).collect();
    assert_eq!(fields, [512, 4, 21, 10, 1]);
    let place: Vec<f64> = (0..4).map(|i| f64_at(section + 0x020 + 8 * i)).collect();
    assert_eq!(place, [-10.0, 100.0, 5.0, 3.0]);
    let length = 32 * 20 * 4;
    assert_eq!([0x040, 0x048, 0x050].map(|at| u64_at(section + at)), [1, 1, length]);
    let directory = u32_at(section + 0x058) as usize * 4096;
    assert_eq!(crc32fast::hash(&bytes[directory..directory + 16]), u32_at(section + 0x05c));
    assert_eq!(&bytes[section + 0x200..section + 0x208], b"\x06\x00memory");
    assert_eq!(crc32fast::hash(&bytes[section..section + 0xffc]), u32_at(section + 0xffc));

    let tile = u32_at(directory) as usize * 4096;
    assert_eq!(u32_at(directory + 4) as usize, length);
    assert_eq!(crc32fast::hash(&bytes[tile..tile + length]), u32_at(directory + 8));
    assert_eq!(bytes[directory + 14..directory + 16], [7, 255]);
    for v in 0..20i64 {
        for u in 0..32i64 {
            let (x, south) = ((u - 4).clamp(0, 20), (v - 4).clamp(0, 9));
            let at = tile + (v * 32 + u) as usize * 4;
            assert_eq!(bytes[at..at + 4], colour(x as u32, 9 - south as u32), "{u} {v}");
        }
    }
}

#[test]
fn the_same_pictures_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let picture = MemoryImage::from_fn([2100, 1300], |x, y| texel(x, y, y > 900));
    let mut files = Vec::new();
    for threads in [1, 2, 5] {
        let path = folder.path().join(format!("{threads}.iqt"));
        land(&path);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draped(&path, picture.clone(), &DrapeOptions::default())).unwrap();
        files.push(std::fs::read(path).unwrap());
    }
    assert!(files[0] == files[1] && files[1] == files[2]);
}

#[test]
fn georeferences_and_extents_lead_to_the_right_metre() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let picture = |map: Option<[f64; 6]>, epsg: Option<u32>| {
        let mut image = MemoryImage::from_fn([80, 60], |x, y| [x as u8, y as u8, 0, 255]);
        image.info_mut().georeference.pixel_to_crs = map;
        image.info_mut().georeference.epsg = epsg;
        image
    };
    // Centre of the north-west texel at 1101, 4699: 100 m east of the terrain's west, 2 m texels, 60 rows southwards from 700 m north.
    let upright = [1101.0, 2.0, 0.0, 4699.0, 0.0, -2.0];
    let done = draped(&path, picture(Some(upright), Some(32610)), &raw()).unwrap();
    assert_eq!(
        (done.place, done.shape.origin_m, done.shape.texel_m),
        (PlaceOrigin::Georeference, [100.0, 580.0], [2.0; 2])
    );
    let stated = |extent| raw().extent(extent);
    let done =
        draped(&path, picture(None, None), &stated(Extent::Crs([1040.0, 4100.0, 1200.0, 4160.0]))).unwrap();
    assert_eq!(
        (done.place, done.shape.origin_m, done.shape.texel_m),
        (PlaceOrigin::Stated, [40.0, 100.0], [2.0, 1.0])
    );
    let done = draped(&path, picture(None, None), &raw()).unwrap();
    assert_eq!(
        (done.place, done.shape.origin_m, done.shape.texel_m),
        (PlaceOrigin::Assumed, [0.0; 2], [15.0, 800.0 / 60.0])
    );

    let before = std::fs::read(&path).unwrap();
    let refused = |image: MemoryImage, options: &DrapeOptions, words: &str| {
        let error = draped(&path, image, options).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
        assert!(std::fs::read(&path).unwrap() == before, "{words}");
    };
    refused(picture(Some([1101.0, 2.0, 0.1, 4699.0, 0.1, -2.0]), None), &raw(), "rotated");
    refused(picture(Some([1101.0, 2.0, 0.0, 4699.0, 0.0, 2.0]), None), &raw(), "mirrored");
    refused(picture(Some(upright), Some(25832)), &raw(), "gdalwarp -t_srs EPSG:32610");
    refused(picture(Some([9e6, 2.0, 0.0, 4699.0, 0.0, -2.0]), None), &raw(), "do not meet");
    refused(picture(None, None), &stated(Extent::Metres([0.0, 0.0, 1e-9, 1.0])), "out of range");
    refused(picture(None, None), &raw().memory_mib(1), "of memory");
    refused(MemoryImage::from_fn([700, 20], |_, _| [9, 9, 9, 0]), &raw(), "transparent throughout");
}

#[test]
fn mosaics_join_where_their_georeferences_say() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let part = |east: f64, north: f64, texel_m: f64, colour: [u8; 4]| -> Box<dyn ImageSource> {
        let mut image = MemoryImage::from_fn([30, 20], move |x, _| if x < 3 { [0; 4] } else { colour });
        let map = [east + 0.5 * texel_m, texel_m, 0.0, north - 0.5 * texel_m, 0.0, -texel_m];
        image.info_mut().georeference.pixel_to_crs = Some(map);
        Box::new(image)
    };
    let progress = terrasoar_layout::progress::Silent;
    let [red, blue] = [[200, 0, 0, 255], [0, 0, 200, 255]];
    let images = [part(1100.0, 4500.0, 2.0, red), part(1140.0, 4480.0, 2.0, blue)];
    let done = drape(&path, &images, &raw(), &progress).unwrap();
    assert_eq!((done.shape.texels, done.shape.origin_m), ([50, 30], [100.0, 440.0]));
    let tile = Opened::new(&path).tile(TileId { level: 0, x: 0, y: 0 }).unwrap();
    let at = |x: usize, south: usize| tile[(4 + south) * 512 + 4 + x];
    // The blue one lies above the red one but for its transparent columns 20..23.
    assert_eq!([at(5, 29), at(22, 15), at(23, 15), at(40, 0)], [red, red, blue, blue]);
    assert_eq!([at(1, 29), at(5, 0), at(40, 29)], [[0; 4]; 3]);
    for (other, words) in [
        (part(1140.5, 4480.0, 2.0, blue), "between the texels"),
        (part(1140.0, 4480.0, 3.0, blue), "another size"),
        (Box::new(MemoryImage::from_fn([4, 4], |_, _| blue)), "does not say where it lies"),
    ] {
        let images = [part(1100.0, 4500.0, 2.0, red), other];
        let error = drape(&path, &images, &raw(), &progress).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
}

/// A map and a plain reader opened before see what they saw, and what is opened after sees the picture.
#[test]
fn readers_go_on_while_an_image_is_draped() {
    struct Watching<'t> {
        readers: &'t [Terrain],
        heights: &'t [Vec<u8>],
        calls: AtomicUsize,
    }
    impl Progress for Watching<'_> {
        fn stage(&self, _: &'static str, _: u64) {}
        fn advance(&self, _: u64) {
            for (reader, heights) in self.readers.iter().zip(self.heights) {
                assert!(&pages(reader) == heights);
            }
            self.calls.fetch_add(1, Ordering::Relaxed);
        }
    }
    fn pages(terrain: &Terrain) -> Vec<u8> {
        (0..terrain.header().record_pages()).flat_map(|p| terrain.checked_page(p).unwrap().to_vec()).collect()
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let open_both = || {
        [
            Terrain::open(&path).unwrap(),
            Terrain::from_source(Box::new(PreadSource::open(&path).unwrap())).unwrap(),
        ]
    };
    let readers = open_both();
    let heights: Vec<Vec<u8>> = readers.iter().map(pages).collect();
    let mut generations = vec![1];
    for _ in 0..3 {
        let watching = Watching { readers: &readers, heights: &heights, calls: AtomicUsize::new(0) };
        let picture: Vec<Box<dyn ImageSource>> =
            vec![Box::new(MemoryImage::from_fn([900, 300], |x, y| texel(x, y, false)))];
        drape(&path, &picture, &DrapeOptions::default(), &watching).unwrap();
        assert!(watching.calls.load(Ordering::Relaxed) > 3);
        let after = open_both();
        for terrain in &after {
            assert!(pages(terrain) == heights[0] && Imagery::open(terrain).unwrap().is_some());
        }
        generations.push(after[0].header().generation);
    }
    assert!(readers.iter().all(|reader| Imagery::open(reader).unwrap().is_none()));
    assert_eq!(generations, [1, 2, 3, 4]);
    // Two sections were replaced, of the same size as the third.
    let terrain = Terrain::open(&path).unwrap();
    let section = terrain.header().imagery.unwrap().bytes;
    let gap = unused_bytes(&terrain).unwrap() - 2 * section;
    assert!(gap < 4096, "{gap}");
}

/// A build that finishes meanwhile wins, and the drape says so.
#[test]
fn a_file_replaced_meanwhile_is_left_alone() {
    struct Replacing<'p>(&'p std::path::Path);
    impl Progress for Replacing<'_> {
        fn stage(&self, _: &'static str, _: u64) {}
        fn advance(&self, texels: u64) {
            if texels > 0 {
                // As a copy or a move does it, which ask nobody; a build would be told that somebody writes.
                let other = self.0.with_extension("other");
                land(&other);
                std::fs::rename(&other, self.0).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let before = std::fs::read(&path).unwrap();
    let picture: Vec<Box<dyn ImageSource>> =
        vec![Box::new(MemoryImage::from_fn([90, 60], |x, y| texel(x, y, false)))];
    let error = drape(&path, &picture, &DrapeOptions::default(), &Replacing(&path)).unwrap_err().to_string();
    assert!(error.contains("replaced by another") && error.contains("do it again"), "{error}");
    assert!(std::fs::read(&path).unwrap() == before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Tiles of one file read through another would be a picture of other ground.
#[test]
fn an_image_is_read_of_the_terrain_that_it_was_opened_of() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    draped(&path, MemoryImage::from_fn([61, 41], |x, y| [x as u8, y as u8, 90, 255]), &raw()).unwrap();
    let Opened { terrain, imagery } = Opened::new(&path);
    let (id, mut tile) = (TileId { level: 0, x: 0, y: 0 }, Vec::new());
    assert!(imagery.read_tile(&terrain, id, &mut tile).unwrap());
    let again = Terrain::open(&path).unwrap();
    let said = imagery.read_tile(&again, id, &mut tile).unwrap_err().to_string();
    assert!(said.contains("another terrain") && tile.is_empty(), "{said}");
}
