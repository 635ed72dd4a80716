//! Directory leaves of the terrain file as a packed one has them (FORMAT.md, section 9.7): which there are, how many pages each has, and its checksum stand at the file's front; which pages those are, and
//! their checksums, in a block for each leaf, which is read when a page of it is asked for.
//!
//! Invariant: the blocks of all leaves lie in the section that holds them, so a file claims no more pages than it has four bytes each for. Cost: 72 bytes a leaf that is present.

use super::container::Section;
use crate::error::LayoutError;
use crate::file::bytes::{checksum, get_u32, put_u32};
use crate::file::directory_shape::DirectoryShape;
use crate::file::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, leaf_page};
use std::path::Path;
use std::sync::OnceLock;

/// Bytes of a leaf in the list of leaves.
pub(crate) const INDEX_BYTES: usize = 5;
/// Bytes of the bits that say which pages of a leaf are present.
const BITS_BYTES: usize = ENTRIES_PER_LEAF / 8;
/// Which pages of a leaf are present, the first one lowest.
type Bits = [u64; ENTRIES_PER_LEAF / 64];

/// A leaf that is present.
#[derive(Debug, Clone, Copy)]
struct PackedLeaf {
    /// Its place in the root.
    number: u32,
    /// CRC-32 of the page that it is in the terrain file.
    checksum: u32,
    /// Record pages of the leaves before it.
    first: u64,
    pages: usize,
    /// First byte of its block in the file.
    block: u64,
}

impl PackedLeaf {
    fn block_bytes(&self) -> usize {
        block_bytes(self.pages)
    }
}

/// Bytes of the block of a leaf with so many pages.
fn block_bytes(pages: usize) -> usize {
    4 * pages + if pages < ENTRIES_PER_LEAF { BITS_BYTES } else { 0 }
}

/// All leaves that are present.
pub(crate) struct PackedLeaves {
    leaves: Vec<PackedLeaf>,
    /// Which pages of each are present, once its block was read.
    bits: Vec<OnceLock<Bits>>,
    /// Logical pages of the terrain.
    record_pages: u64,
    /// Number of the terrain file's first record page.
    first_page: u64,
}

impl PackedLeaves {
    /// From the sections of a file that packs `packed_pages` of `record_pages` pages, which begin with page `first_page` of the terrain file. `None` if they contradict that.
    pub(crate) fn parse(
        runs: &[u8],
        index: &[u8],
        blocks: &Section,
        [record_pages, packed_pages]: [u64; 2],
        first_page: u64,
    ) -> Option<Self> {
        let (index, rest) = index.as_chunks::<INDEX_BYTES>();
        let numbers =
            present_numbers(runs, record_pages.div_ceil(ENTRIES_PER_LEAF as u64), index.len() as u64)?;
        let (mut first, mut block) = (0, blocks.offset);
        let mut leaves = Vec::with_capacity(numbers.len());
        for (number, entry) in numbers.into_iter().zip(index) {
            let pages = usize::from(entry[0]) + 1;
            leaves.push(PackedLeaf { number, checksum: get_u32(entry, 1), first, pages, block });
            first += pages as u64;
            block = block.checked_add(block_bytes(pages) as u64)?;
        }
        let is_whole = rest.is_empty()
            && first == packed_pages
            && Some(block) == blocks.offset.checked_add(blocks.bytes);
        let bits = (0..leaves.len()).map(|_| OnceLock::new()).collect();
        is_whole.then_some(Self { leaves, bits, record_pages, first_page })
    }

    /// How many there are.
    pub(crate) fn count(&self) -> u64 {
        self.leaves.len() as u64
    }

    /// The terrain file's page that leaf `at`, of those that are present, is. `read` fills a buffer with the bytes at an offset of the packed file.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the leaf if its block does not give the page with its checksum; I/O.
    pub(crate) fn page(
        &self,
        path: &Path,
        at: usize,
        read: impl FnOnce(u64, &mut [u8]) -> Result<(), LayoutError>,
    ) -> Result<Vec<u8>, LayoutError> {
        let leaf = &self.leaves[at];
        let page = self.unchecked_page(at, read)?.filter(|page| checksum(page) == leaf.checksum);
        let Some(page) = page else {
            let place = format!("directory leaf {}", leaf.number);
            return Err(LayoutError::damaged_terrain(path, place, "the checksum does not match"));
        };
        let mut present = Bits::default();
        for i in (0..ENTRIES_PER_LEAF).filter(|i| Entry::read(&page, *i).is_present()) {
            present[i / 64] |= 1 << (i % 64);
        }
        let _ = self.bits[at].set(present);
        Ok(page)
    }

