//! The reference system of a grid: WKT where a writer left it, else the parameters of CF's grid mappings as a PROJ string (CF 1.11, appendix F).

use super::attributes::{number, numbers, text};
use netcdf_reader::{NcAttribute, NcVariable};
use terrasoar_layout::words::harmless;

/// Text of the system that the variable of a grid mapping describes, and the attribute it stands in; nothing where it describes none. What it says that is not read here is an error in words.
pub(super) fn of(mapping: &NcVariable) -> Result<Option<(String, &'static str)>, String> {
    described(mapping.attributes())
}

fn described(attributes: &[NcAttribute]) -> Result<Option<(String, &'static str)>, String> {
    for name in ["crs_wkt", "spatial_ref", "esri_pe_string", "proj4", "proj4text", "projection_wkt"] {
        if let Some(found) = text(attributes, name) {
            return Ok(Some((found, name)));
        }
    }
    for name in ["epsg_code", "EPSG_code", "epsg"] {
        let code = text(attributes, name).or_else(|| number(attributes, name).map(|code| code.to_string()));
        if let Some(code) = code {
            let digits = code.trim().trim_start_matches("EPSG:").trim_start_matches("epsg:").to_owned();
            if digits.parse::<u32>().is_ok() {
                return Ok(Some((format!("EPSG:{digits}"), "epsg_code")));
            }
        }
    }
    let Some(name) = text(attributes, "grid_mapping_name") else { return Ok(None) };
    let plane = plane(attributes, &name)
        .ok_or_else(|| format!("the grid mapping \"{}\" is not read here", harmless(&name, 60)))?;
    let body = body(attributes)?;
    Ok(Some((format!("{plane} {body} +no_defs"), "grid_mapping_name")))
}

/// Whether a mapping moves its origin, which CF counts in the unit of coordinates and GDAL in metres.
pub(super) fn is_moved(mapping: &NcVariable) -> bool {
    let of = |name| number(mapping.attributes(), name).unwrap_or(0.0);
    of("false_easting") != 0.0 || of("false_northing") != 0.0
}

/// The projection alone.
fn plane(attributes: &[NcAttribute], name: &str) -> Option<String> {
    let of = |name: &str| number(attributes, name);
    let or = |name: &str, default: f64| of(name).unwrap_or(default);
    let parallels = numbers(attributes, "standard_parallel");
    let shift = format!("+x_0={} +y_0={}", or("false_easting", 0.0), or("false_northing", 0.0));
    let [central, origin] =
        [or("longitude_of_central_meridian", 0.0), or("latitude_of_projection_origin", 0.0)];
    let centre = of("longitude_of_projection_origin").unwrap_or(central);
    let scale = of("scale_factor_at_central_meridian").or_else(|| of("scale_factor_at_projection_origin"));
    Some(format!(
        "+proj={}",
        match name {
            "latitude_longitude" => "longlat".to_owned(),
            "transverse_mercator" =>
                format!("tmerc +lat_0={origin} +lon_0={central} +k={} {shift}", scale.unwrap_or(1.0)),
            "mercator" => match (parallels.first(), scale) {
                (Some(parallel), _) => format!("merc +lat_ts={parallel} +lon_0={centre} {shift}"),
                (None, scale) => format!("merc +lon_0={centre} +k={} {shift}", scale.unwrap_or(1.0)),
            },
            "lambert_conformal_conic" => match parallels[..] {
                [one] => format!("lcc +lat_1={one} +lat_0={origin} +lon_0={central} {shift}"),
                [one, two] =>
                    format!("lcc +lat_1={one} +lat_2={two} +lat_0={origin} +lon_0={central} {shift}"),
                _ => return None,
            },
            "albers_conical_equal_area" => match parallels[..] {
                [one] => format!("aea +lat_1={one} +lat_2={one} +lat_0={origin} +lon_0={central} {shift}"),
                [one, two] =>
                    format!("aea +lat_1={one} +lat_2={two} +lat_0={origin} +lon_0={central} {shift}"),
                _ => return None,
            },
            "lambert_azimuthal_equal_area" => format!("laea +lat_0={origin} +lon_0={centre} {shift}"),
            "azimuthal_equidistant" => format!("aeqd +lat_0={origin} +lon_0={centre} {shift}"),
            "orthographic" => format!("ortho +lat_0={origin} +lon_0={centre} {shift}"),
            "sinusoidal" => format!("sinu +lon_0={centre} {shift}"),
            "stereographic" => {
                format!("stere +lat_0={origin} +lon_0={centre} +k={} {shift}", scale.unwrap_or(1.0))
            }
            "lambert_cylindrical_equal_area" => match (parallels.first(), scale) {
                (Some(parallel), _) => format!("cea +lat_ts={parallel} +lon_0={central} {shift}"),
                (None, scale) => format!("cea +lon_0={central} +k={} {shift}", scale.unwrap_or(1.0)),
            },
            "polar_stereographic" => {
                let pole = or(
                    "latitude_of_projection_origin",
                    if parallels.first().is_some_and(|p| *p < 0.0) { -90.0 } else { 90.0 },
                );
                if pole.abs() != 90.0 {
                    return None;
                }
                let meridian = of("straight_vertical_longitude_from_pole").unwrap_or(centre);
                match (parallels.first(), scale) {
                    (Some(parallel), _) => {
                        format!("stere +lat_0={pole} +lat_ts={parallel} +lon_0={meridian} {shift}")
                    }
                    (None, scale) => {
                        format!("stere +lat_0={pole} +lon_0={meridian} +k={} {shift}", scale.unwrap_or(1.0))
                    }
                }
            }
            _ => return None,
        }
    ))
}

