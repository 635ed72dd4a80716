//! Metres between samples, on the ground, at the centre of the grid.
//!
//! Lengths on a map are taken as they are, because most maps are true to scale; where one is off by more than a percent there is a warning. In degrees and in maps of Mercator's kind steps grow with
//! the latitude, so they are measured on the ground at the centre. Where the step differs from that by more than a percent within the grid, a warning says so and advises reprojection. Coordinates without a known unit are
//! metres or degrees. Which of them is decided only where it is certain ([`Guess`]); otherwise the person must say it.

use super::guess::Guess;
use crate::crs::{Ground, Kind, System};
use crate::reader::HorizontalSize;
use std::path::Path;
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// How far a map may be from the ground before it is measured, and how far the step may change within a grid before this is said.
const TRUE_TO: f64 = 0.01;
/// Latitudes beyond which a degree of longitude is no measure.
const POLE_DEG: f64 = 89.9;

/// Metres between samples and where they came from.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Spacing {
    /// East and north; `None` if nothing says.
    pub(crate) metres: Option<[f64; 2]>,
    /// Latitude of the centre in degrees, where it was converted from angles.
    pub(crate) latitude_deg: Option<f64>,
    /// Where it came from, in words.
    pub(crate) words: String,
}

/// The spacing of a north-up grid of `samples` with this map. A person who `stated` a spacing is not asked.
///
/// # Errors
/// [`LayoutError::Usage`] where the centre lies at a pole of a grid of degrees, or where metres and degrees are as likely.
pub(crate) fn spacing(
    path: &Path,
    system: &mut System,
    map: Option<[f64; 6]>,
    samples: [u32; 2],
    stated: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Spacing, LayoutError> {
    let Some(map) = map else { return Ok(Spacing::default()) };
    let steps = [[map[1], map[4]], [map[2], map[5]]];
    let lengths = steps.map(|[x, y]| hypot(x, y));
    if system.unit.is_none() {
        let guess = Guess::of(&map, samples);
        if !stated {
            guess.tell(path, lengths, warnings)?;
        }
        system.unit = Some(guess.unit());
        if guess.is_degrees() {
            system.kind = Kind::Geographic;
        }
    }
    let size = system.unit.as_ref().map(|unit| unit.size);
    let ground = Ground::new(system);
    let [columns, rows] = samples.map(|count| f64::from(count.max(2) - 1));
    let at =
        |col: f64, row: f64| [map[0] + map[1] * col + map[2] * row, map[3] + map[4] * col + map[5] * row];
    let centre = at(columns / 2.0, rows / 2.0);
    let measured = |place: [f64; 2]| ground.as_ref().and_then(|ground| ground.steps_m(place, steps));
    match size {
        Some(HorizontalSize::Radians(size)) => {
            let latitude = (centre[1] * system.signs[1] * size).to_degrees();
            if latitude.is_nan() || latitude.abs() >= POLE_DEG {
                if stated {
                    return Ok(Spacing::default());
                }
                return Err(LayoutError::Usage(format!(
                    "{}: the elevation model is in degrees and its centre lies at latitude {latitude:.4}, where degrees have no useful length; \
                     state the spacing in metres, or reproject the model",
                    path.display()
                ))
                .mended_by(Remedy::Spacing));
            }
            let (metres, _) = measured(centre).ok_or_else(|| beyond(path))?;
            if !stated {
                tell_change(&measured, &at, [columns, rows], metres, warnings);
            }
            let words = format!("measured on the ellipsoid at the centre latitude {latitude:.4}");
            Ok(Spacing { metres: Some(metres), latitude_deg: Some(latitude), words })
        }
        Some(HorizontalSize::Metres(size)) => {
            let on_map = lengths.map(|length| length * size);
            let Some((metres, latitude)) = measured(centre) else {
                if !stated && system.kind == Kind::Projected {
                    warnings.push(unmeasured(system, ground.is_some()));
                }
                return Ok(Spacing { metres: Some(on_map), latitude_deg: None, words: String::new() });
            };
            if !ground.as_ref().is_some_and(Ground::is_cylindrical) {
                if !stated {
                    tell_off(on_map, metres, latitude, warnings);
                }
                return Ok(Spacing { metres: Some(on_map), latitude_deg: None, words: String::new() });
            }
            if !stated {
                tell_change(&measured, &at, [columns, rows], metres, warnings);
            }
            let words = format!(
                "measured on the ellipsoid at the centre latitude {:.4}; on the map it is {:.4} x {:.4} m",
                latitude.to_degrees(),
                on_map[0],
                on_map[1]
            );
            Ok(Spacing { metres: Some(metres), latitude_deg: None, words })
        }
        None => Ok(Spacing { metres: Some(lengths), latitude_deg: None, words: String::new() }),
    }
}

/// Says how far the map is from the ground, if it is far.
fn tell_off(on_map_m: [f64; 2], metres: [f64; 2], latitude: f64, warnings: &mut Vec<Warning>) {
    let off = (0..2).map(|i| (metres[i] / on_map_m[i] - 1.0).abs()).fold(0.0, f64::max);
    if off > TRUE_TO && off.is_finite() {
        warnings.push(
            Warning::new(format!(
                "distances on the map differ by {:.1} % from those on the ground at the centre, latitude {:.2}, and were taken as they are; bring the elevation model into \
                 a system made for its place for true ones",
                100.0 * off,
                latitude.to_degrees()
            ))
            .mended_by(Remedy::Reproject, "utm"),
        );
    }
}

/// Says that nothing is known of the ground below a map.
fn unmeasured(system: &System, is_known: bool) -> Warning {
    let name = match harmless(&system.name, 80) {
        name if name.is_empty() => "the reference system".to_owned(),
        name => name,
    };
    let why = match is_known {
        true => format!("the centre of the elevation model lies outside of what {name} covers"),
        false => format!("how {name} is projected is not known here"),
    };
    Warning::new(format!(
        "{why}, so longitudes and latitudes are not known, and distances on the map were taken for those on the ground; for true ones bring the elevation model over before: gdalwarp -t_srs SYSTEM INPUT output.tif"
    ))
}

fn beyond(path: &Path) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: the centre of the elevation model lies outside of what its reference system covers; check its place, or state the spacing in metres",
        path.display()
    ))
    .mended_by(Remedy::Spacing)
}

