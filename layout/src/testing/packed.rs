//! Packed files with nonsense in them and right checksums.
//!
//! A recipe changes bytes where something is decided: fields of a header slot, sections, blocks of directory leaves, places of tiles, segments, blocks and tables of what was appended. Then every checksum is
//! made right again, from the bottom up: segments, tables of runs, leaves, blocks, sections, the root of a directory that is packed, header slots. Record pages keep theirs, as tiles have none of pages.
//! Invariant and cost are those of this module.

use crate::file::bytes::{PAGE_BYTES, checksum, get_u16, get_u32, get_u64};
use crate::file::directory_shape::DirectoryShape;
use crate::grid::Grid;
use crate::packed::bounds::BOUND_BYTES;
use crate::packed::container::{BLOCKS, BOUNDS, INDEX, ROOT, RUNS, Section};
use crate::packed::leaves::{INDEX_BYTES, PackedLeaves};
use crate::packed::places::{LEAF_BYTES, PLACE_BYTES};
use crate::packed::shape::{Groups, SEGMENTS};
use std::ops::Range;

/// Changes of a recipe that are made.
const MOST_CHANGES: usize = 64;
/// Blocks of a chain that are sealed.
const MOST_BLOCKS: usize = 64;
const SECTIONS: usize = 0x120;
const BLOCK: usize = 0x1e8;
const TABLE_ENTRY: usize = 6;
/// Logical pages of a grid whose directory is sealed.
const MOST_PAGES: u64 = 1 << 22;

/// Changes a packed file by a recipe, eight bytes a change: which part (2), where in it (4), how (1), a value (1); and seals it.
pub fn mutate_packed(file: &mut [u8], recipe: &[u8]) {
    let parts = parts(file);
    for change in recipe.as_chunks::<8>().0.iter().take(MOST_CHANGES) {
        let Some(part) = parts.get(usize::from(get_u16(change, 0)) % parts.len().max(1)) else { break };
        let at = part.start + get_u32(change, 2) as usize % part.len().max(1);
        let Some(byte) = file.get_mut(at) else { continue };
        match change[6] % 3 {
            0 => *byte = change[7],
            1 => *byte ^= 1 << (change[7] % 8),
            _ => *byte = byte.wrapping_add(change[7]),
        }
    }
    reseal_packed(file);
}

/// Makes the checksums of a packed file right, as far as its parts lie in it.
pub fn reseal_packed(file: &mut [u8]) {
    for slot in slots(file) {
        for block in chain(file, slot).into_iter().rev() {
            for run in block.runs() {
                let (pages, place) = (number(file, run + 4, 4), number(file, run + 8, 8));
                if number(file, run + 16, 4) == 1 {
                    let table = place..place.saturating_add(pages.saturating_mul(TABLE_ENTRY));
                    seal(file, run + 20, table);
                }
            }
            seal(file, block.named_at + 8, block.range());
        }
        seal_directory(file, slot);
        let sizes = leaf_sizes(file, slot);
        let has_bounds = sections(file, slot).any(|section| number(file, section, 4) == BOUNDS as usize);
        for section in sections(file, slot) {
            let range = range_of(file, section);
            if number(file, section, 4) == ROOT as usize && range.end <= file.len() {
                for (leaf, tiles) in (range.start..range.end).step_by(LEAF_BYTES).zip(&sizes) {
                    seal_leaf(file, leaf, *tiles, has_bounds);
                }
            }
            seal(file, section + 4, range);
        }
        seal(file, slot + 0xffc, slot..slot + 0xffc);
    }
}

/// A block of the list of runs, and where it is named.
struct Block {
    at: usize,
    runs: usize,
    named_at: usize,
}

impl Block {
    fn range(&self) -> Range<usize> {
        self.at..self.at.saturating_add(16 + 24 * self.runs)
    }

    fn runs(&self) -> impl Iterator<Item = usize> + use<> {
        let first = self.at + 16;
        (0..self.runs).map(move |i| first + 24 * i)
    }
}

