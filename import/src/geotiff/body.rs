//! The geographic system under the keys, as words of a PROJ string: ellipsoid, prime meridian, shift to WGS 84, and the unit of angles.
//!
//! A code of the registry says all of that, and what keys say beside it is compared and told where it differs, as GDAL passes over it too. A system of the file's own is put
//! together from a datum's code, or axes, or an ellipsoid's code, with the meridian and the shift of the keys (OGC 19-008r4, section 7.3). What cannot be honoured gives a warning and no words.

use super::keys::Keys;
use super::shapes::SHAPES;
use crate::crs::{Kind, by_text, figures_differ, places_differ, proj_word, unit_of_code};
use crate::reader::HorizontalSize;
use terrasoar_layout::dem::Warning;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

pub(super) const GEOGRAPHIC_TYPE: u16 = 2048;
const DATUM: u16 = 2050;
const MERIDIAN: u16 = 2051;
pub(super) const ANGULAR_UNITS: u16 = 2054;
pub(super) const ANGULAR_UNIT_SIZE: u16 = 2055;
const ELLIPSOID: u16 = 2056;
const SEMI_MAJOR: u16 = 2057;
const SEMI_MINOR: u16 = 2058;
const INVERSE_FLATTENING: u16 = 2059;
const AZIMUTH_UNITS: u16 = 2060;
const MERIDIAN_LONGITUDE: u16 = 2061;
const SHIFT: u16 = 2062;

/// EPSG's prime meridians from code 8901 on, degrees east of Greenwich.
const MERIDIANS: [f64; 14] = [
    0.0,
    -9.131_906_111_111_11,
    2.337_229_17,
    -74.080_916_666_666_7,
    -3.687_938_888_888_89,
    12.452_333_333_333_3,
    7.439_583_333_333_33,
    106.807_719_444_444,
    -17.666_666_666_666_7,
    4.367_975,
    18.058_277_777_777_8,
    23.716_337_5,
    10.722_916_666_666_7,
    2.337_208_333_333_33,
];

/// Words of a PROJ string that tell a geographic system.
const WORDS: [&str; 8] = ["R", "a", "b", "rf", "ellps", "datum", "towgs84", "nadgrids"];

/// Whether the keys name anything that a map could be of.
pub(super) fn is_named(keys: &Keys) -> bool {
    let has_code = |key: u16| keys.short(key).is_some_and(|code| code != 0);
    has_code(GEOGRAPHIC_TYPE) || has_code(DATUM) || has_code(ELLIPSOID) || keys.real(SEMI_MAJOR).is_some()
}

/// Degrees a unit of angles, in which the parameters of projections are; `None` for a unit that is not known.
pub(super) fn degrees_a_unit(keys: &Keys) -> Option<f64> {
    let radians = match keys.short(ANGULAR_UNITS) {
        Some(32767) => keys.real(ANGULAR_UNIT_SIZE).filter(|size| size.is_finite() && *size > 0.0)?,
        // As GDAL reads them: degrees with a fraction.
        Some(9107 | 9108) => return Some(1.0),
        None | Some(0) => {
            let unit = keys.code(GEOGRAPHIC_TYPE).and_then(|code| by_text(&format!("EPSG:{code}"))?.unit);
            match unit.map(|unit| unit.size) {
                Some(HorizontalSize::Radians(size)) => size,
                _ => return Some(1.0),
            }
        }
        Some(code) => return degrees_of(code),
    };
    Some(exact_degrees(radians))
}

/// Degrees a unit of azimuths: degrees, if the keys do not say it.
pub(super) fn degrees_an_azimuth(keys: &Keys) -> Option<f64> {
    match keys.short(AZIMUTH_UNITS) {
        None | Some(0) => Some(1.0),
        Some(code) => degrees_of(code),
    }
}

/// Degrees an angle of a code.
fn degrees_of(code: u16) -> Option<f64> {
    match unit_of_code(code.into())?.1 {
        HorizontalSize::Radians(size) => Some(exact_degrees(size)),
        HorizontalSize::Metres(_) => None,
    }
}

fn exact_degrees(radians: f64) -> f64 {
    let degrees = radians.to_degrees();
    [1.0, 0.9].into_iter().find(|exact| (degrees / exact - 1.0).abs() < 1e-9).unwrap_or(degrees)
}

/// The words; `None` where the keys tell no system, or one that is not read here.
pub(super) fn words(keys: &Keys, warnings: &mut Vec<Warning>) -> Option<String> {
    let code = keys.code(GEOGRAPHIC_TYPE);
    if let Some(words) = code.and_then(|code| of_code(code, true)) {
        differs(keys, &words, &format!("EPSG:{} (key GeographicType)", code.unwrap_or(0)), warnings);
        return Some(words);
    }
    let meridian = match meridian(keys) {
        Ok(None | Some(0.0)) => String::new(),
        Ok(Some(degrees)) => format!(" +pm={degrees}"),
        Err(words) => {
            warnings.push(unplaced(&words));
            return None;
        }
    };
    // Of the registry's datums of old, the number of the system is that of the datum less 2000.
    let datum = keys.code(DATUM).filter(|code| (6001..7000).contains(code));
    if let Some((datum, words)) = datum.and_then(|code| Some((code, of_code(code - 2000, false)?))) {
        let words = format!("{words}{meridian}");
        differs(keys, &words, &format!("EPSG:{datum} (key GeogGeodeticDatum)"), warnings);
        return Some(words);
    }
    let figure = axes(keys).or_else(|| {
        let (_, a, rf) = SHAPES.iter().find(|(code, ..)| keys.short(ELLIPSOID) == Some(*code))?;
        Some(if *rf == 0.0 { format!("+a={a} +b={a}") } else { format!("+a={a} +rf={rf}") })
    })?;
    let shift = match keys.reals(SHIFT) {
        None => String::new(),
        Some(values) if matches!(values.len(), 3 | 7) && values.iter().all(|value| value.is_finite()) => {
            let values: Vec<String> = values.iter().map(f64::to_string).collect();
            format!(" +towgs84={}", values.join(","))
        }
        Some(values) => {
            warnings.push(
                Warning::new(format!(
                    "the shift of the file's datum to WGS 84 (key GeogTOWGS84) has {} numbers, not three or seven, and was left out, so places may be off by some hundred metres",
                    values.len()
                ))
                .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
            );
            String::new()
        }
    };
    Some(format!("{figure}{shift}{meridian}"))
}

