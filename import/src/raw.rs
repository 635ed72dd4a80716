//! Heightmaps without any header: `.r16`, `.r32`, `.raw` and whatever else, from the north-western sample on, row by row.
//!
//! A person says the type of the numbers and how many make a row ("1025x1025:u16le"). The extensions `.r16` and `.r32` usually stand for a type, and nearly all such files are
//! squares. So those two are read without being told, with a warning that says what was assumed. Nothing else is guessed; the error lists what would fit.

use crate::plain::{Kind, Plain};
use crate::reader::{Declared, Reader};
use std::path::Path;
use terrasoar_layout::dem::{SampleSink, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Samples that are looked at to tell the order of bytes.
const LOOKED_AT: u32 = 1 << 12;

/// A heightmap without a header.
#[derive(Debug)]
pub(crate) struct RawDem {
    plain: Plain,
    declared: Declared,
}

/// Columns, rows and type, as a person states them: "1025x513:u16le".
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    samples: [u32; 2],
    kind: Kind,
}

impl Shape {
    fn parse(text: &str) -> Result<Self, LayoutError> {
        let refused = |why: String| {
            LayoutError::Usage(format!(
                "\"{}\" is no shape of a heightmap: {why}; it is columns x rows and the type of a number, such as 1025x1025:u16le",
                harmless(text, 60)
            ))
            .mended_by(Remedy::RawShape)
        };
        let (sides, kind) = text.trim().split_once(':').ok_or_else(|| refused("it has no colon".into()))?;
        let (wide, high) =
            sides.split_once(['x', 'X', '\u{d7}']).ok_or_else(|| refused("it has no x".into()))?;
        let side = |text: &str| {
            let number = text.trim().parse::<u32>().ok().filter(|side| *side >= 2);
            number.ok_or_else(|| refused(format!("\"{}\" is no number of samples", harmless(text, 20))))
        };
        Ok(Self { samples: [side(wide)?, side(high)?], kind: kind.trim().parse().map_err(refused)? })
    }
}

/// Columns and rows of an `.hgt` tile as a person states them, whose numbers are of one type alone.
pub(crate) fn tile_shape(text: &str) -> Result<[u32; 2], LayoutError> {
    let shape = Shape::parse(text)?;
    if shape.kind.to_string() != "i16be" {
        let problem = format!(
            "the numbers of .hgt tiles are of type i16be, not {}; state the shape so, or give the file another name",
            shape.kind
        );
        return Err(LayoutError::Usage(problem).mended_by(Remedy::RawShape));
    }
    Ok(shape.samples)
}

impl RawDem {
    /// The file in the shape that a person states.
    pub(crate) fn stated(path: &Path, shape: &str) -> Result<Self, LayoutError> {
        let Shape { samples, kind } = Shape::parse(shape)?;
        let length = file_length(path)?;
        // Two sides of 32 bits and 8 bytes do not fit into 64.
        let used = u128::from(samples[0]) * u128::from(samples[1]) * u128::from(kind.bytes());
        if used != u128::from(length) {
            return Err(LayoutError::Usage(format!(
                "{}: {} x {} samples of {} bytes are {used} bytes and the file has {length}{}; state the shape that it has",
                path.display(),
                samples[0],
                samples[1],
                kind.bytes(),
                fitting(length)
            ))
            .mended_by(Remedy::RawShape));
        }
        let mut raw = Self::with_shape(path, samples, kind)?;
        raw.declared
            .notes
            .push("the first sample is taken as the north-western one, as heightmaps are stored".into());
        raw.warn_about_order()?;
        Ok(raw)
    }

    /// A file whose name says the type of its numbers, as a square.
    pub(crate) fn square(path: &Path) -> Result<Self, LayoutError> {
        let length = file_length(path)?;
        let extension = path.extension().map(|e| e.to_ascii_lowercase()).unwrap_or_default();
        let named = match extension.to_str() {
            Some("r16") => Some("u16le"),
            Some("r32") => Some("f32le"),
            _ => None,
        };
        let kind: Option<Kind> = named.and_then(|name| name.parse().ok());
        let square = kind.and_then(|kind| Some((kind, side_of_square(length, kind.bytes())?)));
        let Some((kind, side)) = square else {
            return Err(LayoutError::unsupported(
                path,
                format!("a heightmap without a header does not say what it holds{}; state its shape, such as 1025x1025:u16le", fitting(length)),
            )
            .mended_by(Remedy::RawShape));
        };
        let mut raw = Self::with_shape(path, [side; 2], kind)?;
        let words = format!(
            "the file has no header; its name and length are those of {side} x {side} samples of type {kind}, the first one in the north-west"
        );
        raw.declared
            .warnings
            .push(Warning::new(words).mended_by(Remedy::RawShape, format!("{side}x{side}:{kind}")));
        raw.warn_about_order()?;
        Ok(raw)
    }