/// Header slots that there are.
fn slots(file: &[u8]) -> Vec<usize> {
    [0, PAGE_BYTES]
        .into_iter()
        .filter(|at| file.len() >= at + PAGE_BYTES && file[*at..*at + 8] != [0; 8])
        .collect()
}

/// Blocks from the newest to the first, as far as they lie in the file.
fn chain(file: &[u8], slot: usize) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut named_at = slot + BLOCK;
    while blocks.len() < MOST_BLOCKS {
        let block =
            Block { at: number(file, named_at, 8), runs: number(file, named_at + 12, 4).min(64), named_at };
        if block.runs == 0 || block.range().end > file.len() || blocks.iter().any(|b| b.at == block.at) {
            break;
        }
        named_at = block.at;
        blocks.push(block);
    }
    blocks
}

/// Where the sections of a header slot are listed.
fn sections(file: &[u8], slot: usize) -> impl Iterator<Item = usize> + use<> {
    let count = usize::from(file[slot + 0x107]).min(8);
    (0..count).map(move |i| slot + SECTIONS + 24 * i)
}

fn range_of(file: &[u8], section: usize) -> Range<usize> {
    let from = number(file, section + 8, 8);
    from..from.saturating_add(number(file, section + 16, 8))
}

/// Makes the checksums of directory leaves those of what their blocks say, and that of the root, where the header names the one that is packed.
fn seal_directory(file: &mut [u8], slot: usize) {
    const FIRST_PAGE: u64 = 3;
    let of_kind = |kind: u32| {
        let found = sections(file, slot).find(|at| number(file, *at, 4) == kind as usize);
        found.map(|at| range_of(file, at)).filter(|range| range.start <= range.end && range.end <= file.len())
    };
    let (Some(runs), Some(index), Some(blocks)) = (of_kind(RUNS), of_kind(INDEX), of_kind(BLOCKS)) else {
        return;
    };
    let section = Section {
        kind: BLOCKS,
        checksum: 0,
        offset: blocks.start as u64,
        bytes: (blocks.end - blocks.start) as u64,
    };
    let record_pages = get_u64(file, slot + 0x068);
    let pages = [record_pages.min(MOST_PAGES), get_u64(file, slot + 0x110)];
    let parse = |file: &[u8]| {
        PackedLeaves::parse(&file[runs.clone()], &file[index.clone()], &section, pages, FIRST_PAGE)
    };
    let Some(leaves) = parse(file) else { return };
    for (at, entry) in index.clone().step_by(INDEX_BYTES).enumerate() {
        let page = leaves.unchecked_page(at, |offset, block| {
            let from = offset as usize;
            block.copy_from_slice(&file[from..from + block.len()]);
            Ok(())
        });
        if let Some(sum) = page.ok().flatten().map(|page| checksum(&page)) {
            file[entry + 1..entry + 5].copy_from_slice(&sum.to_le_bytes());
        }
    }
    let shape = DirectoryShape::new(file[slot + 0x010].into(), pages[0]);
    let root_page = FIRST_PAGE + pages[1] + leaves.count() + leaves.nodes(shape);
    if u64::from(get_u32(file, slot + 0x078)) == root_page
        && let Some(leaves) = parse(file)
    {
        let (_, root) = leaves.root(shape, pages[1]);
        file[slot + 0x080..slot + 0x084].copy_from_slice(&checksum(&root).to_le_bytes());
    }
}

fn leaf_sizes(file: &[u8], slot: usize) -> Vec<usize> {
    let samples = [0x014, 0x018].map(|field| get_u32(file, slot + field));
    // A grid with more leaves than the file has room for is refused anyway.
    if samples.iter().any(|side| *side > 1 << 14) {
        return Vec::new();
    }
    Grid::new(samples, [1.0; 2]).map_or_else(
        |_| Vec::new(),
        |grid| {
            let groups = Groups::of(&grid);
            (0..groups.leaves).map(|leaf| groups.leaf_size(leaf)).collect()
        },
    )
}

