//! Pictures of every format, told by content: opened, read, draped over a sound terrain; as they say, and by other bands or stretched.

use crate::land::PLAIN;
use crate::seeds::{self, Inputs};
use crate::words::{refused, told};
use std::num::NonZero;
use std::path::Path;
use terrasoar_import::{PictureOptions, Stretch, open_image, open_images, open_images_on};
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::imagery::{DrapeOptions, Extent, ImageSource, Imagery, TileFormat, decode_tile, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Texels of a picture that is read to its end and draped.
const MOST_TEXELS: u64 = 1 << 18;
/// Bytes of rows that are read of any other.
const MOST_BYTES: usize = 1 << 20;
/// Memory that draping may take, and that a picture read here may ask for.
const MEMORY_MIB: u64 = 64;

pub(crate) fn seeds() -> Inputs {
    let mut seeds =
        seeds::folder("import/tests/image_fixtures", &["png", "jpg", "tif", "webp", "jp2", "j2k", "jxl"]);
    // Elevation data are pictures too, as far as one can tell.
    seeds.extend(
        seeds::folder("import/tests/fixtures", &["tif"])
            .into_iter()
            .filter(|(name, _)| name.starts_with("byte")),
    );
    seeds
}

pub(crate) fn body(data: &[u8]) {
    let folder = crate::scratch::folder();
    let path = folder.path().join("picture");
    seeds::write(&path, &seeds::with_png_sums(data));
    if let Some(image) = told(open_image(&path)) {
        reads_and_drapes(image, folder.path());
    }
    brings(&path);
    let shown = open_images(std::slice::from_ref(&path), None, &options(data));
    told(shown).into_iter().flatten().for_each(|image| reads_and_drapes(image, folder.path()));
}

/// Bands and a stretch, other ones of other data.
fn options(data: &[u8]) -> PictureOptions {
    let pick = data.iter().fold(0u8, |sum, byte| sum.rotate_left(1) ^ byte);
    let bands: &[u32] = [&[3, 2, 1][..], &[1], &[], &[2, 2, 1]][usize::from(pick & 3)];
    let stretch = [
        Some(Stretch::Percentiles(2.0, 98.0)),
        Some(Stretch::Values(-100.0, 3000.0)),
        Some(Stretch::Percentiles(0.0, 100.0)),
        None,
    ][usize::from(pick >> 2 & 3)];
    PictureOptions {
        bands: bands.iter().filter_map(|band| NonZero::new(*band)).collect(),
        stretch,
        memory_mib: Some(MEMORY_MIB),
        ..PictureOptions::default()
    }
}

/// Brings a picture onto the terrain, from wherever it says it lies.
pub(crate) fn brings(path: &Path) {
    let source = MemorySource::new("plain", PLAIN.clone());
    let terrain = Terrain::from_source(Box::new(source)).unwrap_or_else(|error| panic!("{error}"));
    let folder = path.parent().unwrap_or(path);
    let brought = told(open_images_on(std::slice::from_ref(&path.to_owned()), terrain.header()));
    brought.into_iter().flatten().for_each(|image| reads_and_drapes(image, folder));
}

/// Reads a picture and drapes it, wherever it says it lies or, if that is nowhere, over the terrain.
pub(crate) fn reads_and_drapes(image: Box<dyn ImageSource>, folder: &Path) {
    let info = image.info().clone();
    let [wide, high] = info.texels.map(u64::from);
    assert!(wide > 0 && high > 0, "{info:?}");
    assert!(info.notes.iter().all(|note| !note.chars().any(char::is_control)), "{info:?}");
    if info.memory_bytes > MEMORY_MIB << 20 || wide * 4 > MOST_BYTES as u64 {
        return;
    }
    let whole = read_rows(&*image, [wide as usize, high as usize]);
    if wide * high > MOST_TEXELS {
        return;
    }
    let images = [image];
    for (extent, format) in
        [(None, TileFormat::Bc1), (Some(Extent::Metres([50.0, 60.0, 400.0, 300.0])), TileFormat::Rgba8)]
    {
        let options = DrapeOptions::default().format(format).extent(extent).memory_mib(MEMORY_MIB);
        let is_draped = drapes(&images, &options, folder);
        assert!(!is_draped || whole, "a picture was draped that cannot be read");
    }
}

/// Reads as many rows as fit; whether all of them could be read.
fn read_rows(image: &dyn ImageSource, [wide, high]: [usize; 2]) -> bool {
    let Some(mut rows) = told(image.rows()) else { return false };
    let mut left = high.min(MOST_BYTES / (wide * 4) + 1);
    let is_all = left == high;
    let step = 7.min(left);
    let mut buffer = vec![0; step * wide * 4];
    while left > 0 {
        let now = step.min(left);
        if told(rows.read(&mut buffer[..now * wide * 4])).is_none() {
            return false;
        }
        left -= now;
    }
    is_all
}

/// Drapes over a sound terrain; what is draped is sound, and what is not leaves the terrain as it was.
fn drapes(images: &[Box<dyn ImageSource>], options: &DrapeOptions, folder: &Path) -> bool {
    let path = folder.join("land.iqt");
    seeds::write(&path, &PLAIN);
    let is_draped = match drape(&path, images, options, &Silent) {
        Ok(draped) => {
            let terrain =
                Terrain::open(&path).unwrap_or_else(|error| panic!("draped and does not open: {error}"));
            assert!(
                terrain.header().to_page() == draped.header.to_page(),
                "what was draped is not what was told"
            );
            let report =
                verify(&terrain, &|_| {}).unwrap_or_else(|error| panic!("draped and not readable: {error}"));
            assert!(report.is_sound(), "draped and not sound: {:?}", report.problems);
            reads_tiles(&terrain, true);
            true
        }
        Err(error) => {
            refused(&error);
            assert!(
                std::fs::read(&path).is_ok_and(|bytes| bytes == *PLAIN),
                "refused, and the terrain is another: {error}"
            );
            false
        }
    };
    let left: Vec<_> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
    assert!(left.len() <= 3, "{left:?}");
    is_draped
}

/// Reads tiles of a terrain's picture, if it has one; in a sound file all of them can be read.
pub(crate) fn reads_tiles(terrain: &Terrain, is_sound: bool) {
    let opened = Imagery::open(terrain);
    assert!(opened.is_ok() || !is_sound, "called sound, and its picture does not open: {:?}", opened.err());
    let Some(Some(imagery)) = told(opened) else { return };
    assert!(!imagery.source().chars().any(|c| c == '\0'));
    let mut tile = Vec::new();
    for id in imagery.shape().ids().take(24) {
        let read = imagery.read_tile(terrain, id, &mut tile);
        assert!(read.is_ok() || !is_sound, "called sound, and a tile is not: {:?}", read.err());
        if told(read) == Some(true) {
            assert_eq!(tile.len(), imagery.shape().format.tile_bytes());
            let texels = decode_tile(imagery.shape().format, &tile);
            assert!(texels.is_some_and(|texels| texels.len() == TileFormat::Rgba8.tile_bytes()));
        }
    }
}
