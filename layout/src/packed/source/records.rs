//! Record pages of a packed file: tiles are read, unpacked, kept, and their records put where pages have them.

use super::{FIRST_PAGE, PackedSource};
use crate::error::LayoutError;
use crate::file::bytes::{Page, checksum};
use crate::file::source::Source;
use crate::grid::order::{point_of, spread};
use crate::packed::blocks::{MOST_TILES, Piece, pieces, tiles_of};
use crate::packed::bounds::bounds_of;
use crate::packed::coder::Decoder;
use crate::packed::places::{PLACE_BYTES, TilePlace};
use crate::packed::shape::{TILE_LOG, TileId, TileShape};
use crate::packed::tile::TileRecords;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

/// Tiles that the last records lay in.
type Near = Vec<(TileId, Option<Arc<TileRecords>>)>;

impl PackedSource {
    /// Where a leaf of the tile directory says that its tile `within` lies; absent if the leaf is.
    pub(super) fn tile_place(&self, leaf: usize, within: usize) -> Result<TilePlace, LayoutError> {
        let Some((at, ..)) = self.tile_root.find(leaf) else { return Ok(TilePlace::default()) };
        let known = &self.tiles[at];
        if known.get().is_none() {
            let bytes = self.leaf_bytes(leaf)?;
            let tiles = self.groups.leaf_size(leaf);
            let mut places: Box<[TilePlace]> = (0..tiles).map(|i| TilePlace::read(&bytes, i)).collect();
            // Without bounds, or with damaged ones, all is read that may be needed.
            let bounds = self.container.has_bounds().then(|| bounds_of(&bytes, tiles)).flatten();
            places.iter_mut().zip(bounds.unwrap_or_default()).for_each(|(place, b)| place.bounds = *b);
            let _ = known.set(places);
        }
        Ok(known.get().and_then(|places| places.get(within)).copied().unwrap_or_default())
    }

    /// A leaf of the tile directory, with its bounds if it has any, which are not checked; nothing if it is absent.
    pub(super) fn leaf_bytes(&self, leaf: usize) -> Result<Vec<u8>, LayoutError> {
        let Some((_, offset, sum)) = self.tile_root.find(leaf) else { return Ok(Vec::new()) };
        let damaged = |problem: &str| {
            LayoutError::damaged_terrain(self.path(), format!("tile directory leaf {leaf}"), problem)
        };
        let tiles = self.groups.leaf_size(leaf);
        let entries = tiles * PLACE_BYTES;
        let mut bytes = vec![0; entries + self.bounds_bytes(tiles)];
        let end = offset.checked_add(bytes.len() as u64);
        if end.is_none_or(|end| end > self.container.packed_bytes) {
            return Err(damaged("it lies outside the file"));
        }
        self.read_packed(offset, &mut bytes)?;
        if checksum(&bytes[..entries]) != sum {
            return Err(damaged("the checksum does not match"));
        }
        Ok(bytes)
    }

    /// The records of a tile down to octave `finest`, counted from its own finest; `None` if they are all inert.
    fn tile(&self, id: TileId, finest: u32) -> Result<Option<Arc<TileRecords>>, LayoutError> {
        let Some((leaf, within)) = self.groups.leaf_of(id) else { return Ok(None) };
        if let Some(tile) = self.cache.get(id, finest) {
            return Ok(Some(tile));
        }
        let place = self.tile_place(leaf, within)?;
        if !place.is_present() {
            return Ok(None);
        }
        let shape = self.groups.shape(id);
        let segments = TileShape::segment_of(finest.min(shape.tile_log.saturating_sub(1))) + 1;
        let tile = Arc::new(self.unpack(id, &shape, &place, segments)?);
        self.cache.put(id, Arc::clone(&tile));
        Ok(Some(tile))
    }

    /// Reads and unpacks a tile.
    pub(in crate::packed) fn unpack(
        &self,
        id: TileId,
        shape: &TileShape,
        place: &TilePlace,
        segments: usize,
    ) -> Result<TileRecords, LayoutError> {
        let damaged = |problem: &str| {
            let [x, y] = id.at;
            let stride = 1u64 << shape.stride_log;
            LayoutError::damaged_terrain(self.path(), format!("tile {x}, {y} of stride {stride}"), problem)
        };
        let mut bytes = vec![0; place.bytes(segments)];
        if place.offset.saturating_add(bytes.len() as u64) > self.container.packed_bytes {
            return Err(damaged("it lies outside the file"));
        }
        self.read_packed(place.offset, &mut bytes)?;
        let begun = Instant::now();
        let mut decoders = Vec::with_capacity(segments);
        let mut rest = &bytes[..];
        for s in 0..segments {
            let (segment, after) = rest.split_at(place.lengths[s].into());
            if checksum(segment) != place.checksums[s] {
                return Err(damaged("the checksum does not match"));
            }
            let wrong = || damaged("it holds something else than a tile");
            decoders.push(Decoder::new(self.width, &self.tables, segment).ok_or_else(wrong)?);
            rest = after;
        }
        let scratch = self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut scratch = scratch.unwrap_or_else(|| self.way.scratch());
        let records = self.way.walk(self.width, shape, &mut scratch, &mut decoders, None);
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        if decoders.iter().all(Decoder::finish) {
            self.meter.count(bytes.len(), begun.elapsed());
            Ok(records)
        } else {
            Err(damaged("it holds something else than a tile"))
        }
    }

