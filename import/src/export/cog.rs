//! The file itself: header, what GDAL calls its structural metadata, the directories of all levels, then tiles, the coarsest level first.
//!
//! Tiles are in the order of their rows, each with its length before it and its last four bytes again behind it, which the metadata promises: readers then need no table of lengths.
//! Tiles without a number are not there: their places and lengths are 0, as GDAL writes and reads sparse files. Places are known once all tiles are made, so the directories are made last and everything is written in one go. BigTIFF from some 4 GiB on.

use super::Meaning;
use super::encode::Numbers;
use super::keys::GeoKeys;
use super::place::Place;
use super::pyramid::{Level, Made, TILE};
use crate::tiff_tags::{CLASSIC_BYTES, LONG, LONG8, SHORT, Tags};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::file::disk::read_at;
use terrasoar_layout::progress::Progress;

/// What is promised of the file. The last line is ours: it tells our files from those that GDAL makes of them.
const STRUCTURE: &str = "LAYOUT=IFDS_BEFORE_DATA\nBLOCK_ORDER=ROW_MAJOR\nBLOCK_LEADER=SIZE_AS_UINT4\nBLOCK_TRAILER=LAST_4_BYTES_REPEATED\nKNOWN_INCOMPATIBLE_EDITION=NO\nMADE_BY=TERRASOAR\n";

/// Bytes before and behind a tile.
const AROUND: u64 = 8;

/// The structural metadata with their length.
fn structure() -> String {
    format!("GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{STRUCTURE}", STRUCTURE.len())
}

/// Whether a file that begins with `start`, of which 300 bytes are enough, could be one that was written here and not changed since.
pub fn is_exported(start: &[u8]) -> bool {
    let rest = match start {
        [b'I', b'I', b'*', 0, ..] => start.get(8..),
        [b'I', b'I', b'+', 0, ..] => start.get(16..),
        _ => None,
    };
    rest.is_some_and(|rest| rest.starts_with(structure().as_bytes()))
}

/// Writes everything to `out`; the bytes written.
pub(super) fn write(
    made: &Made,
    numbers: Numbers,
    meaning: &Meaning,
    place: &Place,
    keys: &GeoKeys,
    out: &Path,
    progress: &dyn Progress,
) -> Result<u64, LayoutError> {
    let tiles = || made.levels.iter().flat_map(Level::stored);
    let data: u64 = tiles().map(|tile| u64::from(tile.bytes) + AROUND).sum();
    progress.stage("arranging", tiles().count() as u64);
    // Tables take 16 bytes a tile at most, stored or not.
    let places: usize = made.levels.iter().map(|level| level.kept.len()).sum();
    let big = data + 16 * places as u64 > CLASSIC_BYTES;
    let mut directories: Vec<Tags> =
        made.levels.iter().enumerate().map(|(i, level)| level_tags(big, i > 0, level, numbers)).collect();
    describe(&mut directories[0], meaning, place, keys);

    // Lengths do not depend on places.
    let structure = structure();
    let first = (directories[0].header(0).len() + structure.len()).next_multiple_of(8) as u64;
    let mut places = vec![first];
    for directory in &directories {
        let end = places[places.len() - 1] + directory.directory(0, 0).len() as u64;
        places.push(end.next_multiple_of(8));
    }
    let mut at = places[directories.len()];
    let kind = if big { LONG8 } else { LONG };
    for (directory, level) in directories.iter_mut().zip(&made.levels).rev() {
        let offsets: Vec<u64> = level
            .kept
            .iter()
            .map(|tile| {
                if tile.bytes == 0 {
                    return 0;
                }
                let offset = at + AROUND / 2;
                at += u64::from(tile.bytes) + AROUND;
                offset
            })
            .collect();
        directory.numbers(324, kind, &offsets);
    }

    let file = AtomicFile::create(out)?;
    let failed = |e| {
        let when_full = "cannot write the file, for which there is no room; make some on its disk, or name an output on another";
        LayoutError::write(out, "cannot write the file", when_full, e)
    };
    let mut sink = BufWriter::with_capacity(1 << 20, file.file());
    let mut head = directories[0].header(first);
    head.extend(structure.as_bytes());
    for (i, directory) in directories.iter().enumerate() {
        head.resize(places[i] as usize, 0);
        let next = if i + 1 < directories.len() { places[i + 1] } else { 0 };
        head.extend(directory.directory(places[i], next));
    }
    head.resize(places[directories.len()] as usize, 0);
    sink.write_all(&head).map_err(failed)?;
    copy(made, &mut sink, progress).and_then(|()| sink.flush()).map_err(failed)?;
    drop(sink);
    file.publish()?;
    Ok(at)
}

