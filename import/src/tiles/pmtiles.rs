//! PMTiles version 3: one file with directories of tiles, numbered along a curve that fills the world zoom by zoom.
//!
//! A header of 127 bytes, a root directory, leaf directories, and the tiles. A directory's entry says where the bytes of a run of equal tiles are, or where a leaf is. This is our own code, because
//! crate `pmtiles` reads by futures alone and brings a runtime for them. Leaves hold only numbers between those of their entry and of the next one, so none can lead back to another. Cost: a
//! leaf is unpacked when it is needed, and the last few are kept.

use super::about::{About, MAX_TEXT_BYTES, sound};
use super::archive::{Archive, Level, Levels};
use super::curve::{Block, FIRST, blocks, id_of};
use super::directory::{Directory, Entry};
use super::grid::{MAX_ZOOM, Span, Tile};
use crate::geotiff::unpack_zstd;
use crate::guard::guard;
use crate::input;
use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;

/// How such a file begins.
pub(super) const MAGIC: &[u8] = b"PMTiles";
const HEADER_BYTES: usize = 127;
/// Longest directory, unpacked.
const MAX_DIRECTORY_BYTES: u64 = 16 << 20;
/// How deep leaves lie in leaves.
const DEEPEST: u32 = 4;
/// Entries of leaves that are kept, and leaves, which are looked through one by one.
const KEPT_ENTRIES: usize = 1 << 17;
const KEPT_LEAVES: usize = 64;
/// Entries that a survey goes through: a world of zoom 15 has some hundred million.
const MOST_ENTRIES: u64 = 1 << 29;

/// An archive of tiles.
pub(super) struct Pmtiles {
    path: PathBuf,
    file: File,
    about: About,
    packing: Packing,
    tile_packing: Packing,
    /// First byte and length of the leaves, and of the tiles.
    leaves: [u64; 2],
    tiles: [u64; 2],
    root: Arc<Directory>,
    /// Leaves by their place in the file, the last one first.
    kept: Mutex<VecDeque<([u64; 2], Arc<Directory>)>>,
}

/// How bytes are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packing {
    None,
    Gzip,
    Zstd,
}

fn packing(path: &Path, what: &str, code: u8) -> Result<Packing, LayoutError> {
    let other = match code {
        1 => return Ok(Packing::None),
        2 => return Ok(Packing::Gzip),
        4 => return Ok(Packing::Zstd),
        3 => "by Brotli".to_owned(),
        code => format!("in an unknown way ({code})"),
    };
    Err(LayoutError::unsupported(
        path,
        format!(
            "its {what} are packed {other}, and read are gzip, Zstandard and none; write it again, for example with: pmtiles convert"
        ),
    ))
}

