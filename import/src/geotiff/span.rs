//! A stretch of a file, read through from its start.

use std::fs::File;
use std::io::Read;
use terrasoar_layout::file::disk::read_at;

/// Longest chunk of ZSTD that is unpacked at once where its window is larger than itself.
pub(super) const LARGEST_WHOLE: u64 = 8 << 20;

/// A part of a file, read from its begin to its end.
#[derive(Clone, Copy)]
pub(super) struct Span<'f> {
    pub(super) file: &'f File,
    pub(super) at: u64,
    pub(super) left: u64,
    /// Whether the bits of each byte stand the other way round.
    pub(super) is_reversed: bool,
}

impl Read for Span<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = buffer.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        read_at(self.file, &mut buffer[..count], self.at)?;
        turn_bits(&mut buffer[..count], self.is_reversed);
        self.at += count as u64;
        self.left -= count as u64;
        Ok(count)
    }
}

/// Turns the bits of each byte, if so it must be.
pub(super) fn turn_bits(bytes: &mut [u8], is_reversed: bool) {
    if is_reversed {
        bytes.iter_mut().for_each(|byte| *byte = byte.reverse_bits());
    }
}
