//! Where the grid lies: the GeoTIFF tags and keys (OGC 19-008r4, GeoTIFF 1.1).
//!
//! A tie point and a pixel size, or a matrix, map raster to ground; the raster's origin is the corner of
//! the first pixel (PixelIsArea, the default) or the first sample itself (PixelIsPoint), and the map
//! returned starts at sample centres either way. Keys name the reference system. Where something is missing or
//! contradictory the field stays empty: a DEM without a place can still be flown over.

use super::body::{self, ANGULAR_UNIT_SIZE, ANGULAR_UNITS, GEOGRAPHIC_TYPE};
use super::keys::Keys;
use super::projection;
use super::tags::{self, Directory, TiffFile};
use crate::crs::unit_of_code;
use crate::reader::{CrsSaid, Declared, HorizontalSize, Said, VerticalUnit};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEOGRAPHIC_CITATION: u16 = 2049;
const SEMI_MAJOR_AXIS: u16 = 2057;
const PROJECTED_TYPE: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_TYPE: u16 = 4096;
const VERTICAL_UNITS: u16 = 4099;

/// What tags and keys say of the place.
#[derive(Debug)]
pub(super) struct Place {
    /// From sample centres to coordinates.
    pub(super) map: Option<[f64; 6]>,
    pub(super) crs: CrsSaid,
    /// What keys say that is not, or not quite, honoured.
    pub(super) warnings: Vec<Warning>,
    /// EPSG's code of the vertical unit.
    pub(super) vertical_unit: Option<u16>,
    /// Scale and offset of heights that the tags of the place give.
    pub(super) scale_z: Option<[f64; 2]>,
}

/// Reads tags and keys.
pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Place, LayoutError> {
    let keys = Keys::read(file, directory)?;
    let mut warnings = Vec::new();
    Ok(Place {
        map: transform(file, directory, keys.short(RASTER_TYPE) == Some(2))?,
        crs: system(&keys, &mut warnings),
        warnings,
        vertical_unit: keys.short(VERTICAL_UNITS).filter(|code| !matches!(code, 0 | 32767)),
        scale_z: scale_z(file, directory)?,
    })
}

/// What the tags of the place say of heights, where it is not what all writers put there.
fn scale_z(file: &mut TiffFile, directory: &Directory) -> Result<Option<[f64; 2]>, LayoutError> {
    let scale = file.reals(directory, tags::MODEL_PIXEL_SCALE, 3)?.and_then(|scale| scale.get(2).copied());
    let tie = file.reals(directory, tags::MODEL_TIEPOINT, 6)?.and_then(|tie| tie.get(5).copied());
    let (scale, offset) = (scale.unwrap_or(0.0), tie.unwrap_or(0.0));
    let is_usual = (scale == 0.0 || scale == 1.0) && offset == 0.0;
    Ok((!is_usual && scale.is_finite() && offset.is_finite()).then_some([scale, offset]))
}

impl Place {
    /// Takes what is said of heights into `declared`.
    pub(super) fn declare(self, declared: &mut Declared) {
        declared.place = self.map.map(|map| Said::new(map, "the GeoTIFF tags"));
        declared.crs = self.crs;
        declared.warnings.extend(self.warnings);
        if let Some([scale, offset]) = self.scale_z {
            let words = format!(
                "the tags of its place give heights a scale of {} and an offset of {}, which GDAL and others pass over, and so was done here",
                number(scale),
                number(offset)
            );
            declared.warnings.push(match scale {
                0.0 => Warning::new(words),
                _ => Warning::new(words).mended_by(Remedy::HeightFactor, number(scale)),
            });
        }
        declared.value.unit =
            self.vertical_unit.map(|code| Said::new(VerticalUnit::Code(code.into()), "key VerticalUnits"));
    }
}

/// ESRI's text in a citation: "ESRI PE String = PROJCS[...]".
fn esri_text(citation: &str) -> Option<String> {
    let (_, text) = citation.split_once("ESRI PE String")?;
    let text = text.trim_start_matches([' ', '=']).trim_end_matches(['|', '\0']).trim();
    text.contains('[').then(|| text.to_owned())
}

/// The name in a citation that says more: "PCS Name = x|Unit = y", "x|ESRI PE String = ...", ESRI's lists of facts.
fn short_name(citation: &str) -> String {
    let parts = citation.split('|').map(str::trim).filter(|part| !part.is_empty());
    let mut named = None;
    let mut first = None;
    for part in parts {
        match part.split_once('=') {
            Some((key, value)) if key.trim().ends_with("Name") => named = named.or(Some(value.trim())),
            Some(_) => {}
            None => first = first.or(Some(part)),
        }
    }
    let name = named.or(first).unwrap_or("");
    if name.eq_ignore_ascii_case("unknown") { String::new() } else { name.to_owned() }
}

