//! A terrain file packed into another, in two passes: one over a sample of the tiles that counts, for the tables, and one that writes.
//!
//! What was written is unpacked again and compared with the terrain file, byte for byte, before it gets its name ([`Check`] says how). So whatever the file holds, what is packed is the same, or packing
//! fails and says so. Cost: each vertex is looked up and unpacked once; memory is a few megabytes, 40 bytes a thousand of these, and 24 bytes a record page.

use super::compare::{CHUNK_BYTES, Check, compare, read_back, refused};
use super::front::Front;
use super::listed::{ListedLeaf, listed, tiles_of};
use super::packer::{Made, Packer, Tables};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, put_u32, put_u64, to_usize};
use crate::file::directory::{page_at, put_directory};
use crate::file::disk::Disk;
use crate::file::header::{Header, INERT_PAGE};
use crate::file::lock::WriteLock;
use crate::file::mark::Mark;
use crate::file::packed_end::{FRONT, Run};
use crate::file::source::Source;
use crate::grid::record::{AnyCodec, RecordCodec};
use crate::packed::bounds::{BOUND_BYTES, BoundTable, SUM_BYTES, UNKNOWN};
use crate::packed::container::{BLOCKS, BOUNDS, Container, INDEX, MODEL, ROOT, RUNS};
use crate::packed::leaves::packed_leaves;
use crate::packed::model::DecodeTables;
use crate::packed::places::{LEAF_BYTES, PLACE_BYTES, TilePlace, TileRoot};
use crate::packed::shape::Groups;
use crate::packed::symbols::EncodeTables;
use crate::packed::way::Way;
use crate::packed::wide::Width;
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::terrain::Terrain;
use crate::with_records;
use rayon::prelude::*;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;
/// Tiles packed before they are written. The next ones are packed meanwhile.
const TILES_AT_ONCE: usize = 2048;

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
    let mut packed = pack_into(disk, &terrain, built, &file, Check::Pages, progress)?;
    if let Some(mark) = Mark::to_carry(terrain.source(), terrain.header())? {
        let when_full = "cannot write the packed file, for which there is no room; make some on its disk, or name an output on another";
        disk.write_at(file.file(), &mark, packed.bytes)
            .map_err(|e| LayoutError::write(to, "cannot write the packed file", when_full, e))?;
        packed.bytes += mark.len() as u64;
    }
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
    let Header { record_kind, grid, scale, .. } = built.header();
    let codec = AnyCodec::new(*record_kind, grid, scale);
    let bytes = with_records!(records, records => {
        let packer = Packer { path: terrain.path(), records, groups, way, codec, bounds: BoundTable::new(), width: Width::best(), check, progress };
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
    progress.stage("syncing", 0);
    // To remove a large file takes a while, in which the disk can take in the other.
    let header = std::thread::scope(|scope| {
        scope.spawn(|| drop(plain));
        publish_terrain(disk, file, over)
    })?;
    Ok((header, packed.bytes))
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

impl<C: RecordCodec> Packer<'_, C> {
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
        front.put(BOUNDS, &[]);
        let place_of = |tiles: usize, leaves: usize| {
            first_leaf + (tiles * (PLACE_BYTES + BOUND_BYTES) + leaves * SUM_BYTES) as u64
        };
        let mut at = place_of(count, leaves.len());

        let failed = |e| {
            let when_full = "cannot write the packed file, for which there is no room; make some on its disk, or name an output on another";
            LayoutError::write(file.target(), "cannot write the packed file", when_full, e)
        };
        let write = |bytes: &[u8], offset| disk.write_at(file.file(), bytes, offset).map_err(failed);
        let mut batches = batches_of(&leaves);
        let mut next = batches.next();
        let mut made = next.map_or(Ok(Vec::new()), |batch| self.make_all(batch, &tables))?;
        while let Some(batch) = next {
            next = batches.next();
            // One batch is written while the next is made.
            let (written, later) = rayon::join(
                || {
                    let mut bytes = Vec::new();
                    let mut made = std::mem::take(&mut made).into_iter();
                    for listed in batch {
                        let tiles = listed.end - listed.first;
                        let mut entries = vec![0; tiles * PLACE_BYTES];
                        let mut leaf_bounds = vec![UNKNOWN; tiles * BOUND_BYTES];
                        let mut is_present = false;
                        for (within, made) in made.by_ref().take(tiles).enumerate() {
                            let Some(Made { bytes: segments, lengths, checksums, bounds }) = made else {
                                continue;
                            };
                            let offset = at + bytes.len() as u64;
                            TilePlace { offset, lengths, checksums, bounds }.write(&mut entries, within);
                            leaf_bounds[within * BOUND_BYTES..][..BOUND_BYTES].copy_from_slice(&bounds);
                            bytes.extend(segments);
                            is_present = true;
                        }
                        let offset = place_of(listed.first, listed.place);
                        if is_present {
                            let place = if is_sparse { listed.place } else { listed.leaf };
                            let to = root + place * LEAF_BYTES;
                            put_u64(&mut front.bytes, to, offset);
                            put_u32(&mut front.bytes, to + 8, checksum(&entries));
                        }
                        entries.extend(leaf_bounds);
                        entries.extend(checksum(&entries).to_le_bytes());
                        write(&entries, offset)?;
                    }
                    write(&bytes, at)?;
                    at += bytes.len() as u64;
                    Ok(())
                },
                || next.map_or(Ok(Vec::new()), |batch| self.make_all(batch, &tables)),
            );
            written?;
            made = later?;
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

/// Leaves of about [`TILES_AT_ONCE`] tiles, one batch after the other.
fn batches_of(leaves: &[ListedLeaf]) -> impl Iterator<Item = &[ListedLeaf]> {
    let mut rest = leaves;
    std::iter::from_fn(move || {
        let first = rest.first()?.first;
        let few = rest.partition_point(|listed| listed.end - first <= TILES_AT_ONCE);
        let (batch, later) = rest.split_at(few.max(1));
        rest = later;
        Some(batch)
    })
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
