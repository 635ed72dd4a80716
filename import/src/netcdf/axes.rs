//! Where the columns and rows of a grid lie: its coordinate variables (CF 1.11, section 5; COARDS).
//!
//! A dimension's coordinates are the variable of its name. They may grow or fall and begin anywhere. Each is checked to be evenly spaced, because other grids
//! would have to be resampled. Cost: one reading of each, a block at a time.

use super::attributes::{number, text};
use super::file::guarded;
use super::units::{self, Unit, Way, unit};
use netcdf_reader::{NcFile, NcSliceInfo, NcSliceInfoElem, NcVariable};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Coordinates read at once.
const BLOCK: u64 = 1 << 16;

/// Coordinates evenly apart.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    pub(super) first: f64,
    pub(super) step: f64,
    /// Degrees are brought to those of east and north; `None` where nothing is said, or nothing that is known.
    pub(super) unit: Option<Unit>,
    /// The name of a unit that is not known.
    pub(super) strange_unit: Option<String>,
    /// Name of the variable.
    pub(super) name: String,
}

/// The way that a dimension lies by its coordinate variable, or by its name alone.
pub(super) fn way(name: &str, coordinates: Option<&NcVariable>) -> Option<Way> {
    let of = |attribute: &str| coordinates.and_then(|variable| text(variable.attributes(), attribute));
    let said = [of("axis"), of("standard_name"), of("units"), Some(name.to_owned())];
    said.into_iter().flatten().find_map(|word| {
        let word = word.to_ascii_lowercase();
        match word.as_str() {
            "x"
            | "longitude"
            | "lon"
            | "long"
            | "projection_x_coordinate"
            | "grid_longitude"
            | "easting"
            | "eastings"
            | "nx"
            | "ncols" => Some(Way::East),
            "y"
            | "latitude"
            | "lat"
            | "projection_y_coordinate"
            | "grid_latitude"
            | "northing"
            | "northings"
            | "ny"
            | "nrows" => Some(Way::North),
            _ => units::way(&word),
        }
    })
}

/// Reads the coordinates in the variable at `place` of the file.
pub(super) fn read(
    path: &Path,
    file: &NcFile,
    place: &str,
    variable: &NcVariable,
) -> Result<Axis, LayoutError> {
    let count = variable.shape().first().copied().unwrap_or(0);
    let attributes = variable.attributes();
    let scale = number(attributes, "scale_factor").unwrap_or(1.0);
    let offset = number(attributes, "add_offset").unwrap_or(0.0);
    let shown = harmless(variable.name(), 40);
    let damaged = |problem: String| LayoutError::damaged(path, format!("variable \"{shown}\""), problem);
    let block = |from: u64, to: u64| {
        let selection =
            NcSliceInfo { selections: vec![NcSliceInfoElem::Slice { start: from, end: to, step: 1 }] };
        guarded(path, &format!("variable \"{shown}\""), || file.read_variable_slice_as_f64(place, &selection))
    };
    let ends = |at: u64| Ok(block(at, at + 1)?.first().map_or(f64::NAN, |value| value * scale + offset));
    let (first, last) = (ends(0)?, ends(count.saturating_sub(1))?);
    let step = (last - first) / (count.max(2) - 1) as f64;
    if !first.is_finite() || !step.is_finite() || step == 0.0 {
        return Err(damaged(
            "its coordinates are not numbers that grow or fall; write the file again".into(),
        ));
    }
    // Singles tell degrees to some 1e-5 of them.
    let tolerance = step.abs() * 0.01 + first.abs().max(last.abs()) * 2.0 * f64::from(f32::EPSILON);
    for from in (0..count).step_by(BLOCK as usize) {
        let values = block(from, count.min(from + BLOCK))?;
        for (at, value) in (from..).zip(&values) {
            let wanted = first + step * at as f64;
            let value = value * scale + offset;
            // An error that sums up is as bad as a jump.
            let off = (value - wanted).abs();
            if off.is_nan() || off > tolerance.min(step.abs() * 0.5) {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "the coordinates in variable \"{shown}\" are not evenly apart: number {at} is {}, and {} would be; make a regular grid of \
                         it, for example with: gdalwarp -t_srs EPSG:4326 INPUT output.tif",
                        short(value),
                        short(wanted)
                    ),
                ));
            }
        }
    }
    let said = text(attributes, "units");
    let found = said.as_deref().and_then(unit);
    check_unit(path, variable, said.as_deref(), found)?;
    let (factor, known) = match found {
        Some(Unit::Degrees(degrees)) => (degrees, Some(Unit::Degrees(1.0))),
        other => (1.0, other),
    };
    Ok(Axis {
        first: first * factor,
        step: step * factor,
        unit: known,
        strange_unit: said.filter(|_| known.is_none()),
        name: variable.name().to_owned(),
    })
}

/// Refuses coordinates that are angles by their name and not by their unit, or the other way round.
fn check_unit(
    path: &Path,
    variable: &NcVariable,
    said: Option<&str>,
    found: Option<Unit>,
) -> Result<(), LayoutError> {
    let Some(said) = said else { return Ok(()) };
    let standard = text(variable.attributes(), "standard_name").unwrap_or_default();
    let is_named = matches!(
        variable.name().to_ascii_lowercase().as_str(),
        "lon" | "long" | "longitude" | "lat" | "latitude"
    );
    let angles = ["longitude", "latitude", "grid_longitude", "grid_latitude"];
    let is_angle = angles.contains(&standard.as_str());
    let [name, shown] = [variable.name(), said].map(|text| harmless(text, 40));
    match found {
        None if is_angle || (is_named && standard.is_empty()) => Err(LayoutError::unsupported(
            path,
            format!(
                "variable \"{name}\" holds longitudes or latitudes in \"{shown}\", which is no unit of angles that is known here; write the unit they are in \
                 into the file, for example: ncatted -a units,{name},o,c,degrees INPUT output.nc"
            ),
        )),
        Some(Unit::Metres(_)) if is_angle => Err(LayoutError::unsupported(
            path,
            format!(
                "variable \"{name}\" holds longitudes or latitudes by its standard name, and its unit \"{shown}\" is a length; mend the one that is wrong, for \
                 example: ncatted -a units,{name},o,c,degrees INPUT output.nc"
            ),
        )),
        Some(Unit::Degrees(_)) if standard.starts_with("projection_") => Err(LayoutError::unsupported(
            path,
            format!(
                "variable \"{name}\" holds the coordinates of a projection as angles, in \"{shown}\", as those of satellites do; make a grid of longitudes and \
                 latitudes of it: gdalwarp -t_srs EPSG:4326 INPUT output.tif"
            ),
        )),
        _ => Ok(()),
    }
}

/// A number in a few characters.
fn short(number: f64) -> String {
    let is_handy = number == 0.0 || (1e-4..1e9).contains(&number.abs());
    if is_handy { ((number * 1e6).round() / 1e6).to_string() } else { format!("{number:.3e}") }
}
