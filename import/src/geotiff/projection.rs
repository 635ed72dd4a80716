//! A projection that a file defines by its own parameters, as a PROJ string.
//!
//! Keys are those of the GeoTIFF standard (OGC 19-008r4, section 7.4), and methods are read as libgeotiff reads them; which of several origins counts depends on the projection, and writers
//! confuse them, so the first that is there is taken. Angles are in the file's unit of angles and degrees in the string, false eastings in its unit of lengths and metres in the string. An unknown
//! projection gives no string and a warning; then only the units of the terrain are known.

use super::body;
use super::keys::Keys;
use terrasoar_layout::dem::Warning;

const PROJECTION: u16 = 3074;
const METHOD: u16 = 3075;
const PARALLEL_1: u16 = 3078;
const PARALLEL_2: u16 = 3079;
const SCALE_AT_ORIGIN: u16 = 3092;
const SCALE_AT_CENTRE: u16 = 3093;
const AZIMUTH: u16 = 3094;
const RECTIFIED_ANGLE: u16 = 3096;

/// Keys of longitudes, latitudes, eastings and northings of origins, in the order they are looked for.
const LONGITUDES: [u16; 4] = [3080, 3084, 3088, 3095];
const LATITUDES: [u16; 3] = [3081, 3085, 3089];
const EASTINGS: [u16; 3] = [3082, 3086, 3090];
const NORTHINGS: [u16; 3] = [3083, 3087, 3091];

/// The PROJ string of the keys, coordinates in a unit of `unit_m` metres.
pub(super) fn proj(keys: &Keys, unit_m: f64, warnings: &mut Vec<Warning>) -> Option<String> {
    let Some(plane) = plane(keys, unit_m) else {
        let what = match (keys.code(METHOD), keys.code(PROJECTION)) {
            (Some(method), _) => format!("by method {method} (key ProjCoordTrans), which is not read here"),
            (None, Some(code)) => format!("as number {code} (key Projection), which is not read here"),
            // A map that names no body either is a local one: metres from a corner.
            (None, None) if !body::is_named(keys) => return None,
            (None, None) => "by no method (keys ProjectedCSType, Projection, ProjCoordTrans)".to_owned(),
        };
        warnings.push(body::unplaced(&format!("the file gives its projection {what}")));
        return None;
    };
    let before = warnings.len();
    let Some(body) = body::words(keys, warnings) else {
        if warnings.len() == before {
            warnings
                .push(body::unplaced("the file names no ellipsoid under its projection that is known here"));
        }
        return None;
    };
    Some(format!("{plane} {body} +to_meter={unit_m}"))
}

/// The words of the projection alone.
fn plane(keys: &Keys, unit_m: f64) -> Option<String> {
    // Zones of UTM have numbers of their own.
    match keys.short(PROJECTION) {
        Some(code @ 16001..=16060) => return Some(format!("+proj=utm +zone={}", code - 16000)),
        Some(code @ 16101..=16160) => return Some(format!("+proj=utm +zone={} +south", code - 16100)),
        _ => {}
    }
    let method = keys.short(METHOD)?;
    let degrees = body::degrees_a_unit(keys)?;
    let first = |keys_of: &[u16]| {
        keys_of.iter().find_map(|key| keys.real(*key)).filter(|v| v.is_finite()).unwrap_or(0.0)
    };
    let angle = |key| keys.real(key).filter(|angle: &f64| angle.is_finite()).map(|angle| angle * degrees);
    let (lon, lat) = (first(&LONGITUDES) * degrees, first(&LATITUDES) * degrees);
    let shift = format!("+x_0={} +y_0={}", first(&EASTINGS) * unit_m, first(&NORTHINGS) * unit_m);
    let origin = format!("+lon_0={lon} {shift}");
    let scale =
        keys.real(SCALE_AT_ORIGIN).or(keys.real(SCALE_AT_CENTRE)).filter(|k| k.is_finite() && *k > 0.0);
    let k = scale.unwrap_or(1.0);
    let (one, two) = (angle(PARALLEL_1), angle(PARALLEL_2));
    let parallels = format!("+lat_1={} +lat_2={}", one.unwrap_or(lat), two.or(one).unwrap_or(lat));
    let oblique = |kind: &str| {
        // Azimuths have a unit of their own. Where the angle of the grid is not said, it is a right one to libgeotiff.
        let azimuth = keys.real(AZIMUTH)? * body::degrees_an_azimuth(keys)?;
        let gamma = angle(RECTIFIED_ANGLE).unwrap_or(90.0);
        Some(format!(
            "+proj=omerc +lat_0={lat} +lonc={lon} +alpha={azimuth} +gamma={gamma}{kind} +k={k} {shift}"
        ))
    };
    Some(match method {
        1 => format!("+proj=tmerc +lat_0={lat} +k={k} {origin}"),
        // False eastings at the natural origin, or at the centre.
        3 => oblique(" +no_uoff")?,
        9815 => oblique("")?,
        // Mercator's origin is at the equator.
        7 if lat != 0.0 => return None,
        7 => match one {
            Some(parallel) => format!("+proj=merc +lat_ts={parallel} {origin}"),
            None => format!("+proj=merc +k={k} {origin}"),
        },
        8 => format!("+proj=lcc +lat_0={lat} {parallels} {origin}"),
        9 => format!("+proj=lcc +lat_0={lat} +lat_1={lat} +k_0={k} {origin}"),
        10 => format!("+proj=laea +lat_0={lat} {origin}"),
        11 => format!("+proj=aea +lat_0={lat} {parallels} {origin}"),
        12 => format!("+proj=aeqd +lat_0={lat} {origin}"),
        13 => format!("+proj=eqdc +lat_0={lat} {parallels} {origin}"),
        14 => format!("+proj=stere +lat_0={lat} +k={k} {origin}"),
        // By the latitude of true scale, or at a pole with a scale.
        15 if lat.abs() < 90.0 && k != 1.0 => return None,
        15 if lat.abs() < 90.0 => {
            format!("+proj=stere +lat_0={} +lat_ts={lat} +k={k} {origin}", if lat < 0.0 { -90 } else { 90 })
        }
        15 => format!("+proj=stere +lat_0={lat} +k={k} {origin}"),
        16 => format!("+proj=sterea +lat_0={lat} +k={k} {origin}"),
        17 => format!("+proj=eqc +lat_ts={} +lat_0={lat} {origin}", one.unwrap_or(0.0)),
        18 => format!("+proj=cass +lat_0={lat} {origin}"),
        19 => format!("+proj=gnom +lat_0={lat} {origin}"),
        // On the sphere of the ellipsoid's area.
        20 => format!("+proj=mill +R_A {origin}"),
        21 => format!("+proj=ortho +lat_0={lat} {origin}"),
        22 => format!("+proj=poly +lat_0={lat} {origin}"),
        23 => format!("+proj=robin {origin}"),
        24 => format!("+proj=sinu {origin}"),
        // To the south and west; a false westing is not an easting, so none is taken.
        27 if shift == "+x_0=0 +y_0=0" => format!("+proj=tmerc +axis=wsu +lat_0={lat} +k={k} {origin}"),
        28 => format!("+proj=cea +lat_ts={} {origin}", one.unwrap_or(0.0)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
