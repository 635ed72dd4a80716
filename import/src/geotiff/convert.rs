//! Bytes of samples into `f64`, voids into NaN.
//!
//! The void value is text in the file; it is converted to the sample type before it is compared, as
//! the writer of the samples did. A void value that the type cannot hold marks nothing. Writers differ in
//! the last digits of "the lowest float": any real below -3.39e38 (or above 3.39e38) is void if the
//! declared value is. Infinities and NaN are void always. Cost: one pass.

use std::path::Path;

use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Beyond this, a real void value is meant as the type's extreme.
const EXTREME: f64 = 3.39e38;

/// What marks a sample as void.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Void {
    /// The value, converted to the sample type; `None` if none is declared or none can match.
    value: Option<f64>,
    declared: bool,
}

impl Void {
    /// Parses the text of the tag, if there is one.
    pub(super) fn parse(
        path: &Path,
        text: Option<&str>,
        sample_type: SampleType,
    ) -> Result<Self, LayoutError> {
        let Some(text) = text.map(str::trim).filter(|text| !text.is_empty()) else {
            return Ok(Self { value: None, declared: false });
        };
        // What C's strtod and its users write for a NaN: nan, -nan, nan(0x7ff8), 1.#QNAN.
        let lower = text.to_ascii_lowercase();
        if lower.contains("nan") || lower.contains("1.#ind") {
            return Ok(Self { value: None, declared: true });
        }
        let Ok(value) = text.parse::<f64>() else {
            let shown = harmless(text, 40);
            return Err(LayoutError::damaged(
                path,
                "tag GDAL_NODATA",
                format!(
                    "the void value \"{shown}\" is no number; set it again: gdal_edit.py -a_nodata -9999 FILE"
                ),
            ));
        };
        let value = match sample_type {
            SampleType::F32 if value.abs() < EXTREME => f64::from(value as f32),
            _ => value,
        };
        Ok(Self { value: Some(value), declared: true })
    }

    /// What stands in for a chunk that the file left out.
    pub(super) fn absent(self) -> f64 {
        if self.declared { f64::NAN } else { 0.0 }
    }

    /// Appends the samples in `bytes`, which are of `sample_type` and in the byte order told.
    pub(super) fn append(
        self,
        sample_type: SampleType,
        big_endian: bool,
        bytes: &[u8],
        samples: &mut Vec<f64>,
    ) {
        match sample_type {
            SampleType::U8 => self.integers(bytes.iter().map(|byte| f64::from(*byte)), samples),
            SampleType::U16 => {
                self.integers(words(bytes, big_endian).map(|w| f64::from(u16::from_ne_bytes(w))), samples)
            }
            SampleType::I16 => {
                self.integers(words(bytes, big_endian).map(|w| f64::from(i16::from_ne_bytes(w))), samples)
            }
            SampleType::U32 => {
                self.integers(words(bytes, big_endian).map(|w| f64::from(u32::from_ne_bytes(w))), samples)
            }
            SampleType::I32 => {
                self.integers(words(bytes, big_endian).map(|w| f64::from(i32::from_ne_bytes(w))), samples)
            }
            SampleType::F32 => {
                self.reals(words(bytes, big_endian).map(|w| f64::from(f32::from_ne_bytes(w))), samples)
            }
            SampleType::F64 => self.reals(words(bytes, big_endian).map(f64::from_ne_bytes), samples),
        }
    }

    fn integers(self, values: impl Iterator<Item = f64>, samples: &mut Vec<f64>) {
        match self.value {
            Some(void) => samples.extend(values.map(|value| if value == void { f64::NAN } else { value })),
            None => samples.extend(values),
        }
    }

    fn reals(self, values: impl Iterator<Item = f64>, samples: &mut Vec<f64>) {
        let void = self.value.unwrap_or(f64::NAN);
        let lowest = if void <= -EXTREME { -EXTREME } else { f64::NEG_INFINITY };
        let highest = if void >= EXTREME { EXTREME } else { f64::INFINITY };
        let sound = |value: f64| value != void && value > lowest && value < highest;
        samples.extend(values.map(|value| if sound(value) { value } else { f64::NAN }));
    }
}

/// Samples of `N` bytes, in native byte order.
fn words<const N: usize>(bytes: &[u8], big_endian: bool) -> impl Iterator<Item = [u8; N]> {
    let swapped = big_endian != cfg!(target_endian = "big");
    let (words, _) = bytes.as_chunks::<N>();
    words.iter().map(move |word| {
        let mut word = *word;
        if swapped {
            word.reverse();
        }
        word
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(text: &str, sample_type: SampleType, bytes: &[u8]) -> Vec<f64> {
        let mut samples = Vec::new();
        let void = Void::parse(Path::new("t.tif"), Some(text), sample_type).unwrap();
        void.append(sample_type, false, bytes, &mut samples);
        samples
    }

    #[test]
    fn void_is_compared_in_the_sample_type() {
        let third = (1.0f32 / 3.0).to_le_bytes();
        assert!(converted("0.3333333333333333", SampleType::F32, &third)[0].is_nan());
        for text in ["-3.4e38", "-3.40282346638529e+38", "-3.4028234663852886e+38"] {
            assert!(converted(text, SampleType::F32, &f32::MIN.to_le_bytes())[0].is_nan(), "{text}");
        }
        assert_eq!(converted("-3.4e38", SampleType::F32, &(-1e38f32).to_le_bytes())[0], f64::from(-1e38f32));
        assert!(converted("nan", SampleType::F64, &f64::NAN.to_le_bytes())[0].is_nan());
        assert!(converted("-9999", SampleType::F32, &f32::NEG_INFINITY.to_le_bytes())[0].is_nan());
        assert!(converted(" -9999.0 ", SampleType::I16, &(-9999i16).to_le_bytes())[0].is_nan());
        assert_eq!(converted("-32768", SampleType::U16, &[0, 128])[0], 32768.0);
        assert!(Void::parse(Path::new("t.tif"), Some("none"), SampleType::I16).is_err());
    }
}
