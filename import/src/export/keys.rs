//! The reference system of a terrain as GeoTIFF keys (GeoTIFF 1.1, OGC 19-008r4).
//!
//! By its EPSG code where it has one; else by ellipsoid and projection, and beside them in full, as the text in a citation that ESRI began with and GDAL reads; else by its name and unit. The
//! unit is stated in any case. Heights are metres whatever they were measured in, so the vertical system is the one in metres, and is left out where there is none.

use super::methods::{self, OWN, Value, Values};
use crate::crs::{HorizontalSize, System, Unit, unit_of_code, vertical_in_metres};
use crate::places::{Crs, coordinate_unit_m};
use terrasoar_layout::file::header::Header;
use terrasoar_layout::words::harmless;

/// Longest text that GDAL reads in a citation, with room for what introduces it.
const MAX_TEXT_BYTES: usize = 2300;
const MAX_NAME_CHARS: usize = 200;

/// How far a file says in which reference system it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Named {
    /// By a code of EPSG.
    Code,
    /// By parameters or a text; where no more is known, by name and unit.
    Parameters,
    /// By name and unit: what more is known does not go into GeoTIFF.
    Name,
    /// The terrain knows no system: coordinates are as they were, or metres from the terrain's south-west sample.
    Nothing,
}

/// Keys as the three tags that hold them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GeoKeys {
    pub(super) directory: Vec<u64>,
    pub(super) reals: Vec<f64>,
    pub(super) texts: String,
    pub(super) named: Named,
}

/// The keys of a terrain's system; with its vertical part where the numbers are heights.
pub(super) fn of(header: &Header, are_heights: bool) -> GeoKeys {
    let (mut values, named) = horizontal(header);
    // Pixels are samples, which are points.
    values.push((1025, Value::Short(2)));
    let vertical = header.about.vertical_epsg.and_then(vertical_in_metres).filter(|_| are_heights);
    let vertical = vertical.and_then(|code| u16::try_from(code).ok());
    if let Some(code) = vertical {
        values.push((4096, Value::Short(code)));
        values.push((4099, Value::Short(9001)));
    }
    // Readers look for a vertical system in files of version 1.1.
    packed(values, u64::from(vertical.is_some()), named)
}

/// Keys of the horizontal part.
fn horizontal(header: &Header) -> (Values, Named) {
    let Some(crs) = Crs::of(header) else {
        if header.sample_to_crs.is_some() {
            return (unit_alone(header), Named::Nothing);
        }
        let local = [
            (1024, Value::Short(1)),
            (1026, Value::Text("local metres from the south-west sample".into())),
            (3072, Value::Short(OWN)),
            (3076, Value::Short(9001)),
        ];
        return (local.into(), Named::Nothing);
    };
    let system = crs.system();
    let is_angle = crs.is_geographic()
        || system.unit.as_ref().is_some_and(|unit| matches!(unit.size, HorizontalSize::Radians(_)));
    let name = match harmless(&system.name, MAX_NAME_CHARS).replace('|', "/") {
        name if name.is_empty() => "unknown".to_owned(),
        name => name,
    };
    let mut values =
        vec![(1024, Value::Short(if is_angle { 2 } else { 1 })), (1026, Value::Text(name.clone()))];
    values.extend(unit(system, is_angle));
    let type_key = if is_angle { 2048 } else { 3072 };
    if let Some(code) = system.code.and_then(|code| u16::try_from(code).ok()).filter(|code| *code != OWN) {
        values.push((type_key, Value::Short(code)));
        return (values, Named::Code);
    }
    let text = full_text(system);
    let unit_m = match system.unit.as_ref().map(|unit| unit.size) {
        Some(HorizontalSize::Metres(metres)) => metres,
        _ => 1.0,
    };
    let proj = system.proj.as_deref();
    let body = proj.and_then(methods::body);
    let projection = proj.filter(|_| !is_angle).and_then(|proj| methods::projection(proj, unit_m));
    let is_whole = body.is_some() && (is_angle || projection.is_some());
    let is_plain = proj.is_none() && system.text.is_empty();
    let is_told = is_whole || is_plain || (text.is_some() && !is_angle);
    let named = if is_told { Named::Parameters } else { Named::Name };
    match (body.filter(|_| is_whole), system.radius_m.filter(|_| is_angle)) {
        (Some(body), _) => values.extend(body),
        (None, Some(radius)) => {
            let sphere = [(2050, Value::Short(OWN)), (2056, Value::Short(OWN))];
            values.extend(sphere);
            values.push((2057, Value::Reals(vec![radius])));
        }
        (None, None) => {}
    }
    values.push((2049, Value::Text(name.clone())));
    if !is_angle {
        values.extend(projection.filter(|_| is_whole).unwrap_or_default());
        values.push((3073, Value::Text(text.map_or(name, |text| format!("ESRI PE String = {text}")))));
    }
    if !values.iter().any(|(key, _)| *key == type_key) {
        values.push((type_key, Value::Short(OWN)));
    }
    (values, named)
}

