//! Complex packing (templates 5.2 and 5.3): numbers in groups, each with a lowest number and a width, of which differences may have been taken before.
//!
//! Lowest numbers, widths and lengths of all groups stand ahead of the numbers; four readers go through the section side by side, so that nothing is held. A number whose bits are all set is
//! missing, where the field says so. Differences are between the numbers that are there. Cost: some shifts and additions a number.

use super::Fault;
use super::bits::Bits;
use super::section::Section;
use std::fs::File;

/// Numbers in groups.
pub(super) struct Complex<'f> {
    lowest: Bits<'f>,
    widths: Bits<'f>,
    lengths: Bits<'f>,
    numbers: Bits<'f>,
    /// Bits of a lowest number, of a width and of a length.
    bits: [u32; 3],
    least_width: u32,
    /// A length is this, and steps of the other.
    least_length: u64,
    length_step: u64,
    last_length: u64,
    groups_left: u64,
    /// How many kinds of missing numbers there are.
    missing: u8,
    group: Group,
    differences: Differences,
}

/// What is left of a group.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    left: u64,
    lowest: i64,
    width: u32,
    /// Whether all of it is missing.
    is_missing: bool,
}

/// What differences were taken.
#[derive(Debug, Clone, Default)]
struct Differences {
    order: usize,
    least: i64,
    /// The numbers ahead of all, as they are.
    first: [i64; 2],
    before: [i64; 2],
    count: usize,
}

impl Differences {
    /// The number that a difference leads to.
    fn number(&mut self, difference: i64) -> i64 {
        let [last, earlier] = self.before;
        let number = match self.order {
            0 => return difference,
            order if self.count < order => self.first[self.count],
            1 => last.wrapping_add(difference).wrapping_add(self.least),
            _ => last.wrapping_mul(2).wrapping_sub(earlier).wrapping_add(difference).wrapping_add(self.least),
        };
        self.count += 1;
        self.before = [number, last];
        number
    }
}

impl<'f> Complex<'f> {
    /// Of section 5 and the bytes of section 7: from, to.
    pub(super) fn new(
        file: &'f File,
        packing: &Section,
        [from, to]: [u64; 2],
        points: u64,
    ) -> Result<Self, Fault> {
        let is_differenced = packing.u16(10) == 3;
        if packing.u8(22) != 1 {
            return Err(Fault::Unsupported(
                "its numbers are grouped row by row (GRIB code table 5.4)".into(),
            ));
        }
        let missing = packing.u8(23);
        if missing > 2 {
            return Err(Fault::Damaged("what it says of missing numbers is no code of GRIB"));
        }
        let groups = u64::from(packing.u32(32));
        let bits = [packing.u8(20), packing.u8(37), packing.u8(47)].map(u32::from);
        // Each group has a number.
        if groups > points || bits.iter().any(|bits| *bits > 32) {
            return Err(Fault::Damaged("its groups cannot be"));
        }
        let mut differences = Differences::default();
        let mut at = from;
        if is_differenced {
            let (order, octets) = (packing.u8(48), packing.u8(49));
            if !(1..=2).contains(&order) || octets > 4 {
                return Err(Fault::Unsupported(format!(
                    "differences of order {order} in {octets} bytes were taken"
                )));
            }
            let end = at + (u64::from(order) + 1) * u64::from(octets);
            let mut head = Bits::new(file, at, end.min(to));
            let width = u32::from(octets) * 8;
            if width > 0 {
                for number in &mut differences.first[..usize::from(order)] {
                    *number = i64::from(head.number(width)?);
                }
                let sign = head.number(1)?;
                let size = i64::from(head.number(width - 1)?);
                differences.least = if sign == 1 { -size } else { size };
            }
            (differences.order, at) = (order.into(), end);
        }
        let mut part = |bits: u32| {
            let begin = at;
            at += (groups * u64::from(bits)).div_ceil(8);
            Bits::new(file, begin, at.min(to))
        };
        let [lowest, widths, lengths] = bits.map(&mut part);
        Ok(Self {
            lowest,
            widths,
            lengths,
            numbers: Bits::new(file, at, to),
            bits,
            least_width: packing.u8(36).into(),
            least_length: packing.u32(38).into(),
            length_step: packing.u8(42).into(),
            last_length: packing.u32(43).into(),
            groups_left: groups,
            missing,
            group: Group::default(),
            differences,
        })
    }

    fn next_group(&mut self) -> Result<Group, Fault> {
        self.groups_left = self.groups_left.checked_sub(1).ok_or(Fault::Damaged("its groups end early"))?;
        let lowest = self.lowest.number(self.bits[0])?;
        let width = self.widths.number(self.bits[1])?.saturating_add(self.least_width);
        let scaled = u64::from(self.lengths.number(self.bits[2])?);
        if width > 32 {
            return Err(Fault::Damaged("a group has numbers of more than 32 bits"));
        }
        let left = if self.groups_left == 0 {
            self.last_length
        } else {
            self.least_length + scaled * self.length_step
        };
        let is_missing = width == 0 && self.is_missing(lowest, self.bits[0]);
        Ok(Group { left, lowest: lowest.into(), width, is_missing })
    }

    /// Whether a number of so many bits stands for one that is missing.
    fn is_missing(&self, number: u32, bits: u32) -> bool {
        let all = ((1u64 << bits) - 1) as u32;
        bits > 0 && (self.missing > 0 && number == all || self.missing == 2 && number == all.wrapping_sub(1))
    }

    /// The next number, NaN where it is missing.
    pub(super) fn next(&mut self) -> Result<f64, Fault> {
        while self.group.left == 0 {
            self.group = self.next_group()?;
        }
        self.group.left -= 1;
        let Group { lowest, width, is_missing, .. } = self.group;
        let above = self.numbers.number(width)?;
        if is_missing || width > 0 && self.is_missing(above, width) {
            return Ok(f64::NAN);
        }
        let number = self.differences.number(lowest + i64::from(above));
        // What is told as a number of 32 bits.
        match i32::try_from(number) {
            Ok(number) => Ok(number.into()),
            Err(_) => Err(Fault::Damaged("its differences lead out of what a number can be")),
        }
    }
}