/// Says how much the step changes within the grid, if it is much.
fn tell_change(
    measured: &impl Fn([f64; 2]) -> Option<([f64; 2], f64)>,
    at: &impl Fn(f64, f64) -> [f64; 2],
    [columns, rows]: [f64; 2],
    centre_m: [f64; 2],
    warnings: &mut Vec<Warning>,
) {
    let mut most: f64 = 0.0;
    for (col, row) in
        [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.5), (1.0, 0.5), (0.0, 1.0), (0.5, 1.0), (1.0, 1.0)]
    {
        let Some((metres, _)) = measured(at(col * columns, row * rows)) else { continue };
        for i in 0..2 {
            most = most.max((metres[i] / centre_m[i] - 1.0).abs());
        }
    }
    if most > TRUE_TO && most.is_finite() {
        warnings.push(
            Warning::new(format!(
                "the distance between samples differs by up to {:.1} % over the elevation model, and that of the centre is used throughout; bring it into a \
                 metric system for true distances",
                100.0 * most
            ))
            .mended_by(Remedy::Reproject, "utm"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::by_text;

    fn words(text: &str, origin: [f64; 2]) -> Vec<String> {
        let mut system = by_text(text).unwrap();
        let map = Some([origin[0], 10.0, 0.0, origin[1], 0.0, -10.0]);
        let mut warnings = Vec::new();
        spacing(Path::new("a"), &mut system, map, [3, 3], false, &mut warnings).unwrap();
        warnings.into_iter().map(|warning| warning.words).collect()
    }

    #[test]
    fn maps_that_lead_to_no_ground_are_told() {
        for (text, wanted) in [
            ("EPSG:8441", "how Tananarive / Laborde Grid is projected is not known here"),
            ("+proj=bonne +lat_1=45 +lon_0=2 +ellps=clrk66", "how PROJ bonne is projected"),
            ("+proj=wintri +datum=WGS84", "distances on the map were taken"),
        ] {
            let words = words(text, [500_000.0, 800_000.0]);
            assert!(words.len() == 1 && words[0].contains(wanted), "{words:?}");
        }
        assert!(words("EPSG:32632", [500_000.0, 5_000_000.0]).is_empty());
        assert!(words("local", [0.0, 0.0]).is_empty());
    }
}
