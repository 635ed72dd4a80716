//! Numbers of any number of bits, one behind the other, read from a part of a file.
//!
//! The most significant bit comes first. Held are some kibibytes. Cost: a shift or two a number.

use super::Fault;
use std::fs::File;
use terrasoar_layout::file::disk::read_at;

/// Bytes that are read at once.
const BUFFER_BYTES: u64 = 1 << 16;

/// A part of a file as bits.
pub(super) struct Bits<'f> {
    file: &'f File,
    /// Bytes that were not read yet: from, to (not included).
    rest: [u64; 2],
    buffer: Vec<u8>,
    at: usize,
    /// Bits that were taken out of the buffer, in the lower end, and how many.
    held: u64,
    count: u32,
}

impl<'f> Bits<'f> {
    /// The bytes from a place up to another one.
    pub(super) fn new(file: &'f File, from: u64, to: u64) -> Self {
        Self { file, rest: [from, to], buffer: Vec::new(), at: 0, held: 0, count: 0 }
    }

    fn byte(&mut self) -> Result<u8, Fault> {
        if self.at == self.buffer.len() {
            let [from, to] = self.rest;
            let length = to.saturating_sub(from).min(BUFFER_BYTES);
            if length == 0 {
                return Err(Fault::Damaged("its numbers end early"));
            }
            self.buffer.resize(length as usize, 0);
            read_at(self.file, &mut self.buffer, from)?;
            (self.rest[0], self.at) = (from + length, 0);
        }
        self.at += 1;
        Ok(self.buffer[self.at - 1])
    }

    /// Passes over what is left of a byte.
    pub(super) fn align(&mut self) {
        self.count -= self.count % 8;
    }

    /// The next number of so many bits, at most 32; 0 of none.
    pub(super) fn number(&mut self, bits: u32) -> Result<u32, Fault> {
        while self.count < bits {
            self.held = self.held << 8 | u64::from(self.byte()?);
            self.count += 8;
        }
        self.count -= bits;
        let number = self.held >> self.count & ((1u64 << bits) - 1);
        Ok(number as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn numbers_of_any_width_come_back() {
        let mut file = tempfile::tempfile().unwrap();
        // 101 0000000111 1 11111111111111111111111111111111 0, and what fills the byte.
        let text = "101".to_owned() + "0000000111" + "1" + &"1".repeat(32) + "0" + "0";
        let bytes: Vec<u8> =
            text.as_bytes().chunks(8).map(|bits| bits.iter().fold(0, |b, c| b << 1 | (c - b'0'))).collect();
        file.write_all(b"xx").unwrap();
        file.write_all(&bytes).unwrap();
        let mut bits = Bits::new(&file, 2, 2 + bytes.len() as u64);
        let found = [3, 10, 0, 1, 32, 1].map(|count| bits.number(count).unwrap());
        assert_eq!(found, [5, 7, 0, 1, u32::MAX, 0]);
        assert!(bits.number(2).is_err());
    }
}
