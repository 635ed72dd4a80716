//! Reference systems: from what a file says to units, names, codes, and the ground.
//!
//! [`resolve`] turns statements into a [`System`]. [`Ground`] converts a system's coordinates to longitude and latitude and back.

mod bound;
mod compare;
mod from_proj;
mod from_wkt;
mod ground;
mod keywords;
mod registry;
mod resolve;
mod south_first;
mod system;
mod wkt;

pub(crate) use compare::{figures_differ, places_differ};
pub(crate) use from_proj::{unit_name as unit_in_words, word as proj_word};
pub use ground::Doubt;
pub(crate) use ground::{Ground, all_over, is_earth};
pub(crate) use keywords::Keywords;
pub(crate) use registry::{is_north_first, unit as unit_of_code, vertical_in_metres};
pub(crate) use resolve::by_text;
pub(crate) use resolve::resolve;
pub(crate) use south_first::{east_north, turned as eastings_first};
pub(crate) use system::{Kind, System, Unit, Vertical, exact_metres};

pub(crate) use crate::reader::HorizontalSize;
use crate::value::US_SURVEY_FOOT_M;
use terrasoar_layout::dem::{Georeference, HorizontalUnit};

/// Longest text of a system that is read.
pub(crate) const MAX_TEXT_BYTES: u64 = wkt::MAX_BYTES as u64;
/// Longest name kept.
const MAX_NAME_CHARS: usize = 200;

/// Words for places that are off by a shift between the datums of two systems, which is not known well.
pub(crate) fn shift_in_doubt(doubt: Doubt, from: &str, to: &str) -> String {
    let [from, to] = [from, to].map(|name| match terrasoar_layout::words::harmless(name, 80) {
        name if name.is_empty() => "a system without a name".to_owned(),
        name => name,
    });
    format!(
        "the shift between the datums of {from} and {to} {doubt}; for true places bring the data over before: gdalwarp -t_srs SYSTEM INPUT output.tif"
    )
}

/// The unit by which terrain files know it.
pub(crate) fn horizontal_unit(system: &System) -> HorizontalUnit {
    match system.unit.as_ref().map(|unit| unit.size) {
        Some(HorizontalSize::Radians(size)) if size == 1f64.to_radians() => HorizontalUnit::Degree,
        Some(HorizontalSize::Metres(1.0)) => HorizontalUnit::Metre,
        Some(HorizontalSize::Metres(0.3048)) => HorizontalUnit::Foot,
        Some(HorizontalSize::Metres(US_SURVEY_FOOT_M)) => HorizontalUnit::UsSurveyFoot,
        _ => HorizontalUnit::Unknown,
    }
}

/// The georeference of a map in a system, without a spacing.
pub(crate) fn georeference(system: &System, map: Option<[f64; 6]>) -> Georeference {
    Georeference {
        epsg: system.code,
        crs_name: terrasoar_layout::words::harmless(&system.name, MAX_NAME_CHARS),
        unit: horizontal_unit(system),
        pixel_to_crs: map,
        body_radius_m: system.radius_m.filter(|radius| !is_earth(*radius)),
        ..Georeference::default()
    }
}
