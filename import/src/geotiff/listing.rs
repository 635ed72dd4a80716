//! Where the chunks of an image lie: two lists of numbers in the file, read a block at a time.
//!
//! The lists are as long as the image has chunks, and a file of a few gigabytes, all holes, can list hundreds of millions. So they are never in memory as a whole. A
//! [`Listing`] knows where they stand, and a [`Places`] holds a block of them. Cost: 16 KiB a reader; two reads of the file a block of
//! [`BLOCK`] chunks, as long as chunks are asked for in order.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;

/// Chunks whose places are at hand at once.
const BLOCK: u64 = 1024;

/// A list of unsigned numbers in a TIFF file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    pub(super) count: u64,
    /// Bytes of a number: 1, 2, 4 or 8.
    pub(super) value_bytes: usize,
    pub(super) big_endian: bool,
    /// The numbers themselves where they stand in the directory.
    pub(super) inline: Option<[u8; 8]>,
    /// Where they stand otherwise.
    pub(super) at: u64,
}

impl Column {
    /// Appends the numbers `first..first + count`, which there are, to `numbers`.
    fn read(&self, file: &File, first: u64, count: u64, numbers: &mut Vec<u64>) -> std::io::Result<()> {
        let size = self.value_bytes;
        let (from, bytes) = (first * size as u64, count as usize * size);
        let mut read;
        let values = match &self.inline {
            // All of them are 8 bytes at most.
            Some(values) => &values[from as usize..from as usize + bytes],
            None => {
                read = vec![0; bytes];
                read_at(file, &mut read, self.at + from)?;
                &read[..]
            }
        };
        numbers.extend(values.chunks_exact(size).map(|value| whole_number(value, self.big_endian)));
        Ok(())
    }
}

/// Where offsets and packed lengths of the chunks are listed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Listing {
    offsets: Column,
    /// Nothing where the file states no lengths at all.
    lengths: Option<Column>,
    file_bytes: u64,
    /// Length of a chunk whose length is not stated, unless the file ends before.
    unstated_bytes: u64,
}

/// A chunk that the file has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) chunk: u64,
    pub(super) at: u64,
    /// Packed length; where the file states none, one that reaches over the chunk.
    pub(super) length: u64,
    pub(super) is_stated: bool,
}

impl Listing {
    /// Both lists, if they are of one length, of a file of `file_bytes`.
    pub(super) fn new(offsets: Column, lengths: Option<Column>, file_bytes: u64) -> Option<Self> {
        let is_whole = lengths.is_none_or(|lengths| lengths.count == offsets.count);
        is_whole.then_some(Self { offsets, lengths, file_bytes, unstated_bytes: u64::MAX })
    }

    /// Says how long a chunk can be at most whose length is not stated: a codec stops where it has what it was asked for.
    pub(super) fn set_unstated_bytes(&mut self, bytes: u64) {
        self.unstated_bytes = bytes;
    }

    /// The place that an offset and a length stand for. A chunk that was left out has no offset; a length of 0 beside an offset says only that
    /// the writer did not know better.
    fn place(&self, chunk: u64, offset: u64, length: u64) -> Option<Place> {
        let is_stated = length != 0;
        let unstated = || self.file_bytes.saturating_sub(offset).min(self.unstated_bytes);
        let length = if is_stated { length } else { unstated() };
        (offset != 0).then_some(Place { chunk, at: offset, length, is_stated })
    }

    /// Number of chunks listed.
    pub(super) fn count(&self) -> u64 {
        self.offsets.count
    }
}

/// Reads places of chunks from `file`.
#[derive(Debug)]
pub(super) struct Places<'f> {
    path: &'f Path,
    file: &'f File,
    listing: Listing,
    /// First chunk at hand.
    first: u64,
    offsets: Vec<u64>,
    lengths: Vec<u64>,
}

impl<'f> Places<'f> {
    pub(super) fn new(path: &'f Path, file: &'f File, listing: Listing) -> Self {
        Self { path, file, listing, first: 0, offsets: Vec::new(), lengths: Vec::new() }
    }

    /// Offset and packed length of a chunk; `None` if the file left it out.
    pub(super) fn get(&mut self, chunk: u64) -> Result<Option<(u64, u64)>, LayoutError> {
        if chunk < self.first || chunk - self.first >= self.offsets.len() as u64 {
            self.turn_to(chunk)?;
        }
        Ok(self.at_hand(chunk).map(|place| (place.at, place.length)))
    }

    /// The place of a chunk that is at hand.
    fn at_hand(&self, chunk: u64) -> Option<Place> {
        let at = (chunk - self.first) as usize;
        let offset = *self.offsets.get(at)?;
        self.listing.place(chunk, offset, self.lengths.get(at).copied().unwrap_or(0))
    }

