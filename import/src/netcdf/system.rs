//! The reference system of a grid: WKT where a writer left it, else the parameters of CF's grid mappings as a PROJ string (CF 1.11, appendix F).

use super::attributes::{number, numbers, text};
use netcdf_reader::{NcAttribute, NcVariable};

/// Text of the system that the variable of a grid mapping describes, and the attribute it stands in.
pub(super) fn of(mapping: &NcVariable) -> Option<(String, &'static str)> {
    let attributes = mapping.attributes();
    for name in ["crs_wkt", "spatial_ref", "esri_pe_string", "proj4", "proj4text", "projection_wkt"] {
        if let Some(found) = text(attributes, name) {
            return Some((found, name));
        }
    }
    for name in ["epsg_code", "EPSG_code", "epsg"] {
        let code = text(attributes, name).or_else(|| number(attributes, name).map(|code| code.to_string()));
        if let Some(code) = code {
            let digits = code.trim().trim_start_matches("EPSG:").trim_start_matches("epsg:").to_owned();
            if digits.parse::<u32>().is_ok() {
                return Some((format!("EPSG:{digits}"), "epsg_code"));
            }
        }
    }
    proj(attributes).map(|found| (found, "grid_mapping_name"))
}

/// The parameters as a PROJ string.
fn proj(attributes: &[NcAttribute]) -> Option<String> {
    let of = |name: &str| number(attributes, name);
    let or = |name: &str, default: f64| of(name).unwrap_or(default);
    let parallels = numbers(attributes, "standard_parallel");
    let shift = format!("+x_0={} +y_0={}", or("false_easting", 0.0), or("false_northing", 0.0));
    let [central, origin] =
        [or("longitude_of_central_meridian", 0.0), or("latitude_of_projection_origin", 0.0)];
    let centre = of("longitude_of_projection_origin").unwrap_or(central);
    let scale = of("scale_factor_at_central_meridian").or_else(|| of("scale_factor_at_projection_origin"));
    let body = format!(
        "+proj={}",
        match text(attributes, "grid_mapping_name")?.as_str() {
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
            "polar_stereographic" => {
                let pole = or(
                    "latitude_of_projection_origin",
                    if parallels.first().is_some_and(|p| *p < 0.0) { -90.0 } else { 90.0 },
                );
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
    );
    let ellipsoid =
        match (of("earth_radius"), of("semi_major_axis"), of("inverse_flattening"), of("semi_minor_axis")) {
            (Some(radius), ..) => format!("+R={radius}"),
            (None, Some(major), Some(flattening), _) if flattening > 0.0 => {
                format!("+a={major} +rf={flattening}")
            }
            (None, Some(major), _, Some(minor)) => format!("+a={major} +b={minor}"),
            (None, Some(major), ..) => format!("+R={major}"),
            _ => "+datum=WGS84".to_owned(),
        };
    Some(format!("{body} {ellipsoid} +no_defs"))
}
