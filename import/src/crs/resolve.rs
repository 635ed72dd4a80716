//! From what a file says, or a person, to a [`System`]: texts, codes, compound codes, units apart.
//!
//! The more exact statement counts: what a person says before the file; a text before a code; a unit stated by itself before the registry's. Where a code is not in the
//! registry, or a text cannot be read, there is a warning, because a unit may depend on it.

use super::from_proj::{self, unit_name};
use super::from_wkt;
use super::registry::{self, Horizontal};
use super::system::{Kind, System, Unit, Vertical, exact_metres};
use crate::reader::{CrsSaid, HorizontalSize};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// The system of a horizontal or compound code.
pub(super) fn by_code(code: u32) -> Option<System> {
    if let Some((horizontal, vertical)) = registry::compound(code) {
        let mut system = by_code_alone(horizontal)?;
        system.vertical = vertical_by_code(vertical);
        return Some(system);
    }
    by_code_alone(code)
}

fn by_code_alone(code: u32) -> Option<System> {
    let mut system = match registry::horizontal(code)? {
        Horizontal::Text { wkt, proj } => {
            let mut system = from_wkt::system(wkt)?;
            if !proj.is_empty() {
                let (proj, off_m) = registry::tied(code, proj);
                (system.proj, system.off_m) = (Some(proj.clone()), off_m);
                let proj = proj.as_str();
                // A string that says nothing of axes does not deny what the text says of them, as for Krovak's to the south and west.
                if from_proj::word(proj, "axis").is_some() {
                    system.signs = from_proj::signs(proj);
                }
            }
            system
        }
        Horizontal::Parts { name, unit_name, size, datum, proj } => {
            let (proj, off_m) = registry::tied(code, proj);
            let mut system = from_proj::system(&proj).unwrap_or_else(System::unknown);
            system.off_m = off_m;
            system.name = name.to_owned();
            system.datum = from_wkt::datum_key(datum);
            system.kind = match size {
                HorizontalSize::Metres(_) => Kind::Projected,
                HorizontalSize::Radians(_) => Kind::Geographic,
            };
            system.unit = Some(Unit { name: unit_name.to_owned(), size: exact(size) });
            system
        }
    };
    system.code = Some(code);
    if system.reach_deg.is_empty() {
        system.reach_deg = registry::reach(&[Some(code), registry::code_of_datum(&system.datum)]);
    }
    Some(system)
}

fn exact(size: HorizontalSize) -> HorizontalSize {
    match size {
        HorizontalSize::Metres(metres) => HorizontalSize::Metres(exact_metres(metres)),
        HorizontalSize::Radians(radians) => HorizontalSize::Radians(super::system::exact_radians(radians)),
    }
}

/// The vertical system of a code.
pub(super) fn vertical_by_code(code: u32) -> Option<Vertical> {
    let entry = registry::vertical(code)?;
    Some(Vertical {
        name: entry.name.to_owned(),
        code: Some(code),
        unit_name: entry.unit_name.to_owned(),
        metres: exact_metres(entry.metres),
        is_down: entry.is_down,
    })
}

/// The system that a text names: WKT, a PROJ string, "EPSG:n", "EPSG:n+m", an URN, "OGC:CRS84".
pub(crate) fn by_text(text: &str) -> Option<System> {
    let text = text.trim_start_matches('\u{feff}').trim().trim_end_matches('\0');
    if text.contains('[') || text.contains('(') {
        return from_wkt::system(text);
    }
    if text.contains("proj=") || text.contains("init=") {
        return match from_proj::init_code(text) {
            Some(code) => by_code(code),
            None => from_proj::system(text),
        };
    }
    let lower = text.to_ascii_lowercase();
    if matches!(lower.as_str(), "wgs84" | "ogc:crs84" | "crs84" | "crs:84" | "urn:ogc:def:crs:ogc:1.3:crs84")
    {
        return by_code(4326);
    }
    if matches!(lower.as_str(), "local" | "metre" | "metres" | "meters" | "m") {
        return Some(local(1.0, "metre"));
    }
    // "EPSG:n", "urn:ogc:def:crs:EPSG::n", "http://www.opengis.net/def/crs/EPSG/0/n", "n", each with "+m".
    let (horizontal, vertical) = lower.split_once('+').map_or((lower.as_str(), None), |(a, b)| (a, Some(b)));
    let number = |word: &str| -> Option<u32> {
        let (authority, code) = match word.rfind([':', '/']) {
            Some(at) => (&word[..at], &word[at + 1..]),
            None => ("epsg", word),
        };
        authority.contains("epsg").then(|| code.parse().ok()).flatten()
    };
    let mut system = by_code(number(horizontal)?)?;
    if let Some(word) = vertical {
        let word = if word.contains(':') { word.to_owned() } else { format!("epsg:{word}") };
        system.vertical = Some(vertical_by_code(number(&word)?)?);
    }
    if system.text.is_empty() {
        system.text = text.to_owned();
    }
    Some(system)
}

