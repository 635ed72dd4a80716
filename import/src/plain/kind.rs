//! What a plain number is: its type and the order of its bytes, as text `u16le`.

use std::fmt;
use std::str::FromStr;
use terrasoar_layout::dem::SampleType;

/// A type of numbers and the order of their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Kind {
    pub(crate) sample_type: SampleType,
    pub(crate) is_big: bool,
}

/// Names of types, and their sizes in bytes.
const TYPES: [(&str, SampleType, u64); 10] = [
    ("u8", SampleType::U8, 1),
    ("i8", SampleType::I8, 1),
    ("u16", SampleType::U16, 2),
    ("i16", SampleType::I16, 2),
    ("u32", SampleType::U32, 4),
    ("i32", SampleType::I32, 4),
    ("u64", SampleType::U64, 8),
    ("i64", SampleType::I64, 8),
    ("f32", SampleType::F32, 4),
    ("f64", SampleType::F64, 8),
];

impl Kind {
    /// Bytes of a number.
    pub(crate) fn bytes(self) -> u64 {
        TYPES.iter().find(|(_, kind, _)| *kind == self.sample_type).map_or(1, |(.., bytes)| *bytes)
    }

    /// The same numbers with their bytes in the other order.
    pub(crate) fn swapped(self) -> Self {
        Self { is_big: !self.is_big, ..self }
    }

    /// Appends the numbers that begin every `step` bytes of `bytes`. What is infinite is void.
    pub(crate) fn append(self, bytes: &[u8], step: usize, samples: &mut Vec<f64>) {
        fn all<const N: usize>(
            bytes: &[u8],
            step: usize,
            is_big: bool,
            samples: &mut Vec<f64>,
            number: impl Fn([u8; N]) -> f64,
        ) {
            let one = |chunk: &[u8]| {
                let mut word = [0; N];
                word.copy_from_slice(&chunk[..N]);
                if is_big {
                    word.reverse();
                }
                number(word)
            };
            samples.extend(bytes.chunks(step.max(N)).filter(|chunk| chunk.len() >= N).map(one));
        }
        let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
        let big = self.is_big;
        match self.sample_type {
            SampleType::U8 => all(bytes, step, big, samples, |[byte]| f64::from(byte)),
            SampleType::I8 => all(bytes, step, big, samples, |b| f64::from(i8::from_le_bytes(b))),
            SampleType::U16 => all(bytes, step, big, samples, |b| f64::from(u16::from_le_bytes(b))),
            SampleType::I16 => all(bytes, step, big, samples, |b| f64::from(i16::from_le_bytes(b))),
            SampleType::U32 => all(bytes, step, big, samples, |b| f64::from(u32::from_le_bytes(b))),
            SampleType::I32 => all(bytes, step, big, samples, |b| f64::from(i32::from_le_bytes(b))),
            SampleType::U64 => all(bytes, step, big, samples, |b| u64::from_le_bytes(b) as f64),
            SampleType::I64 => all(bytes, step, big, samples, |b| i64::from_le_bytes(b) as f64),
            SampleType::F64 => all(bytes, step, big, samples, |b| finite(f64::from_le_bytes(b))),
            // Half precision is no kind of these files.
            SampleType::F32 | SampleType::F16 => {
                all(bytes, step, big, samples, |b| finite(f64::from(f32::from_le_bytes(b))));
            }
        }
    }
}

impl FromStr for Kind {
    type Err = String;

    /// `u8`, `i16le`, `f32be`; without an order the low byte is first.
    fn from_str(text: &str) -> Result<Self, String> {
        let lower = text.to_ascii_lowercase();
        let (name, is_big) = match (lower.strip_suffix("be"), lower.strip_suffix("le")) {
            (Some(name), _) => (name, true),
            (_, Some(name)) => (name, false),
            _ => (lower.as_str(), false),
        };
        let known = TYPES.iter().find(|(known, ..)| *known == name);
        known.map(|(_, sample_type, _)| Self { sample_type: *sample_type, is_big }).ok_or_else(|| {
            format!(
                "{text:?} is no type of numbers; there are u8, i8, and u16, i16, u32, i32, u64, i64, f32, f64 with le or be behind"
            )
        })
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = TYPES.iter().find(|(_, kind, _)| *kind == self.sample_type).map_or("", |(name, ..)| *name);
        let order = match (self.bytes(), self.is_big) {
            (1, _) => "",
            (_, true) => "be",
            (_, false) => "le",
        };
        write!(f, "{name}{order}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_names_and_numbers() {
        for (name, bytes, wanted) in [
            ("u8", vec![200u8, 1], vec![200.0, 1.0]),
            ("i8", vec![200, 1], vec![-56.0, 1.0]),
            ("u16le", vec![1, 2, 255, 255], vec![513.0, 65535.0]),
            ("i16be", vec![255, 254, 1, 0], vec![-2.0, 256.0]),
            ("u32be", vec![0, 0, 1, 0], vec![256.0]),
            ("i32le", vec![255; 4], vec![-1.0]),
            ("u64be", vec![0, 0, 0, 0, 0, 0, 0, 9], vec![9.0]),
            ("i64le", vec![255; 8], vec![-1.0]),
            ("f32be", 1.5f32.to_be_bytes().to_vec(), vec![1.5]),
            ("f64le", (-2.25f64).to_le_bytes().to_vec(), vec![-2.25]),
        ] {
            let kind: Kind = name.parse().unwrap();
            assert_eq!(kind.to_string(), name);
            let mut samples = Vec::new();
            kind.append(&bytes, kind.bytes() as usize, &mut samples);
            assert_eq!(samples, wanted, "{name}");
        }
        assert_eq!("U16".parse::<Kind>().unwrap().to_string(), "u16le");
        assert!(
            "f16".parse::<Kind>().is_err() && "".parse::<Kind>().is_err() && "le".parse::<Kind>().is_err()
        );
        let mut samples = Vec::new();
        "f32le".parse::<Kind>().unwrap().append(&f32::INFINITY.to_le_bytes(), 4, &mut samples);
        assert!(samples[0].is_nan());
    }
}
