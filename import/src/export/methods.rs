//! A projection by its parameters, as GeoTIFF keys: the way back of `geotiff::projection`.
//!
//! Keys and which of several origins a method uses are those of the GeoTIFF standard (OGC 19-008r4, annex C) and of libgeotiff. What cannot be said by them exactly gives nothing: other prime
//! meridians, axes to the west or south, oblique Mercator, whose variants the standard does not tell apart.

use crate::crs::proj_word;

/// User-defined.
pub(super) const OWN: u16 = 32767;

/// What a key holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Short(u16),
    Reals(Vec<f64>),
    Text(String),
}

/// Keys with what they hold.
pub(super) type Values = Vec<(u16, Value)>;

/// PROJ's ellipsoids: name, code, semi-major axis and inverse flattening.
const ELLIPSOIDS: [(&str, u16, f64, f64); 12] = [
    ("WGS84", 7030, 6_378_137.0, 298.257_223_563),
    ("GRS80", 7019, 6_378_137.0, 298.257_222_101),
    ("clrk66", 7008, 6_378_206.4, 294.978_698_213_898_2),
    ("clrk80", 7012, 6_378_249.145, 293.465),
    ("clrk80ign", 7011, 6_378_249.2, 293.466_021_293_626_9),
    ("bessel", 7004, 6_377_397.155, 299.152_812_8),
    ("intl", 7022, 6_378_388.0, 297.0),
    ("airy", 7001, 6_377_563.396, 299.324_964_6),
    ("krass", 7024, 6_378_245.0, 298.3),
    ("aust_SA", 7003, 6_378_160.0, 298.25),
    ("WGS72", 7043, 6_378_135.0, 298.26),
    ("sphere", OWN, 6_370_997.0, f64::INFINITY),
];

/// Geographic systems of PROJ's datums.
const DATUMS: [(&str, u16); 3] = [("WGS84", 4326), ("NAD83", 4269), ("NAD27", 4267)];