impl Pmtiles {
    /// Reads header, metadata and root directory.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let action = "cannot read the PMTiles file";
        let file = input::open(path, action)?;
        let length = file.metadata().map_err(|source| LayoutError::io(path, action, source))?.len();
        let damaged = |problem: &str| LayoutError::damaged(path, "header", problem);
        let mut header = [0; HEADER_BYTES];
        if length < HEADER_BYTES as u64 {
            return Err(damaged("the file is cut short; fetch it again"));
        }
        read_at(&file, &mut header, 0).map_err(|source| LayoutError::io(path, action, source))?;
        if header[7] != 3 {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "it is PMTiles of version {}, and version 3 is read; convert it with: pmtiles convert",
                    header[7]
                ),
            ));
        }
        let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let degrees =
            |at: usize| f64::from(i32::from_le_bytes(std::array::from_fn(|i| header[at + i]))) / 1e7;
        let part = |at: usize, name: &str| {
            let part = [number(at), number(at + 8)];
            let ends = part[0].checked_add(part[1]).filter(|end| *end <= length);
            ends.map(|_| part)
                .ok_or_else(|| damaged(&format!("its {name} lie beyond the end of the file; fetch it again")))
        };
        let format = match header[99] {
            1 => "vector tiles",
            5 => "AVIF",
            6 => "MapLibre vector tiles",
            _ => "",
        };
        let mut archive = Self {
            path: path.to_owned(),
            about: About { format: (!format.is_empty()).then(|| format.to_owned()), ..About::default() },
            packing: packing(path, "directories", header[97])?,
            tile_packing: packing(path, "tiles", if header[98] == 0 { 1 } else { header[98] })?,
            leaves: part(40, "leaf directories")?,
            tiles: part(56, "tiles")?,
            file,
            root: Arc::default(),
            kept: Mutex::default(),
        };
        let (root, metadata) = (part(8, "root directory")?, part(24, "metadata")?);
        archive.root = Arc::new(archive.directory(root, "root directory")?);
        if metadata[1] > 0 {
            let json = archive.unpacked(metadata, MAX_TEXT_BYTES, "metadata")?;
            archive.about.take_json(&serde_json::from_slice(&json).unwrap_or_default(), "its metadata");
        }
        let bounds = [degrees(102), degrees(106), degrees(110), degrees(114)];
        archive.about.bounds = sound(bounds).or(archive.about.bounds);
        Ok(archive)
    }

    /// The bytes of a part of the file, unpacked.
    fn unpacked(&self, part: [u64; 2], most: u64, place: &str) -> Result<Vec<u8>, LayoutError> {
        let packed = self.read(part, most, place)?;
        unpack(&self.path, place, self.packing, packed, most)
    }

    fn read(&self, [at, length]: [u64; 2], most: u64, place: &str) -> Result<Vec<u8>, LayoutError> {
        if length > most {
            return Err(too_long(&self.path, place, most));
        }
        let mut bytes = vec![0; length as usize];
        read_at(&self.file, &mut bytes, at)
            .map_err(|source| LayoutError::io(&self.path, "cannot read the PMTiles file", source))?;
        Ok(bytes)
    }

    fn directory(&self, part: [u64; 2], place: &str) -> Result<Directory, LayoutError> {
        let bytes = self.unpacked(part, MAX_DIRECTORY_BYTES, place)?;
        Directory::parse(&bytes).map_err(|problem| LayoutError::damaged(&self.path, place, problem))
    }

    /// The leaf of an entry, whose numbers are from the entry's to `end`.
    fn leaf(&self, entry: &Entry, end: u64) -> Result<Arc<Directory>, LayoutError> {
        let place = || format!("leaf directory of tile number {}", entry.id);
        let damaged = |problem: &str| LayoutError::damaged(&self.path, place(), problem);
        let [first, length] = self.leaves;
        let lies_in = entry.offset.checked_add(entry.length).is_some_and(|end| end <= length);
        if !lies_in {
            return Err(damaged("it lies beyond the leaf directories; fetch the file again"));
        }
        let part = [first + entry.offset, entry.length];
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().position(|(key, _)| *key == part);
        let leaf = match found.and_then(|at| kept.remove(at)) {
            Some((_, leaf)) => leaf,
            None => Arc::new(self.directory(part, &place())?),
        };
        kept.push_front((part, Arc::clone(&leaf)));
        while kept.len() > 1
            && (kept.len() > KEPT_LEAVES
                || kept.iter().map(|(_, leaf)| leaf.len()).sum::<usize>() > KEPT_ENTRIES)
        {
            kept.pop_back();
        }
        if leaf.first().is_none() {
            return Err(damaged("it leads to no tile; fetch the file again"));
        }
        if leaf.first().is_some_and(|first| first < entry.id) || leaf.end() > end {
            return Err(damaged("its tiles are not those that it is for; fetch the file again"));
        }
        Ok(leaf)
    }

    /// The entry of the tile of a number.
    fn find(&self, id: u64) -> Result<Option<Entry>, LayoutError> {
        let (mut directory, mut end) = (Arc::clone(&self.root), u64::MAX);
        for _ in 0..=DEEPEST {
            let Some((entry, next)) = directory.find(id) else { return Ok(None) };
            end = end.min(next);
            if entry.run > 0 {
                return Ok((id - entry.id < entry.run).then_some(entry));
            }
            directory = self.leaf(&entry, end)?;
        }
        Err(self.too_deep())
    }

    fn too_deep(&self) -> LayoutError {
        LayoutError::damaged(
            &self.path,
            "leaf directories",
            format!("they lie more than {DEEPEST} deep in each other; fetch the file again"),
        )
    }

    fn walk(
        &self,
        directory: &Directory,
        end: u64,
        depth: u32,
        spans: &[Option<Span>],
        seen: &mut u64,
        each: &mut dyn FnMut(Block),
    ) -> Result<(), LayoutError> {
        *seen += directory.len().max(1) as u64;
        if *seen > MOST_ENTRIES {
            return Err(LayoutError::unsupported(
                &self.path,
                "it has more tiles than can be counted; take the part you need out of it with the program pmtiles (extract)",
            ));
        }
        for (entry, next) in directory.entries() {
            if entry.run > 0 {
                blocks(entry.id, entry.run, each);
            } else if depth == 0 {
                return Err(self.too_deep());
            } else if touches(spans, entry.id, next.min(end)) {
                let end = next.min(end);
                let leaf = self.leaf(&entry, end)?;
                self.walk(&leaf, end, depth - 1, spans, seen, each)?;
            }
        }
        Ok(())
    }

    fn tile_part(&self, tile: Tile, entry: &Entry) -> Result<[u64; 2], LayoutError> {
        let [first, length] = self.tiles;
        let ends = entry.offset.checked_add(entry.length).filter(|end| *end <= length);
        ends.map(|_| [first + entry.offset, entry.length]).ok_or_else(|| {
            let problem = "its bytes lie beyond the end of the file; fetch it again";
            LayoutError::damaged(&self.path, self.label(tile), problem)
        })
    }
}

