//! Checksums made right from the bottom up: record pages, tiles, leaves, roots, journal pages, header slots.
//!
//! Parts that share pages are sealed again until nothing changes or [`ROUNDS`] are over. Cost: a round makes the checksum of each page once, and of tiles
//! at most [`MOST_TILE_BYTES`].

use super::image::Image;
use super::parts::{Parts, page_of, tile_directory};
use crate::file::bytes::{PAGE_BYTES, checksum, get_u32};
use crate::file::directory_shape::DirectoryShape;
use crate::file::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES};
use crate::grid::Grid;
use crate::grid::order::slot_count;
use std::collections::{BTreeMap, BTreeSet};

const ROUNDS: usize = 4;
const MOST_TILE_BYTES: usize = 64 << 20;

/// What becomes of fields that count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counts {
    /// They stay as they are.
    Keep,
    /// They say what is there, as far as that can be: side and pages of the grid, pages and tiles stored, length of the file.
    Settle,
}

/// Makes the checksums of a terrain file right, those of its journal and of every state that it leads to among them.
pub fn reseal(terrain: &mut Vec<u8>, counts: Counts) {
    seal(&mut Image::terrain(terrain), counts);
}

/// As [`reseal`], of an overlay over the terrain file `base`, and makes it name that base.
pub fn reseal_overlay(base: &[u8], overlay: &mut Vec<u8>, counts: Counts) {
    seal(&mut Image::overlay(base, overlay), counts);
}

pub(super) fn seal(image: &mut Image<'_>, counts: Counts) {
    image.name_base();
    if counts == Counts::Settle {
        settle_grid(image);
    }
    for _ in 0..ROUNDS {
        if !round(image, counts) {
            break;
        }
    }
}

/// Makes the fields of a header that follow from others agree with them.
fn settle_grid(image: &mut Image<'_>) {
    for at in image.headers() {
        let samples = [image.u32_at(at + 0x014), image.u32_at(at + 0x018)];
        let Ok(grid) = Grid::new(samples, [1.0; 2]) else { continue };
        let Some(kind) = image.get(at + 0x011, 1).map(|kind| kind[0]) else { continue };
        let per_page = match kind {
            1 | 4 => 1024,
            2 => 512,
            _ => 256,
        };
        let record_pages = slot_count(grid.k()).div_ceil(per_page);
        image.put(at + 0x010, &[grid.k() as u8]);
        image.put(at + 0x068, &record_pages.to_le_bytes());
        let entries = DirectoryShape::new(grid.k(), record_pages).root_entries();
        image.put(at + 0x07c, &(entries as u32).to_le_bytes());
        let length = image.u64_at(at + 0x088).min(image.end() as u64);
        image.put(at + 0x088, &length.to_le_bytes());
    }
}

/// Seals everything once; tells whether anything changed.
fn round(image: &mut Image<'_>, counts: Counts) -> bool {
    let parts = Parts::of(image);
    let mut changed = false;
    for section in &parts.sections {
        changed |= seal_section(image, *section, counts);
    }
    let mut sums = BTreeMap::new();
    let mut leaves = BTreeSet::new();
    for root in &parts.roots {
        let at = root.page as usize * PAGE_BYTES;
        for leaf in root.leaves(image) {
            if leaves.insert(leaf) {
                changed |= seal_leaf(image, leaf, &mut sums);
            }
        }
        let mut stored = 0;
        if root.has_nodes {
            for i in 0..root.entries {
                let node = image.u32_at(at + i * ENTRY_BYTES);
                if node != 0 && page_of(image, node).is_some() {
                    let first = i as u64 * ENTRIES_PER_LEAF as u64;
                    let entries = (node as usize * PAGE_BYTES, ENTRIES_PER_LEAF);
                    changed |= seal_entries(image, entries, (first, root.record_pages), &mut stored);
                }
            }
            changed |= seal_entries(image, (at, root.entries), (0, 0), &mut stored);
        } else {
            changed |= seal_entries(image, (at, root.entries), (0, root.record_pages), &mut stored);
        }
        if let Some(sum) = image.sum(at, root.entries * ENTRY_BYTES) {
            changed |= image.put(root.checksum_at, &sum.to_le_bytes());
            if counts == Counts::Settle {
                changed |= image.put(root.stored_at, &stored.to_le_bytes());
            }
        }
    }
    for page in &parts.journal {
        changed |= seal_page(image, *page as usize * PAGE_BYTES);
    }
    for at in image.headers() {
        changed |= seal_page(image, at);
    }
    changed
}

