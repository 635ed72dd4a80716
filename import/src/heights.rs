//! What a raw number is in metres: scale, offset, unit and direction, and where each was found.
//!
//! A unit is taken from the person, the band, or the vertical system, in this order. A unit that is named and not known gives a warning. So does a unit that only the map has: maps in
//! feet often come with heights in feet, and often they do not.

use crate::crs::{System, unit_of_code};
use crate::options::{Direction, OpenOptions};
use crate::reader::{HorizontalSize, ValueSaid, VerticalUnit};
use crate::value::unit_m;
use terrasoar_layout::dem::{UnitOf, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::{harmless, number};

/// What raw numbers are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heights {
    /// Metres a raw number, below 0 for depths.
    pub(crate) scale_m: f64,
    /// Metres at raw number 0.
    pub(crate) offset_m: f64,
    /// The file's unit.
    pub(crate) unit: UnitOf,
    /// Where all this came from.
    pub(crate) words: String,
    /// Whether the unit was found, not assumed.
    pub(crate) unit_is_known: bool,
}

/// Works out what raw numbers are.
///
/// # Errors
/// [`LayoutError::Usage`] for a unit that a person names and that is none.
pub(crate) fn heights(
    said: &ValueSaid,
    system: &System,
    options: &OpenOptions,
    packed: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Heights, LayoutError> {
    let mut words = Vec::new();
    let found = match &options.height_unit {
        Some(text) => {
            let metres = typed_unit(text)?;
            words.push(format!("unit {} as typed", harmless(text, 40)));
            Some((harmless(text, 40), metres))
        }
        None => unit_of(said, system, &mut words, warnings),
    };
    let unit_is_known = found.is_some() || packed;
    if !unit_is_known {
        tell_feet(system, warnings);
    }
    let (name, metres) = found.unwrap_or_else(|| ("metre".into(), 1.0));
    let direction = direction_of(said, system, options, &mut words);
    let sign = if direction == Direction::Down { -1.0 } else { 1.0 };
    let mut scale = 1.0;
    if let Some(found) = said.scale.as_ref().filter(|found| found.value == 0.0) {
        warnings.push(
            Warning::new(format!(
                "the scale 0 ({}) would make all heights alike; 1 was taken, so heights are wrong unless the numbers are heights already; write the true scale into the file",
                found.by
            ))
            .mended_by(Remedy::HeightFactor, "FACTOR"),
        );
    } else if let Some(found) = &said.scale {
        scale = found.value;
        words.push(format!("scale {} from {}", number(found.value), found.by));
    }
    let mut offset = 0.0;
    if let Some(found) = &said.offset {
        offset = found.value;
        words.push(format!("offset {} from {}", number(found.value), found.by));
    }
    Ok(Heights {
        scale_m: sign * scale * metres,
        offset_m: sign * offset * metres,
        unit: UnitOf { name, size: metres, is_angle: false },
        words: words.join(", "),
        unit_is_known,
    })
}

/// A unit by name, by code, or by metres.
fn typed_unit(text: &str) -> Result<f64, LayoutError> {
    let by_number = || text.trim().parse::<f64>().ok().filter(|metres| metres.is_finite() && *metres > 0.0);
    unit_m(text).or_else(by_number).ok_or_else(|| {
        LayoutError::Usage(format!(
            "\"{}\" is no unit of heights that is known here; name one such as m, ft, ftUS, dm, cm, fathom, or its metres, such as 0.1",
            harmless(text, 40)
        ))
        .mended_by(Remedy::HeightUnit)
    })
}

/// The unit that the file states: of the band, or of the vertical system.
fn unit_of(
    said: &ValueSaid,
    system: &System,
    words: &mut Vec<String>,
    warnings: &mut Vec<Warning>,
) -> Option<(String, f64)> {
    if let Some(unit) = &said.unit {
        let found = match &unit.value {
            VerticalUnit::Name(name) => unit_m(name).map(|metres| (harmless(name, 40), metres)),
            VerticalUnit::Metres(metres) => Some((format!("unit of {} m", number(*metres)), *metres)),
            VerticalUnit::Code(code) => match unit_of_code(*code) {
                Some((name, HorizontalSize::Metres(metres))) => {
                    Some((name.to_owned(), crate::crs::exact_metres(metres)))
                }
                _ => None,
            },
        };
        if let Some((name, metres)) = found {
            words.push(format!("unit {name} from {}", unit.by));
            return Some((name, metres));
        }
        let shown = match &unit.value {
            VerticalUnit::Name(name) => format!("\"{}\"", harmless(name, 40)),
            VerticalUnit::Metres(metres) => number(*metres),
            VerticalUnit::Code(code) => format!("EPSG:{code}"),
        };
        warnings.push(
            Warning::new(format!(
                "the unit of heights {shown} ({}) is no length that is known here; metres were taken",
                unit.by
            ))
            .mended_by(Remedy::HeightUnit, "ft"),
        );
    }
    let vertical = system.vertical.as_ref()?;
    let name = if vertical.unit_name.is_empty() { "metre".to_owned() } else { vertical.unit_name.clone() };
    let code = vertical.code.map(|code| format!(" (EPSG:{code})")).unwrap_or_default();
    words.push(format!("unit {} from {}{code}", harmless(&name, 40), harmless(&vertical.name, 60)));
    Some((harmless(&name, 40), vertical.metres))
}

fn direction_of(
    said: &ValueSaid,
    system: &System,
    options: &OpenOptions,
    words: &mut Vec<String>,
) -> Direction {
    if let Some(direction) = options.positive {
        if direction == Direction::Down {
            words.push("depths, as typed".into());
        }
        return direction;
    }
    if let Some(found) = &said.direction {
        if found.value == Direction::Down {
            words.push(format!("depths, from {}", found.by));
        }
        return found.value;
    }
    match &system.vertical {
        Some(vertical) if vertical.is_down => {
            words.push(format!("depths, from {}", harmless(&vertical.name, 60)));
            Direction::Down
        }
        _ => Direction::Up,
    }
}

/// A map in feet, and nothing about heights.
fn tell_feet(system: &System, warnings: &mut Vec<Warning>) {
    let Some(unit) = &system.unit else { return };
    let HorizontalSize::Metres(metres) = unit.size else { return };
    if (0.3..0.31).contains(&metres) {
        let flag = if metres == crate::value::US_SURVEY_FOOT_M { "ftUS" } else { "ft" };
        warnings.push(
            Warning::new(format!(
                "coordinates are in {} and nothing says what heights are in; metres were taken",
                harmless(&unit.name, 40)
            ))
            .mended_by(Remedy::HeightUnit, flag),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reader::Said;

    fn of(said: &ValueSaid, options: &OpenOptions) -> (Heights, Vec<Warning>) {
        let mut warnings = Vec::new();
        let heights = heights(said, &System::unknown(), options, false, &mut warnings).unwrap();
        (heights, warnings)
    }

    #[test]
    fn metres_are_raw_times_scale_plus_offset_times_unit() {
        let mut said = ValueSaid {
            scale: Some(Said::new(0.1, "a")),
            offset: Some(Said::new(500.0, "b")),
            unit: Some(Said::new(VerticalUnit::Name("ft".into()), "c")),
            ..ValueSaid::default()
        };
        let (feet, warnings) = of(&said, &OpenOptions::default());
        assert!((feet.scale_m - 0.030_48).abs() < 1e-15 && (feet.offset_m - 152.4).abs() < 1e-12);
        assert!(warnings.is_empty() && feet.words.contains("scale 0.1 from a"), "{}", feet.words);
        said.direction = Some(Said::new(Direction::Down, "d"));
        assert!((of(&said, &OpenOptions::default()).0.scale_m + 0.030_48).abs() < 1e-15);
        let typed = OpenOptions {
            positive: Some(Direction::Up),
            height_unit: Some("0.5".into()),
            ..OpenOptions::default()
        };
        assert_eq!(of(&said, &typed).0.scale_m, 0.05);
        said.scale = Some(Said::new(0.0, "a"));
        let (flat, warnings) = of(&said, &OpenOptions::default());
        assert!((flat.scale_m + 0.3048).abs() < 1e-15 && warnings[0].words.contains("the scale 0 (a)"));
        said.unit = Some(Said::new(VerticalUnit::Name("mGal".into()), "c"));
        assert_eq!(of(&said, &OpenOptions::default()).1.len(), 2);
        let wrong = OpenOptions { height_unit: Some("ell".into()), ..OpenOptions::default() };
        assert!(heights(&said, &System::unknown(), &wrong, false, &mut Vec::new()).is_err());
    }
}