fn seal_leaf(file: &mut [u8], named_at: usize, tiles: usize, has_bounds: bool) {
    let at = number(file, named_at, 8);
    let range = at..at.saturating_add(tiles * PLACE_BYTES);
    if at == 0 || range.end > file.len() {
        return;
    }
    for tile in range.clone().step_by(PLACE_BYTES) {
        let mut from = number(file, tile, 6);
        for s in 0..SEGMENTS {
            let end = from.saturating_add(number(file, tile + 6 + 2 * s, 2));
            seal(file, tile + 12 + 4 * s, from..end);
            from = end;
        }
    }
    // Of a leaf with bounds, what is behind them.
    if has_bounds {
        seal(file, range.end + tiles * BOUND_BYTES, range.start..range.end + tiles * BOUND_BYTES);
    }
    seal(file, named_at + 8, range);
}

fn number(file: &[u8], at: usize, bytes: usize) -> usize {
    let mut raw = [0; 8];
    if let Some(found) = at.checked_add(bytes).and_then(|end| file.get(at..end)) {
        raw[..bytes].copy_from_slice(found);
    }
    usize::try_from(get_u64(&raw, 0)).unwrap_or(usize::MAX)
}

fn seal(file: &mut [u8], at: usize, range: Range<usize>) {
    if let Some(sum) = file.get(range).map(checksum)
        && let Some(place) = at.checked_add(4).and_then(|end| file.get_mut(at..end))
    {
        place.copy_from_slice(&sum.to_le_bytes());
    }
}

/// Parts of which each decides something, those of the header several times.
fn parts(file: &[u8]) -> Vec<Range<usize>> {
    let mut parts = Vec::new();
    for slot in slots(file) {
        parts.extend(
            [0x008..0x100, 0x100..0x110, 0x120..0x1e0, 0x1e0..0x1f8].map(|r| slot + r.start..slot + r.end),
        );
        for block in chain(file, slot) {
            parts.push(block.range());
            for run in block.runs() {
                let place = number(file, run + 8, 8);
                let bytes = number(file, run + 4, 4).saturating_mul(TABLE_ENTRY);
                parts.push(place..place.saturating_add(bytes));
                parts.push(place.saturating_add(bytes)..place.saturating_add(bytes).saturating_add(512));
            }
        }
        let sizes = leaf_sizes(file, slot);
        for section in sections(file, slot) {
            let range = range_of(file, section);
            if number(file, section, 4) == ROOT as usize && range.end <= file.len() {
                for (leaf, tiles) in range.clone().step_by(LEAF_BYTES).zip(&sizes) {
                    let at = number(file, leaf, 8);
                    let entries = at..at.saturating_add(tiles * PLACE_BYTES);
                    let first = number(file, at, 6);
                    parts.extend([entries, first..first.saturating_add(2048)]);
                }
            }
            parts.push(range);
        }
    }
    parts.retain(|part| part.start < part.end && part.end <= file.len());
    parts
}

#[cfg(test)]
mod tests {
    use super::super::seeds::packed_seeds;
    use super::*;
    use crate::file::source::MemorySource;
    use crate::read::terrain::Terrain;

    /// The sealer finds every checksum that a writer writes, and changes nothing else.
    #[test]
    fn sealing_a_sound_packed_file_changes_nothing() {
        for seed in packed_seeds() {
            let mut file = seed.files.terrain.clone();
            assert!(parts(&file).len() > 8, "{}", seed.name);
            let opens = |file: &[u8]| Terrain::from_source(Box::new(MemorySource::new("a", file.to_vec())));
            opens(&file).unwrap();
            // A checksum that is wrong is made right.
            for at in [0xffc, SECTIONS + 4, BLOCK + 8] {
                file[at] ^= u8::from(number(&file, BLOCK, 8) > 0 || at != BLOCK + 8);
            }
            mutate_packed(&mut file, &[]);
            assert!(file == seed.files.terrain, "{}", seed.name);
        }
    }
}