/// The unit of coordinates that are in no system that is known; nothing where it is not known either.
fn unit_alone(header: &Header) -> Values {
    let Some(metres) = coordinate_unit_m(header) else { return Vec::new() };
    let unit_m = Unit { name: String::new(), size: HorizontalSize::Metres(metres) };
    let system = System { unit: Some(unit_m), ..System::unknown() };
    let mut values = vec![(1024, Value::Short(1)), (3072, Value::Short(OWN))];
    values.extend(unit(&system, false));
    values
}

/// The system as WKT, if it is known so and the text goes into a citation.
fn full_text(system: &System) -> Option<String> {
    let text = &system.text;
    let fits = text.contains('[') && text.is_ascii() && !text.contains('|') && text.len() <= MAX_TEXT_BYTES;
    fits.then(|| text.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The unit by its code, or by its size.
fn unit(system: &System, is_angle: bool) -> Values {
    let Some(unit) = &system.unit else { return Vec::new() };
    let (code_key, size_key, codes) =
        if is_angle { (2054, 2055, 9101..=9122) } else { (3076, 3077, 9001..=9099) };
    let size = match unit.size {
        HorizontalSize::Metres(size) | HorizontalSize::Radians(size) => size,
    };
    let is_it = |code: &u16| {
        unit_of_code((*code).into()).is_some_and(|(_, known)| match (known, unit.size) {
            (HorizontalSize::Metres(a), HorizontalSize::Metres(b))
            | (HorizontalSize::Radians(a), HorizontalSize::Radians(b)) => (a / b - 1.0).abs() < 1e-12,
            _ => false,
        })
    };
    // The degree is named before units that are as large.
    let first = if is_angle { 9102 } else { 9001 };
    match std::iter::once(first).chain(codes).find(is_it) {
        Some(code) => vec![(code_key, Value::Short(code))],
        None => vec![(code_key, Value::Short(OWN)), (size_key, Value::Reals(vec![size]))],
    }
}

/// Keys in the order of their numbers, and what they point to.
fn packed(mut values: Values, minor: u64, named: Named) -> GeoKeys {
    values.sort_by_key(|(key, _)| *key);
    let mut keys = GeoKeys {
        directory: vec![1, 1, minor, values.len() as u64],
        reals: Vec::new(),
        texts: String::new(),
        named,
    };
    for (key, value) in values {
        let entry = match value {
            Value::Short(value) => [0, 1, u64::from(value)],
            Value::Reals(reals) => {
                let at = keys.reals.len() as u64;
                keys.reals.extend(&reals);
                [34736, reals.len() as u64, at]
            }
            Value::Text(text) => {
                let at = keys.texts.len() as u64;
                keys.texts.push_str(&text);
                keys.texts.push('|');
                [34737, text.len() as u64 + 1, at]
            }
        };
        keys.directory.push(key.into());
        keys.directory.extend(entry);
    }
    keys
}
