//! The directory of a picture's tiles in memory: what it says of the tiles that are stored, in runs of 64 entries, and nothing of runs without one.
//!
//! In the file it has 16 bytes for every tile that there could be. A picture of islands far apart has millions of those and stores few. Invariant: each run that is kept has a tile that is stored. Cost: 1 KiB a run at the
//! most; finding an entry is finding its run in a tree.

use super::section::{TILE_ENTRY_BYTES, TileEntry};
use crate::error::LayoutError;
use crate::file::bytes::to_usize;
use std::collections::{BTreeMap, BTreeSet};

/// Entries of a run.
const RUN: u64 = 64;
/// Bytes that are read or written at a time, of whole runs.
const PIECE_BYTES: usize = 1 << 16;

type Run = [TileEntry; RUN as usize];

/// Entries of all tiles, in the order of the directory.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entries {
    count: u64,
    runs: BTreeMap<u32, Box<Run>>,
}

impl Entries {
    /// Of so many tiles, none of which is stored.
    pub(super) fn none_of(count: u64) -> Self {
        Self { count, runs: BTreeMap::new() }
    }

    /// The directory of so many tiles whose bytes `read` gives, and its checksum.
    ///
    /// # Errors
    /// Those of `read`.
    pub(super) fn read(
        count: u64,
        read: impl Fn(u64, &mut [u8]) -> Result<(), LayoutError>,
    ) -> Result<(Self, u32), LayoutError> {
        let mut entries = Self::none_of(count);
        let mut sum = crc32fast::Hasher::new();
        let bytes = count * TILE_ENTRY_BYTES as u64;
        let mut piece = Vec::new();
        for at in (0..bytes).step_by(PIECE_BYTES) {
            piece.resize(to_usize((bytes - at).min(PIECE_BYTES as u64))?, 0);
            read(at, &mut piece)?;
            sum.update(&piece);
            let first = at / TILE_ENTRY_BYTES as u64;
            for (i, bytes) in piece.as_chunks::<TILE_ENTRY_BYTES>().0.iter().enumerate() {
                if bytes.iter().any(|byte| *byte != 0) {
                    entries.set(first + i as u64, TileEntry::read(bytes, 0));
                }
            }
        }
        Ok((entries, sum.finalize()))
    }

    /// Calls `put` with the directory's bytes, one piece after the other.
    ///
    /// # Errors
    /// Those of `put`.
    pub(super) fn pieces(
        &self,
        mut put: impl FnMut(&[u8]) -> Result<(), LayoutError>,
    ) -> Result<(), LayoutError> {
        let per_piece = (PIECE_BYTES / TILE_ENTRY_BYTES) as u64;
        let mut piece = vec![0; PIECE_BYTES];
        for first in (0..self.count).step_by(per_piece as usize) {
            let count = (self.count - first).min(per_piece);
            piece.fill(0);
            for (i, entry) in self.between(first, count) {
                entry.write(&mut piece, (i - first) as usize);
            }
            put(&piece[..count as usize * TILE_ENTRY_BYTES])?;
        }
        Ok(())
    }

    /// Checksum of the directory's bytes.
    pub(super) fn checksum(&self) -> u32 {
        let mut sum = crc32fast::Hasher::new();
        let summed = self.pieces(|piece| {
            sum.update(piece);
            Ok(())
        });
        debug_assert!(summed.is_ok(), "nothing is written");
        sum.finalize()
    }

    /// An entry; that of a tile which is not stored where there is none.
    pub(super) fn get(&self, index: u64) -> TileEntry {
        let run = u32::try_from(index / RUN).ok().and_then(|run| self.runs.get(&run));
        run.map_or_else(TileEntry::default, |run| run[(index % RUN) as usize])
    }

    /// Puts an entry in place of another.
    pub(super) fn set(&mut self, index: u64, entry: TileEntry) {
        let Some(number) = u32::try_from(index / RUN).ok().filter(|_| index < self.count) else { return };
        let empty = TileEntry::default();
        if entry != empty {
            let run = self.runs.entry(number).or_insert_with(|| Box::new([empty; RUN as usize]));
            run[(index % RUN) as usize] = entry;
        } else if let Some(run) = self.runs.get_mut(&number) {
            run[(index % RUN) as usize] = empty;
            if run.iter().all(|entry| *entry == empty) {
                self.runs.remove(&number);
            }
        }
    }

