//! Numbers packed by CCSDS 121.0-B-3, as libaec packs them: blocks of numbers, each by whichever code is shortest.
//!
//! ```text
//! block      number of its code; the first of an interval also a number as it is, where differences were taken
//! code 0     a bit: 0 blocks of zeros, how many in ones; 1 pairs of small numbers in ones
//! codes 1 on each number's upper part in ones, then the lower bits of all
//! last code  numbers as they are
//! ```
//!
//! A number in ones is as many zeros before a one. Differences to the number before are folded to be positive. Held is one block. Crate rust-aec 0.1 loses numbers at the end. Cost: a step a bit.

use super::Fault;
use super::bits::Bits;
use super::section::Section;

/// So many blocks of zeros stand for all that are left of a part.
const REST: u64 = 5;
/// Blocks of a part.
const PART: u64 = 64;

/// Numbers as they are unpacked.
pub(super) struct Ccsds<'f> {
    bits: Bits<'f>,
    width: u32,
    code_bits: u32,
    block: usize,
    /// Blocks of an interval, and how many of this one are behind.
    interval: u64,
    done: u64,
    are_differences: bool,
    is_padded: bool,
    last: u64,
    /// Numbers of the block at hand, and which comes next.
    numbers: Vec<u64>,
    at: usize,
    /// Zeros that follow.
    zeros: u64,
}

impl<'f> Ccsds<'f> {
    /// Of section 5, for numbers of `width` bits.
    pub(super) fn new(bits: Bits<'f>, packing: &Section, width: u32) -> Result<Self, Fault> {
        let flags = packing.u8(22);
        if flags & 1 != 0 {
            return Err(Fault::Unsupported("its numbers of CCSDS have a sign".into()));
        }
        let (block, interval) = (usize::from(packing.u8(23)), u64::from(packing.u16(24)));
        if !matches!(block, 8 | 16 | 32 | 64) || interval == 0 || width == 0 || width > 32 {
            return Err(Fault::Damaged("its blocks of CCSDS cannot be"));
        }
        let is_restricted = flags & 16 != 0;
        let code_bits = match width {
            17.. => 5,
            9.. => 4,
            3..=4 if is_restricted => 2,
            1..=2 if is_restricted => 1,
            _ => 3,
        };
        Ok(Self {
            bits,
            width,
            code_bits,
            block,
            interval,
            done: 0,
            are_differences: flags & 8 != 0,
            is_padded: flags & 32 != 0,
            last: 0,
            numbers: Vec::with_capacity(block),
            at: 0,
            zeros: 0,
        })
    }

    /// The next number.
    pub(super) fn next(&mut self) -> Result<f64, Fault> {
        loop {
            if let Some(number) = self.numbers.get(self.at) {
                self.at += 1;
                return Ok(*number as f64);
            }
            if self.zeros > 0 {
                self.zeros -= 1;
                // No difference, or the number itself.
                return Ok(if self.are_differences { self.last as f64 } else { 0.0 });
            }
            self.next_block()?;
        }
    }

    fn next_block(&mut self) -> Result<(), Fault> {
        if self.done >= self.interval {
            self.done = 0;
            if self.is_padded {
                self.bits.align();
            }
        }
        self.numbers.clear();
        self.at = 0;
        let code = self.bits.number(self.code_bits)?;
        let is_low = code == 0;
        let are_pairs = is_low && self.bits.number(1)? == 1;
        if self.are_differences && self.done == 0 {
            self.last = self.bits.number(self.width)?.into();
            self.numbers.push(self.last);
        }
        if is_low && !are_pairs {
            let blocks = match self.ones()? + 1 {
                REST => (self.interval - self.done).min(PART - self.done % PART),
                blocks if blocks > REST => blocks - 1,
                blocks => blocks,
            };
            if blocks > self.interval - self.done {
                return Err(Fault::Damaged("its stream of CCSDS has zeros beyond an interval"));
            }
            self.zeros = blocks * self.block as u64 - self.numbers.len() as u64;
            self.done += blocks;
            return Ok(());
        }
        if are_pairs {
            while self.numbers.len() < self.block {
                let pair = self.ones()?;
                // The pair's sum, and its second number: pairs are counted by their sums.
                let sum = ((8 * pair + 1).isqrt() - 1) / 2;
                let second = pair - sum * (sum + 1) / 2;
                if self.numbers.len().is_multiple_of(2) {
                    self.push(sum - second)?;
                }
                self.push(second)?;
            }
        } else if code == (1 << self.code_bits) - 1 {
            while self.numbers.len() < self.block {
                let number = self.bits.number(self.width)?;
                self.push(number.into())?;
            }
        } else {
            self.split(code - 1)?;
        }
        self.done += 1;
        Ok(())
    }

    /// Numbers of which so many lower bits stand apart.
    fn split(&mut self, lower: u32) -> Result<(), Fault> {
        let first = self.numbers.len();
        let mut upper = [0; 64];
        for upper in &mut upper[first..self.block] {
            *upper = self.ones()?;
        }
        for upper in &upper[first..self.block] {
            let number = upper.checked_mul(1 << lower).ok_or(DAMAGED)? + u64::from(self.bits.number(lower)?);
            self.push(number)?;
        }
        Ok(())
    }

    /// A number in ones.
    fn ones(&mut self) -> Result<u64, Fault> {
        let mut number = 0;
        while self.bits.number(1)? == 0 {
            number += 1;
        }
        Ok(number)
    }

    /// Takes a number, unfolded where it is a difference.
    fn push(&mut self, number: u64) -> Result<(), Fault> {
        let most = (1u64 << self.width) - 1;
        if number > most {
            return Err(DAMAGED);
        }
        let number = if self.are_differences { self.unfold(number, most) } else { number };
        self.numbers.push(number);
        Ok(())
    }

    /// Where a folded difference leads: both ways while there is room on both sides, then on the side that has more.
    fn unfold(&mut self, folded: u64, most: u64) -> u64 {
        let is_high = self.last > most / 2;
        let room = if is_high { most - self.last } else { self.last };
        let half = folded.div_ceil(2);
        self.last = if half > room {
            if is_high { most - folded } else { folded }
        } else if folded.is_multiple_of(2) {
            self.last + half
        } else {
            self.last - half
        };
        self.last
    }
}

const DAMAGED: Fault = Fault::Damaged("its stream of CCSDS is damaged");
