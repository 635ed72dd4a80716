//! The system that data is brought into, and the new grid in it.
//!
//! The new grid covers all the old one covers, its sample centres at whole multiples of its step, so that neighbouring data sets make grids that meet. The rim is
//! found by projecting the old rim and a mesh inside it. Cost: some hundred points.

use super::mapping::apply;
use crate::crs::{Ground, HorizontalSize, Kind, System, by_text, east_north, is_earth};
use crate::options::OpenOptions;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::{MOST_SAMPLES, MOST_SAMPLES_WORDS};
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::{harmless, number};

/// Points on each side of the mesh that finds the rim.
const MESH: u32 = 32;
/// Widest data in degrees of longitude that UTM is chosen for.
const UTM_WIDTH_DEG: f64 = 12.0;

/// The grid that new samples lie on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    pub(super) map: [f64; 6],
    pub(super) samples: [u32; 2],
}

/// The rim of a grid as points: its outer corners and a mesh between them, in columns and rows.
pub(crate) fn mesh([columns, rows]: [u32; 2]) -> impl Iterator<Item = [f64; 2]> {
    let at = |i: u32, count: u32| -0.5 + f64::from(count) * f64::from(i) / f64::from(MESH);
    (0..=MESH).flat_map(move |j| (0..=MESH).map(move |i| [at(i, columns), at(j, rows)]))
}

/// The system that `text` asks for, for data that `ground` brings to longitude and latitude.
pub(crate) fn system(
    path: &Path,
    text: &str,
    old: &System,
    ground: &Ground,
    old_map: &[f64; 6],
    samples: [u32; 2],
) -> Result<System, LayoutError> {
    let lower = text.trim().to_ascii_lowercase();
    if !matches!(lower.as_str(), "utm" | "auto") {
        let system = by_text(text).filter(|system| system.kind != Kind::Local);
        // A grid in a system that counts to the south first would cross it, so the same map with eastings is taken.
        let system = system.map(|system| if system.is_south_first { east_north(&system) } else { system });
        return system.ok_or_else(|| {
            LayoutError::Usage(format!(
                "\"{}\" is no reference system that is known here to bring data into; name one as EPSG:n, WKT or a PROJ string, or utm, or auto",
                harmless(text, 60)
            ))
            .mended_by(Remedy::Reproject)
        });
    }
    let [columns, rows] = samples.map(|count| f64::from(count - 1));
    let centre = apply(old_map, [columns / 2.0, rows / 2.0]);
    let [lon, lat] = ground.world(centre).ok_or_else(|| outside(path))?.map(f64::to_degrees);
    let wide = mesh(samples)
        .filter_map(|at| ground.world(apply(old_map, at)))
        .map(|[x, _]| {
            let away = (x.to_degrees() - lon).abs() % 360.0;
            away.min(360.0 - away)
        })
        .fold(0.0, f64::max)
        * 2.0;
    let on_earth = old.radius_m.is_none_or(is_earth);
    let zone = ((lon + 180.0) / 6.0).floor().rem_euclid(60.0) as u32 + 1;
    let utm = if lat < 0.0 { 32_700 + zone } else { 32_600 + zone };
    let is_polar = !(-80.0..=84.0).contains(&lat);
    let radius = old.radius_m.filter(|_| !on_earth);
    let code = match (lower.as_str(), on_earth) {
        (_, true) if is_polar => Some(if lat > 0.0 { 32_661 } else { 32_761 }),
        ("utm", true) => Some(utm),
        ("auto", true) if wide <= UTM_WIDTH_DEG => Some(utm),
        _ => None,
    };
    let found = match code {
        Some(code) => by_text(&format!("EPSG:{code}")),
        None => {
            let body = radius.map_or("+datum=WGS84".to_owned(), |radius| format!("+a={radius} +b={radius}"));
            by_text(&format!("+proj=laea +lat_0={} +lon_0={} {body} +units=m", tenth(lat), tenth(lon)))
        }
    };
    found.ok_or_else(|| outside(path))
}

