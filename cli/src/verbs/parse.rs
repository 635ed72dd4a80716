//! Parsers for words of the command line that are more than a number. Each says what it takes when it refuses a word.

use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use std::num::NonZero;
use std::path::PathBuf;
use terrasoar::flight::generate::FlightKind;
use terrasoar::flyover::EngineKind;
use terrasoar::refine::Culling;
use terrasoar::view::{ErrorMetric, Viewport};
use terrasoar_import::Stretch;
use terrasoar_import::synth::MAX_SIZE;

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is not a finite decimal number")),
    }
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("it must be above 0".into()) })
}

/// A number other than 0.
pub(super) fn not_zero(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v != 0.0 { Ok(v) } else { Err("it must not be 0".into()) })
}

/// A number in any notation, or nan, kept as it was typed: what it is depends on the type of the samples.
pub(super) fn raw_value(text: &str) -> Result<String, String> {
    let text = text.trim();
    if text.eq_ignore_ascii_case("nan") || text.parse::<f64>().is_ok_and(f64::is_finite) {
        return Ok(text.to_owned());
    }
    Err(format!("`{text}` is neither a number nor nan"))
}

/// A number that is 0 or more.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("it must not be negative".into()) })
}

/// Any number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text)
}

/// A percentage above 0, at most 100.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    positive(text).and_then(|v| if v <= 100.0 { Ok(v) } else { Err("it must be at most 100".into()) })
}

/// A tolerance in pixels.
pub(super) fn tolerance_px(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| {
        if (0.01..=10_000.0).contains(&v) {
            Ok(v)
        } else {
            Err("it must be from 0.01 to 10000 pixels".into())
        }
    })
}

/// A vertical exaggeration.
pub(super) fn exaggeration(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| {
        if (0.01..=100.0).contains(&v) { Ok(v) } else { Err("it must be from 0.01 to 100".into()) }
    })
}

/// `M` or `MX,MY`: metres between samples, east and north.
pub(super) fn spacing_m(text: &str) -> Result<[f64; 2], String> {
    let length = |word: &str| {
        let metres = positive(word)?;
        if (1e-3..=1e6).contains(&metres) {
            Ok(metres)
        } else {
            Err("it must be from 0.001 to 1000000".to_owned())
        }
    };
    match text.split_once(',') {
        None => length(text).map(|m| [m, m]),
        Some((east, north)) => Ok([length(east)?, length(north)?]),
    }
}

/// `X,Y`: metres east and north.
pub(super) fn place_m(text: &str) -> Result<[f64; 2], String> {
    let (east, north) =
        text.split_once(',').ok_or("give two numbers, metres east and north, such as 1500,820.5")?;
    Ok([number(east)?, number(north)?])
}

/// `X,Y`: a place in some system, east before north.
pub(super) fn place(text: &str) -> Result<[f64; 2], String> {
    let (east, north) =
        text.split_once(',').ok_or("give two numbers, east before north, such as 1500,820.5")?;
    Ok([number(east)?, number(north)?])
}

/// `A` or `A,B`: one number above 0, or the least and the greatest.
pub(super) fn range(text: &str) -> Result<[f64; 2], String> {
    match text.split_once(',') {
        None => positive(text).map(|value| [value, value]),
        Some((low, high)) => match [positive(low)?, positive(high)?] {
            [low, high] if low <= high => Ok([low, high]),
            _ => Err("the first number must not be greater than the second".into()),
        },
    }
}

/// `W,S,E,N`: the sides of a rectangle.
pub(super) fn extent(text: &str) -> Result<[f64; 4], String> {
    let sides: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    match <[f64; 4]>::try_from(sides) {
        Ok([west, south, east, north]) if west < east && south < north => Ok([west, south, east, north]),
        Ok(_) => Err("west must be less than east, and south less than north".into()),
        Err(_) => Err("give west, south, east and north, such as 0,0,5000,4000".into()),
    }
}

