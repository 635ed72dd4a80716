//! A terrain file packed into another, in two passes: one over a sample of the tiles that counts, for the tables, and one that writes.
//!
//! What was written is unpacked again and compared with the terrain file, byte for byte, before it gets its name ([`Check`] says how). So whatever the file holds, what is packed is the same, or packing
//! fails and says so. Cost: each vertex is looked up and unpacked once; memory is a few megabytes, 40 bytes a thousand of these, and 24 bytes a record page.

use super::compare::{CHUNK_BYTES, Check, compare, read_back, refused};
use super::front::Front;
use super::gather::tile_of;
use super::listed::{ListedLeaf, listed, tiles_of};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, put_u32, put_u64, to_usize};
use crate::file::directory::{page_at, put_directory};
use crate::file::disk::Disk;
use crate::file::header::{Header, INERT_PAGE};
use crate::file::lock::WriteLock;
use crate::file::packed_end::{FRONT, Run};
use crate::file::source::Source;
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::RecordCodec;
use crate::packed::coder::{Decoder, Encoder, PlainEncoder};
use crate::packed::container::{BLOCKS, Container, INDEX, MODEL, ROOT, RUNS};
use crate::packed::leaves::packed_leaves;
use crate::packed::model::{CONTEXTS, Counts, DecodeTables, Model};
use crate::packed::places::{LEAF_BYTES, PLACE_BYTES, TilePlace, TileRoot};
use crate::packed::shape::{Groups, SEGMENTS, TileId};
use crate::packed::symbols::EncodeTables;
use crate::packed::tile::TileRecords;
use crate::packed::token::TOKENS;
use crate::packed::way::{Scratch, Way};
use crate::packed::wide::Width;
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::records::Records;
use crate::read::terrain::Terrain;
use crate::with_records;
use rayon::prelude::*;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;
/// Tiles packed before they are written.
const TILES_AT_ONCE: usize = 4096;

/// Tiles of which all are counted, and of more one in so many.
const TILES_COUNTED: usize = 1024;
const TILES_A_SAMPLE: u32 = 8;

/// What became of a terrain that was packed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Packed {
    /// Bytes of the terrain file.
    pub bytes_before: u64,
    /// Bytes of the packed one, imagery included.
    pub bytes: u64,
    /// Bytes a sample of the packed one, imagery left out.
    pub bytes_per_sample: f64,
}

/// Packs the terrain file `from` into a new file `to`. It reads as the terrain file does, pages, imagery and history included.
///
/// What the terrain was before all edits is packed, as a build or a compaction left it. What was appended to it since, its history with it, is taken over as it is.
///
/// # Errors
/// Damage and I/O of the terrain; I/O of `to`; [`LayoutError::Unsupported`] for a terrain that other programs laid out, and one that is packed already.
pub fn pack(disk: &dyn Disk, from: &Path, to: &Path, progress: &dyn Progress) -> Result<Packed, LayoutError> {
    let terrain = Terrain::open(from)?;
    if terrain.source().packed_bytes().is_some() {
        return Err(refused(from, "it is packed already"));
    }
    // What edits have not touched.
    let built = terrain.header().history.map(|_| Terrain::open_original(from)).transpose()?;
    let file = AtomicFile::create(to)?;
    let built = built.as_ref().unwrap_or(&terrain);
    let packed = pack_into(disk, &terrain, built, &file, Check::Pages, progress)?;
    progress.stage("syncing", 0);
    file.publish_on(disk)?;
    Ok(packed)
}

/// Packs `terrain`, which is mapped and was `built` before all edits, into `file`, which is not published yet.
///
/// # Errors
/// As [`pack`].
pub(crate) fn pack_into(
    disk: &dyn Disk,
    terrain: &Terrain,
    built: &Terrain,
    file: &AtomicFile,
    check: Check,
    progress: &dyn Progress,
) -> Result<Packed, LayoutError> {
    if check == Check::Pages {
        check_pages(terrain, progress)?;
        if built.instance() != terrain.instance() {
            check_pages(built, progress)?;
        }
    }
    let directory_end = check_packable(built)?;
    let records = built.records()?;
    let (groups, way) = (Groups::of(built.grid()), Way::of(built.header()));
    let bytes = with_records!(records, records => {
        let packer = Packer { path: terrain.path(), records, groups, way, width: Width::best(), check, progress };
        packer.write(disk, terrain, built, directory_end, file)?
    });
    compare(terrain, built, file, check, progress)?;
    let [wide, high] = terrain.grid().samples().map(f64::from);
    let imagery = terrain.header().imagery.map_or(0, |place| place.bytes);
    Ok(Packed {
        bytes_before: terrain.header().file_bytes,
        bytes,
        bytes_per_sample: bytes.saturating_sub(imagery) as f64 / (wide * high),
    })
}

