//! Where the grid lies: the GeoTIFF tags and keys (OGC 19-008r4, GeoTIFF 1.1).
//!
//! A tie point and a pixel size, or a matrix, map raster to ground; the raster's origin is the corner of
//! the first pixel (PixelIsArea, the default) or the first sample itself (PixelIsPoint), and the map
//! returned starts at sample centres either way. Keys name the reference system. What is missing or
//! contradictory leaves the field empty: a DEM without a place can still be flown over.

use super::tags::{self, Directory, TiffFile};
use terrasoar_layout::dem::{Georeference, HorizontalUnit};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEOGRAPHIC_TYPE: u16 = 2048;
const GEOGRAPHIC_CITATION: u16 = 2049;
const ANGULAR_UNITS: u16 = 2054;
const SEMI_MAJOR_AXIS: u16 = 2057;
const PROJECTED_TYPE: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;

/// Semi-major axes of the Earth's ellipsoids in use, with room to spare.
const EARTH_RADII_M: std::ops::RangeInclusive<f64> = 6_370_000.0..=6_385_000.0;

/// Keys looked at, and the directory's head; there are not a hundred in the standard.
const MAX_KEYS: u64 = 1024;
/// Keys count values and characters in 16 bits.
const MAX_PLACE: u64 = 1 << 16;

/// Longest name kept.
const MAX_NAME_CHARS: usize = 200;

/// The georeference, and the metres of a vertical unit.
pub(super) fn read(file: &mut TiffFile, directory: &Directory) -> Result<(Georeference, f64), LayoutError> {
    let keys = Keys::read(file, directory)?;
    let projected = keys.code(PROJECTED_TYPE);
    let geographic = keys.code(GEOGRAPHIC_TYPE);
    let model = keys.short(MODEL_TYPE).unwrap_or(match (projected, geographic) {
        (Some(_), _) => 1,
        (None, Some(_)) => 2,
        (None, None) => 0,
    });
    let (epsg, unit) = match model {
        1 => (projected, linear_unit(keys.short(LINEAR_UNITS), projected)),
        2 => {
            let degrees = matches!(keys.short(ANGULAR_UNITS), None | Some(9102));
            (geographic, if degrees { HorizontalUnit::Degree } else { HorizontalUnit::Unknown })
        }
        _ => (None, HorizontalUnit::Unknown),
    };
    let names = if model == 2 {
        [GEOGRAPHIC_CITATION, CITATION, PROJECTED_CITATION]
    } else {
        [PROJECTED_CITATION, CITATION, GEOGRAPHIC_CITATION]
    };
    let radius = keys.real(SEMI_MAJOR_AXIS).filter(|radius| radius.is_finite() && *radius > 0.0);
    let georeference = Georeference {
        epsg,
        crs_name: names.iter().find_map(|key| keys.text(*key)).unwrap_or_default(),
        unit,
        pixel_to_crs: transform(file, directory, keys.short(RASTER_TYPE) == Some(2))?,
        body_radius_m: radius.filter(|radius| !EARTH_RADII_M.contains(radius)),
    };
    let vertical_unit_m = match keys.short(VERTICAL_UNITS) {
        Some(9002) => 0.3048,
        Some(9003) => 1200.0 / 3937.0,
        _ => 1.0,
    };
    Ok((georeference, vertical_unit_m))
}

/// The unit by its code; without one, of the EPSG families that are metric throughout.
fn linear_unit(code: Option<u16>, epsg: Option<u32>) -> HorizontalUnit {
    match (code, epsg) {
        (Some(9001), _) => HorizontalUnit::Metre,
        (Some(9002), _) => HorizontalUnit::Foot,
        (Some(9003), _) => HorizontalUnit::UsSurveyFoot,
        (Some(_), _) => HorizontalUnit::Unknown,
        (
            None,
            Some(32601..=32660 | 32701..=32760 | 26901..=26923 | 26701..=26722 | 25828..=25838 | 3857 | 3395),
        ) => HorizontalUnit::Metre,
        (None, _) => HorizontalUnit::Unknown,
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