/// `W,S,E,N` in degrees; a west that is greater than the east is one on the other side of 180 degrees.
pub(super) fn bounds(text: &str) -> Result<[f64; 4], String> {
    let sides: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    match <[f64; 4]>::try_from(sides) {
        Ok(sides) if sides[0] != sides[2] && sides[1] < sides[3] => Ok(sides),
        Ok(_) => Err("west and east must differ, and south be less than north".into()),
        Err(_) => Err("give west, south, east and north in degrees, such as 7,46,8,47".into()),
    }
}

/// `LOW,HIGH` in percent, or `LOW..HIGH` in values.
pub(super) fn stretch(text: &str) -> Result<Stretch, String> {
    if let Some((low, high)) = text.split_once("..") {
        let (low, high) = (number(low)?, number(high)?);
        return match low < high {
            true => Ok(Stretch::Values(low, high)),
            false => {
                Err("the first value, which is black, must be less than the second, which is white".into())
            }
        };
    }
    let (low, high) =
        text.split_once(',').ok_or("give two percentages, such as 2,98, or two values, such as 200..3000")?;
    let (low, high) = (number(low)?, number(high)?);
    match 0.0 <= low && low < high && high <= 100.0 {
        true => Ok(Stretch::Percentiles(low, high)),
        false => {
            Err("percentages are from 0 to 100, the first less than the second; values are written 200..3000"
                .into())
        }
    }
}

/// One band or three, counted from 1.
pub(super) fn bands(text: &str) -> Result<Vec<NonZero<u32>>, String> {
    let wrong = |_| "give three bands counted from 1, such as 4,3,2, or one for grey".to_owned();
    let bands: Vec<NonZero<u32>> =
        text.split(',').map(|band| band.trim().parse().map_err(wrong)).collect::<Result<_, _>>()?;
    match bands.len() {
        1 | 3 => Ok(bands),
        count => Err(format!("{count} bands make no colours; give three, such as 4,3,2, or one for grey")),
    }
}

/// `WIDTHxHEIGHT` in pixels.
pub(super) fn viewport(text: &str) -> Result<Viewport, String> {
    let side = |word: &str| match word.parse::<u32>() {
        Ok(pixels) if (1..=65_536).contains(&pixels) => Ok(pixels),
        _ => Err("give width and height in pixels, each from 1 to 65536, such as 800x600".to_owned()),
    };
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width and height, such as 800x600")?;
    Ok(Viewport { width_px: side(width)?, height_px: side(height)? })
}

/// Samples a side of synthetic terrain: 2^k + 1.
pub(super) fn synth_size(text: &str) -> Result<u32, String> {
    let size: u32 = text.parse().map_err(|_| format!("`{text}` is not a whole number"))?;
    if (3..=MAX_SIZE).contains(&size) && (size - 1).is_power_of_two() {
        Ok(size)
    } else {
        Err(format!("it must be 2^k + 1: 3, 5, 9, ... 1025, 2049, 4097, 8193, ... {MAX_SIZE}"))
    }
}

/// A path whose extension is one of `allowed`, given in lower case. The rest of the name may be any that the system has.
pub(super) fn with_extension(allowed: &'static [&'static str]) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| {
        let ends_in = |wanted: &&str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(wanted));
        if allowed.iter().any(ends_in) {
            Ok(path)
        } else {
            Err(format!("the name must end in .{}", allowed.join(" or .")))
        }
    })
}

/// An engine by name.
pub(super) fn engine() -> impl TypedValueParser<Value = EngineKind> {
    PossibleValuesParser::new(EngineKind::ALL.map(EngineKind::name))
        .try_map(|word| word.parse::<EngineKind>())
}

/// Frames a second; 0 for no pace.
pub(super) fn pace(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| {
        if v == 0.0 || (0.001..=1e6).contains(&v) {
            Ok(v)
        } else {
            Err("it must be 0, or from 0.001 to 1000000".into())
        }
    })
}

/// A measure of errors by name.
pub(super) fn metric() -> impl TypedValueParser<Value = ErrorMetric> {
    PossibleValuesParser::new(ErrorMetric::ALL.map(ErrorMetric::name))
        .map(|word| ErrorMetric::ALL.into_iter().find(|metric| metric.name() == word).unwrap_or_default())
}