/// Packs the terrain file `plain`, which never gets a name, into `file`, and publishes that as [`publish_terrain`] does. The header, and the length of the packed file.
///
/// # Errors
/// As [`pack`].
pub(crate) fn publish_packed(
    disk: &dyn Disk,
    plain: AtomicFile,
    file: AtomicFile,
    over: Option<&WriteLock>,
    check: Check,
    progress: &dyn Progress,
) -> Result<(Header, u64), LayoutError> {
    let packed = {
        let terrain = Terrain::mapped(read_back(&plain)?)?;
        pack_into(disk, &terrain, &terrain, &file, check, progress)?
    };
    drop(plain);
    progress.stage("syncing", 0);
    Ok((publish_terrain(disk, file, over)?, packed.bytes))
}

/// Whether a file is laid out as a build leaves it: then its directory follows from which pages there are. Where that ends.
fn check_packable(built: &Terrain) -> Result<u64, LayoutError> {
    let (path, header) = (built.path(), built.header());
    let in_order =
        "other programs wrote it, in an order of their own; write it anew with `terrasoar compact`";
    let mut next = INERT_PAGE;
    for (_, entry) in built.present_pages()? {
        next += 1;
        if entry.page != next || entry.generation != 1 {
            return Err(refused(path, in_order));
        }
    }
    let leaves = built.table().leaves().map(|(number, leaf)| (number, &leaf[..]));
    let (root, page) = put_directory(path, header.directory(), leaves, next + 1, |_, _| Ok(()))?;
    let end = u64::from(page) * PAGE + root.bytes.len() as u64;
    let is_in_order =
        [header.root_page, header.root_checksum] == [page, root.checksum] && end <= header.file_bytes;
    if is_in_order { Ok(end) } else { Err(refused(path, in_order)) }
}

/// Holds every record page against its checksum: through a map nobody would.
fn check_pages(terrain: &Terrain, progress: &dyn Progress) -> Result<(), LayoutError> {
    let per_page = terrain.header().records_per_page();
    progress.stage("checking", terrain.header().stored_pages * per_page);
    let present: Vec<u64> = terrain.present_pages()?.map(|(page, _)| page).collect();
    present
        .into_par_iter()
        .try_for_each(|page| terrain.checked_page(page).map(|_| progress.advance(per_page)))
}

/// The tables of a file, as writing and reading have them.
struct Tables {
    encode: EncodeTables,
    decode: DecodeTables,
}

/// A packed tile.
struct Made {
    segments: [Vec<u8>; SEGMENTS],
}

struct Packer<'p, C: RecordCodec> {
    path: &'p Path,
    records: Records<'p, C>,
    groups: Groups,
    way: Way,
    width: Width,
    check: Check,
    progress: &'p dyn Progress,
}

