//! The flight file's grammar, a line at a time: what a header, a note and a frame look like and which values
//! they may hold (`FLIGHT.md`).
//!
//! Reader and writer both go through here, so what one accepts the other accepts. Nothing here does I/O.

use super::FlightFrame;
use std::fmt::{self, Write as _};

/// Version of the format that is read and written.
pub const VERSION: u32 = 1;
/// Most frames a flight may have.
pub const MAX_FRAMES: u64 = 10_000_000;
/// Most bytes of a line, its end not counted.
pub(super) const MAX_LINE_BYTES: usize = 4096;
/// Most notes of a flight.
pub(super) const MAX_NOTES: usize = 256;
/// First word of a flight file.
pub(super) const MAGIC: &str = "terrasoar-flight";
/// The words of the second line.
pub(super) const UNITS: [&str; 4] = ["units", "metres", "degrees", "seconds"];
/// A frame's fields in file order.
pub(super) const FIELDS: [&str; 8] =
    ["time_s", "east_m", "north_m", "up_m", "yaw_deg", "pitch_deg", "roll_deg", "vfov_deg"];

/// A value outside its field's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fault {
    pub(super) field: &'static str,
    pub(super) found: f64,
    pub(super) allowed: &'static str,
}

/// The frame's values in the order of [`FIELDS`].
pub(super) fn values(frame: &FlightFrame) -> [f64; 8] {
    let [east, north, up] = frame.eye_m;
    [frame.time_s, east, north, up, frame.yaw_deg, frame.pitch_deg, frame.roll_deg, frame.vertical_fov_deg]
}

/// The frame with `values` in the order of [`FIELDS`].
pub(super) fn frame_of(values: [f64; 8]) -> FlightFrame {
    let [time_s, east, north, up, yaw_deg, pitch_deg, roll_deg, vertical_fov_deg] = values;
    FlightFrame { time_s, eye_m: [east, north, up], yaw_deg, pitch_deg, roll_deg, vertical_fov_deg }
}

/// The first of `values` outside its range; `None` for a frame that may be written. Not-a-numbers are outside.
pub(super) fn fault_in(values: &[f64; 8]) -> Option<Fault> {
    FIELDS.into_iter().zip(values).find_map(|(field, &found)| {
        let (inside, allowed) = match field {
            "time_s" => ((0.0..=1e9).contains(&found), "from 0 to 1e9"),
            "pitch_deg" => ((-90.0..=90.0).contains(&found), "from -90 to 90"),
            "vfov_deg" => (found > 0.0 && found < 180.0, "above 0 and below 180"),
            _ => (found.abs() <= 1e9, "from -1e9 to 1e9"),
        };
        (!inside).then_some(Fault { field, found, allowed })
    })
}

/// Whether `text` is a decimal as the format has it; narrower than what the standard library parses.
pub(crate) fn is_decimal(text: &str) -> bool {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (unsigned, None),
    };
    let digits = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    digits(whole)
        && digits(fraction)
        && !(whole.is_empty() && fraction.is_empty())
        && exponent.is_none_or(|e| {
            let e = e.strip_prefix(['+', '-']).unwrap_or(e);
            !e.is_empty() && digits(e)
        })
}

/// Name and value of a note, if `line` is one.
pub(super) fn note_of(line: &str) -> Option<(&str, &str)> {
    let (name, value) = line.strip_prefix("# ")?.split_once(':')?;
    let trimmed = value.trim_matches([' ', '\t']);
    let spaced = value.starts_with([' ', '\t']) && !trimmed.is_empty();
    (spaced && is_note_name(name)).then_some((name, trimmed))
}

fn is_note_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
}

/// The line for a note, if it would read back as the same note.
pub(super) fn note_line(name: &str, value: &str) -> Option<String> {
    let line = format!("# {name}: {value}");
    let one_line = line.len() <= MAX_LINE_BYTES && !line.contains(['\n', '\r']);
    (one_line && note_of(&line) == Some((name, value))).then_some(line)
}

/// Appends a frame's line without its end: shortest digits that read back the same.
pub(super) fn push_frame(line: &mut String, values: &[f64; 8]) -> fmt::Result {
    for (i, value) in values.iter().enumerate() {
        if i > 0 {
            line.push(' ');
        }
        push_number(line, *value)?;
    }
    Ok(())
}

/// Appends a number: shortest digits that read back the same.
pub(crate) fn push_number(line: &mut String, value: f64) -> fmt::Result {
    let magnitude = value.abs();
    if magnitude == 0.0 || (1e-6..1e15).contains(&magnitude) {
        write!(line, "{value}")
    } else {
        write!(line, "{value:e}")
    }
}

/// `text` for an error message: quoted, shortened, without control characters.
pub(crate) fn excerpt(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push('…');
    }
    format!("`{short}`")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn decimals_are_what_the_specification_says() {
        for good in ["0", "-0", "+1", "1.", ".5", "1.5e3", "1E-7", "00012"] {
            assert!(is_decimal(good) && good.parse::<f64>().is_ok(), "{good}");
        }
        for bad in ["", "-", ".", "e5", "1e", "1e+", "inf", "nan", "0x10", "1_000", "1,5", "--1", "1.2.3"] {
            assert!(!is_decimal(bad), "{bad}");
        }
    }

    #[test]
    fn notes_are_told_from_remarks() {
        assert_eq!(note_of("# terrain:  a b "), Some(("terrain", "a b")));
        for remark in ["# see this: that", "#a: b", "# http://x", "# A: b", "# a:", "# a: ", "a: b"] {
            assert_eq!(note_of(remark), None, "{remark}");
        }
        assert_eq!(note_line("a", "b\nc"), None);
        assert_eq!(note_line("a", " b"), None);
        assert_eq!(note_line("a", &"x".repeat(5000)), None);
    }

    proptest! {
        #[test]
        fn every_decimal_parses(text in "[+-]?[0-9]{0,20}[.]?[0-9]{0,20}([eE][+-]?[0-9]{1,4})?") {
            prop_assert!(!is_decimal(&text) || text.parse::<f64>().is_ok());
        }

        #[test]
        fn frames_survive_as_text(values in prop::array::uniform8(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO)) {
            let mut line = String::new();
            push_frame(&mut line, &values).unwrap();
            prop_assert!(line.len() <= MAX_LINE_BYTES);
            let fields: Vec<&str> = line.split(' ').collect();
            prop_assert_eq!(fields.len(), 8);
            for (field, value) in fields.into_iter().zip(values) {
                prop_assert!(is_decimal(field));
                prop_assert_eq!(field.parse::<f64>().unwrap().to_bits(), value.to_bits());
            }
        }
    }
}
