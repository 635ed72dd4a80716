//! Reference systems: from what a file says to units, names and codes.

use crate::reader::{CrsSaid, HorizontalSize};
use crate::value::US_SURVEY_FOOT_M;
use terrasoar_layout::dem::{Georeference, HorizontalUnit};

/// Semi-major axes of the Earth's ellipsoids in use, with room to spare.
const EARTH_RADII_M: std::ops::RangeInclusive<f64> = 6_370_000.0..=6_385_000.0;

/// The georeference that is kept of a place and a system.
pub(crate) fn georeference(said: &CrsSaid, place: Option<[f64; 6]>) -> Georeference {
    let unit = match said.unit.as_ref().map(|unit| unit.value) {
        Some(HorizontalSize::Radians(_)) => HorizontalUnit::Degree,
        Some(HorizontalSize::Metres(1.0)) => HorizontalUnit::Metre,
        Some(HorizontalSize::Metres(0.3048)) => HorizontalUnit::Foot,
        Some(HorizontalSize::Metres(US_SURVEY_FOOT_M)) => HorizontalUnit::UsSurveyFoot,
        _ => HorizontalUnit::Unknown,
    };
    Georeference {
        epsg: said.code.as_ref().map(|code| code.value),
        crs_name: said.name.clone(),
        unit,
        pixel_to_crs: place,
        body_radius_m: said.radius_m.filter(|radius| !EARTH_RADII_M.contains(radius)),
    }
}