/// A way of culling by name.
pub(super) fn culling() -> impl TypedValueParser<Value = Culling> {
    PossibleValuesParser::new(Culling::ALL.map(Culling::name))
        .map(|word| Culling::ALL.into_iter().find(|culling| culling.name() == word).unwrap_or_default())
}

/// A kind of flight by name.
pub(super) fn flight_kind() -> impl TypedValueParser<Value = FlightKind> {
    PossibleValuesParser::new(FlightKind::ALL.map(FlightKind::name))
        .try_map(|word| word.parse::<FlightKind>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_understood_or_refused() {
        assert_eq!(spacing_m("10").unwrap(), [10.0, 10.0]);
        assert_eq!(spacing_m("10.08,13.64").unwrap(), [10.08, 13.64]);
        assert_eq!(place_m("-3,4e2").unwrap(), [-3.0, 400.0]);
        assert_eq!(range("2,3").unwrap(), [2.0, 3.0]);
        assert_eq!(range("2").unwrap(), [2.0, 2.0]);
        assert!(range("3,2").is_err() && range("0,2").is_err() && range("1,2,3").is_err());
        assert_eq!(viewport("800x600").unwrap(), Viewport::default());
        assert_eq!(synth_size("1025").unwrap(), 1025);
        assert_eq!(synth_size("1048577").unwrap(), 1_048_577);
        for wrong in ["", "0", "-1", "nan", "inf", "1,2,3", "10,", "1e9"] {
            assert!(spacing_m(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "5", "1,x", "1,nan"] {
            assert!(place_m(wrong).is_err(), "{wrong}");
        }
        assert_eq!(extent("-1,0,5e3,4").unwrap(), [-1.0, 0.0, 5000.0, 4.0]);
        for wrong in ["", "1,2,3", "1,2,3,4,5", "2,0,1,1", "0,1,1,1", "0,0,nan,1"] {
            assert!(extent(wrong).is_err(), "{wrong}");
        }
        assert_eq!(stretch("2,98").unwrap(), Stretch::Percentiles(2.0, 98.0));
        assert_eq!(stretch("-0.5..1e3").unwrap(), Stretch::Values(-0.5, 1000.0));
        for wrong in
            ["", "2", "98,2", "-1,98", "2,101", "3..3", "3000..200", "nan..1", "1..inf", "1,2,3", "a,b"]
        {
            assert!(stretch(wrong).is_err(), "{wrong}");
        }
        assert_eq!(bands("4, 3,2").unwrap().iter().map(|band| band.get()).collect::<Vec<_>>(), [4, 3, 2]);
        for wrong in ["", "0", "1,2", "1,2,3,4", "-1", "1,x,3", "4294967296"] {
            assert!(bands(wrong).is_err(), "{wrong}");
        }
        for wrong in ["800", "0x600", "800x", "800x600x3", "99999999x1"] {
            assert!(viewport(wrong).is_err(), "{wrong}");
        }
        for wrong in ["1024", "2", "2097153", "x"] {
            assert!(synth_size(wrong).is_err(), "{wrong}");
        }
        assert!(percent("100.5").is_err() && tolerance_px("0").is_err() && not_negative("-1").is_err());
    }

    #[test]
    fn names_end_as_they_should_whatever_comes_before() {
        let parser = with_extension(&["tif", "png"]);
        let command = clap::Command::new("x");
        let parsed = |name: &std::ffi::OsStr| parser.parse_ref(&command, None, name);
        assert_eq!(parsed("a.b/c.TIF".as_ref()).unwrap(), PathBuf::from("a.b/c.TIF"));
        for wrong in ["a", "a.ply", "tif", "a.tif.gz", "a.tif/b"] {
            let message = parsed(wrong.as_ref()).unwrap_err().to_string();
            assert!(message.contains("the name must end in .tif or .png"), "{message}");
        }
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt;
            let name = std::ffi::OsStr::from_bytes(b"\xff\xfe.png");
            assert_eq!(parsed(name).unwrap().as_os_str(), name);
        }
    }
}