/// The finite number of a word.
fn number(proj: &str, name: &str) -> Option<f64> {
    proj_word(proj, name)?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// The body that a PROJ string is of: a geographic system by its code, or by its ellipsoid.
pub(super) fn body(proj: &str) -> Option<Values> {
    if proj_word(proj, "pm").is_some_and(|meridian| meridian != "0" && meridian != "greenwich") {
        return None;
    }
    let is_shifted = proj_word(proj, "nadgrids").is_some() || proj_word(proj, "towgs84").is_some();
    if let Some(datum) = proj_word(proj, "datum").filter(|_| !is_shifted) {
        let (_, code) = DATUMS.iter().find(|(name, _)| *name == datum)?;
        return Some(vec![(2048, Value::Short(*code))]);
    }
    let datum_ellipsoid = || match proj_word(proj, "datum")? {
        "WGS84" => Some("WGS84"),
        "NAD83" => Some("GRS80"),
        "NAD27" => Some("clrk66"),
        _ => None,
    };
    let (code, a, rf) = match number(proj, "R").or_else(|| number(proj, "a")) {
        Some(a) => {
            let by_minor = || number(proj, "b").map(|b| if a == b { f64::INFINITY } else { a / (a - b) });
            let by_flattening = || number(proj, "f").map(|f| 1.0 / f);
            let rf = number(proj, "rf").or_else(by_minor).or_else(by_flattening).unwrap_or(f64::INFINITY);
            (OWN, a, if proj_word(proj, "R").is_some() { f64::INFINITY } else { rf })
        }
        None => {
            let name = proj_word(proj, "ellps").or_else(datum_ellipsoid)?;
            ELLIPSOIDS.iter().find(|known| known.0 == name).map(|(_, code, a, rf)| (*code, *a, *rf))?
        }
    };
    let mut values = vec![
        (2048, Value::Short(OWN)),
        (2050, Value::Short(OWN)),
        (2056, Value::Short(code)),
        (2057, Value::Reals(vec![a])),
    ];
    // A sphere's flattening has no inverse.
    values.push(if rf.is_finite() { (2059, Value::Reals(vec![rf])) } else { (2058, Value::Reals(vec![a])) });
    if let Some(shift) = proj_word(proj, "towgs84") {
        let shift: Vec<f64> = shift.split(',').map(|word| word.parse().ok()).collect::<Option<_>>()?;
        if !matches!(shift.len(), 3 | 7) {
            return None;
        }
        values.push((2062, Value::Reals(shift)));
    }
    Some(values)
}

/// The projection of a PROJ string whose coordinates are in a unit of `unit_m` metres, without its body.
pub(super) fn projection(proj: &str, unit_m: f64) -> Option<Values> {
    if proj_word(proj, "axis").is_some_and(|axis| axis != "enu") {
        return None;
    }
    let kind = proj_word(proj, "proj")?;
    if kind == "utm" {
        let zone: u16 = proj_word(proj, "zone")?.parse().ok().filter(|zone| (1..=60).contains(zone))?;
        let first = if proj_word(proj, "south").is_some() { 16100 } else { 16000 };
        return Some(vec![(3074, Value::Short(first + zone))]);
    }
    let of = |name| number(proj, name);
    let lat = of("lat_0").unwrap_or(0.0);
    let lon = of("lon_0").unwrap_or(0.0);
    let scale = of("k_0").or(of("k")).unwrap_or(1.0);
    let at_origin = [(3081, lat), (3080, lon)];
    let at_centre = [(3089, lat), (3088, lon)];
    let shifts = |keys: [u16; 2]| {
        [(keys[0], of("x_0").unwrap_or(0.0) / unit_m), (keys[1], of("y_0").unwrap_or(0.0) / unit_m)]
    };
    let plain = shifts([3082, 3083]);
    let (method, parameters): (u16, Vec<(u16, f64)>) = match kind {
        "tmerc" => (1, [&at_origin[..], &[(3092, scale)], &plain].concat()),
        "merc" => match of("lat_ts") {
            Some(parallel) => (7, [&at_origin[..], &[(3078, parallel)], &plain].concat()),
            None => (7, [&at_origin[..], &[(3092, scale)], &plain].concat()),
        },
        "lcc" => match (of("lat_1")?, of("lat_2")) {
            (one, two) if two.is_none_or(|two| two == one) && one == lat => {
                (9, [&at_origin[..], &[(3092, scale)], &plain].concat())
            }
            (one, two) if scale == 1.0 => {
                let parallels = [(3085, lat), (3084, lon), (3078, one), (3079, two.unwrap_or(one))];
                (8, [&parallels[..], &shifts([3086, 3087])].concat())
            }
            _ => return None,
        },
        "laea" => (10, [at_centre, plain].concat()),
        "aea" => {
            let parallels = [(3078, of("lat_1")?), (3079, of("lat_2").or(of("lat_1"))?)];
            (11, [at_origin, parallels, plain].concat())
        }
        "aeqd" => (12, [at_centre, plain].concat()),
        "eqdc" => (13, [at_origin, [(3078, of("lat_1")?), (3079, of("lat_2")?)], plain].concat()),
        "stere" if lat.abs() == 90.0 => {
            // By the latitude of true scale, or by the scale at the pole.
            let true_at = of("lat_ts").unwrap_or(lat);
            (15, [&[(3081, true_at), (3095, lon), (3092, scale)][..], &plain].concat())
        }
        "sterea" => (16, [&at_origin[..], &[(3092, scale)], &plain].concat()),
        "eqc" => (17, [&[(3078, of("lat_ts").unwrap_or(0.0))][..], &at_centre, &plain].concat()),
        "cass" => (18, [at_origin, plain].concat()),
        "mill" => (20, [at_centre, plain].concat()),
        "ortho" => (21, [at_centre, plain].concat()),
        "poly" => (22, [at_origin, plain].concat()),
        "robin" => (23, [&at_centre[1..], &plain].concat()),
        "sinu" => (24, [&at_centre[1..], &plain].concat()),
        "cea" => (28, [&[(3078, of("lat_ts").unwrap_or(0.0))][..], &at_origin[1..], &plain].concat()),
        _ => return None,
    };
    let mut values = vec![(3074, Value::Short(OWN)), (3075, Value::Short(method))];
    values.extend(parameters.into_iter().map(|(key, value)| (key, Value::Reals(vec![value]))));
    Some(values)
}