/// What the keys say of the reference system.
fn system(keys: &Keys, warnings: &mut Vec<Warning>) -> CrsSaid {
    let projected = keys.code(PROJECTED_TYPE);
    let geographic = keys.code(GEOGRAPHIC_TYPE);
    let model = keys.short(MODEL_TYPE).unwrap_or(match (projected, geographic) {
        (Some(_), _) => 1,
        (None, Some(_)) => 2,
        (None, None) => 0,
    });
    let (code, code_by) = match model {
        1 => (projected, "key ProjectedCSType"),
        2 => (geographic, "key GeographicType"),
        _ => (None, ""),
    };
    let names = if model == 2 {
        [GEOGRAPHIC_CITATION, CITATION, PROJECTED_CITATION]
    } else {
        [PROJECTED_CITATION, CITATION, GEOGRAPHIC_CITATION]
    };
    let size = |key| keys.real(key).filter(|size| size.is_finite() && *size > 0.0);
    let (code_key, size_key, is_angle) = match model {
        2 => (ANGULAR_UNITS, ANGULAR_UNIT_SIZE, true),
        _ => (LINEAR_UNITS, LINEAR_UNIT_SIZE, false),
    };
    let by = if is_angle { "key GeogAngularUnits" } else { "key ProjLinearUnits" };
    let unit = match keys.short(code_key) {
        // A unit of the file's own has its size.
        Some(32767) => size(size_key).map(|size| match is_angle {
            true => HorizontalSize::Radians(size),
            false => HorizontalSize::Metres(size),
        }),
        // GDAL's reading of the degree with minutes and seconds as digits is the plain degree.
        Some(9108) if is_angle => Some(HorizontalSize::Radians(1f64.to_radians())),
        Some(code) => unit_of_code(code.into())
            .map(|(_, size)| size)
            .filter(|size| matches!(size, HorizontalSize::Radians(_)) == is_angle),
        None => None,
    };
    let citations = [CITATION, PROJECTED_CITATION, GEOGRAPHIC_CITATION];
    let esri = citations.iter().find_map(|key| esri_text(&keys.whole_text(*key)?));
    let text = match (code, esri) {
        (Some(code), _) => {
            body::compare(keys, code, model == 1, warnings);
            None
        }
        (None, Some(text)) => Some(Said::new(text, "ESRI's text in a citation")),
        (None, None) => {
            let metres = match unit {
                Some(HorizontalSize::Metres(metres)) => metres,
                _ => 1.0,
            };
            let own = match model {
                1 => projection::proj(keys, metres, warnings),
                2 => body::words(keys, warnings).map(|words| format!("+proj=longlat {words}")),
                _ => None,
            };
            own.map(|text| Said::new(text, "keys of the projection"))
        }
    };
    let name = names.iter().find_map(|key| keys.text(*key)).map(|name| short_name(&name)).unwrap_or_default();
    CrsSaid {
        unit_yields: false,
        text,
        code: code.map(|code| Said::new(code, code_by)),
        vertical_code: keys.code(VERTICAL_TYPE).map(|code| Said::new(code, "key VerticalCSType")),
        name,
        unit: unit.map(|unit| Said::new(unit, by)),
        radius_m: size(SEMI_MAJOR_AXIS),
        is_local: false,
    }
}

/// The map from sample centres to the ground.
fn transform(
    file: &mut TiffFile,
    directory: &Directory,
    point: bool,
) -> Result<Option<[f64; 6]>, LayoutError> {
    let matrix = file.reals(directory, tags::MODEL_TRANSFORMATION, 16)?;
    let scale = file.reals(directory, tags::MODEL_PIXEL_SCALE, 3)?;
    let tie = file.reals(directory, tags::MODEL_TIEPOINT, 6)?;
    let raster = match (matrix.as_deref(), scale.as_deref(), tie.as_deref()) {
        (_, Some(&[across, down, ..]), Some(&[col, row, _, x, y, _, ..])) => {
            [x - col * across, across, 0.0, y + row * down.abs(), 0.0, -down.abs()]
        }
        (Some(&[a, b, _, x, d, e, _, y, ..]), ..) => [x, a, b, y, d, e],
        _ => return Ok(None),
    };
    let [x, a, b, y, d, e] = raster;
    let half = if point { 0.0 } else { 0.5 };
    let map = [x + half * (a + b), a, b, y + half * (d + e), d, e];
    // A map that flattens the grid to a line is as good as none.
    let sound = map.iter().all(|value| value.is_finite()) && a * e != b * d;
    Ok(sound.then_some(map))
}