    /// Where a page of the terrain file lies on the ground, as a number that is near for pages near each other; those that are no record pages come first.
    pub(crate) fn place_of(&self, number: u64) -> u64 {
        let nth = number.checked_sub(FIRST_PAGE).filter(|nth| *nth < self.container.pages);
        let Some(logical) = nth.and_then(|nth| self.logical(nth).ok()) else { return 0 };
        let per_page = self.header.records_per_page();
        let first = logical * per_page;
        // Its middle, or whatever is no ghost.
        let mut slots = (first + per_page / 2..first + per_page).chain(first..first + per_page / 2);
        let point = slots.find_map(|slot| point_of(self.header.grid.k(), slot));
        let [x, y] = point.map_or([0; 2], |p| [p.x(), p.y()].map(|v| u64::from(v >> TILE_LOG)));
        1 + (spread(y) << 1 | spread(x))
    }

    /// Fills a record page.
    pub(super) fn record_page(&self, logical: u64, page: &mut Page) -> Result<(), LayoutError> {
        let k = self.header.grid.k();
        let first = logical * self.header.records_per_page();
        page.copy_from_slice(&self.inert[..]);
        let page = page.as_chunks_mut::<4>().0;
        let words = self.way.words();
        let slots = first..first + (page.len() / words) as u64;
        let mut near = Near::default();
        for piece in pieces(&self.groups, k, slots) {
            match piece {
                Piece::Single(slots) => {
                    let places = &mut page[words * (slots.start - first) as usize..];
                    for (slot, place) in slots.zip(places.chunks_exact_mut(words)) {
                        self.record(slot, &mut near, place)?;
                    }
                }
                Piece::Block { first: from, slots, block, group, tile } => {
                    let records = &mut page[words * (from - first) as usize..][..words * slots.len()];
                    let mut tiles: [Option<Arc<TileRecords>>; MOST_TILES] = [const { None }; MOST_TILES];
                    for (number, id) in tiles_of(&self.groups, block, &slots, group, tile) {
                        match id {
                            Some(id) => tiles[number] = self.tile(id, block.octave())?,
                            // Ghosts, and vertices of the square's border, whose records the tile inside has.
                            None => {
                                for i in block.slots_in(number, &slots) {
                                    let within = i - slots.start;
                                    let record = &mut records[words * within..][..words];
                                    self.record(from + within as u64, &mut near, record)?;
                                }
                            }
                        }
                    }
                    let tiles = tiles.each_ref().map(|tile| tile.as_ref().map(|t| t.all()));
                    if words == 1 {
                        block.gather(&slots, &tiles, records);
                    } else {
                        block.gather_words(&slots, &tiles, records, words);
                    }
                }
            }
        }
        Ok(())
    }

    /// Puts one record where an inert one is.
    fn record(&self, slot: u64, near: &mut Near, to: &mut [[u8; 4]]) -> Result<(), LayoutError> {
        let Some(p) = point_of(self.header.grid.k(), slot) else { return Ok(()) };
        let octave = self.groups.octave(p);
        let (id, at) = self.groups.tile_of(p, octave);
        let finest = octave.saturating_sub(self.groups.groups[usize::from(id.group)].stride_log);
        let is_it = |(known, tile): &(TileId, Option<Arc<TileRecords>>)| {
            *known == id && tile.as_ref().is_none_or(|tile| tile.finest <= finest)
        };
        let found = match near.iter().position(is_it) {
            Some(found) => found,
            None => {
                near.push((id, self.tile(id, finest)?));
                near.len() - 1
            }
        };
        if let Some(tile) = &near[found].1 {
            to.iter_mut().zip(tile.words_at(at)).for_each(|(to, from)| *to = from.to_le_bytes());
        }
        // The next vertex is likely to be in the same tile.
        near.swap(0, found);
        Ok(())
    }
}