/// Checksums of the pages that `count` entries at `at` name, which are leaf `first` and those behind it; adds their record pages to those `stored`, as far as there are so many.
fn seal_entries(
    image: &mut Image<'_>,
    (at, count): (usize, usize),
    (first, record_pages): (u64, u64),
    stored: &mut u64,
) -> bool {
    let per_leaf = ENTRIES_PER_LEAF as u64;
    let mut changed = false;
    for i in 0..count {
        let leaf = image.u32_at(at + i * ENTRY_BYTES);
        let Some(page) = page_of(image, leaf).filter(|_| leaf != 0) else { continue };
        let left = record_pages.saturating_sub((first + i as u64) * per_leaf);
        let entries = page.chunks_exact(ENTRY_BYTES).take(left.min(per_leaf) as usize);
        *stored += entries.filter(|entry| get_u32(entry, 0) != 0).count() as u64;
        let sum = checksum(page);
        changed |= image.put(at + i * ENTRY_BYTES + 4, &sum.to_le_bytes());
    }
    changed
}

/// Checksums of the record pages that a leaf names.
fn seal_leaf(image: &mut Image<'_>, leaf: u32, sums: &mut BTreeMap<u32, u32>) -> bool {
    let at = leaf as usize * PAGE_BYTES;
    let mut changed = false;
    for entry in (at..at + PAGE_BYTES).step_by(ENTRY_BYTES) {
        let page = image.u32_at(entry);
        if page == 0 {
            continue;
        }
        let Some(bytes) = page_of(image, page) else { continue };
        let sum = *sums.entry(page).or_insert_with(|| checksum(bytes));
        changed |= image.put(entry + 4, &sum.to_le_bytes());
    }
    changed
}

fn seal_section(image: &mut Image<'_>, at: usize, counts: Counts) -> bool {
    let mut changed = false;
    if let Some(directory) = tile_directory(image, at) {
        let (mut stored, mut stored_bytes, mut budget) = (0u64, 0u64, MOST_TILE_BYTES);
        for entry in (0..directory.tiles).map(|i| directory.at + i * ENTRY_BYTES) {
            let (page, bytes) = (image.u32_at(entry), image.u32_at(entry + 4));
            if page == 0 {
                continue;
            }
            stored += 1;
            stored_bytes += u64::from(bytes);
            let Some(left) = budget.checked_sub(bytes as usize) else { continue };
            let begin = page as usize * PAGE_BYTES;
            if let Some(sum) = image.sum(begin, bytes as usize) {
                changed |= image.put(entry + 8, &sum.to_le_bytes());
                budget = left;
            }
        }
        if counts == Counts::Settle {
            changed |= image.put(at + 0x048, &stored.to_le_bytes());
            changed |= image.put(at + 0x050, &stored_bytes.to_le_bytes());
        }
        if let Some(sum) = image.sum(directory.at, directory.tiles * ENTRY_BYTES) {
            changed |= image.put(at + 0x05c, &sum.to_le_bytes());
        }
    }
    changed | seal_page(image, at)
}

/// The checksum that a page ends with.
fn seal_page(image: &mut Image<'_>, at: usize) -> bool {
    image.sum(at, 0xffc).is_some_and(|sum| image.put(at + 0xffc, &sum.to_le_bytes()))
}