/// A site's own system.
fn local(metres: f64, unit: &str) -> System {
    let mut system = System::unknown();
    system.kind = Kind::Local;
    system.name = "local system".into();
    system.unit = Some(Unit { name: unit.to_owned(), size: HorizontalSize::Metres(metres) });
    system
}

/// The system that a person `asked` for, or that the file names, and what may be wrong with it.
///
/// # Errors
/// [`LayoutError::Usage`] for a system that a person names and that is not known.
pub(crate) fn resolve(
    said: &CrsSaid,
    asked: Option<&str>,
    warnings: &mut Vec<Warning>,
) -> Result<System, LayoutError> {
    if let Some(text) = asked {
        let mut system = by_text(text).ok_or_else(|| {
            LayoutError::Usage(format!(
                "\"{}\" is no reference system that is known here; name one as EPSG:n, EPSG:n+m, WKT or a PROJ string, or local for a site in metres",
                harmless(text, 60)
            ))
            .mended_by(Remedy::ReferenceSystem)
        })?;
        system.by = "what was typed".into();
        return Ok(system);
    }
    let mut system = found(said, warnings);
    // What the file states by itself wins over the registry, as the standard of GeoTIFF has it.
    let yields = said.unit_yields && system.unit.is_some();
    if let Some(unit) = said.unit.as_ref().filter(|_| !yields) {
        let size = exact(unit.value);
        let differs = system.unit.as_ref().is_none_or(|known| known.size != size);
        if differs {
            system.unit = Some(Unit { name: unit_name(size), size });
        }
        if system.kind == Kind::Unknown {
            system.kind = match size {
                HorizontalSize::Radians(_) => Kind::Geographic,
                HorizontalSize::Metres(_) => Kind::Local,
            };
            if system.by.is_empty() {
                system.by = unit.by.clone();
            }
        }
    }
    if let Some(code) = &said.vertical_code {
        match vertical_by_code(code.value) {
            Some(vertical) => system.vertical = Some(vertical),
            None => warnings.push(
                Warning::new(format!(
                    "the vertical system EPSG:{} is not in the registry here, so the unit of heights is taken to be the metre",
                    code.value
                ))
                .mended_by(Remedy::HeightUnit, "ft"),
            ),
        }
    }
    if let Some(radius) = said.radius_m.filter(|_| system.radius_m.is_none()) {
        system.radius_m = Some(radius);
    }
    if system.name.is_empty() {
        system.name.clone_from(&said.name);
    }
    if said.is_local && system.kind == Kind::Unknown {
        system.kind = Kind::Local;
    }
    Ok(system)
}

/// By text, or by code, or by a name that is itself a text.
fn found(said: &CrsSaid, warnings: &mut Vec<Warning>) -> System {
    if let Some(text) = &said.text {
        if let Some(mut system) = by_text(&text.value) {
            system.by.clone_from(&text.by);
            return system;
        }
        let what = if from_wkt::is_geocentric(&text.value) {
            "is geocentric, in which a grid has no place on the ground"
        } else {
            "cannot be read here"
        };
        warnings.push(
            Warning::new(format!(
                "the reference system \"{}\" in {} {what}; its unit is not known",
                harmless(&text.value, 60),
                text.by
            ))
            .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
        );
    }
    if let Some(code) = &said.code {
        if let Some(mut system) = by_code(code.value) {
            system.by.clone_from(&code.by);
            return system;
        }
        let mut system = System::unknown();
        system.code = Some(code.value);
        system.by.clone_from(&code.by);
        if said.unit.is_none() {
            warnings.push(
                Warning::new(format!(
                    "EPSG:{} is not in the registry here, so its unit is not known",
                    code.value
                ))
                .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
            );
        }
        return system;
    }
    System::unknown()
}