    /// Entries that say anything, with their indices, in order.
    pub(super) fn all(&self) -> impl Iterator<Item = (u64, TileEntry)> + Clone + '_ {
        self.between(0, self.count)
    }

    /// Those of so many from an index on, both of whole runs.
    fn between(&self, first: u64, count: u64) -> impl Iterator<Item = (u64, TileEntry)> + Clone + '_ {
        let [from, to] = [first, first + count].map(|i| u32::try_from(i.div_ceil(RUN)).unwrap_or(u32::MAX));
        self.runs.range(from..to).flat_map(|(number, run)| {
            let first = u64::from(*number) * RUN;
            (first..).zip(run.iter().copied()).filter(|(_, entry)| *entry != TileEntry::default())
        })
    }

    /// Indices of entries that are not the same in another directory.
    pub(super) fn differing(&self, other: &Self) -> Vec<u64> {
        let numbers: BTreeSet<u32> = self.runs.keys().chain(other.runs.keys()).copied().collect();
        let unlike = |number: u32| self.runs.get(&number) != other.runs.get(&number);
        let indices = numbers.into_iter().filter(|number| unlike(*number)).flat_map(|number| {
            let first = u64::from(number) * RUN;
            first..first + RUN
        });
        indices.filter(|index| self.get(*index) != other.get(*index)).collect()
    }

    /// Runs that are kept.
    #[cfg(test)]
    fn runs(&self) -> usize {
        self.runs.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::bytes::checksum;
    use crate::mix::Random;

    fn entry(i: u64) -> TileEntry {
        TileEntry { page: i as u32 + 3, bytes: 8, checksum: 7 * i as u32, average: [i as u8; 4] }
    }

    /// Against a plain row of entries.
    #[test]
    fn entries_are_those_of_a_row_of_all() {
        for (count, stored) in [(0, 0), (1, 1), (63, 20), (64, 64), (5_000, 0), (5_000, 4_999), (300_001, 40)]
        {
            let mut random = Random::new(count + stored);
            let mut row = vec![TileEntry::default(); count as usize];
            let mut entries = Entries::none_of(count);
            for i in 0..stored {
                let index = random.below(count);
                row[index as usize] = entry(i);
                entries.set(index, entry(i));
            }
            // Some are taken away again.
            for _ in 0..stored / 3 {
                let index = random.below(count);
                row[index as usize] = TileEntry::default();
                entries.set(index, TileEntry::default());
            }
            entries.set(count, entry(1));
            assert!((0..count).all(|i| entries.get(i) == row[i as usize]));
            let all: Vec<_> =
                (0..).zip(row.iter().copied()).filter(|(_, e)| *e != TileEntry::default()).collect();
            assert_eq!(entries.all().collect::<Vec<_>>(), all);
            assert!(entries.runs() <= all.len());
            let mut bytes = vec![0; row.len() * TILE_ENTRY_BYTES];
            row.iter().enumerate().for_each(|(i, entry)| entry.write(&mut bytes, i));
            let mut written = Vec::new();
            entries
                .pieces(|piece| {
                    written.extend_from_slice(piece);
                    Ok(())
                })
                .unwrap();
            assert!(written == bytes);
            assert_eq!(entries.checksum(), checksum(&bytes));
            let read = |at: u64, to: &mut [u8]| {
                to.copy_from_slice(&bytes[at as usize..][..to.len()]);
                Ok(())
            };
            assert_eq!(Entries::read(count, read).unwrap(), (entries.clone(), checksum(&bytes)));
            let mut other = entries.clone();
            let changed: BTreeSet<u64> = (0..count.min(9)).map(|_| random.below(count)).collect();
            changed.iter().for_each(|index| other.set(*index, entry(9_999)));
            let changed: Vec<u64> = changed.into_iter().collect();
            assert_eq!((entries.differing(&other), other.differing(&entries)), (changed.clone(), changed));
            assert!(entries.differing(&entries.clone()).is_empty());
        }
    }
}