    /// As [`PackedLeaves::page`], whatever its checksum; `None` if the block has another number of pages than is said of it.
    pub(crate) fn unchecked_page(
        &self,
        at: usize,
        read: impl FnOnce(u64, &mut [u8]) -> Result<(), LayoutError>,
    ) -> Result<Option<Vec<u8>>, LayoutError> {
        let leaf = &self.leaves[at];
        let mut block = vec![0; leaf.block_bytes()];
        read(leaf.block, &mut block)?;
        let (bits, sums) = block.split_at(block.len() - 4 * leaf.pages);
        let is_present = |i: usize| bits.get(i / 8).is_none_or(|byte| byte >> (i % 8) & 1 == 1);
        let places: Vec<usize> = (0..ENTRIES_PER_LEAF).filter(|i| is_present(*i)).collect();
        let first = u64::from(leaf.number) * ENTRIES_PER_LEAF as u64;
        let most = self.record_pages.saturating_sub(first);
        if places.len() != leaf.pages || places.last().is_some_and(|last| *last as u64 >= most) {
            return Ok(None);
        }
        let mut entries = [Entry::default(); ENTRIES_PER_LEAF];
        for ((page, i), sum) in (self.first_page + leaf.first..).zip(places).zip(sums.as_chunks::<4>().0) {
            entries[i] = Entry { page: page as u32, checksum: u32::from_le_bytes(*sum), generation: 1 };
        }
        Ok(Some(leaf_page(&entries)))
    }

    /// The logical page that is the `nth` of those that are packed.
    ///
    /// # Errors
    /// As [`PackedLeaves::page`].
    pub(crate) fn logical(
        &self,
        path: &Path,
        nth: u64,
        read: impl FnOnce(u64, &mut [u8]) -> Result<(), LayoutError>,
    ) -> Result<u64, LayoutError> {
        let at = self.leaves.partition_point(|leaf| leaf.first <= nth).saturating_sub(1);
        let leaf = &self.leaves[at];
        if leaf.pages < ENTRIES_PER_LEAF && self.bits[at].get().is_none() {
            self.page(path, at, read)?;
        }
        let mut within = (nth - leaf.first) as u32;
        let bits = self.bits[at].get().copied().unwrap_or([u64::MAX; ENTRIES_PER_LEAF / 64]);
        let mut place = 0;
        for word in bits {
            if within < word.count_ones() {
                place += nth_bit(word, within);
                break;
            }
            within -= word.count_ones();
            place += 64;
        }
        Ok(u64::from(leaf.number) * ENTRIES_PER_LEAF as u64 + u64::from(place))
    }

    /// The nodes of the terrain file's directory, and its root, which leads to them, or to the leaves where there are none.
    pub(crate) fn root(&self, shape: DirectoryShape, packed_pages: u64) -> (PackedNodes, Vec<u8>) {
        let mut root = vec![0; shape.root_entries() as usize * ENTRY_BYTES];
        let first = self.first_page + packed_pages;
        let entry = |page: u64, checksum| Entry { page: page as u32, checksum, generation: 1 };
        let mut nodes = PackedNodes(Vec::new());
        if !shape.has_nodes() {
            for (page, leaf) in (first..).zip(&self.leaves) {
                entry(page, leaf.checksum).write(&mut root, leaf.number as usize);
            }
            return (nodes, root);
        }
        let first_node = first + self.count();
        let mut at = 0;
        for leaves in self.leaves.chunk_by(|a, b| node_of(a.number) == node_of(b.number)) {
            nodes.0.push(at);
            let page = nodes.page(self, nodes.count() - 1, first);
            let here = entry(first_node + nodes.count() - 1, checksum(&page));
            here.write(&mut root, node_of(leaves[0].number) as usize);
            at += leaves.len();
        }
        (nodes, root)
    }

    /// Nodes that are present, of a directory that has any.
    pub(crate) fn nodes(&self, shape: DirectoryShape) -> u64 {
        let nodes = self.leaves.chunk_by(|a, b| node_of(a.number) == node_of(b.number));
        if shape.has_nodes() { nodes.count() as u64 } else { 0 }
    }
}

/// Nodes that are present: place of the first leaf of each among those that are present.
#[derive(Debug)]
pub(crate) struct PackedNodes(Vec<usize>);

impl PackedNodes {
    fn count(&self) -> u64 {
        self.0.len() as u64
    }

    /// The terrain file's page that node `at`, of those that are present, is; the first leaf is page `first_leaf`. Zeros for one that there is not.
    pub(crate) fn page(&self, leaves: &PackedLeaves, at: u64, first_leaf: u64) -> Vec<u8> {
        let mut entries = [Entry::default(); ENTRIES_PER_LEAF];
        let Some(first) = usize::try_from(at).ok().and_then(|at| self.0.get(at).copied()) else {
            return leaf_page(&entries);
        };
        let node = node_of(leaves.leaves[first].number);
        let of_node = leaves.leaves[first..].iter().take_while(|leaf| node_of(leaf.number) == node);
        for (page, leaf) in (first_leaf + first as u64..).zip(of_node) {
            entries[leaf.number as usize % ENTRIES_PER_LEAF] =
                Entry { page: page as u32, checksum: leaf.checksum, generation: 1 };
        }
        leaf_page(&entries)
    }
}