impl<C: RecordCodec> Packer<'_, C> {
    /// Whether a tile may give anything but inert records. All that it gives lies below its centre, unless it gives the corners of the square, too.
    fn may_hold(&self, id: TileId) -> bool {
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

    fn samples_of(&self, id: TileId) -> u64 {
        3 << (2 * self.groups.groups[usize::from(id.group)].tile_log) >> 2
    }

    fn encoded(&self, id: TileId, records: &TileRecords, scratch: &mut Scratch) -> [Encoder; SEGMENTS] {
        let mut encoders: [Encoder; SEGMENTS] = std::array::from_fn(|_| Encoder::default());
        self.way.walk(self.width, &self.groups.shape(id), scratch, &mut encoders, Some(records));
        encoders
    }

    /// Whether a tile's values are counted, of the finest group of many tiles one in a few: those that chance takes, so that no pattern of the ground's is in step with them.
    fn is_counted(&self, number: usize, tiles: usize, id: TileId) -> bool {
        let chance = (number as u32).wrapping_mul(0x9e37_79b1) >> 16;
        tiles <= TILES_COUNTED || id.group > 0 || chance.is_multiple_of(TILES_A_SAMPLE)
    }

    /// Counts what occurs.
    fn model(&self, leaves: &[ListedLeaf]) -> Model {
        let none = || (vec![[0; TOKENS]; CONTEXTS], self.way.scratch());
        let count = leaves.last().map_or(0, |last| last.end);
        let counts = leaves
            .par_iter()
            .flat_map_iter(|leaf| tiles_of(&self.groups, std::slice::from_ref(leaf)))
            .filter(|(number, id)| self.is_counted(*number, count, *id))
            .fold(none, |(mut counts, mut scratch), (_, id)| {
                if let Some(records) = self.records_of(id) {
                    for encoder in self.encoded(id, &records, &mut scratch) {
                        encoder.count(&mut counts);
                    }
                }
                self.progress.advance(self.samples_of(id));
                (counts, scratch)
            })
            .map(|(counts, _)| counts)
            .reduce(|| none().0, sum);
        if count > TILES_COUNTED { Model::from_sample(&counts) } else { Model::from_counts(&counts) }
    }

    /// Packs a tile; `None` if all that it gives are inert.
    fn make(&self, id: TileId, tables: &Tables, scratch: &mut Scratch) -> Result<Option<Made>, LayoutError> {
        let shape = self.groups.shape(id);
        self.progress.advance(self.samples_of(id));
        let Some(records) = self.records_of(id) else { return Ok(None) };
        let segments = self.encoded(id, &records, scratch).map(|encoder| encoder.finish(&tables.encode));
        let segments = match segments {
            [Some(a), Some(b), Some(c)] => [a, b, c],
            // A sample lacked a token: values are stored as they are.
            _ => {
                let mut encoders: [PlainEncoder; SEGMENTS] = std::array::from_fn(|_| PlainEncoder::default());
                self.way.walk(self.width, &shape, scratch, &mut encoders, Some(&records));
                encoders.map(PlainEncoder::finish)
            }
        };
        if self.check == Check::Tiles {
            let decoders = segments.iter().map(|bytes| Decoder::new(&tables.decode, bytes));
            let same = decoders.collect::<Option<Vec<_>>>().is_some_and(|mut decoders| {
                let found = self.way.walk(self.width, &shape, scratch, &mut decoders, None);
                decoders.iter().all(Decoder::finish) && found.gives_same(&records, &shape)
            });
            if !same {
                let [x, y] = id.at;
                let stride = 1u64 << shape.stride_log;
                let problem = format!(
                    "tile {x}, {y} of stride {stride} does not come out as it went in; please report it"
                );
                return Err(refused(self.path, &problem));
            }
        }
        Ok(Some(Made { segments }))
    }

    /// Writes the whole file: what was `built`, whose directory ends at `directory_end`, and what `terrain` has behind it. Its length.
    fn write(
        &self,
        disk: &dyn Disk,
        terrain: &Terrain,
        built: &Terrain,
        directory_end: u64,
        file: &AtomicFile,
    ) -> Result<u64, LayoutError> {
        let leaves = listed(&self.groups, |id| self.may_hold(id));
        let count = leaves.last().map_or(0, |last| last.end);
        let samples = tiles_of(&self.groups, &leaves).map(|(_, id)| self.samples_of(id)).sum();
        let counted =
            tiles_of(&self.groups, &leaves).filter(|(number, id)| self.is_counted(*number, count, *id));
        self.progress.stage("counting", counted.map(|(_, id)| self.samples_of(id)).sum());
        let model = self.model(&leaves);
        let tables = Tables { encode: EncodeTables::of(&model), decode: DecodeTables::of(&model) };
        self.progress.stage("packing", samples);

        let (source, header) = (terrain.source(), terrain.header());
        let slots = header_slots(source, header)?;
        let mut front = Front::default();
        front.put(MODEL, &model.to_bytes());
        built.check_directory()?;
        let directory = header.directory();
        let of_directory = built.table().leaves().map(|(number, leaf)| (number, &leaf[..]));
        let [runs, index, blocks] = packed_leaves(directory.leaves(), of_directory);
        front.put(RUNS, &runs);
        front.put(INDEX, &index);
        // Leaves have their place before it is known what they hold.
        let numbers: Vec<usize> = leaves.iter().map(|listed| listed.leaf).collect();
        let mut root = TileRoot::begin(self.groups.leaves, &numbers, directory.has_nodes());
        let is_sparse = !root.is_empty();
        let first_place = root.len();
        let places = if is_sparse { leaves.len() } else { self.groups.leaves };
        root.resize(first_place + places * LEAF_BYTES, 0);
        let root = front.put(ROOT, &root) + first_place;
        let first_leaf = FRONT + front.bytes.len() as u64;
        let mut at = first_leaf + (count * PLACE_BYTES) as u64;

        let failed = |e| {
            let when_full = "cannot write the packed file, for which there is no room; make some on its disk, or name an output on another";
            LayoutError::write(file.target(), "cannot write the packed file", when_full, e)
        };
        let write = |bytes: &[u8], offset| disk.write_at(file.file(), bytes, offset).map_err(failed);
        let mut done = 0;
        while done < leaves.len() {
            let few =
                leaves[done..].partition_point(|listed| listed.end - leaves[done].first <= TILES_AT_ONCE);
            let batch = &leaves[done..done + few.max(1)];
            let tiles: Vec<TileId> = tiles_of(&self.groups, batch).map(|(_, id)| id).collect();
            let made: Vec<Option<Made>> = tiles
                .par_iter()
                .with_min_len(16)
                .map_init(|| self.way.scratch(), |scratch, id| self.make(*id, &tables, scratch))
                .collect::<Result<_, LayoutError>>()?;
            let mut bytes = Vec::new();
            let mut made = made.into_iter();
            for (i, listed) in (done..).zip(batch) {
                let mut entries = vec![0; (listed.end - listed.first) * PLACE_BYTES];
                let mut is_present = false;
                for (within, made) in made.by_ref().take(listed.end - listed.first).enumerate() {
                    let Some(Made { segments }) = made else { continue };
                    let mut place = TilePlace { offset: at + bytes.len() as u64, ..TilePlace::default() };
                    for (s, segment) in segments.iter().enumerate() {
                        place.lengths[s] = segment.len() as u16;
                        place.checksums[s] = checksum(segment);
                        bytes.extend(segment);
                    }
                    place.write(&mut entries, within);
                    is_present = true;
                }
                let offset = first_leaf + (listed.first * PLACE_BYTES) as u64;
                if is_present {
                    let to = root + if is_sparse { i } else { listed.leaf } * LEAF_BYTES;
                    put_u64(&mut front.bytes, to, offset);
                    put_u32(&mut front.bytes, to + 8, checksum(&entries));
                }
                write(&entries, offset)?;
            }
            write(&bytes, at)?;
            at += bytes.len() as u64;
            done += batch.len();
        }
        front.seal(ROOT);
        front.list(BLOCKS, &blocks, at);
        write(&blocks, at)?;
        at += blocks.len() as u64;

        // What is not packed: imagery, and what edits appended.
        let (first, last) = (directory_end / PAGE, header.file_bytes.div_ceil(PAGE));
        let place = at;
        let mut chunk = vec![0; CHUNK_BYTES];
        while at - place < (last - first) * PAGE {
            let from = directory_end + (at - place);
            let count = to_usize(header.file_bytes.saturating_sub(from).min(CHUNK_BYTES as u64))?;
            source.read_at(from, &mut chunk[..count])?;
            let whole = count.next_multiple_of(PAGE_BYTES);
            chunk[count..whole].fill(0);
            write(&chunk[..whole], at)?;
            at += whole as u64;
        }
        let run = match u32::try_from(last - first) {
            Ok(0) => None,
            Ok(pages) => {
                Some(Run { first: page_at(file.target(), directory_end)?, pages, place, table: None })
            }
            Err(_) => return Err(refused(terrain.path(), "it is too large")),
        };
        write(&front.bytes, FRONT)?;
        let sections = front.sections;
        let container = |packed_bytes| Container {
            packed_bytes,
            pages: built.header().stored_pages,
            sections: sections.clone(),
        };
        let mut end = container(at).end(first, at);
        if let Some(run) = run {
            let block = end.with(run, at).1;
            write(&block, at)?;
            end = container(at + block.len() as u64).end(first, at).with(run, at).0;
        }
        for (slot, page) in (0..).zip(&slots) {
            let page = if page.iter().all(|byte| *byte == 0) { page.clone() } else { end.to_file(page) };
            write(&page[..], slot * PAGE)?;
        }
        Ok(end.end)
    }
}

fn sum(mut a: Counts, b: Counts) -> Counts {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += b);
    a
}

/// The two header pages of a terrain file; zeros for the one that does not count, should it be no header.
fn header_slots(source: &dyn Source, header: &Header) -> Result<[Box<Page>; 2], LayoutError> {
    let mut slots = [0, 1].map(|_| Box::new([0; PAGE_BYTES]));
    for (slot, page) in (0..).zip(&mut slots) {
        source.read_at(slot * PAGE, &mut page[..])?;
        let is_one = Header::parse(source.path(), page)
            .is_ok_and(|found| found.record_kind == header.record_kind && found.grid == header.grid);
        if !is_one {
            page.fill(0);
        }
    }
    Ok(slots)
}
