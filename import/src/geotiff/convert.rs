//! Bytes of pixels into raw numbers: one band of them, or heights packed into three.
//!
//! Where a band of alpha is 0 the sample is void. Values that a file declares to mean "no data" pass unchanged here. They are turned into voids later, in
//! the same way for every format. Cost: one pass.

use half::f16;
use terrasoar_layout::dem::SampleType;

use super::stored::Stored;
use crate::value::Decode;

/// What makes a number of a pixel.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Pick {
    /// The sample of a band, counted from 0.
    Band(usize),
    /// A height from the first three.
    Decode(Decode),
}

/// How the bytes of a chunk's rows become numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Convert {
    pub(super) sample_type: SampleType,
    /// How samples are stored that no machine has.
    pub(super) odd: Option<Stored>,
    pub(super) big_endian: bool,
    /// Samples of a pixel that lie side by side.
    pub(super) bands: usize,
    pub(super) pick: Pick,
    /// Band of alpha, counted from 0.
    pub(super) alpha: Option<usize>,
    /// What stands in a band for a chunk that the file left out.
    pub(super) absent: f64,
    /// What stands in for pixels all of whose bands the file left out.
    pub(super) left_out: f64,
}

impl Convert {
    /// Appends the first `pixels` of a row.
    pub(super) fn append_row(&self, row: &[u8], pixels: usize, samples: &mut Vec<f64>) {
        match self.odd {
            Some(stored) => self.pixels(stored.odd(row, self.big_endian, pixels * self.bands), samples),
            None => self.append(row, samples),
        }
    }

    /// Appends the pixels in `bytes`, which are whole ones.
    fn append(&self, bytes: &[u8], samples: &mut Vec<f64>) {
        let big = self.big_endian;
        match self.sample_type {
            SampleType::U8 => self.pixels(bytes.iter().map(|byte| f64::from(*byte)), samples),
            SampleType::I8 => self.pixels(bytes.iter().map(|byte| f64::from(*byte as i8)), samples),
            SampleType::U16 => {
                self.pixels(words(bytes, big).map(|w| f64::from(u16::from_ne_bytes(w))), samples)
            }
            SampleType::I16 => {
                self.pixels(words(bytes, big).map(|w| f64::from(i16::from_ne_bytes(w))), samples)
            }
            SampleType::F16 => {
                self.pixels(words(bytes, big).map(|w| f64::from(f16::from_ne_bytes(w))), samples)
            }
            SampleType::U32 => {
                self.pixels(words(bytes, big).map(|w| f64::from(u32::from_ne_bytes(w))), samples)
            }
            SampleType::I32 => {
                self.pixels(words(bytes, big).map(|w| f64::from(i32::from_ne_bytes(w))), samples)
            }
            SampleType::F32 => {
                self.pixels(words(bytes, big).map(|w| f64::from(f32::from_ne_bytes(w))), samples)
            }
            SampleType::U64 => self.pixels(words(bytes, big).map(|w| u64::from_ne_bytes(w) as f64), samples),
            SampleType::I64 => self.pixels(words(bytes, big).map(|w| i64::from_ne_bytes(w) as f64), samples),
            SampleType::F64 => self.pixels(words(bytes, big).map(f64::from_ne_bytes), samples),
        }
    }

    fn pixels(&self, values: impl Iterator<Item = f64>, samples: &mut Vec<f64>) {
        if let (1, Pick::Band(_)) = (self.bands, &self.pick) {
            samples.extend(values);
            return;
        }
        let mut colours = [0.0; 3];
        let mut place = 0;
        let (mut picked, mut seen) = (0.0, true);
        // One value after the other: pixels of any number of bands, without a copy of them.
        for value in values {
            match &self.pick {
                Pick::Band(band) if *band == place => picked = value,
                Pick::Decode(_) if place < 3 => colours[place] = value,
                _ => {}
            }
            if self.alpha == Some(place) {
                seen = value != 0.0;
            }
            place += 1;
            if place == self.bands {
                if let Pick::Decode(decode) = &self.pick {
                    picked = decode.height(colours);
                }
                samples.push(if seen { picked } else { f64::NAN });
                (place, seen) = (0, true);
            }
        }
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

    fn converted(sample_type: SampleType, big_endian: bool, bytes: &[u8]) -> Vec<f64> {
        let convert = Convert {
            sample_type,
            odd: None,
            big_endian,
            bands: 1,
            pick: Pick::Band(0),
            alpha: None,
            absent: 0.0,
            left_out: 0.0,
        };
        let mut samples = Vec::new();
        convert.append(bytes, &mut samples);
        samples
    }

    #[test]
    fn every_type_in_either_byte_order() {
        for (sample_type, little, value) in [
            (SampleType::U8, vec![200], 200.0),
            (SampleType::I8, vec![200], -56.0),
            (SampleType::U16, 40_000u16.to_le_bytes().to_vec(), 40_000.0),
            (SampleType::I16, (-9999i16).to_le_bytes().to_vec(), -9999.0),
            (SampleType::U32, 4_000_000_000u32.to_le_bytes().to_vec(), 4e9),
            (SampleType::I32, i32::MIN.to_le_bytes().to_vec(), -2_147_483_648.0),
            (SampleType::U64, (1u64 << 53).to_le_bytes().to_vec(), 9_007_199_254_740_992.0),
            (SampleType::I64, (-5i64).to_le_bytes().to_vec(), -5.0),
            // 1.5 in half precision: sign 0, exponent 15, fraction 1/2.
            (SampleType::F16, 0x3e00u16.to_le_bytes().to_vec(), 1.5),
            (SampleType::F32, 1.25f32.to_le_bytes().to_vec(), 1.25),
            (SampleType::F64, 1e300f64.to_le_bytes().to_vec(), 1e300),
        ] {
            assert_eq!(converted(sample_type, false, &little), [value], "{sample_type:?}");
            let big: Vec<u8> = little.into_iter().rev().collect();
            assert_eq!(converted(sample_type, true, &big), [value], "{sample_type:?}");
        }
    }

    #[test]
    fn a_band_is_picked_and_alpha_makes_voids() {
        let mut convert = Convert {
            sample_type: SampleType::U8,
            odd: None,
            big_endian: false,
            bands: 3,
            pick: Pick::Band(1),
            alpha: Some(2),
            absent: 0.0,
            left_out: 0.0,
        };
        let mut samples = Vec::new();
        convert.append(&[1, 2, 255, 3, 4, 0, 5, 6, 1], &mut samples);
        assert!(samples[0] == 2.0 && samples[1].is_nan() && samples[2] == 6.0 && samples.len() == 3);
        convert.bands = 4;
        convert.alpha = Some(3);
        convert.pick = Pick::Decode(Decode::parse("mapbox").unwrap());
        samples.clear();
        convert.append(&[1, 134, 160, 255, 0, 0, 0, 0], &mut samples);
        assert!(samples[0].abs() < 1e-9 && samples[1].is_nan(), "{samples:?}");
    }
}