/// Whether tiles of numbers from `id` to before `end` can be among those of the columns and rows of each zoom.
fn touches(spans: &[Option<Span>], id: u64, end: u64) -> bool {
    let mut some = false;
    blocks(id, end.saturating_sub(id), &mut |block| {
        let span = spans.get(usize::from(block.zoom)).copied().flatten();
        some |= span.and_then(|span| span.shared(block.span)).is_some();
    });
    some
}

fn too_long(path: &Path, place: &str, most: u64) -> LayoutError {
    LayoutError::damaged(
        path,
        place,
        format!("it takes more than the {most} bytes that it may; fetch the file again"),
    )
}

fn unpack(
    path: &Path,
    place: &str,
    packing: Packing,
    packed: Vec<u8>,
    most: u64,
) -> Result<Vec<u8>, LayoutError> {
    let damaged = || LayoutError::damaged(path, place, "its packed bytes are damaged; fetch the file again");
    let unpacked = match packing {
        Packing::None => return Ok(packed),
        Packing::Gzip => {
            let mut bytes = Vec::new();
            flate2::read::GzDecoder::new(&packed[..])
                .take(most + 1)
                .read_to_end(&mut bytes)
                .map_err(|_| damaged())?;
            bytes
        }
        Packing::Zstd => {
            guard(path, || place.to_owned(), || unpack_zstd(&packed, most as usize + 1).ok_or_else(damaged))?
        }
    };
    if unpacked.len() as u64 > most { Err(too_long(path, place, most)) } else { Ok(unpacked) }
}

impl Archive for Pmtiles {
    fn path(&self) -> &Path {
        &self.path
    }

    fn kind(&self) -> &'static str {
        "PMTiles"
    }

    fn about(&self) -> &About {
        &self.about
    }

    fn memory_bytes(&self) -> u64 {
        let entries = (self.root.len() + KEPT_ENTRIES) as u64;
        // And a leaf that is being unpacked.
        entries * size_of::<Entry>() as u64 + (8 << 20)
    }

    fn survey(&self, within: &dyn Fn(u8) -> Option<Span>) -> Result<Levels, LayoutError> {
        let spans: Vec<Option<Span>> = (0..=MAX_ZOOM).map(within).collect();
        let mut levels = Levels::new();
        let mut count = |block: Block| {
            let shared = spans[usize::from(block.zoom)].and_then(|span| span.shared(block.span));
            let Some(span) = shared else { return };
            let first = span.tile(block.zoom, 0);
            let level =
                levels.entry(block.zoom).or_insert_with(|| Level { count: 0, span, samples: Vec::new() });
            level.count = level.count.saturating_add(span.count());
            level.span = level.span.around(span);
            level.look_at(first);
        };
        self.walk(&self.root, FIRST[usize::from(MAX_ZOOM) + 1], DEEPEST, &spans, &mut 0, &mut count)?;
        Ok(levels)
    }

    fn each_span(&self, zoom: u8, within: Span, each: &mut dyn FnMut(Span)) -> Result<(), LayoutError> {
        let mut spans = vec![None; usize::from(MAX_ZOOM) + 1];
        spans[usize::from(zoom)] = Some(within);
        let mut block = |block: Block| {
            if let Some(span) = within.shared(block.span).filter(|_| block.zoom == zoom) {
                each(span);
            }
        };
        self.walk(&self.root, FIRST[usize::from(MAX_ZOOM) + 1], DEEPEST, &spans, &mut 0, &mut block)
    }

    fn has(&self, tile: Tile) -> Result<bool, LayoutError> {
        self.find(id_of(tile)).map(|entry| entry.is_some())
    }

    fn fetch(&self, tile: Tile, most: u64, into: &mut Vec<u8>) -> Result<bool, LayoutError> {
        let Some(entry) = self.find(id_of(tile))? else { return Ok(false) };
        let part = self.tile_part(tile, &entry)?;
        if part[1] > most {
            return Err(self.too_long(tile, part[1], most));
        }
        let packed = self.read(part, most, "tile")?;
        *into = unpack(&self.path, &self.label(tile), self.tile_packing, packed, most)?;
        Ok(true)
    }
}
