//! A directory of PMTiles: entries in the order of their numbers (PMTiles 3.4, section 4.2).
//!
//! Numbers, lengths of runs, lengths and places come in four columns of numbers of variable length, and nothing behind them: so what a directory takes to unpack is in proportion to its entries. What comes
//! out is in order, and no two entries overlap. Cost: 32 bytes of memory an entry.

use super::curve::FIRST;

/// Entries of a directory, at most.
const MAX_ENTRIES: usize = 1 << 20;

/// Where a run of equal tiles is, or a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Entry {
    /// Number of the first tile.
    pub(super) id: u64,
    /// Tiles in a line that are these bytes; 0 of a leaf.
    pub(super) run: u64,
    pub(super) offset: u64,
    pub(super) length: u64,
}

/// Entries in order.
#[derive(Debug, Default)]
pub(super) struct Directory(Vec<Entry>);

/// Takes numbers of variable length from the front of some bytes.
struct Numbers<'b>(&'b [u8]);

impl Numbers<'_> {
    fn next(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let (byte, rest) = self.0.split_first()?;
            self.0 = rest;
            let part = u64::from(byte & 0x7f);
            if (part << shift) >> shift != part {
                return None;
            }
            value |= part << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }
}

impl Directory {
    /// Reads a directory.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, &'static str> {
        const SHORT: &str = "it is cut short or damaged; fetch the file again";
        let mut numbers = Numbers(bytes);
        let count = numbers.next().ok_or(SHORT)?;
        // Each entry takes four bytes at least.
        let count = usize::try_from(count).ok().filter(|count| *count <= bytes.len() / 4).ok_or(SHORT)?;
        if count > MAX_ENTRIES {
            return Err("it has more than a million entries; write the file again with leaf directories");
        }
        let mut entries = vec![Entry::default(); count];
        let mut id = 0u64;
        for entry in &mut entries {
            id = numbers.next().and_then(|step| id.checked_add(step)).ok_or(SHORT)?;
            entry.id = id;
        }
        for entry in &mut entries {
            entry.run = numbers.next().ok_or(SHORT)?;
        }
        for entry in &mut entries {
            entry.length = numbers.next().filter(|length| *length > 0).ok_or(SHORT)?;
        }
        let mut follows = None;
        for entry in &mut entries {
            let offset = numbers.next().ok_or(SHORT)?;
            entry.offset = if offset == 0 { follows.ok_or(SHORT)? } else { offset - 1 };
            follows = entry.offset.checked_add(entry.length);
        }
        if !numbers.0.is_empty() {
            return Err("it has bytes behind its last entry; fetch the file again");
        }
        let mut end = 0;
        for (i, entry) in entries.iter().enumerate() {
            if i > 0 && entry.id < end {
                return Err("its tiles are out of order; fetch the file again, or write it again");
            }
            end = entry
                .id
                .checked_add(entry.run.max(1))
                .filter(|end| *end <= FIRST[FIRST.len() - 1])
                .ok_or("it has tiles beyond the deepest zoom; fetch the file again")?;
        }
        Ok(Self(entries))
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The first number.
    pub(super) fn first(&self) -> Option<u64> {
        self.0.first().map(|entry| entry.id)
    }

    /// Behind the last number that an entry begins or ends with.
    pub(super) fn end(&self) -> u64 {
        self.0.last().map_or(0, |entry| entry.id + entry.run.max(1))
    }

    /// The last entry up to a number, and the number of the entry behind it.
    pub(super) fn find(&self, id: u64) -> Option<(Entry, u64)> {
        let behind = self.0.partition_point(|entry| entry.id <= id);
        let entry = self.0[..behind].last()?;
        Some((*entry, self.0.get(behind).map_or(u64::MAX, |next| next.id)))
    }

    /// Every entry, and the number of the one behind it.
    pub(super) fn entries(&self) -> impl Iterator<Item = (Entry, u64)> {
        let behind = self.0.iter().skip(1).map(|entry| entry.id).chain([u64::MAX]);
        self.0.iter().copied().zip(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_in_columns() {
        // Two tiles in a line with equal bytes, one behind them, and a leaf.
        let bytes = [3, 5, 2, 0x80, 1, 2, 1, 0, 10, 20, 30, 1, 0, 100];
        let directory = Directory::parse(&bytes).unwrap();
        let entry = |id, run, offset, length| Entry { id, run, offset, length };
        assert_eq!(directory.find(6), Some((entry(5, 2, 0, 10), 7)));
        assert_eq!(directory.find(7), Some((entry(7, 1, 10, 20), 135)));
        assert_eq!(directory.find(1000), Some((entry(135, 0, 99, 30), u64::MAX)));
        assert_eq!(directory.find(4), None);
    }

    #[test]
    fn nonsense_is_refused() {
        let refused = |bytes: &[u8]| Directory::parse(bytes).unwrap_err();
        assert!(refused(&[]).contains("cut short"));
        assert!(refused(&[2, 1, 1, 1]).contains("cut short"));
        assert!(refused(&[1, 5, 1, 0, 1]).contains("cut short"), "no bytes");
        assert!(refused(&[1, 5, 1, 9, 0]).contains("cut short"), "follows nothing");
        assert!(refused(&[1, 5, 1, 9, 1, 0]).contains("behind its last entry"));
        assert!(refused(&[0, 0]).contains("behind its last entry"), "no entries and a byte");
        assert!(refused(&[2, 5, 0, 1, 1, 9, 9, 1, 0]).contains("out of order"));
        assert!(refused(&[2, 5, 1, 2, 1, 9, 9, 1, 0]).contains("out of order"), "a run into the next");
        let long = [0xff; 9];
        let run = [&[1, 5][..], &long, &[1, 9, 1]].concat();
        assert!(refused(&run).contains("beyond the deepest"), "a run of 2^64");
        let id = [&[1][..], &long, &[1, 1, 9, 1]].concat();
        assert!(refused(&id).contains("beyond the deepest"));
        assert!(refused(&[&[1][..], &[0xff; 10], &[1; 9]].concat()).contains("cut short"), "eleven bytes");
    }
}