    /// The first chunk from `chunk` on that the file has.
    pub(super) fn next(&mut self, mut chunk: u64) -> Result<Option<Place>, LayoutError> {
        while chunk < self.listing.count() {
            // Brings it to hand.
            self.get(chunk)?;
            let end = self.first + self.offsets.len() as u64;
            if let Some(place) = (chunk..end).find_map(|chunk| self.at_hand(chunk)) {
                return Ok(Some(place));
            }
            chunk = end;
        }
        Ok(None)
    }

    /// Brings the block of `chunk` to hand.
    fn turn_to(&mut self, chunk: u64) -> Result<(), LayoutError> {
        self.first = chunk / BLOCK * BLOCK;
        self.offsets.clear();
        self.lengths.clear();
        let count = BLOCK.min(self.listing.count().saturating_sub(self.first));
        let Listing { offsets, lengths, .. } = self.listing;
        let of_lengths = |numbers: &mut Vec<u64>| match lengths {
            Some(lengths) => lengths.read(self.file, self.first, count, numbers),
            None => Ok(()),
        };
        offsets
            .read(self.file, self.first, count, &mut self.offsets)
            .and_then(|()| of_lengths(&mut self.lengths))
            .map_err(|source| match source.kind() {
                ErrorKind::UnexpectedEof => LayoutError::damaged(
                    self.path,
                    "table of chunks",
                    "the file was cut short while it was read; start again",
                ),
                _ => LayoutError::io(self.path, "cannot read the TIFF file", source),
            })
    }
}

/// The unsigned number in at most 8 bytes.
pub(super) fn whole_number(bytes: &[u8], big_endian: bool) -> u64 {
    let add = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
    if big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn places_are_read_in_any_order_and_type() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&[0; 8]).unwrap();
        let count = 3 * BLOCK / 2;
        for chunk in 0..count {
            file.write_all(&(100 + chunk as u32).to_be_bytes()).unwrap();
        }
        for chunk in 0..count {
            file.write_all(&(chunk as u16 % 7).to_be_bytes()).unwrap();
        }
        let column = |value_bytes, at| Column { count, value_bytes, big_endian: true, inline: None, at };
        let mut listing = Listing::new(column(4, 8), Some(column(2, 8 + 4 * count)), 1000).unwrap();
        listing.set_unstated_bytes(500);
        let mut places = Places::new(Path::new("t.tif"), &file, listing);
        for chunk in [0, 1, BLOCK, BLOCK - 1, count - 1, 8] {
            // No length of 0: as much as a chunk can be, or as there is.
            let unstated = 900u64.saturating_sub(chunk).min(500);
            let length = if chunk % 7 == 0 { unstated } else { chunk % 7 };
            assert_eq!(places.get(chunk).unwrap(), Some((100 + chunk, length)), "{chunk}");
        }
        assert_eq!(places.get(count).unwrap(), None);
        let mut next = 0;
        while let Some(Place { chunk, at, is_stated, .. }) = places.next(next).unwrap() {
            assert_eq!((chunk, at, is_stated), (next, 100 + chunk, chunk % 7 != 0));
            next = chunk + 1;
        }
        assert_eq!(next, count);
        file.set_len(100).unwrap();
        let mut places = Places::new(Path::new("t.tif"), &file, listing);
        assert!(places.get(BLOCK).unwrap_err().to_string().contains("cut short"));
    }

    #[test]
    fn short_lists_stand_in_the_directory() {
        let column = |values: [u8; 8]| Column {
            count: 2,
            value_bytes: 4,
            big_endian: false,
            inline: Some(values),
            at: 0,
        };
        let offsets = column([9, 0, 0, 0, 8, 1, 0, 0]);
        let listing = Listing::new(offsets, Some(column([5, 0, 0, 0, 6, 0, 0, 0])), 1000).unwrap();
        let file = tempfile::tempfile().unwrap();
        let mut places = Places::new(Path::new("t.tif"), &file, listing);
        assert_eq!([0, 1].map(|chunk| places.get(chunk).unwrap().unwrap()), [(9, 5), (264, 6)]);
        let listing = Listing::new(column([9, 0, 0, 0, 0, 0, 0, 0]), None, 1000).unwrap();
        let mut places = Places::new(Path::new("t.tif"), &file, listing);
        assert_eq!([0, 1].map(|chunk| places.get(chunk).unwrap()), [Some((9, 991)), None]);
        assert!(Listing::new(offsets, Some(Column { count: 3, ..offsets }), 1000).is_none());
    }
}
