//! Where the grid lies: the GeoTIFF tags and keys (OGC 19-008r4, GeoTIFF 1.1).
//!
//! A tie point and a pixel size, or a matrix, map raster to ground; the raster's origin is the corner of
//! the first pixel (PixelIsArea, the default) or the first sample itself (PixelIsPoint), and the map
//! returned starts at sample centres either way. Keys name the reference system. What is missing or
//! contradictory leaves the field empty: a DEM without a place can still be flown over.

use super::tags::{self, Directory, TiffFile};
use crate::reader::{CrsSaid, Declared, HorizontalSize, Said, VerticalUnit};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEOGRAPHIC_TYPE: u16 = 2048;
const GEOGRAPHIC_CITATION: u16 = 2049;
const ANGULAR_UNITS: u16 = 2054;
const ANGULAR_UNIT_SIZE: u16 = 2055;
const SEMI_MAJOR_AXIS: u16 = 2057;
const PROJECTED_TYPE: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_TYPE: u16 = 4096;
const VERTICAL_UNITS: u16 = 4099;

/// Keys looked at, and the directory's head; there are not a hundred in the standard.
const MAX_KEYS: u64 = 1024;
/// Keys count values and characters in 16 bits.
const MAX_PLACE: u64 = 1 << 16;

/// Longest name kept.
const MAX_NAME_CHARS: usize = 200;

/// What tags and keys say of the place.
#[derive(Debug)]
pub(super) struct Place {
    /// From sample centres to coordinates.
    pub(super) map: Option<[f64; 6]>,
    pub(super) crs: CrsSaid,
    /// EPSG's code of the vertical unit.
    pub(super) vertical_unit: Option<u16>,
}

/// Reads tags and keys.
pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<Place, LayoutError> {
    let keys = Keys::read(file, directory)?;
    Ok(Place {
        map: transform(file, directory, keys.short(RASTER_TYPE) == Some(2))?,
        crs: system(&keys),
        vertical_unit: keys.short(VERTICAL_UNITS).filter(|code| !matches!(code, 0 | 32767)),
    })
}

impl Place {
    /// Takes what is said of heights into `declared`.
    pub(super) fn declare(self, declared: &mut Declared) {
        declared.place = self.map.map(|map| Said::new(map, "the GeoTIFF tags"));
        declared.crs = self.crs;
        declared.value.unit =
            self.vertical_unit.map(|code| Said::new(VerticalUnit::Code(code.into()), "key VerticalUnits"));
    }
}

/// What the keys say of the reference system.
fn system(keys: &Keys) -> CrsSaid {
    let projected = keys.code(PROJECTED_TYPE);
    let geographic = keys.code(GEOGRAPHIC_TYPE);
    let model = keys.short(MODEL_TYPE).unwrap_or(match (projected, geographic) {
        (Some(_), _) => 1,
        (None, Some(_)) => 2,
        (None, None) => 0,
    });
    let (code, by) = match model {
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
    let unit = match model {
        2 => match keys.short(ANGULAR_UNITS) {
            Some(32767) => size(ANGULAR_UNIT_SIZE)
                .map(|size| Said::new(HorizontalSize::Radians(size), "key GeogAngularUnitSize")),
            Some(code) => {
                angular(code).map(|size| Said::new(HorizontalSize::Radians(size), "key GeogAngularUnits"))
            }
            None => None,
        },
        _ => match keys.short(LINEAR_UNITS) {
            Some(32767) => size(LINEAR_UNIT_SIZE)
                .map(|size| Said::new(HorizontalSize::Metres(size), "key ProjLinearUnitSize")),
            Some(code) => {
                linear(code).map(|size| Said::new(HorizontalSize::Metres(size), "key ProjLinearUnits"))
            }
            None => None,
        },
    };
    CrsSaid {
        text: None,
        code: code.map(|code| Said::new(code, by)),
        vertical_code: keys.code(VERTICAL_TYPE).map(|code| Said::new(code, "key VerticalCSType")),
        name: names.iter().find_map(|key| keys.text(*key)).unwrap_or_default(),
        unit,
        radius_m: size(SEMI_MAJOR_AXIS),
        is_local: false,
    }
}

/// Metres of EPSG's codes of units of length.
fn linear(code: u16) -> Option<f64> {
    Some(match code {
        9001 => 1.0,
        9002 => 0.3048,
        9003 => 1200.0 / 3937.0,
        9036 => 1000.0,
        _ => return None,
    })
}

/// Radians of EPSG's codes of angular units.
fn angular(code: u16) -> Option<f64> {
    Some(match code {
        9101 => 1.0,
        9102 => 1f64.to_radians(),
        9103 => (1.0 / 60.0f64).to_radians(),
        9104 => (1.0 / 3600.0f64).to_radians(),
        9105 | 9106 => std::f64::consts::PI / 200.0,
        _ => return None,
    })
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

/// The key directory: triples of a key, where its value is, and the value or its place there.
struct Keys {
    directory: Vec<u64>,
    reals: Vec<f64>,
    texts: String,
}

impl Keys {
    fn read(file: &mut TiffFile, directory: &Directory) -> Result<Self, LayoutError> {
        Ok(Self {
            directory: file.numbers(directory, tags::GEO_KEY_DIRECTORY, 4 * MAX_KEYS)?.unwrap_or_default(),
            reals: file.reals(directory, tags::GEO_DOUBLE_PARAMS, MAX_PLACE)?.unwrap_or_default(),
            texts: file.text(directory, tags::GEO_ASCII_PARAMS, MAX_PLACE)?.unwrap_or_default(),
        })
    }

    /// Tag, count and value of a key.
    fn entry(&self, key: u16) -> Option<(u64, usize, u64)> {
        let entries = self.directory.get(4..)?.chunks_exact(4);
        let entry = entries.into_iter().find(|entry| entry[0] == u64::from(key))?;
        Some((entry[1], usize::try_from(entry[2]).ok()?, entry[3]))
    }

    fn short(&self, key: u16) -> Option<u16> {
        self.entry(key).filter(|entry| entry.0 == 0).and_then(|entry| u16::try_from(entry.2).ok())
    }

    /// A code of EPSG; 0 and 32767 stand for undefined and user-defined.
    fn code(&self, key: u16) -> Option<u32> {
        self.short(key).filter(|code| !matches!(code, 0 | 32767)).map(u32::from)
    }

    fn real(&self, key: u16) -> Option<f64> {
        let (tag, _, at) = self.entry(key)?;
        let at = usize::try_from(at).ok()?;
        (tag == u64::from(tags::GEO_DOUBLE_PARAMS)).then(|| self.reals.get(at).copied()).flatten()
    }

    fn text(&self, key: u16) -> Option<String> {
        let (tag, count, at) = self.entry(key)?;
        let at = usize::try_from(at).ok()?;
        if tag != u64::from(tags::GEO_ASCII_PARAMS) {
            return None;
        }
        let bytes = self.texts.as_bytes().get(at..at.checked_add(count)?.min(self.texts.len()))?;
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_end_matches(['|', '\0']).trim();
        let shown = harmless(text, MAX_NAME_CHARS);
        (!shown.is_empty()).then_some(shown)
    }
}
