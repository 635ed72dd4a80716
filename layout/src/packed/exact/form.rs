//! Exact and fine records in parts: the bits of a height, of an error and of a radius.

use crate::grid::record::{Compact, RecordCodec, RecordKind};

/// Which kind of exact or fine records a terrain has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// 4 bytes: a height of 16 bits, an error of ten and a radius of six.
    Fine,
    /// 8 bytes: a single, and the upper halves of two more.
    Single,
    /// 16 bytes: a double and two singles.
    Double,
}

/// First error code of fine records on the fringe, and the largest of others.
const FRINGE: u8 = 248;
pub(super) const TOP_FINE_ERROR: u32 = 991;

/// A record's parts, as bits. The codes of fine records are numbers that grow with error and radius; on the fringe the sign bit and the record's own codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Parts {
    pub(super) height: u64,
    pub(super) error: u32,
    pub(super) radius: u32,
}

impl Form {
    /// That of a kind of records; `None` for compact ones.
    pub(crate) fn of(kind: RecordKind) -> Option<Self> {
        match kind {
            RecordKind::Compact => None,
            RecordKind::Fine => Some(Self::Fine),
            RecordKind::Exact8 => Some(Self::Single),
            RecordKind::Exact16 => Some(Self::Double),
        }
    }

    /// Words of 4 bytes a record.
    pub(crate) fn words(self) -> usize {
        match self {
            Self::Fine => 1,
            Self::Single => 2,
            Self::Double => 4,
        }
    }

    /// The words of an inert record.
    pub(crate) fn inert_words(self) -> &'static [u32] {
        match self {
            Self::Fine => &[Compact::INERT],
            Self::Single => &[0, 0xffff_0000],
            Self::Double => &[0, 0, 0, u32::MAX],
        }
    }

    /// Bits of a height.
    pub(super) fn height_bits(self) -> u32 {
        match self {
            Self::Fine => 16,
            Self::Single => 32,
            Self::Double => 64,
        }
    }

    /// Bits of an error or a radius.
    pub(super) fn code_bits(self) -> u32 {
        match self {
            Self::Fine | Self::Single => 16,
            Self::Double => 32,
        }
    }

    /// The sign bit of an error or a radius.
    pub(super) fn sign(self) -> u32 {
        1 << (self.code_bits() - 1)
    }

    /// All bits of an error or a radius.
    pub(super) fn code_mask(self) -> u32 {
        u32::MAX >> (32 - self.code_bits())
    }

    /// The record of an inert vertex.
    pub(super) fn inert(self) -> Parts {
        Parts { height: 0, error: 0, radius: self.code_mask() }
    }

    /// The parts of a record's words.
    #[inline(always)]
    pub(super) fn parts(self, words: &[u32]) -> Parts {
        match (self, words) {
            (Self::Fine, [raw]) if *raw == Compact::INERT => self.inert(),
            (Self::Fine, [raw]) => {
                let (height, [_, _, error, last]) = (u64::from(raw & 0xffff), raw.to_le_bytes());
                if error >= FRINGE {
                    let error = self.sign() | u32::from(error - FRINGE);
                    return Parts { height, error, radius: last.into() };
                }
                let (error, radius) = Compact::fine_codes(*raw);
                Parts { height, error: error.into(), radius: radius.into() }
            }
            (Self::Single, [height, codes]) => {
                Parts { height: u64::from(*height), error: codes & 0xffff, radius: codes >> 16 }
            }
            (Self::Double, [low, high, error, radius]) => {
                Parts { height: u64::from(*low) | u64::from(*high) << 32, error: *error, radius: *radius }
            }
            _ => self.inert(),
        }
    }

    /// Puts a record into its words.
    #[inline(always)]
    pub(super) fn put(self, parts: Parts, words: &mut [u32]) {
        match (self, words) {
            (Self::Fine, [raw]) => {
                let height = parts.height as u32 & 0xffff;
                *raw = if parts == self.inert() {
                    Compact::INERT
                } else if parts.error & self.sign() != 0 {
                    height | u32::from(FRINGE | parts.error as u8 & 7) << 16 | parts.radius << 24
                } else {
                    // What no writer makes is cut to what there is.
                    height
                        | Compact::of_fine_codes(
                            parts.error.min(TOP_FINE_ERROR) as u16,
                            parts.radius as u8 & 63,
                        )
                };
            }
            (Self::Single, [height, codes]) => {
                *height = parts.height as u32;
                *codes = parts.error & 0xffff | parts.radius << 16;
            }
            (Self::Double, [low, high, error, radius]) => {
                *low = parts.height as u32;
                *high = (parts.height >> 32) as u32;
                *error = parts.error;
                *radius = parts.radius;
            }
            _ => {}
        }
    }

    /// The number that a height's bits are; 0 for what is none.
    #[inline(always)]
    pub(super) fn value(self, bits: u64) -> f64 {
        let value = match self {
            Self::Fine => f64::from(bits as u16),
            Self::Single => f64::from(f32::from_bits(bits as u32)),
            Self::Double => f64::from_bits(bits),
        };
        if value.is_finite() { value } else { 0.0 }
    }

    /// The bits of the height nearest to `value`; those of 0 where there is none.
    #[inline(always)]
    pub(super) fn nearest(self, value: f64) -> u64 {
        match self {
            // The conversion cuts off what lies behind the point, and what lies beyond all codes.
            Self::Fine => u64::from((value + 0.5) as u16),
            Self::Single if (value as f32).is_finite() => u64::from((value as f32).to_bits()),
            Self::Double if value.is_finite() => value.to_bits(),
            _ => 0,
        }
    }

    /// A height's bits as a number that grows with the height, and back again.
    #[inline(always)]
    fn ordered(self, bits: u64) -> u64 {
        if self == Self::Fine {
            return bits;
        }
        let sign = 1 << (self.height_bits() - 1);
        if bits & sign == 0 { bits | sign } else { !bits & (u64::MAX >> (64 - self.height_bits())) }
    }

    #[inline(always)]
    fn bits_at(self, place: u64) -> u64 {
        if self == Self::Fine {
            return place;
        }
        let sign = 1 << (self.height_bits() - 1);
        if place & sign != 0 { place ^ sign } else { !place & (u64::MAX >> (64 - self.height_bits())) }
    }

    /// How far a height lies from a predicted one, as a number that is small if it is near.
    #[inline(always)]
    pub(super) fn residual(self, bits: u64, predicted: u64) -> u64 {
        folded(self.ordered(bits).wrapping_sub(self.ordered(predicted)), self.height_bits())
    }

    /// The height of a residual.
    #[inline(always)]
    pub(super) fn restored(self, residual: u64, predicted: u64) -> u64 {
        let place = self.ordered(predicted).wrapping_add(unfolded(residual));
        self.bits_at(place & (u64::MAX >> (64 - self.height_bits())))
    }
}

