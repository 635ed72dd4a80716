//! Tiles of a terrain file, packed: which there are, what occurs in them, and each by itself.
//!
//! A tile that a build made is held against what its bytes give, most often without reading it a second time: the walk that wrote it made records again of what it asked, and a decoder that is asked the
//! same gives the same. One tile in a few is read whole.

use super::compare::{Check, refused};
use super::gather::tile_of;
use super::listed::{ListedLeaf, tiles_of};
use crate::error::LayoutError;
use crate::file::bytes::checksum;
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::{AnyCodec, RecordCodec};
use crate::packed::bounds::{BoundTable, Bounds};
use crate::packed::coder::Decoder;
use crate::packed::encoder::{Encoder, PlainEncoder};
use crate::packed::model::{CONTEXTS, Counts, DecodeTables, Model};
use crate::packed::shape::{Groups, SEGMENTS, TileId, TileShape};
use crate::packed::symbols::EncodeTables;
use crate::packed::tile::TileRecords;
use crate::packed::token::TOKENS;
use crate::packed::way::{Scratch, Way};
use crate::packed::wide::Width;
use crate::progress::Progress;
use crate::read::records::Records;
use rayon::prelude::*;
use std::path::Path;

/// Tiles of which all are counted, and of more one in so many.
const TILES_COUNTED: usize = 1024;
const TILES_A_SAMPLE: u32 = 8;

/// Of tiles of a build, one in so many is read whole, in case the writer's walk ever knew what a reader's does not.
const TILES_READ: u32 = 16;

/// Tiles that a thread packs one after the other.
const TILES_A_TASK: usize = 16;

/// The tables of a file, as writing and reading have them.
pub(super) struct Tables {
    pub(super) encode: EncodeTables,
    pub(super) decode: DecodeTables,
}

/// A packed tile.
pub(super) struct Made {
    /// Its segments one after the other.
    pub(super) bytes: Vec<u8>,
    pub(super) lengths: [u16; SEGMENTS],
    pub(super) checksums: [u32; SEGMENTS],
    pub(super) bounds: Bounds,
}

/// What a thread keeps from tile to tile.
struct Bench {
    scratch: Scratch,
    encoders: [Encoder; SEGMENTS],
    words: Vec<[u8; 2]>,
    bytes: Vec<u8>,
}

pub(super) struct Packer<'p, C: RecordCodec> {
    pub(super) path: &'p Path,
    pub(super) records: Records<'p, C>,
    pub(super) groups: Groups,
    pub(super) way: Way,
    /// For bounds of errors.
    pub(super) codec: AnyCodec,
    pub(super) bounds: BoundTable,
    pub(super) width: Width,
    pub(super) check: Check,
    pub(super) progress: &'p dyn Progress,
}