/// Node of a leaf.
fn node_of(leaf: u32) -> u32 {
    leaf / ENTRIES_PER_LEAF as u32
}

/// Place of the `nth` bit that is set.
fn nth_bit(mut word: u64, nth: u32) -> u32 {
    for _ in 0..nth {
        word &= word.wrapping_sub(1);
    }
    word.trailing_zeros()
}

/// The sections of a directory of so many leaves, with these, by number and in order, of at most 256 entries each: runs of absent and present leaves, the list, the blocks.
#[cfg(feature = "files")]
pub(crate) fn packed_leaves<'e>(all: u64, leaves: impl Iterator<Item = (u64, &'e [Entry])>) -> [Vec<u8>; 3] {
    let present = |leaf: &[Entry]| leaf.iter().filter(|entry| entry.is_present()).count();
    let (mut numbers, mut index, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    for (number, leaf) in leaves {
        let count = present(leaf);
        if count == 0 {
            continue;
        }
        numbers.push(number);
        index.push((count - 1) as u8);
        let at = index.len();
        index.resize(at + 4, 0);
        put_u32(&mut index, at, checksum(&leaf_page(leaf)));
        if count < ENTRIES_PER_LEAF {
            let mut bits = [0; BITS_BYTES];
            for (i, _) in leaf.iter().enumerate().filter(|(_, entry)| entry.is_present()) {
                bits[i / 8] |= 1 << (i % 8);
            }
            blocks.extend(bits);
        }
        blocks.extend(
            leaf.iter().filter(|entry| entry.is_present()).flat_map(|entry| entry.checksum.to_le_bytes()),
        );
    }
    [runs_of(all, &numbers), index, blocks]
}

/// Runs of absent and present ones of `all` things in turn, absent ones first, seven bits a byte, the low ones first; `present` are the numbers of those that are, ascending.
#[cfg(any(test, feature = "files"))]
pub(crate) fn runs_of(all: u64, present: &[u64]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |mut run: u64| {
        while run >= 128 {
            bytes.push(run as u8 | 128);
            run >>= 7;
        }
        bytes.push(run as u8);
    };
    let mut at = 0;
    for run in present.chunk_by(|a, b| a + 1 == *b) {
        put(run[0] - at);
        put(run.len() as u64);
        at = run[0] + run.len() as u64;
    }
    // Nothing at all is a run of none.
    if at < all || all == 0 {
        put(all - at);
    }
    bytes
}

/// Numbers of those that are present, of which there are `count` among `all`. `None` if the bytes say anything else.
pub(crate) fn present_numbers(bytes: &[u8], all: u64, count: u64) -> Option<Vec<u32>> {
    let mut present = Vec::new();
    let (mut at, mut is_present, mut bytes) = (0u64, false, bytes.iter());
    while at < all {
        let mut run = 0u64;
        for shift in (0..).step_by(7) {
            let byte = bytes.next().filter(|_| shift < 63)?;
            run |= u64::from(byte & 127) << shift;
            if byte & 128 == 0 {
                break;
            }
        }
        let end = at.checked_add(run).filter(|end| *end <= all)?;
        if is_present {
            if present.len() as u64 + run > count {
                return None;
            }
            present.extend((at..end).map(|number| number as u32));
        }
        (at, is_present) = (end, !is_present);
    }
    (bytes.next().is_none() && present.len() as u64 == count).then_some(present)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_come_back(pages in prop::collection::vec((any::<bool>(), 1usize..400), 0..30)) {
            let all: Vec<bool> = pages.iter().flat_map(|(present, count)| vec![*present; *count]).collect();
            let expected: Vec<u32> = (0u32..).zip(&all).filter(|(_, p)| **p).map(|(i, _)| i).collect();
            let present: Vec<u64> = expected.iter().copied().map(u64::from).collect();
            let bytes = runs_of(all.len() as u64, &present);
            let count = expected.len() as u64;
            if !all.is_empty() {
                prop_assert_eq!(present_numbers(&bytes, all.len() as u64, count), Some(expected));
                prop_assert_eq!(present_numbers(&bytes, all.len() as u64, count + 1), None);
                prop_assert_eq!(present_numbers(&bytes[..bytes.len() - 1], all.len() as u64, count), None);
            }
        }

        #[test]
        fn any_bytes_are_runs_or_none(bytes in prop::collection::vec(any::<u8>(), 0..40), pages in 0u64..3000, count in 0u64..3000) {
            present_numbers(&bytes, pages, count);
        }
    }
}
