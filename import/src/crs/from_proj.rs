//! PROJ strings: `+proj=utm +zone=32 +datum=WGS84 +units=us-ft`, and the parts of them that a terrain needs.

use super::registry;
use super::system::{Kind, System, Unit, Vertical, exact_metres};
use crate::reader::HorizontalSize;
use crate::value::unit_m;

/// Equatorial radii of PROJ's ellipsoids that are none of the Earth's, and of those in common use.
const RADII_M: [(&str, f64); 12] = [
    ("WGS84", 6_378_137.0),
    ("GRS80", 6_378_137.0),
    ("clrk66", 6_378_206.4),
    ("clrk80", 6_378_249.145),
    ("clrk80ign", 6_378_249.2),
    ("bessel", 6_377_397.155),
    ("intl", 6_378_388.0),
    ("airy", 6_377_563.396),
    ("krass", 6_378_245.0),
    ("sphere", 6_370_997.0),
    ("WGS72", 6_378_135.0),
    ("aust_SA", 6_378_160.0),
];

/// Directions of the first two axes that are read: eastings or westings first; northings first, which data has the other way round all the same; and southings before westings, which are
/// turned. Others cross columns and rows.
const AXES: [&str; 6] = ["en", "es", "wn", "ws", "ne", "sw"];

/// The value of a word, "" for one without.
pub(crate) fn word<'t>(text: &'t str, name: &str) -> Option<&'t str> {
    text.split_whitespace().find_map(|word| {
        let word = word.strip_prefix('+').unwrap_or(word);
        match word.split_once('=') {
            Some((key, value)) => (key == name).then_some(value),
            None => (word == name).then_some(""),
        }
    })
}

/// A number, or a quotient such as 1/10.
fn number(text: &str) -> Option<f64> {
    let (above, below) = text.split_once('/').unwrap_or((text, "1"));
    let value = above.trim().parse::<f64>().ok()? / below.trim().parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// The EPSG code that a string names instead of describing the system: `+init=epsg:4326`.
pub(super) fn init_code(text: &str) -> Option<u32> {
    word(text, "init")?.to_ascii_lowercase().strip_prefix("epsg:")?.parse().ok()
}

/// The system that a string describes; `None` if it is no such string.
pub(super) fn system(text: &str) -> Option<System> {
    let text = text.trim();
    let projection = word(text, "proj")?;
    if word(text, "axis").is_some_and(|axis| !AXES.iter().any(|known| axis.starts_with(known))) {
        return None;
    }
    let mut system = System::unknown();
    system.text = text.to_owned();
    system.proj = Some(text.to_owned());
    system.radius_m = ["R", "a"].iter().find_map(|key| word(text, key).and_then(number)).or_else(|| {
        let name = word(text, "ellps").or_else(|| word(text, "datum"))?;
        RADII_M.iter().find(|(known, _)| *known == name).map(|(_, radius)| *radius)
    });
    if matches!(projection, "longlat" | "latlong" | "lonlat" | "latlon") {
        system.kind = Kind::Geographic;
        system.name = "longitude and latitude".into();
        system.unit = Some(Unit { name: "degree".into(), size: HorizontalSize::Radians(1f64.to_radians()) });
    } else {
        system.kind = Kind::Projected;
        system.name = match (projection, word(text, "zone")) {
            ("utm", Some(zone)) => {
                format!("UTM zone {zone}{}", if word(text, "south").is_some() { "S" } else { "N" })
            }
            _ => format!("PROJ {projection}"),
        };
        // A named unit counts before its size, as in PROJ.
        let metres = match (word(text, "units"), word(text, "to_meter")) {
            (Some(name), _) => unit_m(name),
            (None, Some(size)) => number(size),
            (None, None) => Some(1.0),
        };
        let name = word(text, "units").unwrap_or("metre").to_owned();
        system.unit = metres.map(|m| Unit { name, size: HorizontalSize::Metres(exact_metres(m)) });
    }
    system.signs = signs(text);
    system.is_south_first = word(text, "axis").is_some_and(|axis| axis.starts_with("sw"));
    let vertical_m =
        word(text, "vunits").and_then(unit_m).or_else(|| word(text, "vto_meter").and_then(number));
    system.vertical = vertical_m.map(|metres| Vertical {
        name: word(text, "geoidgrids").map(|grid| format!("heights by {grid}")).unwrap_or_default(),
        code: None,
        unit_name: word(text, "vunits").unwrap_or("").to_owned(),
        metres: exact_metres(metres),
        is_down: false,
    });
    Some(system)
}

/// Which way the axes point: `+axis=wsu` counts to the west and south.
pub(super) fn signs(text: &str) -> [f64; 2] {
    let axis = word(text, "axis").unwrap_or("enu");
    [if axis.contains('w') { -1.0 } else { 1.0 }, if axis.contains('s') { -1.0 } else { 1.0 }]
}

/// Name of the unit code, for those that keys name.
pub(crate) fn unit_name(size: HorizontalSize) -> String {
    match size {
        HorizontalSize::Metres(1.0) => "metre".into(),
        HorizontalSize::Metres(0.3048) => "foot".into(),
        HorizontalSize::Metres(metres) if metres == crate::value::US_SURVEY_FOOT_M => "US survey foot".into(),
        HorizontalSize::Metres(1000.0) => "kilometre".into(),
        HorizontalSize::Metres(metres) => format!("unit of {metres} m"),
        HorizontalSize::Radians(radians) if radians == 1f64.to_radians() => "degree".into(),
        HorizontalSize::Radians(radians) => {
            let known = [9101, 9103, 9104, 9105].into_iter().find_map(|code| {
                let (name, size) = registry::unit(code)?;
                let HorizontalSize::Radians(known) = size else { return None };
                ((known / radians - 1.0).abs() < 1e-9).then_some(name)
            });
            known.map_or_else(|| format!("unit of {} degrees", radians.to_degrees()), str::to_owned)
        }
    }
}
