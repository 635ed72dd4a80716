//! Bits one after the other in bytes, the low ones first.

/// Bits on their way into bytes.
#[derive(Debug, Clone, Default)]
pub(crate) struct BitWriter {
    bytes: Vec<u8>,
    waiting: u64,
    count: u32,
}

impl BitWriter {
    /// Appends the low `count` bits of `value`, at most 32; the others are 0.
    #[inline(always)]
    pub(crate) fn put(&mut self, value: u32, count: u32) {
        self.waiting |= u64::from(value) << self.count;
        self.count += count;
        if self.count >= 32 {
            self.bytes.extend((self.waiting as u32).to_le_bytes());
            self.waiting >>= 32;
            self.count -= 32;
        }
    }

    /// Appends numbers of so many bits, at most 14 each: faster than one by one.
    #[inline(always)]
    pub(crate) fn put_some<const N: usize>(&mut self, some: [(u16, u8); N]) {
        let mut at = self.bytes.len();
        // Whole bytes of what waits, bits of the numbers, and a word that is stored over what follows.
        self.bytes.resize(at + 4 + 2 * N + 8, 0);
        let mut store = |waiting: &mut u64, count: &mut u32| {
            if let Some(place) = self.bytes.get_mut(at..at + 8) {
                place.copy_from_slice(&waiting.to_le_bytes());
            }
            at += (*count / 8) as usize;
            *waiting >>= *count & !7;
            *count &= 7;
        };
        let (mut waiting, mut count) = (self.waiting, self.count);
        store(&mut waiting, &mut count);
        for few in some.chunks(4) {
            for (value, bits) in few {
                waiting |= u64::from(*value) << count;
                count += u32::from(*bits);
            }
            store(&mut waiting, &mut count);
        }
        self.bytes.truncate(at);
        (self.waiting, self.count) = (waiting, count);
    }

    /// Appends all bytes to `bytes`, the last one filled up with zeros.
    pub(crate) fn write(&self, bytes: &mut Vec<u8>) {
        let last = self.waiting.to_le_bytes();
        bytes.extend_from_slice(&self.bytes);
        bytes.extend_from_slice(&last[..self.count.div_ceil(8) as usize]);
    }

    /// All bytes.
    pub(crate) fn finish(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.write(&mut bytes);
        bytes
    }

    /// Forgets all bits, and keeps the room.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        (self.waiting, self.count) = (0, 0);
    }
}

/// Bits out of bytes. Behind the end there are zeros.
#[derive(Debug, Clone)]
pub(crate) struct BitReader<'b> {
    bytes: &'b [u8],
    /// Bits taken.
    at: usize,
}

impl<'b> BitReader<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next `count` bits, at most 32.
    #[inline]
    pub(crate) fn take(&mut self, count: u32) -> u32 {
        let from = self.at >> 3;
        let word = match self.bytes.get(from..).and_then(|rest| rest.first_chunk::<8>()) {
            Some(chunk) => u64::from_le_bytes(*chunk),
            None => self.last_word(from),
        };
        let value = word >> (self.at & 7) & ((1 << count) - 1);
        self.at += count as usize;
        value as u32
    }

    /// Takes bits a few times, at most 249 bits together, at most 32 at a time: faster than one by one.
    #[inline(always)]
    pub(crate) fn take_some(&mut self, mut take: impl FnMut(&mut SomeBits<'_>)) {
        let from = self.at >> 3;
        let mut last = [0; WINDOW];
        let bytes = match self.bytes.get(from..).and_then(|rest| rest.first_chunk()) {
            Some(bytes) => bytes,
            None => {
                let rest = self.bytes.get(from..).unwrap_or_default();
                last[..rest.len()].copy_from_slice(rest);
                &last
            }
        };
        let mut some = SomeBits { bytes, at: self.at & 7 };
        take(&mut some);
        self.at = 8 * from + some.at;
    }

    #[cold]
    fn last_word(&self, from: usize) -> u64 {
        let rest = self.bytes.get(from..).unwrap_or_default();
        rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
    }

    /// Whether all bytes were taken, and no more, and what is left of the last is 0.
    pub(crate) fn is_at_end(&self) -> bool {
        self.at.div_ceil(8) == self.bytes.len()
            && (self.at.is_multiple_of(8) || self.bytes[self.at / 8] >> (self.at % 8) == 0)
    }
}

/// Most bits of [`BitReader::take_some`].
#[cfg(test)]
const SOME_BITS: usize = 8 * (WINDOW - 8) - 7;
const WINDOW: usize = 40;

/// The next bits.
#[derive(Debug)]
pub(crate) struct SomeBits<'b> {
    bytes: &'b [u8; WINDOW],
    at: usize,
}

impl SomeBits<'_> {
    /// The next `count` bits, at most 32.
    #[inline(always)]
    pub(crate) fn take(&mut self, count: u32) -> u32 {
        let from = self.at >> 3 & (WINDOW - 9);
        let mut word = [0; 8];
        word.copy_from_slice(&self.bytes[from..from + 8]);
        let value = u64::from_le_bytes(word) >> (self.at & 7) & ((1 << count) - 1);
        self.at += count as usize;
        value as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bits_come_back(values in prop::collection::vec((any::<u32>(), 0u32..=32), 0..100)) {
            let mut writer = BitWriter::default();
            let low = |value: u32, count: u32| (u64::from(value) & ((1 << count) - 1)) as u32;
            values.iter().for_each(|(value, count)| writer.put(low(*value, *count), *count));
            let bytes = writer.finish();
            let mut other = BitWriter::default();
            for (i, (value, count)) in values.iter().enumerate() {
                let [low_count, high_count] = [*count / 3, *count - *count / 3].map(|bits| bits.min(14));
                let rest = *count - low_count - high_count;
                let parts = [(0, low_count), (low_count, high_count), (low_count + high_count, rest)];
                let part = |(from, bits): (u32, u32)| low(value.checked_shr(from).unwrap_or(0), bits);
                if i % 3 == 0 {
                    parts.into_iter().for_each(|at| other.put(part(at), at.1));
                } else {
                    let [a, b, c] = parts.map(|at| (part(at) as u16, at.1 as u8));
                    other.put_some([a, b, c, (0, 0), (0, 0)]);
                }
            }
            prop_assert_eq!(&other.finish(), &bytes);
            let mut reader = BitReader::new(&bytes);
            for (value, count) in &values {
                prop_assert_eq!(reader.take(*count), low(*value, *count));
            }
            prop_assert!(reader.is_at_end());
            let mut reader = BitReader::new(&bytes);
            for some in values.chunks(SOME_BITS / 32) {
                reader.take_some(|bits| some.iter().for_each(|(value, count)| assert_eq!(bits.take(*count), low(*value, *count))));
            }
            prop_assert!(reader.is_at_end());
            reader.take(9);
            prop_assert!(!reader.is_at_end());
        }
    }
}
