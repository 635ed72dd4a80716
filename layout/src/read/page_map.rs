//! A number for each logical page, where most have the same: which place in memory a page has.
//!
//! Those of a square of up to 2^16 steps in compact records lie in one row, so that a look is one load. Where there are more, the first pages do; those behind lie in blocks of as many as a directory leaf
//! has, and blocks that are all the same are one. Cost: 4 bytes a logical page of the row, taken as they are written, and of the blocks behind it 4 bytes each and 1 KiB for each that is written to.

use crate::file::entries::ENTRIES_PER_LEAF;

/// Most pages that all lie in the row, which then has 32 MiB: those of a square of 2^16 steps in compact records, rounded up. What a header claims is no reason to ask the system for more. Over a square of 2^17 steps, which has more pages, SOAR takes 1.08 times as long as with one row, and kinetic no longer.
const MOST_IN_ROW: u64 = 1 << 23;
/// Pages of the row where there are more.
const SHORT_ROW: u64 = 1 << 20;
/// Pages a block.
const BLOCK: usize = ENTRIES_PER_LEAF;
/// The block whose numbers are all 0.
const ZEROS: u32 = 0;
/// The block whose numbers are all [`u32::MAX`].
const ONES: u32 = 1;

/// Numbers of logical pages, 0 at first.
#[derive(Debug, Clone, Default)]
pub(crate) struct PageMap {
    row: Vec<u32>,
    /// Which of `numbers` each block behind the row is.
    blocks: Vec<u32>,
    numbers: Vec<[u32; BLOCK]>,
    count: u64,
}

impl PageMap {
    /// Of so many pages, all of which have the number 0.
    pub(crate) fn new(count: u64) -> Self {
        Self::with_row(count, if count <= MOST_IN_ROW { count } else { SHORT_ROW })
    }

    fn with_row(count: u64, most: u64) -> Self {
        let row = count.min(most);
        let blocks = place((count - row).div_ceil(BLOCK as u64));
        let numbers = if blocks == 0 { Vec::new() } else { [0, u32::MAX].map(|v| [v; BLOCK]).into() };
        // Zeros that are never written take no memory.
        Self { row: vec![0; place(row)], blocks: vec![ZEROS; blocks], numbers, count }
    }

    /// Logical pages.
    #[inline(always)]
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// The pages of the row.
    #[inline(always)]
    pub(crate) fn row(&self) -> &[u32] {
        &self.row
    }

    /// The number of a page.
    ///
    /// # Panics
    /// For a page past the last one.
    #[inline(always)]
    pub(crate) fn at(&self, page: u64) -> u32 {
        match self.row.get(place(page)) {
            Some(number) => *number,
            None => self.behind(page),
        }
    }

    /// The number of a page behind the row.
    ///
    /// # Panics
    /// As [`PageMap::at`].
    #[cold]
    #[inline(never)]
    pub(crate) fn behind(&self, page: u64) -> u32 {
        let (block, within) = self.split(page);
        self.numbers[self.blocks[block] as usize][within]
    }

    /// The number of a page; `None` past the last one.
    #[inline(always)]
    pub(crate) fn get(&self, page: u64) -> Option<u32> {
        match self.row.get(place(page)) {
            Some(number) => Some(*number),
            None if page < self.count => Some(self.behind(page)),
            None => None,
        }
    }

    fn split(&self, page: u64) -> (usize, usize) {
        let behind = page - self.row.len() as u64;
        (place(behind / BLOCK as u64), (behind % BLOCK as u64) as usize)
    }

    /// Sets the number of a page.
    ///
    /// # Panics
    /// As [`PageMap::at`].
    pub(crate) fn set(&mut self, page: u64, number: u32) {
        if let Some(place) = self.row.get_mut(place(page)) {
            *place = number;
            return;
        }
        let (block, within) = self.split(page);
        let mut at = self.blocks[block];
        if self.numbers[at as usize][within] == number {
            return;
        }
        if at <= ONES {
            let own = self.numbers[at as usize];
            at = self.numbers.len() as u32;
            self.numbers.push(own);
            self.blocks[block] = at;
        }
        self.numbers[at as usize][within] = number;
    }

    /// Sets the numbers of all pages of a directory leaf to [`u32::MAX`]; `leaf` is its number.
    pub(crate) fn set_leaf_to_ones(&mut self, leaf: u64) {
        let first = leaf * BLOCK as u64;
        let end = (first + BLOCK as u64).min(self.count);
        if first >= self.row.len() as u64 && first < end {
            let block = self.split(first).0;
            self.blocks[block] = ONES;
        } else {
            (first..end).for_each(|page| self.set(page, u32::MAX));
        }
    }
}

/// A place in a row. Where a machine does not count so far there is nothing.
#[inline(always)]
fn place(page: u64) -> usize {
    usize::try_from(page).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        /// Against a plain map, wherever the row ends.
        #[test]
        fn pages_have_the_numbers_that_they_were_given(
            row in 0u64..4, count in 0u64..3000,
            steps in prop::collection::vec((0u64..3000, 0u32..5, any::<bool>()), 0..60),
        ) {
            let mut map = PageMap::with_row(count, row * BLOCK as u64);
            let mut plain: BTreeMap<u64, u32> = BTreeMap::new();
            for (page, number, whole) in steps.into_iter().filter(|(page, ..)| *page < count) {
                if whole {
                    let leaf = page / BLOCK as u64;
                    map.set_leaf_to_ones(leaf);
                    let pages = leaf * BLOCK as u64..(leaf + 1) * BLOCK as u64;
                    plain.extend(pages.filter(|page| *page < count).map(|page| (page, u32::MAX)));
                } else {
                    map.set(page, number);
                    plain.insert(page, number);
                }
            }
            prop_assert_eq!(map.count(), count);
            for page in 0..count {
                let number = plain.get(&page).copied().unwrap_or(0);
                prop_assert_eq!((map.at(page), map.get(page)), (number, Some(number)));
            }
            prop_assert_eq!(map.get(count), None);
            prop_assert_eq!(map.get(u64::MAX), None);
        }
    }

    #[test]
    fn as_many_pages_as_a_square_of_20_bits_has_in_the_largest_records() {
        let count = crate::grid::order::slot_count(20).div_ceil(256);
        assert!(count > u64::from(u32::MAX));
        let mut map = PageMap::new(count);
        map.set(count - 1, 7);
        map.set_leaf_to_ones((count - 1) / 256 - 1);
        assert_eq!([map.at(0), map.at(SHORT_ROW), map.at(count - 1)], [0, 0, 7]);
        assert_eq!(map.at((count - 1) / 256 * 256 - 1), u32::MAX);
        assert_eq!(map.get(count), None);
    }
}
