//! How a sample is stored: whole numbers of 1 to 64 bits and reals of 16, 24, 32 and 64.
//!
//! Samples of a width that no machine has are packed without gaps, the most significant bit first whatever the byte order, and rows begin at a byte (TIFF 6.0, section 8;
//! GDAL's NBITS). Those of 24 bits are what GDAL makes of them, which is nearly alone in writing such files: the most significant byte first, and in big-endian files last. A real of
//! 24 bits is in the file's byte order: a sign, 7 bits of exponent and 16 of fraction (Adobe Photoshop TIFF Technical Note 3, 2005). Cost: one pass.

use super::tags::{self, Directory, TiffFile};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::pow;

/// What a sample's bits mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Unsigned,
    Signed,
    Real,
}

/// How a sample is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stored {
    kind: Kind,
    bits: u32,
}

impl Stored {
    /// Of the image `directory`.
    pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Self, LayoutError> {
        let bits = file.numbers(directory, tags::BITS_PER_SAMPLE, MAX_BANDS)?.unwrap_or_else(|| vec![1]);
        let format = file.number(directory, tags::SAMPLE_FORMAT)?.unwrap_or(1);
        let first = bits.first().copied().unwrap_or(1);
        if bits.iter().any(|bits| *bits != first) {
            let problem = "its bands are of several widths, which is not read; make them alike: \
                           gdal_translate -ot Float32 INPUT output.tif";
            return Err(LayoutError::unsupported(file.path(), problem));
        }
        let kind = match (format, first) {
            // 4 says "unknown", and is read as what a number without a format is.
            (1 | 4, 1..=64) => Some(Kind::Unsigned),
            (2, 2..=64) => Some(Kind::Signed),
            (3, 16 | 24 | 32 | 64) => Some(Kind::Real),
            _ => None,
        };
        if let Some(kind) = kind {
            return Ok(Self { kind, bits: first as u32 });
        }
        let kind = match format {
            1 => "unsigned",
            2 => "signed",
            3 => "floating-point",
            5 | 6 => "complex",
            _ => "untyped",
        };
        Err(LayoutError::unsupported(
            file.path(),
            format!(
                "{first}-bit {kind} samples are not read (whole numbers of 1 to 64 bits and real ones of 16, 24, 32 and 64 are); \
                 convert them: gdal_translate -ot Float32 INPUT output.tif"
            ),
        ))
    }

    /// Bits of a sample.
    pub(super) fn bits(self) -> u64 {
        u64::from(self.bits)
    }

    /// Bytes of a sample that is made of whole ones.
    pub(super) fn bytes(self) -> Option<u64> {
        self.bits.is_multiple_of(8).then_some(u64::from(self.bits / 8))
    }

    /// Whether it is a real number.
    pub(super) fn is_real(self) -> bool {
        self.kind == Kind::Real
    }

    /// The smallest type that holds every value.
    pub(super) fn sample_type(self) -> SampleType {
        match (self.kind, self.bits) {
            (Kind::Unsigned, ..=8) => SampleType::U8,
            (Kind::Unsigned, ..=16) => SampleType::U16,
            (Kind::Unsigned, ..=32) => SampleType::U32,
            (Kind::Unsigned, _) => SampleType::U64,
            (Kind::Signed, ..=8) => SampleType::I8,
            (Kind::Signed, ..=16) => SampleType::I16,
            (Kind::Signed, ..=32) => SampleType::I32,
            (Kind::Signed, _) => SampleType::I64,
            (Kind::Real, 16) => SampleType::F16,
            (Kind::Real, ..=32) => SampleType::F32,
            (Kind::Real, _) => SampleType::F64,
        }
    }

    /// Whether it is stored as a machine has it.
    pub(super) fn is_plain(self) -> bool {
        matches!(self.bits, 8 | 16 | 32 | 64)
    }

    /// Its name: "uint12".
    pub(super) fn name(self) -> String {
        let kind = match self.kind {
            Kind::Unsigned => "uint",
            Kind::Signed => "int",
            Kind::Real => "float",
        };
        format!("{kind}{}", self.bits)
    }