fn tenth(degrees: f64) -> String {
    number((degrees * 10.0).round() / 10.0)
}

fn outside(path: &Path) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: the elevation model lies outside of what its reference system or the new one covers; name another one to bring it into",
        path.display()
    ))
    .mended_by(Remedy::Reproject)
}

/// The step of the new grid in the new system's unit: `resolution` metres, or what the old step is on the ground at the centre.
pub(super) fn step(
    path: &Path,
    new: &System,
    old: &Ground,
    old_map: &[f64; 6],
    samples: [u32; 2],
    options: &OpenOptions,
) -> Result<f64, LayoutError> {
    let [columns, rows] = samples.map(|count| f64::from(count - 1));
    let centre = apply(old_map, [columns / 2.0, rows / 2.0]);
    let metres = match options.resolution {
        Some(metres) if metres.is_finite() && metres > 0.0 => metres,
        Some(_) => return Err(LayoutError::Usage("a resolution is a number of metres above 0".into())),
        None => {
            let steps = [[old_map[1], old_map[4]], [old_map[2], old_map[5]]];
            let (steps, _) = old.steps_m(centre, steps).ok_or_else(|| outside(path))?;
            three_digits((steps[0] * steps[1]).sqrt())
        }
    };
    Ok(match new.unit.as_ref().map(|unit| unit.size) {
        Some(HorizontalSize::Metres(size)) => metres / size,
        Some(HorizontalSize::Radians(size)) => metres / (new.radius_m.unwrap_or(6_378_137.0) * size),
        None => metres,
    })
}

/// A step's first three digits, which are as good and read better: the number that this decimal text reads back as.
pub(crate) fn three_digits(step: f64) -> f64 {
    format!("{step:.2e}").parse().unwrap_or(step)
}

/// The new grid of a `step`, over the old one that `over` brings into the new system.
pub(super) fn grid(
    path: &Path,
    samples: [u32; 2],
    steps: [f64; 2],
    turn: Option<f64>,
    signs: [f64; 2],
    mut over: impl FnMut([f64; 2]) -> Option<[f64; 2]>,
) -> Result<Grid, LayoutError> {
    let middle = samples.map(|count| f64::from(count - 1) / 2.0);
    let centre = over(middle).ok_or_else(|| outside(path))?;
    let (mut low, mut high) = (centre, centre);
    for at in mesh(samples) {
        let Some(mut point) = over(at) else { continue };
        if let Some(turn) = turn {
            point[0] += turn * ((centre[0] - point[0]) / turn).round();
        }
        for i in 0..2 {
            low[i] = low[i].min(point[i]);
            high[i] = high[i].max(point[i]);
        }
    }
    let first: [f64; 2] = std::array::from_fn(|i| (low[i] / steps[i] + 0.5 - 1e-6).floor());
    let last: [f64; 2] = std::array::from_fn(|i| (high[i] / steps[i] - 0.5 + 1e-6).ceil());
    let counts: [f64; 2] = std::array::from_fn(|i| last[i] - first[i] + 1.0);
    if counts.iter().any(|count| !(2.0..=f64::from(MOST_SAMPLES)).contains(count)) {
        return Err(LayoutError::Usage(format!(
            "{}: brought over it would have {} x {} samples, and a terrain has from 2 to {MOST_SAMPLES_WORDS} on a side; state another resolution",
            path.display(),
            number(counts[0]),
            number(counts[1])
        ))
        .mended_by(Remedy::Resolution));
    }
    // Columns run to the east and rows to the south, whichever way the axes point.
    let from = |i: usize, ascending: bool| if ascending { first[i] * steps[i] } else { last[i] * steps[i] };
    let map = [
        from(0, signs[0] > 0.0),
        signs[0] * steps[0],
        0.0,
        from(1, signs[1] < 0.0),
        0.0,
        -signs[1] * steps[1],
    ];
    Ok(Grid { map, samples: counts.map(|count| count as u32) })
}
