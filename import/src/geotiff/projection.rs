//! A projection that a file defines by its own parameters, as a PROJ string.
//!
//! Keys are those of the GeoTIFF standard (OGC 19-008r4, section 7.4); which of several origins counts depends on the projection, and writers confuse them, so the first
//! that is there is taken. False eastings are in the file's unit and metres in the string. An unknown projection gives no string; then only the units of the terrain are known.

use super::keys::Keys;
use crate::crs::by_text;

const GEOGRAPHIC_TYPE: u16 = 2048;
const ELLIPSOID: u16 = 2056;
const SEMI_MAJOR: u16 = 2057;
const SEMI_MINOR: u16 = 2058;
const INVERSE_FLATTENING: u16 = 2059;
const PROJECTION: u16 = 3074;
const METHOD: u16 = 3075;
const PARALLEL_1: u16 = 3078;
const PARALLEL_2: u16 = 3079;
const SCALE_AT_ORIGIN: u16 = 3092;
const SCALE_AT_CENTRE: u16 = 3093;
const AZIMUTH: u16 = 3094;

/// Keys of longitudes, latitudes, eastings and northings of origins, in the order they are looked for.
const LONGITUDES: [u16; 4] = [3080, 3084, 3088, 3095];
const LATITUDES: [u16; 3] = [3081, 3085, 3089];
const EASTINGS: [u16; 3] = [3082, 3086, 3090];
const NORTHINGS: [u16; 3] = [3083, 3087, 3091];

/// The PROJ string of the keys, coordinates in a unit of `unit_m` metres.
pub(super) fn proj(keys: &Keys, unit_m: f64) -> Option<String> {
    let ellipsoid = ellipsoid(keys)?;
    let units = format!("+to_meter={unit_m}");
    // Zones of UTM have numbers of their own.
    match keys.short(PROJECTION) {
        Some(code @ 16001..=16060) => {
            return Some(format!("+proj=utm +zone={} {ellipsoid} {units}", code - 16000));
        }
        Some(code @ 16101..=16160) => {
            return Some(format!("+proj=utm +zone={} +south {ellipsoid} {units}", code - 16100));
        }
        _ => {}
    }
    let first = |keys_of: &[u16]| {
        keys_of.iter().find_map(|key| keys.real(*key)).filter(|v| v.is_finite()).unwrap_or(0.0)
    };
    let (lon, lat) = (first(&LONGITUDES), first(&LATITUDES));
    let origin = format!(
        "+lon_0={lon} +x_0={} +y_0={} {ellipsoid} {units}",
        first(&EASTINGS) * unit_m,
        first(&NORTHINGS) * unit_m
    );
    let scale =
        keys.real(SCALE_AT_ORIGIN).or(keys.real(SCALE_AT_CENTRE)).filter(|k| k.is_finite() && *k > 0.0);
    let k = scale.unwrap_or(1.0);
    let (one, two) = (keys.real(PARALLEL_1), keys.real(PARALLEL_2));
    let parallels = format!("+lat_1={} +lat_2={}", one.unwrap_or(lat), two.or(one).unwrap_or(lat));
    Some(match keys.short(METHOD)? {
        1 => format!("+proj=tmerc +lat_0={lat} +k={k} {origin}"),
        3 => format!(
            "+proj=omerc +lat_0={lat} +lonc={lon} +alpha={} +k={k} {}",
            keys.real(AZIMUTH)?,
            origin.replace("+lon_0=", "+unused=")
        ),
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
        // Polar, by the latitude of true scale, or at a point with a scale.
        14 | 15 if lat.abs() < 90.0 => {
            format!("+proj=stere +lat_0={} +lat_ts={lat} +k={k} {origin}", if lat < 0.0 { -90 } else { 90 })
        }
        14 | 15 => format!("+proj=stere +lat_0={lat} +k={k} {origin}"),
        16 => format!("+proj=sterea +lat_0={lat} +k={k} {origin}"),
        17 => format!("+proj=eqc +lat_ts={} +lat_0={lat} {origin}", one.unwrap_or(0.0)),
        18 => format!("+proj=cass +lat_0={lat} {origin}"),
        20 => format!("+proj=mill {origin}"),
        21 => format!("+proj=ortho +lat_0={lat} {origin}"),
        22 => format!("+proj=poly +lat_0={lat} {origin}"),
        23 => format!("+proj=robin {origin}"),
        24 => format!("+proj=sinu {origin}"),
        28 => format!("+proj=cea +lat_ts={} {origin}", one.unwrap_or(0.0)),
        _ => return None,
    })
}

/// The ellipsoid as words of a PROJ string.
fn ellipsoid(keys: &Keys) -> Option<String> {
    let size = |key| keys.real(key).filter(|size: &f64| size.is_finite() && *size > 0.0);
    if let Some(a) = size(SEMI_MAJOR) {
        return Some(match (size(SEMI_MINOR), size(INVERSE_FLATTENING)) {
            (Some(b), _) => format!("+a={a} +b={b}"),
            (None, Some(rf)) => format!("+a={a} +rf={rf}"),
            (None, None) => format!("+a={a} +b={a}"),
        });
    }
    let by_code = match keys.short(ELLIPSOID) {
        Some(7019) => Some("GRS80"),
        Some(7030) => Some("WGS84"),
        Some(7008) => Some("clrk66"),
        Some(7012) => Some("clrk80"),
        Some(7004) => Some("bessel"),
        Some(7022) => Some("intl"),
        Some(7001) => Some("airy"),
        Some(7024) => Some("krass"),
        _ => None,
    };
    if let Some(name) = by_code {
        return Some(format!("+ellps={name}"));
    }
    let system = by_text(&format!("EPSG:{}", keys.code(GEOGRAPHIC_TYPE)?))?;
    let proj = system.proj?;
    let kept: Vec<&str> = proj
        .split_whitespace()
        .filter(|word| {
            ["+a=", "+b=", "+rf=", "+ellps=", "+datum=", "+towgs84=", "+pm="]
                .iter()
                .any(|start| word.starts_with(start))
        })
        .collect();
    Some(kept.join(" "))
}
