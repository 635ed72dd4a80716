//! Which raw numbers mean "no data": what the file declares and what a person adds, in the sample's own type.
//!
//! A void value is text. It is brought into the sample's type before it is compared, as the writer of the samples did: 0.1 marks the singles nearest to 0.1, and
//! -3.4028235e38 the lowest single however many digits were written. A value that the type cannot hold marks nothing. Writers differ in the last digits of "the lowest
//! float": any real below -3.39e38 (or above 3.39e38) is void if such a value is. Infinities and NaN are void always. Cost: one comparison a value.

use crate::reader::Said;
use half::f16;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Beyond this, a real void value is meant as the type's extreme.
const EXTREME: f64 = 3.39e38;

/// A void value.
#[derive(Debug)]
struct Mark {
    text: String,
    /// In the type of the samples; `None` if the type cannot hold it.
    value: Option<f64>,
    /// Whether a person named it.
    is_asked: bool,
    matched: AtomicBool,
}

/// The void values of a data set.
#[derive(Debug)]
pub(crate) struct Voids {
    marks: Vec<Mark>,
    is_real: bool,
    /// Lowest and highest number that is data.
    valid: Option<[f64; 2]>,
}

impl Voids {
    /// The values that the file `declared` and those that a person `asked` for.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] for a declared value that is no number, [`LayoutError::Usage`] for such one that was asked for.
    pub(crate) fn new(
        path: &Path,
        declared: &[Said<String>],
        asked: &[String],
        sample_type: SampleType,
    ) -> Result<Self, LayoutError> {
        let mut marks = Vec::new();
        for said in declared {
            let text = said.value.trim();
            if text.is_empty() {
                continue;
            }
            let value = parse(text, sample_type).ok_or_else(|| {
                LayoutError::damaged(
                    path,
                    said.by.clone(),
                    format!(
                        "the void value \"{}\" is no number; set it again: gdal_edit.py -a_nodata -9999 FILE",
                        harmless(text, 40)
                    ),
                )
            })?;
            marks.push(Mark { text: text.into(), value, is_asked: false, matched: AtomicBool::new(false) });
        }
        for text in asked {
            let value = parse(text.trim(), sample_type).ok_or_else(|| {
                LayoutError::Usage(format!(
                    "\"{}\" is no number and so no value that means \"no data\"; name one such as -9999, or nan",
                    harmless(text, 40)
                ))
                .mended_by(Remedy::Nodata)
            })?;
            marks.push(Mark {
                text: text.trim().into(),
                value,
                is_asked: true,
                matched: AtomicBool::new(false),
            });
        }
        Ok(Self { marks, is_real: !sample_type.is_integer(), valid: None })
    }

    /// With all void that is lower or higher than what the file declares to be `valid`, in the type of the samples.
    pub(crate) fn within(mut self, valid: Option<[f64; 2]>, sample_type: SampleType) -> Self {
        // An end of more digits than the samples have must not make its own number void.
        let rounded = |value: f64| match sample_type {
            SampleType::F16 => f64::from(f16::from_f64(value)),
            SampleType::F32 => f64::from(value as f32),
            _ => value,
        };
        self.valid = valid.map(|ends| ends.map(rounded));
        self
    }

    /// Whether anything is looked for in samples.
    pub(crate) fn is_idle(&self) -> bool {
        !self.is_real && self.valid.is_none() && self.marks.iter().all(|mark| mark.value.is_none())
    }

    /// The values, as text.
    pub(crate) fn texts(&self) -> impl Iterator<Item = &str> {
        self.marks.iter().map(|mark| mark.text.as_str())
    }

    /// Makes NaN of the samples that are void.
    pub(crate) fn apply(&self, samples: &mut [f64]) {
        for mark in &self.marks {
            let Some(value) = mark.value.filter(|value| !value.is_nan()) else { continue };
            let [low, high] = match value {
                _ if !self.is_real => [value, value],
                _ if value <= -EXTREME => [f64::NEG_INFINITY, -EXTREME],
                _ if value >= EXTREME => [EXTREME, f64::INFINITY],
                _ => [value, value],
            };
            let mut found = false;
            for sample in samples.iter_mut() {
                let is_void = (*sample >= low) & (*sample <= high);
                found |= is_void;
                *sample = if is_void { f64::NAN } else { *sample };
            }
            if found {
                mark.matched.store(true, Ordering::Relaxed);
            }
        }
        if let Some([low, high]) = self.valid {
            samples
                .iter_mut()
                .filter(|sample| **sample < low || **sample > high)
                .for_each(|sample| *sample = f64::NAN);
        }
        if self.is_real {
            samples.iter_mut().filter(|sample| sample.is_infinite()).for_each(|sample| *sample = f64::NAN);
        }
    }

    /// Values that a person named and that matched nothing, as text; asked for when all samples have passed.
    pub(crate) fn unmatched(&self) -> Vec<String> {
        let is_idle = |mark: &&Mark| {
            mark.is_asked && !mark.value.is_some_and(f64::is_nan) && !mark.matched.load(Ordering::Relaxed)
        };
        self.marks.iter().filter(is_idle).map(|mark| mark.text.clone()).collect()
    }
}