    fn with_shape(path: &Path, samples: [u32; 2], kind: Kind) -> Result<Self, LayoutError> {
        let steps = [kind.bytes(), kind.bytes() * u64::from(samples[0])];
        let plain = Plain::checked(path, samples, kind, 0, steps)?;
        let declared =
            Declared::new(samples, kind.sample_type, format!("heightmap without a header, {kind}"));
        Ok(Self { plain, declared })
    }

    /// Ground is smooth: numbers that are much smoother with their bytes the other way round are stored that way.
    fn warn_about_order(&mut self) -> Result<(), LayoutError> {
        let kind = self.plain.kind();
        let rough = |kind: Kind| {
            let samples = self.plain.first_as(kind, LOOKED_AT)?;
            let steps = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            // What is no number is no ground.
            Ok::<f64, LayoutError>(
                steps.map(|step| if step.is_finite() { step.min(1e12) } else { 1e12 }).sum(),
            )
        };
        let (as_said, other) = (rough(kind)?, rough(kind.swapped())?);
        if kind.bytes() > 1 && as_said > 16.0 * other && other > 0.0 {
            let [wide, high] = self.declared.samples;
            let swapped = kind.swapped();
            let words = format!(
                "the ground is very rough with numbers of type {kind}, and smooth with {swapped}: their bytes seem to be the other way round"
            );
            self.declared
                .warnings
                .push(Warning::new(words).mended_by(Remedy::RawShape, format!("{wide}x{high}:{swapped}")));
        }
        Ok(())
    }
}

fn file_length(path: &Path) -> Result<u64, LayoutError> {
    let metadata = std::fs::metadata(path);
    Ok(metadata.map_err(|source| LayoutError::io(path, "cannot open the elevation file", source))?.len())
}

/// The side of the square that so many bytes are, if they are one.
fn side_of_square(length: u64, bytes: u64) -> Option<u32> {
    let side = (length / bytes).isqrt();
    (side * side * bytes == length && side >= 2).then(|| u32::try_from(side).ok()).flatten()
}

/// Shapes that have this length, in words that follow others.
fn fitting(length: u64) -> String {
    let shapes: Vec<String> = ["u8", "u16le", "f32le", "f64le"]
        .iter()
        .filter_map(|name| {
            let kind: Kind = name.parse().ok()?;
            let side = side_of_square(length, kind.bytes())?;
            Some(format!("{side}x{side}:{name}"))
        })
        .collect();
    match shapes.as_slice() {
        [] => format!("; its {length} bytes are no square of numbers of 1, 2, 4 or 8 bytes"),
        shapes => format!("; of squares, {} would fit its {length} bytes", shapes.join(" or ")),
    }
}

impl Reader for RawDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.plain.stream(sink)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_read_as_people_type_them() {
        for text in ["1025x513:u16le", " 1025 X 513 : U16 ", "1025\u{d7}513:u16"] {
            let shape = Shape::parse(text).unwrap();
            assert_eq!((shape.samples, shape.kind.to_string().as_str()), ([1025, 513], "u16le"), "{text}");
        }
        for (text, wanted) in [
            ("", "no colon"),
            ("5:u8", "no x"),
            ("5x1:u8", "no number of samples"),
            ("-5x5:u8", "no number of samples"),
            ("5x5:u7", "no type"),
            ("99999999999x5:u8", "no number of samples"),
        ] {
            let said = Shape::parse(text).unwrap_err();
            assert!(said.to_string().contains(wanted) && said.remedy() == Some(Remedy::RawShape), "{said}");
        }
    }

    #[test]
    fn lengths_are_squares_or_not() {
        assert_eq!(side_of_square(2 * 1025 * 1025, 2), Some(1025));
        assert_eq!(
            [side_of_square(2, 2), side_of_square(0, 2), side_of_square(2 * 1025 * 1025 + 1, 2)],
            [None; 3]
        );
        assert!(
            fitting(4 * 513 * 513).contains("513x513:f32le")
                && fitting(4 * 513 * 513).contains("1026x1026:u8")
        );
        assert!(fitting(7).contains("no square"));
    }
}