/// A difference modulo 2^`bits` as a number that is small if it is near 0.
#[inline(always)]
pub(super) fn folded(value: u64, bits: u32) -> u64 {
    let unused = 64 - bits;
    let value = (value << unused) as i64 >> unused;
    ((value << 1) ^ (value >> 63)) as u64 & (u64::MAX >> unused)
}

/// What [`folded`] was given; its low bits count.
#[inline(always)]
pub(super) fn unfolded(value: u64) -> u64 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_and_residuals_come_back(words: [u32; 4], predicted: u64) {
            for form in [Form::Fine, Form::Single, Form::Double] {
                let words = &words[..form.words()];
                let parts = form.parts(words);
                let mut back = vec![0; form.words()];
                form.put(parts, &mut back);
                prop_assert_eq!(&back[..], words);
                let predicted = predicted & (u64::MAX >> (64 - form.height_bits()));
                let residual = form.residual(parts.height, predicted);
                prop_assert_eq!(form.restored(residual, predicted), parts.height);
                prop_assert_eq!(form.residual(predicted, predicted), 0);
            }
        }
    }

    #[test]
    fn neighbours_are_near() {
        for (a, b) in
            [(1.0f32, 1.0f32.next_up()), (-1.0, (-1.0f32).next_up()), (0.0, 0.0f32.next_up()), (-0.0, 0.0)]
        {
            let [a, b] = [a, b].map(|v| u64::from(v.to_bits()));
            assert_eq!([Form::Single.residual(b, a), Form::Single.residual(a, b)], [2, 1]);
        }
        assert_eq!(Form::Double.nearest(f64::INFINITY), 0);
        assert_eq!(Form::Single.nearest(1e300), 0);
        assert_eq!(Form::Single.value(u64::from(f32::NAN.to_bits())), 0.0);
    }
}
