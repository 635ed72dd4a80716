//! Pictures far apart as one: the tiles are those of one picture with all of them, and memory follows what they cover. Alone in its process, whose memory it looks at.

mod common;

use common::drape::{Opened, land, raw};
use std::path::Path;
use std::time::{Duration, Instant};
use terrasoar_layout::imagery::{DrapeOptions, ImageSource, Imagery, MemoryImage, TileId, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// Small enough for all of them to lie within the terrain.
const TEXEL_M: f64 = 1.0 / 2048.0;

/// A colour of its own for each place of a mosaic, transparent here and there.
fn texel(x: u32, y: u32) -> [u8; 4] {
    let alpha = if (x / 9 + y / 7).is_multiple_of(5) { 0 } else { 255 };
    [(x * 7) as u8, (y * 3) as u8, ((x / 8) ^ (y / 8)) as u8, alpha]
}

/// A picture whose north-west corner is so many texels east and south of the mosaic's.
fn part([east, south]: [u32; 2], texels: [u32; 2]) -> Box<dyn ImageSource> {
    let mut image = MemoryImage::from_fn(texels, |x, y| texel(east + x, south + y));
    let [west, north] = [1100.0 + f64::from(east) * TEXEL_M, 4500.0 - f64::from(south) * TEXEL_M];
    let map = [west + 0.5 * TEXEL_M, TEXEL_M, 0.0, north - 0.5 * TEXEL_M, 0.0, -TEXEL_M];
    image.info_mut().georeference.pixel_to_crs = Some(map);
    Box::new(image)
}

/// A tile's texels and their mean colour.
type Tile = (Vec<u8>, Option<[u8; 4]>);

/// Every tile of a file, absent ones too.
fn tiles(path: &Path) -> Vec<Option<Tile>> {
    let terrain = Terrain::open(path).unwrap();
    let imagery = Imagery::open(&terrain).unwrap().unwrap();
    let shape = imagery.shape();
    let tile = |id| {
        let mut tile = Vec::new();
        let is_there = imagery.read_tile(&terrain, id, &mut tile).unwrap();
        is_there.then(|| (tile, imagery.average(id)))
    };
    shape.ids().map(tile).collect()
}

/// The most bytes of this process that ever were in memory; none where the system does not say.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?)
}

#[test]
fn pictures_far_apart_are_one_picture() {
    memory_and_time_follow_what_pictures_cover();
    pictures_apart_give_the_tiles_of_one_picture();
}

fn pictures_apart_give_the_tiles_of_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let places = [
        // The corners of the whole, one that overlaps, rows and columns of one texel, odd sizes.
        ([0, 0], [301, 77]),
        ([4100, 3801], [233, 200]),
        ([250, 40], [600, 30]),
        ([2000, 700], [1, 900]),
        ([1000, 2303], [1700, 1]),
        ([3000, 1500], [509, 513]),
        ([0, 3999], [2, 2]),
    ];
    let apart: Vec<_> = places.into_iter().map(|(at, size)| part(at, size)).collect();
    let [wide, high] = [4333_u32, 4001_u32];
    let mut whole = MemoryImage::from_fn([wide, high], |x, y| {
        let within = |([east, south], [wide, high]): &([u32; 2], [u32; 2])| {
            (*east..east + wide).contains(&x) && (*south..south + high).contains(&y)
        };
        // Where images are transparent the mosaic is, without a colour.
        let seen = texel(x, y);
        if places.iter().any(within) && seen[3] > 0 { seen } else { [0; 4] }
    });
    whole.info_mut().georeference.pixel_to_crs = apart[0].info().georeference.pixel_to_crs;
    let mut files = Vec::new();
    for (images, name) in [(apart, "apart.iqt"), (vec![Box::new(whole) as Box<dyn ImageSource>], "whole.iqt")]
    {
        let path = folder.path().join(name);
        land(&path);
        let done = drape(&path, &images, &raw().memory_mib(4096), &Silent).unwrap();
        assert_eq!(done.shape.texels, [wide, high]);
        files.push((done.shape, tiles(&path)));
    }
    assert!(files[0] == files[1]);
    let absent = files[0].1.iter().filter(|tile| tile.is_none()).count();
    assert!(absent > files[0].1.len() / 3, "{absent}");
}

/// Two pictures at opposite corners of 600,000 texels a side, and a third between: of strips as wide as the whole 4 GB would be kept.
fn memory_and_time_follow_what_pictures_cover() {
    const SIDE: u32 = 600_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    land(&path);
    let images = [
        part([0, 0], [700, 600]),
        part([SIDE - 800, SIDE - 500], [800, 500]),
        part([SIDE / 2, SIDE / 2], [300, 300]),
    ];
    let before = peak_bytes();
    let begun = Instant::now();
    let options = DrapeOptions::default().memory_mib(128);
    let done = drape(&path, &images, &options, &Silent).unwrap();
    let took = begun.elapsed();
    assert_eq!(done.shape.texels, [SIDE; 2]);
    if let (Some(before), Some(peak)) = (before, peak_bytes()) {
        // 16 bytes for each tile of the directory beside the rows, as it lies in memory and as it is written.
        let (taken, directory) = (peak - before, 16 * done.shape.tiles());
        println!("{taken} bytes, the directory {directory}; {took:?}");
        assert!(taken < (128 << 20) + 2 * directory, "{taken} bytes, the directory {directory}");
    }
    assert!(took < Duration::from_secs(60), "{took:?}");
    let opened = Opened::new(&path);
    for (id, is_there) in [([0, 1190], true), ([1190, 0], true), ([595, 595], true), ([600, 2], false)] {
        let tile = opened.tile(TileId { level: 0, x: id[0], y: id[1] });
        assert_eq!(tile.is_some(), is_there, "{id:?}");
    }
}
