//! The numbers of a tile as bytes: rounded to what is stored, differences of neighbours, DEFLATE.
//!
//! Integers are stored as differences (predictor 2 of TIFF 6.0), reals as differences of their bytes, the high ones first (predictor 3, Adobe's technical note 3 of TIFF). Cost: some 20 ns a
//! number, most of it DEFLATE's.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::{self, Write};

/// How numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// Whole numbers of 16 bits; -32768 stands for none.
    Int16,
    /// Single precision; NaN stands for none.
    Float32,
    /// Double precision; NaN stands for none.
    Float64,
}

impl Numbers {
    /// Bytes a number.
    pub fn bytes(self) -> usize {
        match self {
            Self::Int16 => 2,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// What stands for no number, as GDAL writes it.
    pub(super) fn nodata(self) -> &'static str {
        if self == Self::Int16 { "-32768" } else { "nan" }
    }

    /// TIFF's number of the kind: signed, or real.
    pub(super) fn sample_format(self) -> u64 {
        if self == Self::Int16 { 2 } else { 3 }
    }

    /// TIFF's number of the predictor.
    pub(super) fn predictor(self) -> u64 {
        self.sample_format()
    }
}

/// The lowest integer stands for no number.
fn int16(value: f64) -> u16 {
    let whole = if value.is_nan() { i16::MIN } else { value.round().clamp(-32767.0, 32767.0) as i16 };
    whole.cast_unsigned()
}

/// The bytes of a tile of rows of `width` numbers.
pub(super) fn encode(values: &[f64], width: usize, numbers: Numbers) -> io::Result<Vec<u8>> {
    let mut out = ZlibEncoder::new(Vec::with_capacity(values.len()), Compression::new(6));
    let mut row = vec![0; width * numbers.bytes()];
    for values in values.chunks_exact(width) {
        match numbers {
            Numbers::Int16 => {
                let mut before = 0;
                for (value, bytes) in values.iter().zip(row.as_chunks_mut().0) {
                    let value = int16(*value);
                    *bytes = value.wrapping_sub(before).to_le_bytes();
                    before = value;
                }
            }
            Numbers::Float32 => in_planes(values.iter().map(|v| (*v as f32).to_be_bytes()), &mut row),
            Numbers::Float64 => in_planes(values.iter().map(|v| v.to_be_bytes()), &mut row),
        }
        out.write_all(&row)?;
    }
    out.finish()
}

/// A row's bytes by their worth, each less the one before it.
fn in_planes<const N: usize>(values: impl Iterator<Item = [u8; N]>, row: &mut [u8]) {
    let width = row.len() / N;
    for (i, bytes) in values.enumerate() {
        for (plane, byte) in bytes.into_iter().enumerate() {
            row[plane * width + i] = byte;
        }
    }
    for i in (1..row.len()).rev() {
        row[i] = row[i].wrapping_sub(row[i - 1]);
    }
}