/// Says what keys tell otherwise than the system by whose `code` the file is placed: its geographic system, meridian, shift or ellipsoid.
pub(super) fn compare(keys: &Keys, code: u32, is_projected: bool, warnings: &mut Vec<Warning>) {
    let Some(words) = of_code(code, true) else { return };
    let by = format!("EPSG:{code} (key {})", if is_projected { "ProjectedCSType" } else { "GeographicType" });
    let other = keys.code(GEOGRAPHIC_TYPE).filter(|_| is_projected);
    if let Some(geographic) = other
        && of_code(geographic, true).is_some_and(|other| places_differ(&words, &other))
    {
        warnings.push(
            Warning::new(format!(
                "the file says {by} and EPSG:{geographic} (key GeographicType), which contradict one another; the first was taken; if that is wrong, places are off, by some hundred metres or more"
            ))
            .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
        );
        return;
    }
    differs(keys, &words, &by, warnings);
}

/// Warns that a projection or body cannot be read.
pub(super) fn unplaced(what: &str) -> Warning {
    Warning::new(format!("{what}, so where the data lie on the ground is not known"))
        .mended_by(Remedy::ReferenceSystem, "EPSG:n")
}

/// The words of a system of the registry.
fn of_code(code: u32, has_meridian: bool) -> Option<String> {
    let system = by_text(&format!("EPSG:{code}"))?;
    if !has_meridian && system.kind != Kind::Geographic {
        return None;
    }
    let proj = system.proj?;
    let kept = |word: &&str| {
        let key = word.trim_start_matches('+').split('=').next().unwrap_or("");
        WORDS.contains(&key) || (has_meridian && key == "pm")
    };
    let kept: Vec<&str> = proj.split_whitespace().filter(kept).collect();
    Some(kept.join(" "))
}

/// The ellipsoid by its axes.
fn axes(keys: &Keys) -> Option<String> {
    let size = |key| keys.real(key).filter(|size: &f64| size.is_finite() && *size > 0.0);
    let a = size(SEMI_MAJOR)?;
    Some(match (size(SEMI_MINOR), size(INVERSE_FLATTENING)) {
        (Some(b), _) => format!("+a={a} +b={b}"),
        (None, Some(rf)) => format!("+a={a} +rf={rf}"),
        (None, None) => format!("+a={a} +b={a}"),
    })
}

/// Degrees of the prime meridian east of Greenwich, where the keys say it.
fn meridian(keys: &Keys) -> Result<Option<f64>, String> {
    if let Some(code) = keys.code(MERIDIAN) {
        let known = code.checked_sub(8901).and_then(|at| MERIDIANS.get(usize::try_from(at).ok()?));
        return known.map(|degrees| Some(*degrees)).ok_or_else(|| {
            format!("the file counts longitudes from the meridian of number {code} (key GeogPrimeMeridian), which is not known here")
        });
    }
    let Some(longitude) = keys.real(MERIDIAN_LONGITUDE).filter(|value| value.is_finite()) else {
        return Ok(None);
    };
    let unit = degrees_a_unit(keys)
        .ok_or_else(|| "the file gives its prime meridian in a unit that is not known here".to_owned())?;
    Ok(Some(longitude * unit))
}

/// Says where the keys tell another meridian, shift or ellipsoid than the `words` of what was taken.
fn differs(keys: &Keys, words: &str, by: &str, warnings: &mut Vec<Warning>) {
    let mut tell = |what: &str, key: &str| {
        warnings.push(
            Warning::new(format!(
                "the file gives {what} of its own (key {key}) that is not the one of {by}; the latter was taken, as GDAL takes it"
            ))
            .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
        );
    };
    let said = proj_word(words, "pm")
        .map_or(Some(0.0), |pm| pm.parse().ok().or_else(|| (pm == "paris").then_some(MERIDIANS[2])));
    if let (Ok(Some(of_keys)), Some(said)) = (meridian(keys), said)
        && (of_keys - said).abs() > 1e-6
    {
        tell(&format!("a prime meridian at {} degrees", number(of_keys)), "GeogPrimeMeridian");
    }
    if let Some(values) = keys.reals(SHIFT) {
        let list: Vec<String> = values.iter().map(f64::to_string).collect();
        let bare: Vec<&str> = words.split_whitespace().filter(|w| !w.starts_with("+towgs84=")).collect();
        let own = format!("{} +towgs84={}", bare.join(" "), list.join(","));
        if places_differ(words, &own) {
            tell("a shift to WGS 84", "GeogTOWGS84");
        }
    }
    if let Some(own) = axes(keys)
        && figures_differ(words, &own)
    {
        tell("an ellipsoid", "GeogSemiMajorAxis");
    }
}