/// The number that `text` says, in the type of the samples; the inner `None` for one that the type cannot hold, the outer for no number.
fn parse(text: &str, sample_type: SampleType) -> Option<Option<f64>> {
    // What C's strtod and its users write for a NaN: nan, -nan, nan(0x7ff8), 1.#QNAN.
    let lower = text.to_ascii_lowercase();
    if lower.contains("nan") || lower.contains("1.#ind") {
        return Some((!sample_type.is_integer()).then_some(f64::NAN));
    }
    // A 64-bit whole number has more digits than a double.
    let whole = match sample_type {
        SampleType::I64 => text.parse::<i64>().ok().map(|value| value as f64),
        SampleType::U64 => text.parse::<u64>().ok().map(|value| value as f64),
        _ => None,
    };
    if whole.is_some() {
        return Some(whole);
    }
    let value: f64 = text.parse().ok()?;
    let within =
        |low: f64, high: f64| (value.fract() == 0.0 && (low..=high).contains(&value)).then_some(value);
    Some(match sample_type {
        SampleType::U8 => within(0.0, 255.0),
        SampleType::I8 => within(-128.0, 127.0),
        SampleType::U16 => within(0.0, 65_535.0),
        SampleType::I16 => within(-32_768.0, 32_767.0),
        SampleType::U32 => within(0.0, f64::from(u32::MAX)),
        SampleType::I32 => within(f64::from(i32::MIN), f64::from(i32::MAX)),
        SampleType::U64 => within(0.0, u64::MAX as f64),
        SampleType::I64 => within(i64::MIN as f64, i64::MAX as f64),
        SampleType::F16 => Some(f64::from(f16::from_f64(value))),
        SampleType::F32 if value.abs() < EXTREME => Some(f64::from(value as f32)),
        SampleType::F32 | SampleType::F64 => Some(value),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn void(text: &str, sample_type: SampleType, sample: f64) -> bool {
        let said = [Said::new(text.to_owned(), "tag GDAL_NODATA")];
        let mut samples = [sample];
        Voids::new(Path::new("t.tif"), &said, &[], sample_type).unwrap().apply(&mut samples);
        samples[0].is_nan()
    }

    #[test]
    fn values_are_compared_in_the_sample_type() {
        use SampleType::*;
        assert!(void("0.3333333333333333", F32, f64::from(1.0f32 / 3.0)));
        for text in ["-3.4e38", "-3.40282346638529e+38", "-3.4028234663852886e+38", "-3.4028235e38"] {
            assert!(void(text, F32, f64::from(f32::MIN)), "{text}");
            assert!(void(text, F64, f64::MIN), "{text}");
            assert!(!void(text, F32, f64::from(-1e38f32)), "{text}");
        }
        assert!(void("nan", F64, f64::NAN) && void("-9999", F32, f64::NEG_INFINITY));
        assert!(void(" -9999.0 ", I16, -9999.0) && !void("-9999.5", I16, -9999.0));
        assert!(!void("-32768", U16, 32768.0) && !void("255.5", U8, 255.0) && void("255", U8, 255.0));
        assert!(void("-128", I8, -128.0) && void("4294967295", U32, 4_294_967_295.0));
        assert!(void("-9223372036854775808", I64, i64::MIN as f64));
        assert!(void("18446744073709551615", U64, u64::MAX as f64));
        assert!(void("9007199254740993", I64, 9_007_199_254_740_993i64 as f64));
        assert!(void("0.1", F16, f64::from(f16::from_f64(0.1))) && void("-65504", F16, -65504.0));
    }

    #[test]
    fn what_lies_outside_of_what_is_valid_is_void() {
        let void = |valid: [f64; 2], sample_type: SampleType, sample: f64| {
            let voids = Voids::new(Path::new("t.nc"), &[], &[], sample_type).unwrap();
            let voids = voids.within(Some(valid), sample_type);
            assert!(!voids.is_idle());
            let mut samples = [sample];
            voids.apply(&mut samples);
            samples[0].is_nan()
        };
        let tenth = f64::from(0.1f32);
        assert!(!void([0.0, 0.1], SampleType::F32, tenth) && void([0.0, 0.1], SampleType::F64, tenth));
        assert!(!void([-5.0, 5.0], SampleType::I16, -5.0) && void([-5.0, 5.0], SampleType::I16, 6.0));
        assert!(void([0.0, f64::INFINITY], SampleType::I16, -1.0));
        assert!(!void([f64::NEG_INFINITY, 0.0], SampleType::I32, -1e9));
    }

    #[test]
    fn what_is_no_number_is_refused_and_what_matched_nothing_is_known() {
        let path = Path::new("t.tif");
        let declared = [Said::new("none".to_owned(), "tag GDAL_NODATA")];
        let refused = Voids::new(path, &declared, &[], SampleType::I16).unwrap_err().to_string();
        assert!(refused.contains("tag GDAL_NODATA") && refused.contains("\"none\""), "{refused}");
        let asked = ["-1".to_owned(), "-2".to_owned(), "70000".to_owned()];
        let voids = Voids::new(path, &[], &asked, SampleType::I16).unwrap();
        let mut samples = [-1.0, 5.0];
        voids.apply(&mut samples);
        assert!(samples[0].is_nan() && samples[1] == 5.0);
        assert_eq!(voids.unmatched(), ["-2", "70000"]);
        assert!(Voids::new(path, &[], &["x".to_owned()], SampleType::I16).is_err());
    }
}