impl<C: RecordCodec> Packer<'_, C> {
    /// Whether a tile may give anything but inert records. All that it gives lies below its centre, unless it gives the corners of the square, too.
    pub(super) fn may_hold(&self, id: TileId) -> bool {
        let group = &self.groups.groups[usize::from(id.group)];
        let (shift, half) =
            (group.stride_log + group.tile_log, 1 << (group.stride_log + group.tile_log) >> 1);
        let [x, y] = id.at.map(|v| (v << shift) + half);
        let centre = slot_of(self.records.grid().k(), GridPoint::new(x, y));
        group.is_top || self.records.raw(centre) != C::INERT
    }

    /// The records of a tile; `None` if all that it gives are inert.
    fn records_of(&self, id: TileId) -> Option<TileRecords> {
        if !self.may_hold(id) {
            return None;
        }
        let (shape, inert) = (self.groups.shape(id), self.way.inert());
        let records = tile_of(&self.records, &self.groups, id, inert);
        (!records.gives_nothing(&shape, inert)).then_some(records)
    }

    pub(super) fn samples_of(&self, id: TileId) -> u64 {
        3 << (2 * self.groups.groups[usize::from(id.group)].tile_log) >> 2
    }

    /// What walks over a tile's records ask, in `bench`, and what they make of it.
    fn encode(&self, id: TileId, records: &TileRecords, bench: &mut Bench) -> TileRecords {
        bench.encoders.iter_mut().for_each(Encoder::clear);
        let (shape, encoders) = (self.groups.shape(id), &mut bench.encoders);
        self.way.walk(self.width, &shape, &mut bench.scratch, encoders, Some(records))
    }

    /// Whether a tile's values are counted, of the finest group of many tiles one in a few: those that chance takes, so that no pattern of the ground's is in step with them.
    pub(super) fn is_counted(&self, number: usize, tiles: usize, id: TileId) -> bool {
        let chance = (number as u32).wrapping_mul(0x9e37_79b1) >> 16;
        tiles <= TILES_COUNTED || id.group > 0 || chance.is_multiple_of(TILES_A_SAMPLE)
    }

    /// Counts what occurs.
    pub(super) fn model(&self, leaves: &[ListedLeaf]) -> Model {
        let none = || (vec![[0; TOKENS]; CONTEXTS], self.bench());
        let count = leaves.last().map_or(0, |last| last.end);
        let counts = leaves
            .par_iter()
            .flat_map_iter(|leaf| tiles_of(&self.groups, std::slice::from_ref(leaf)))
            .filter(|(number, id)| self.is_counted(*number, count, *id))
            .fold(none, |(mut counts, mut bench), (_, id)| {
                if let Some(records) = self.records_of(id) {
                    self.encode(id, &records, &mut bench);
                    bench.encoders.iter().for_each(|encoder| encoder.count(&mut counts));
                }
                self.progress.advance(self.samples_of(id));
                (counts, bench)
            })
            .map(|(counts, _)| counts)
            .reduce(|| none().0, sum);
        if count > TILES_COUNTED { Model::from_sample(&counts) } else { Model::from_counts(&counts) }
    }

    /// Packs all tiles of some leaves, in order.
    pub(super) fn make_all(
        &self,
        leaves: &[ListedLeaf],
        tables: &Tables,
    ) -> Result<Vec<Option<Made>>, LayoutError> {
        let tiles: Vec<TileId> = tiles_of(&self.groups, leaves).map(|(_, id)| id).collect();
        let tiles = tiles.par_iter().with_min_len(TILES_A_TASK);
        tiles.map_init(|| self.bench(), |bench, id| self.make(*id, tables, bench)).collect()
    }

    fn bench(&self) -> Bench {
        Bench {
            scratch: self.way.scratch(),
            encoders: std::array::from_fn(|_| Encoder::new(self.width)),
            words: Vec::new(),
            bytes: Vec::new(),
        }
    }

    /// Packs a tile; `None` if all that it gives are inert.
    fn make(&self, id: TileId, tables: &Tables, bench: &mut Bench) -> Result<Option<Made>, LayoutError> {
        let shape = self.groups.shape(id);
        self.progress.advance(self.samples_of(id));
        let Some(records) = self.records_of(id) else { return Ok(None) };
        let found = self.encode(id, &records, bench);
        bench.bytes.clear();
        let mut ends = [0; SEGMENTS];
        let mut is_whole = true;
        for (encoder, end) in bench.encoders.iter().zip(&mut ends) {
            let done = encoder.finish(&tables.encode, &mut bench.words, &mut bench.bytes);
            is_whole &= done.is_some();
            *end = bench.bytes.len();
        }
        let starts = [0, ends[0], ends[1]];
        let mut same = true;
        if !is_whole {
            return self.make_plain(id, &records, tables, bench);
        }
        if self.check == Check::Tiles {
            // A reader's walk is this one, and asks by what it was given: what it is given is what it makes.
            let segments = starts.iter().zip(ends).map(|(start, end)| &bench.bytes[*start..end]);
            let mut pairs = bench.encoders.iter().zip(segments);
            same = pairs.all(|(encoder, segment)| encoder.is_given_by(&tables.decode, segment))
                && found.gives_same(&records, &shape)
                && (!is_read_whole(id) || self.reads_as(id, &records, ends, tables, bench));
        }
        if !same {
            return Err(self.other_than_it_was(id));
        }
        Ok(Some(made(&bench.bytes, ends, self.bounds_of(&shape, &records))))
    }

    /// Packs a tile of which a sample lacked a token: values are stored as they are.
    #[cold]
    fn make_plain(
        &self,
        id: TileId,
        records: &TileRecords,
        tables: &Tables,
        bench: &mut Bench,
    ) -> Result<Option<Made>, LayoutError> {
        let shape = self.groups.shape(id);
        let mut encoders: [PlainEncoder; SEGMENTS] = std::array::from_fn(|_| PlainEncoder::default());
        self.way.walk(self.width, &shape, &mut bench.scratch, &mut encoders, Some(records));
        bench.bytes.clear();
        let ends = encoders.map(|encoder| {
            encoder.finish(&mut bench.bytes);
            bench.bytes.len()
        });
        if self.check == Check::Tiles && !self.reads_as(id, records, ends, tables, bench) {
            return Err(self.other_than_it_was(id));
        }
        Ok(Some(made(&bench.bytes, ends, self.bounds_of(&shape, records))))
    }

    fn bounds_of(&self, shape: &TileShape, records: &TileRecords) -> Bounds {
        self.bounds.of_tile(&self.codec, shape, records)
    }

    /// Whether a reader makes a tile's records of the segments in `bench`, which have these ends.
    fn reads_as(
        &self,
        id: TileId,
        records: &TileRecords,
        ends: [usize; SEGMENTS],
        tables: &Tables,
        bench: &mut Bench,
    ) -> bool {
        let shape = self.groups.shape(id);
        let segments = [0, ends[0], ends[1]].into_iter().zip(ends);
        let decoders =
            segments.map(|(start, end)| Decoder::new(self.width, &tables.decode, &bench.bytes[start..end]));
        decoders.collect::<Option<Vec<_>>>().is_some_and(|mut decoders| {
            let found = self.way.walk(self.width, &shape, &mut bench.scratch, &mut decoders, None);
            decoders.iter().all(Decoder::finish) && found.gives_same(records, &shape)
        })
    }

    #[cold]
    fn other_than_it_was(&self, id: TileId) -> LayoutError {
        let [x, y] = id.at;
        let stride = 1u64 << self.groups.shape(id).stride_log;
        let problem =
            format!("tile {x}, {y} of stride {stride} does not come out as it went in; please report it");
        refused(self.path, &problem)
    }
}

/// Whether a tile is read whole: those that chance takes.
fn is_read_whole(id: TileId) -> bool {
    let [x, y] = id.at;
    let chance = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca6b) ^ u32::from(id.group);
    (chance ^ chance >> 16).is_multiple_of(TILES_READ)
}

/// A tile of segments with these ends.
fn made(bytes: &[u8], ends: [usize; SEGMENTS], bounds: Bounds) -> Made {
    let mut start = 0;
    let segments = ends.map(|end| &bytes[std::mem::replace(&mut start, end)..end]);
    Made {
        bytes: bytes.to_vec(),
        lengths: segments.map(|segment| segment.len() as u16),
        checksums: segments.map(checksum),
        bounds,
    }
}

fn sum(mut a: Counts, b: Counts) -> Counts {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += b);
    a
}
