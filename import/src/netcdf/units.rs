//! Units of coordinates by the names that files give them (UDUNITS' names, CF 1.11, section 4).
//!
//! An angle says how many degrees it is, below 0 where it counts to the west or the south: "degrees_west". A number before a name multiplies it: "0.001 degrees". A name that is not known is
//! no unit: the caller says so, for a guess would put the ground elsewhere. Cost: some comparisons of text.

/// Which way an axis lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    East,
    North,
}

/// Whether it is a degree to the south, which differs from "degrees" by a capital or by what parts the words.
fn is_one_south(name: &str) -> bool {
    let is_parted = ["degree", "deg"].iter().any(|word| {
        let rest = name.to_ascii_lowercase();
        matches!(rest.strip_prefix(word), Some("_s" | " s" | "-s"))
    });
    is_parted || matches!(name, "degreeS" | "degS")
}

/// What counts coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unit {
    /// Degrees a unit, to the east and the north.
    Degrees(f64),
    /// Metres a unit.
    Metres(f64),
}

/// The unit by its name; GMT has it in brackets behind what is counted: "longitude [degrees_east]".
pub(super) fn unit(name: &str) -> Option<Unit> {
    let name = inside(name);
    if let Some((count, rest)) = name.split_once(char::is_whitespace)
        && let Ok(count) = count.parse::<f64>()
    {
        let is_count = count.is_finite() && count != 0.0;
        return match unit_of(rest.trim()).filter(|_| is_count)? {
            Unit::Degrees(degrees) => Some(Unit::Degrees(count * degrees)),
            Unit::Metres(metres) => Some(Unit::Metres(count * metres)),
        };
    }
    unit_of(name)
}

/// Whether a unit itself tells longitudes from latitudes.
pub(super) fn way(name: &str) -> Option<Way> {
    if is_one_south(inside(name)) {
        return Some(Way::North);
    }
    match direction(&plain(inside(name)))? {
        "e" | "east" | "w" | "west" => Some(Way::East),
        "n" | "north" | "s" | "south" => Some(Way::North),
        _ => None,
    }
}

fn inside(name: &str) -> &str {
    let inside = name.split_once('[').and_then(|(_, rest)| rest.split_once(']'));
    inside.map_or(name, |(inside, _)| inside).trim()
}

/// Small letters without what only parts words.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, '_' | '-' | '.' | ' ')).flat_map(char::to_lowercase).collect()
}

/// What stands behind "degrees", where that is known; "degreesouth" is one degree to the south.
fn direction(plain: &str) -> Option<&str> {
    const KNOWN: [&str; 17] = [
        "",
        "e",
        "east",
        "n",
        "north",
        "w",
        "west",
        "s",
        "south",
        "t",
        "true",
        "lon",
        "lat",
        "longitude",
        "latitude",
        "decimal",
        "arc",
    ];
    let words = ["degrees", "degree", "degs", "deg", "°", "º"];
    words.iter().filter_map(|word| plain.strip_prefix(word)).find(|rest| KNOWN.contains(rest))
}

fn unit_of(name: &str) -> Option<Unit> {
    if is_one_south(name) {
        return Some(Unit::Degrees(-1.0));
    }
    let plain = plain(name);
    if let Some(towards) = direction(&plain) {
        let is_back = matches!(towards, "w" | "west" | "s" | "south");
        return Some(Unit::Degrees(if is_back { -1.0 } else { 1.0 }));
    }
    let degrees = match plain.as_str() {
        "decimaldegree" | "decimaldegrees" | "angulardegree" | "angulardegrees" | "arcdeg" | "arcdegree"
        | "arcdegrees" => 1.0,
        "radian" | "radians" | "rad" => 1f64.to_degrees(),
        "milliradian" | "milliradians" | "mrad" => 1e-3f64.to_degrees(),
        "microradian" | "microradians" | "urad" => 1e-6f64.to_degrees(),
        "grad" | "grads" | "grade" | "grades" | "gon" | "gons" | "gradian" | "gradians" => 0.9,
        "arcminute" | "arcminutes" | "arcmin" | "arcmins" | "angularminute" | "angularminutes"
        | "minuteofarc" | "minutesofarc" | "'" | "′" => 1.0 / 60.0,
        "arcsecond" | "arcseconds" | "arcsec" | "arcsecs" | "angularsecond" | "angularseconds"
        | "secondofarc" | "secondsofarc" | "\"" | "″" => 1.0 / 3600.0,
        "millidegree" | "millidegrees" => 1e-3,
        "microdegree" | "microdegrees" => 1e-6,
        _ => return crate::value::unit_m(name).map(Unit::Metres),
    };
    Some(Unit::Degrees(degrees))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_known_by_all_their_names() {
        let east =
            ["degrees_east", "degree_east", "degree_E", "degrees_E", "degreeE", "degreesE", "Degrees East"];
        let west =
            ["degrees_west", "degree_west", "degree_W", "degrees_W", "degreeW", "degreesW", "Degrees West"];
        let north = ["degrees_north", "degree_N", "degreesN", "degreeN", "longitude [degrees_north]"];
        let south =
            ["degrees_south", "degree_S", "degrees_S", "degreesS", "degreeS", "latitude [degree_south]"];
        for (names, degrees, wanted) in [
            (&east[..], 1.0, Way::East),
            (&west, -1.0, Way::East),
            (&north, 1.0, Way::North),
            (&south, -1.0, Way::North),
        ] {
            for name in names {
                assert_eq!((unit(name), way(name)), (Some(Unit::Degrees(degrees)), Some(wanted)), "{name}");
            }
        }
        for (name, degrees) in [
            ("degrees", 1.0),
            ("degree", 1.0),
            ("deg", 1.0),
            ("degrees_true", 1.0),
            ("decimal degrees", 1.0),
            ("0.001 degrees", 0.001),
            ("radians", 57.295_779_513_082_32),
            ("rad", 57.295_779_513_082_32),
            ("grad", 0.9),
            ("arc_minutes", 1.0 / 60.0),
            ("arcmin", 1.0 / 60.0),
            ("arc_second", 1.0 / 3600.0),
        ] {
            let found = unit(name);
            let Some(Unit::Degrees(found)) = found else { panic!("{name}: {found:?}") };
            assert!((found - degrees).abs() <= 1e-15 * degrees && way(name).is_none(), "{name}: {found}");
        }
    }

    #[test]
    fn lengths_and_strangers() {
        for (name, metres) in
            [("m", 1.0), ("km", 1000.0), ("US_survey_foot", 1200.0 / 3937.0), ("2 km", 2000.0)]
        {
            assert_eq!(unit(name), Some(Unit::Metres(metres)), "{name}");
        }
        for name in ["", "degrees_celsius", "degC", "level", "1", "0 m", "nan m", "hours"] {
            assert_eq!(unit(name), None, "{name}");
        }
    }
}
