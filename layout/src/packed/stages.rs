//! The stages of unpacking, each by itself: for the benchmark that says what they cost.

use super::coder::{Coder, Decoder};
use super::places::TilePlace;
use super::shape::{SEGMENTS, TileId, TileShape};
use super::source::PackedSource;
use super::walk::{Scratch, walk};
use super::wide::Width;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, checksum};
use crate::file::source::{MemorySource, Source};
use std::hint::black_box;

/// A way of reading tiles that this processor has.
#[derive(Debug, Clone, Copy)]
pub struct Way(Width);

impl Way {
    /// All there are, the portable one first.
    pub fn all() -> Vec<Self> {
        Width::all().into_iter().map(Self).collect()
    }

    /// Whether every processor has it.
    pub fn is_portable(self) -> bool {
        self.0 == Width::PORTABLE
    }

    /// A name for it.
    pub fn name(self) -> String {
        format!("{:?}", self.0)
    }
}

/// A packed file in memory, and what its tiles ask for while they are unpacked.
pub struct Stages {
    source: PackedSource,
    tiles: Vec<Tile>,
    scratch: Scratch,
    records: u64,
    /// Record pages by their place on the ground.
    by_place: Vec<u64>,
}

struct Tile {
    id: TileId,
    shape: TileShape,
    place: TilePlace,
    bytes: Vec<u8>,
    segments: [Recorded; SEGMENTS],
}

/// What was asked of a segment, and what it gave.
#[derive(Debug, Default, Clone)]
struct Recorded {
    rows: Vec<(u16, Vec<u8>, Vec<u16>)>,
    singles: Vec<u16>,
}

/// Notes what a decoder is asked for.
struct Noting<'b> {
    decoder: Decoder<'b>,
    noted: Recorded,
}

impl Coder for Noting<'_> {
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        self.decoder.values(first, contexts, values);
        self.noted.rows.push((first, contexts.to_vec(), values.to_vec()));
    }

    fn value(&mut self, context: u16, turn: usize, value: &mut u16) {
        self.decoder.value(context, turn, value);
        self.noted.singles.push(*value);
    }

    fn raw(&mut self, bits: u32, value: &mut u16) {
        self.decoder.raw(bits, value);
        self.noted.singles.push(*value);
    }
}

/// Gives what was noted, without decoding anything.
struct Giving<'n> {
    noted: &'n Recorded,
    row: usize,
    single: usize,
}

impl Coder for Giving<'_> {
    #[inline(always)]
    fn values(&mut self, _: u16, _: &[u8], values: &mut [u16]) {
        values.copy_from_slice(&self.noted.rows[self.row].2);
        self.row += 1;
    }

    fn value(&mut self, _: u16, _: usize, value: &mut u16) {
        *value = self.noted.singles[self.single];
        self.single += 1;
    }

    fn raw(&mut self, _: u32, value: &mut u16) {
        *value = self.noted.singles[self.single];
        self.single += 1;
    }
}

impl Stages {
    /// Opens a packed file's bytes, and unpacks it once.
    ///
    /// # Errors
    /// As opening and reading it has.
    pub fn open(bytes: Vec<u8>) -> Result<Self, LayoutError> {
        let inner = MemorySource::new("packed", bytes);
        let source = PackedSource::open(Box::new(inner))?;
        let Some(rules) = source.rules() else {
            return Err(LayoutError::Usage(
                "its records are exact; the stages are those of compact ones".into(),
            ));
        };
        let (width, mut scratch) = (source.width(), Scratch::default());
        let mut tiles = Vec::new();
        for (id, shape, place) in source.all_tiles()? {
            let mut bytes = vec![0; place.bytes(SEGMENTS)];
            source.packed().read_at(place.offset, &mut bytes)?;
            let mut rest = &bytes[..];
            let mut segments = Vec::new();
            for length in place.lengths {
                let (segment, after) = rest.split_at(length.into());
                let Some(decoder) = Decoder::new(width, source.tables(), segment) else { break };
                segments.push(Noting { decoder, noted: Recorded::default() });
                rest = after;
            }
            walk(width, &shape, rules, &mut scratch, &mut &mut segments[..], None);
            let mut noted: Vec<Recorded> = segments.into_iter().map(|segment| segment.noted).collect();
            noted.resize(SEGMENTS, Recorded::default());
            let segments: [Recorded; SEGMENTS] = noted.try_into().unwrap_or_default();
            tiles.push(Tile { id, shape, place, bytes, segments });
        }
        let records = source.record_pages() * (PAGE_BYTES as u64 / 4);
        Ok(Self { source, tiles, scratch, records, by_place: Vec::new() })
    }