/// Copies the tiles, the coarsest level first.
fn copy(made: &Made, out: &mut impl Write, progress: &dyn Progress) -> io::Result<()> {
    let mut bytes = Vec::new();
    for tile in made.levels.iter().rev().flat_map(Level::stored) {
        bytes.resize(tile.bytes as usize, 0);
        read_at(&made.spool, &mut bytes, tile.offset)?;
        out.write_all(&tile.bytes.to_le_bytes())?;
        out.write_all(&bytes)?;
        out.write_all(&bytes[bytes.len() - 4..])?;
        progress.advance(1);
    }
    Ok(())
}

/// What all levels say.
fn level_tags(big: bool, is_overview: bool, level: &Level, numbers: Numbers) -> Tags {
    let mut tags = Tags::new(big);
    if is_overview {
        tags.numbers(254, LONG, &[1]);
    }
    tags.numbers(256, LONG, &[level.size[0].into()]);
    tags.numbers(257, LONG, &[level.size[1].into()]);
    tags.numbers(258, SHORT, &[8 * numbers.bytes() as u64]);
    // DEFLATE with Adobe's number.
    tags.numbers(259, SHORT, &[8]);
    tags.numbers(262, SHORT, &[1]);
    tags.numbers(277, SHORT, &[1]);
    tags.numbers(284, SHORT, &[1]);
    tags.numbers(317, SHORT, &[numbers.predictor()]);
    tags.numbers(322, SHORT, &[TILE.into()]);
    tags.numbers(323, SHORT, &[TILE.into()]);
    let bytes: Vec<u64> = level.kept.iter().map(|tile| tile.bytes.into()).collect();
    tags.numbers(324, if big { LONG8 } else { LONG }, &bytes);
    tags.numbers(325, LONG, &bytes);
    tags.numbers(339, SHORT, &[numbers.sample_format()]);
    tags.text(42113, numbers.nodata());
    tags
}

/// What the finest level says of the whole file.
fn describe(tags: &mut Tags, meaning: &Meaning, place: &Place, keys: &GeoKeys) {
    tags.text(270, &ascii(&meaning.file));
    tags.text(305, concat!("Terrasoar ", env!("CARGO_PKG_VERSION")));
    match place {
        Place::NorthUp { size, first } => {
            tags.reals(33550, &[size[0], size[1], 0.0]);
            tags.reals(33922, &[0.0, 0.0, 0.0, first[0], first[1], 0.0]);
        }
        Place::Matrix([a, b, x, d, e, y]) => {
            let rows = [[*a, *b, 0.0, *x], [*d, *e, 0.0, *y], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
            tags.reals(34264, &rows.concat());
        }
    }
    tags.numbers(34735, SHORT, &keys.directory);
    if !keys.reals.is_empty() {
        tags.reals(34736, &keys.reals);
    }
    if !keys.texts.is_empty() {
        tags.text(34737, &keys.texts);
    }
    let band = ascii(&meaning.band).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    tags.text(
        42112,
        &format!(
            "<GDALMetadata>\n  <Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">{band}</Item>\n  \
             <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">m</Item>\n</GDALMetadata>\n"
        ),
    );
}

/// A text of seven-bit characters, as these tags have it.
fn ascii(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii() && !c.is_ascii_control() { c } else { '?' }).collect()
}