/// Names of ellipsoids in the EPSG dataset, and in PROJ.
const ELLIPSOIDS: [(&str, &str); 10] = [
    ("WGS 84", "WGS84"),
    ("GRS 1980", "GRS80"),
    ("Bessel 1841", "bessel"),
    ("International 1924", "intl"),
    ("Airy 1830", "airy"),
    ("Airy Modified 1849", "mod_airy"),
    ("Clarke 1866", "clrk66"),
    ("Clarke 1880 (IGN)", "clrk80ign"),
    ("Krassowsky 1940", "krass"),
    ("Krassovsky 1940", "krass"),
];

/// Ellipsoid, shift to WGS 84 and prime meridian.
fn body(attributes: &[NcAttribute]) -> Result<String, String> {
    let of = |name: &str| number(attributes, name);
    let is = |a: &str, b: &str| a.replace(['_', ' '], "").eq_ignore_ascii_case(&b.replace(['_', ' '], ""));
    let by_name = || match text(attributes, "reference_ellipsoid_name") {
        None => Ok("+datum=WGS84".to_owned()),
        Some(name) => ELLIPSOIDS
            .iter()
            .find(|known| is(known.0, &name))
            .map(|known| format!("+ellps={}", known.1))
            .ok_or_else(|| {
                format!("the ellipsoid \"{}\" without its axes is not known here", harmless(&name, 60))
            }),
    };
    let ellipsoid =
        match (of("earth_radius"), of("semi_major_axis"), of("inverse_flattening"), of("semi_minor_axis")) {
            (Some(radius), ..) => format!("+R={radius}"),
            (None, Some(major), Some(flattening), _) if flattening > 0.0 => {
                format!("+a={major} +rf={flattening}")
            }
            (None, Some(major), _, Some(minor)) => format!("+a={major} +b={minor}"),
            (None, Some(major), ..) => format!("+R={major}"),
            _ => by_name()?,
        };
    let shift = match numbers(attributes, "towgs84") {
        values if values.is_empty() => String::new(),
        values if matches!(values.len(), 3 | 7) && values.iter().all(|value| value.is_finite()) => {
            let values: Vec<String> = values.iter().map(f64::to_string).collect();
            format!(" +towgs84={}", values.join(","))
        }
        values => return Err(format!("a shift to WGS 84 of {} numbers is not read here", values.len())),
    };
    let meridian = match (of("longitude_of_prime_meridian"), text(attributes, "prime_meridian_name")) {
        (Some(0.0), _) | (None, None) => String::new(),
        (Some(degrees), _) => format!(" +pm={degrees}"),
        (None, Some(name)) if is(&name, "Greenwich") => String::new(),
        (None, Some(name)) if is(&name, "Paris") => " +pm=paris".to_owned(),
        (None, Some(name)) if is(&name, "Ferro") => " +pm=ferro".to_owned(),
        (None, Some(name)) => {
            return Err(format!(
                "the prime meridian \"{}\" without its longitude is not known here",
                harmless(&name, 60)
            ));
        }
    };
    Ok(format!("{ellipsoid}{shift}{meridian}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::{Ground, by_text};
    use netcdf_reader::NcAttrValue;

    fn attributes(name: &str, numbers: &[(&str, &[f64])], texts: &[(&str, &str)]) -> Vec<NcAttribute> {
        let named = |name: &str, value| NcAttribute { name: name.to_owned(), value };
        let numbers = numbers.iter().map(|(name, values)| named(name, NcAttrValue::Doubles(values.to_vec())));
        let texts = [("grid_mapping_name", name)].into_iter().chain(texts.iter().copied());
        let texts = texts.map(|(name, text)| named(name, NcAttrValue::Chars(text.to_owned())));
        numbers.chain(texts).collect()
    }

    /// Places by GDAL 3.10 where it reads the attributes, else by PROJ strings of what CF says of them.
    #[test]
    fn mappings_lead_to_their_places() {
        let centre: [(&str, &[f64]); 2] =
            [("latitude_of_projection_origin", &[46.0]), ("longitude_of_projection_origin", &[3.0])];
        let scaled = [&centre[..], &[("scale_factor_at_projection_origin", &[0.999])]].concat();
        let zone: [(&str, &[f64]); 4] = [
            ("longitude_of_central_meridian", &[9.0]),
            ("false_easting", &[3_500_000.0]),
            ("semi_major_axis", &[6_377_397.155]),
            ("inverse_flattening", &[299.152_812_8]),
        ];
        let shift: (&str, &[f64]) = ("towgs84", &[598.1, 73.7, 418.2, 0.202, 0.045, -2.455, 6.7]);
        let with = |more: (&'static str, &'static [f64])| [&zone[..], &[more]].concat();
        let shifted = [&zone[..], &[shift]].concat();
        let (near, far) = ([15_000.0, 15_000.0], [3_515_000.0, 5_540_000.0]);
        let bessel = |lon| [lon, 49.997_297_864_300_83];
        let paris: (&str, &[f64]) = ("longitude_of_prime_meridian", &[2.337_229_17]);
        for (name, numbers, texts, at, to) in [
            ("stereographic", &scaled[..], &[][..], near, [3.194_305_035_92, 46.134_919_634_91]),
            ("azimuthal_equidistant", &centre, &[], near, [3.194_111_970_71, 46.134_785_003_44]),
            ("orthographic", &centre, &[], near, [3.194_112_328_79, 46.134_785_251_97]),
            (
                "lambert_cylindrical_equal_area",
                &[("standard_parallel", &[30.0]), ("longitude_of_central_meridian", &[3.0])],
                &[],
                [15_000.0, 4_515_000.0],
                [3.155_462_517_17, 38.071_760_707_16],
            ),
            ("sinusoidal", &centre[1..], &[], near, [3.134_747_667_77, 0.135_655_419_01]),
            ("transverse_mercator", &shifted, &[], far, [9.208_161_151_44, 49.996_152_069_2]),
            ("transverse_mercator", &with(paris), &[], far, bessel(11.546_460_436_2)),
            (
                "transverse_mercator",
                &zone,
                &[("prime_meridian_name", "Ferro")],
                far,
                bessel(-8.457_435_397_14),
            ),
            (
                "transverse_mercator",
                &zone[..2],
                &[("reference_ellipsoid_name", "Bessel 1841")],
                far,
                bessel(9.209_231_269_53),
            ),
        ] {
            let (text, _) = described(&attributes(name, numbers, texts)).unwrap().unwrap();
            let ground = Ground::new(&by_text(&text).unwrap()).unwrap_or_else(|| panic!("{text}"));
            let found = ground.world(at).unwrap().map(f64::to_degrees);
            let away = (found[0] - to[0]).abs().max((found[1] - to[1]).abs());
            assert!(away < 1e-7, "{name} {texts:?} {text}: {found:?}");
        }
    }

    #[test]
    fn what_is_not_read_is_told() {
        for (name, numbers, texts, words) in [
            ("rotated_latitude_longitude", &[][..], &[][..], "\"rotated_latitude_longitude\" is not read"),
            ("polar_stereographic", &[("latitude_of_projection_origin", &[70.0][..])], &[], "polar"),
            ("latitude_longitude", &[], &[("reference_ellipsoid_name", "Mine")], "ellipsoid \"Mine\""),
            ("latitude_longitude", &[], &[("prime_meridian_name", "Rome")], "meridian \"Rome\""),
            ("latitude_longitude", &[("towgs84", &[1.0, 2.0])], &[], "2 numbers"),
        ] {
            let told = described(&attributes(name, numbers, texts)).unwrap_err();
            assert!(told.contains(words), "{told}");
        }
    }
}