    /// The first `count` samples of a row that is not plain.
    pub(super) fn odd(self, row: &[u8], big_endian: bool, count: usize) -> impl Iterator<Item = f64> {
        (0..count).map(move |number| {
            let value = match (self.bits, self.kind) {
                (24, Kind::Real) => triple(row, big_endian, number),
                (24, _) => triple(row, !big_endian, number),
                _ => bits(row, self.bits, number),
            };
            match self.kind {
                Kind::Unsigned => value as f64,
                Kind::Signed => ((value << (64 - self.bits)) as i64 >> (64 - self.bits)) as f64,
                Kind::Real => real_24(value as u32),
            }
        })
    }
}

/// Bands of an image, at most.
pub(super) const MAX_BANDS: u64 = 4096;

/// Three bytes.
fn triple(row: &[u8], big_endian: bool, number: usize) -> u64 {
    let bytes = row.get(3 * number..3 * number + 3).unwrap_or(&[0; 3]);
    super::listing::whole_number(bytes, big_endian)
}

/// A number of `width` bits, at most 64, of a row without gaps.
fn bits(row: &[u8], width: u32, number: usize) -> u64 {
    let first = number * width as usize;
    let last = first + width as usize;
    // At most nine bytes.
    let bytes = row.get(first / 8..last.div_ceil(8)).unwrap_or(&[]);
    let whole = bytes.iter().fold(0u128, |whole, byte| whole << 8 | u128::from(*byte));
    let value = whole >> (last.next_multiple_of(8) - last);
    (value & ((1u128 << width) - 1)) as u64
}

/// A real of 24 bits.
fn real_24(bits: u32) -> f64 {
    let sign = if bits >> 23 & 1 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (bits >> 16 & 0x7f, f64::from(bits & 0xffff) / 65536.0);
    sign * match exponent {
        0 => fraction * pow(2.0, -62.0),
        0x7f if fraction == 0.0 => f64::INFINITY,
        0x7f => f64::NAN,
        _ => (1.0 + fraction) * pow(2.0, f64::from(exponent) - 63.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_width_come_back() {
        for width in 1..=64u32 {
            let top = 1u128 << width;
            let values: Vec<u64> =
                (0..20u128).map(|i| (i * i * 0x9e37_79b9_7f4a_7c15 % top) as u64).collect();
            let mut row = vec![0u8; (20 * width as usize).div_ceil(8)];
            for (number, value) in values.iter().enumerate() {
                for bit in 0..width as usize {
                    let at = number * width as usize + bit;
                    row[at / 8] |= ((value >> (width as usize - 1 - bit) & 1) as u8) << (7 - at % 8);
                }
            }
            for (number, value) in values.iter().enumerate() {
                assert_eq!(bits(&row, width, number), *value, "{width}, {number}");
            }
            let stored = Stored { kind: Kind::Signed, bits: width };
            if width > 1 && width != 24 {
                let half = 1i128 << (width - 1);
                let wanted = values.iter().map(|v| {
                    (if i128::from(*v) < half { i128::from(*v) } else { i128::from(*v) - 2 * half }) as f64
                });
                assert_eq!(
                    stored.odd(&row, true, 20).collect::<Vec<_>>(),
                    wanted.collect::<Vec<_>>(),
                    "{width}"
                );
            }
        }
    }

    #[test]
    fn reals_of_24_bits() {
        let of = |bits: u32| real_24(bits);
        assert_eq!([of(0), of(0x3f_0000), of(0xbf_8000), of(0x40_0000)], [0.0, 1.0, -1.5, 2.0]);
        assert_eq!([of(1), of(0x7e_ffff)], [2f64.powi(-78), (2.0 - 2f64.powi(-16)) * 2f64.powi(63)]);
        assert!(of(0x7f_0001).is_nan() && of(0xff_0000) == f64::NEG_INFINITY);
        let stored = Stored { kind: Kind::Real, bits: 24 };
        assert_eq!(stored.odd(&[0, 0, 0x3f, 0, 0x80, 0xbf], false, 2).collect::<Vec<_>>(), [1.0, -1.5]);
    }
}