    /// Records of all pages that are present.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Reads tiles this way from now on.
    pub fn read(&mut self, way: Way) {
        self.source.set_width(way.0);
    }

    /// All values, without what is made of them.
    pub fn values(&mut self) {
        let (width, mut found) = (self.source.width(), vec![0; 1 << 13]);
        for tile in &self.tiles {
            let mut rest = &tile.bytes[..];
            for (length, noted) in tile.place.lengths.iter().zip(&tile.segments) {
                let (segment, after) = rest.split_at(usize::from(*length));
                let Some(mut decoder) = Decoder::new(width, self.source.tables(), segment) else { break };
                for (first, contexts, values) in &noted.rows {
                    decoder.values(*first, contexts, &mut found[..values.len()]);
                }
                black_box(&mut found);
                rest = after;
            }
        }
    }

    /// All that is made of values: predictions, contexts, codes, records in the order of tiles.
    pub fn making(&mut self) {
        let (Some(rules), width) = (self.source.rules(), self.source.width()) else { return };
        for tile in &self.tiles {
            let mut segments = tile.segments.each_ref().map(|noted| Giving { noted, row: 0, single: 0 });
            black_box(walk(width, &tile.shape, rules, &mut self.scratch, &mut &mut segments[..], None));
        }
    }

    /// All tiles: both together, with the checksums of their segments.
    ///
    /// # Errors
    /// Damage.
    pub fn tiles(&mut self) -> Result<(), LayoutError> {
        for tile in &self.tiles {
            black_box(self.source.unpack(tile.id, &tile.shape, &tile.place, SEGMENTS)?);
        }
        Ok(())
    }

    /// All record pages, neighbours one after the other, as those do who unpack the whole; tiles are unpacked anew as far as they are not kept.
    ///
    /// # Errors
    /// Damage.
    pub fn neighbours(&mut self) -> Result<(), LayoutError> {
        if self.by_place.is_empty() {
            self.by_place = (3..3 + self.source.record_pages()).collect();
            self.by_place.sort_by_cached_key(|number| self.source.place_of(*number));
        }
        let mut page = vec![0; PAGE_BYTES];
        for number in &self.by_place {
            self.source.read_at(number * PAGE_BYTES as u64, &mut page)?;
            black_box(&mut page);
        }
        Ok(())
    }

    /// All record pages in the order of the file.
    ///
    /// # Errors
    /// Damage.
    pub fn pages(&mut self) -> Result<(), LayoutError> {
        let mut bytes = vec![0; 64 << 10];
        let end = (3 + self.source.record_pages()) * PAGE_BYTES as u64;
        let mut at = 3 * PAGE_BYTES as u64;
        while at < end {
            let count = (end - at).min(bytes.len() as u64);
            self.source.read_at(at, &mut bytes[..count as usize])?;
            at += count;
            black_box(&mut bytes);
        }
        Ok(())
    }

    /// Checksums of as many pages as there are.
    pub fn checksums(&self) {
        let page = [7; PAGE_BYTES];
        (0..self.source.record_pages()).for_each(|_| {
            black_box(checksum(black_box(&page)));
        });
    }

    /// Tiles that were unpacked so far for pages, and how many there are.
    pub fn unpacked(&self) -> (u64, u64) {
        (self.source.tiles_unpacked(), self.tiles.len() as u64)
    }
}
