//! Metres between samples: from the DEM's unit of length, from degrees at its centre latitude, from the user, or assumed.

use crate::dem::{DemInfo, Georeference, HorizontalUnit};
use crate::error::LayoutError;
use crate::file::header::SpacingOrigin;
use crate::portable::{hypot, sin_cos};
use crate::remedy::Remedy;
use crate::words::number;

/// Equatorial radius of WGS 84, metres.
const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// First eccentricity squared of WGS 84.
const EARTH_ECCENTRICITY_2: f64 = 0.006_694_379_990_14;

/// Spacing in metres east and north, and where it came from.
pub(super) fn resolve(
    info: &DemInfo,
    stated: Option<[f64; 2]>,
) -> Result<([f64; 2], SpacingOrigin), LayoutError> {
    if let Some(spacing) = stated {
        return Ok((spacing, SpacingOrigin::User));
    }
    let reference = &info.georeference;
    if let Some(spacing) = reference.spacing_m {
        let origin = reference
            .centre_latitude_deg
            .map(|centre_latitude_deg| SpacingOrigin::Degrees { centre_latitude_deg });
        return Ok((spacing, origin.unwrap_or(SpacingOrigin::Dem)));
    }
    let Some(map) = reference.pixel_to_crs else { return Ok(([1.0; 2], SpacingOrigin::Assumed)) };
    let step = [hypot(map[1], map[4]), hypot(map[2], map[5])];
    let metres = |unit_m: f64| Ok((step.map(|s| s * unit_m), SpacingOrigin::Dem));
    let unit = match reference.unit {
        HorizontalUnit::Unknown if looks_like_degrees(info, &map) => HorizontalUnit::Degree,
        unit => unit,
    };
    match unit {
        HorizontalUnit::Unknown | HorizontalUnit::Metre => metres(1.0),
        HorizontalUnit::Foot => metres(0.3048),
        HorizontalUnit::UsSurveyFoot => metres(1200.0 / 3937.0),
        HorizontalUnit::Degree => {
            let col = f64::from(info.samples_wide - 1) / 2.0;
            let row = f64::from(info.samples_high - 1) / 2.0;
            let latitude = map[3] + map[4] * col + map[5] * row;
            if latitude.is_nan() || latitude.abs() >= 89.9 {
                return Err(LayoutError::Usage(format!(
                    "the elevation model is in degrees and its centre lies at latitude {}, where degrees have no \
                     useful length; state the spacing in metres, or reproject the model",
                    number(latitude)
                ))
                .mended_by(Remedy::Spacing));
            }
            let [lon_m, lat_m] = degree_m(latitude, reference);
            let spacing = [hypot(map[1] * lon_m, map[4] * lat_m), hypot(map[2] * lon_m, map[5] * lat_m)];
            Ok((spacing, SpacingOrigin::Degrees { centre_latitude_deg: latitude }))
        }
    }
}

/// Whether coordinates of unknown unit are degrees: they lie on the globe, and their steps would be centimetres if they were metres.
fn looks_like_degrees(info: &DemInfo, map: &[f64; 6]) -> bool {
    let corners = [0, info.samples_wide - 1]
        .into_iter()
        .flat_map(|col| [0, info.samples_high - 1].map(|row| (f64::from(col), f64::from(row))));
    let on_globe = corners.into_iter().all(|(col, row)| {
        (-181.0..=361.0).contains(&(map[0] + map[1] * col + map[2] * row))
            && (-91.0..=91.0).contains(&(map[3] + map[4] * col + map[5] * row))
    });
    on_globe && hypot(map[1], map[4]).max(hypot(map[2], map[5])) <= 0.05
}

/// Metres a degree of longitude and of latitude: on the WGS 84 ellipsoid, or on a sphere of the body's radius.
fn degree_m(latitude_deg: f64, reference: &Georeference) -> [f64; 2] {
    let (sin, cos) = sin_cos(latitude_deg.to_radians());
    let degree = 1f64.to_radians();
    match reference.body_radius_m {
        // Every ellipsoid of the Earth is within a fraction of a percent of WGS 84.
        Some(radius) if !(6.3e6..6.45e6).contains(&radius) => [degree * radius * cos, degree * radius],
        _ => {
            let w = 1.0 - EARTH_ECCENTRICITY_2 * sin * sin;
            [
                degree * EARTH_RADIUS_M * cos / w.sqrt(),
                degree * EARTH_RADIUS_M * (1.0 - EARTH_ECCENTRICITY_2) / (w * w.sqrt()),
            ]
        }
    }
}

/// The affine map from samples counted east and north of the south-west sample to the reference system.
pub(super) fn sample_to_crs(info: &DemInfo) -> Option<[f64; 6]> {
    let m = info.georeference.pixel_to_crs?;
    let last_row = f64::from(info.samples_high - 1);
    Some([m[0] + m[2] * last_row, m[1], -m[2], m[3] + m[5] * last_row, m[4], -m[5]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::SampleType;

    fn info(unit: HorizontalUnit, map: [f64; 6]) -> DemInfo {
        DemInfo {
            samples_wide: 11,
            samples_high: 21,
            sample_type: SampleType::I16,
            height_scale: 1.0,
            height_offset_m: 0.0,
            georeference: Georeference { unit, pixel_to_crs: Some(map), ..Default::default() },
            format: String::new(),
            about: Default::default(),
        }
    }

    #[test]
    fn degrees_become_metres_at_the_centre_latitude() {
        // Rows step south by 0.1 degrees from 46 N: the centre row lies at 45 N.
        let map = [10.0, 0.1, 0.0, 46.0, 0.0, -0.1];
        let (spacing, origin) = resolve(&info(HorizontalUnit::Degree, map), None).unwrap();
        assert_eq!(origin, SpacingOrigin::Degrees { centre_latitude_deg: 45.0 });
        assert!((spacing[0] - 7_884.68).abs() < 0.1, "{spacing:?}");
        assert!((spacing[1] - 11_113.18).abs() < 0.1, "{spacing:?}");
    }

    #[test]
    fn a_stated_spacing_wins_and_an_unknown_one_is_assumed() {
        let degrees = info(HorizontalUnit::Degree, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
        assert_eq!(resolve(&degrees, Some([30.0, 31.0])).unwrap(), ([30.0, 31.0], SpacingOrigin::User));
        let mut nothing = degrees.clone();
        nothing.georeference.pixel_to_crs = None;
        assert_eq!(resolve(&nothing, None).unwrap(), ([1.0; 2], SpacingOrigin::Assumed));
        let mut pole = degrees;
        pole.georeference.pixel_to_crs = Some([0.0, 1.0, 0.0, 100.0, 0.0, -1.0]);
        assert!(resolve(&pole, None).is_err());
    }

    #[test]
    fn unknown_units_are_degrees_only_where_nothing_else_makes_sense() {
        let tiny = [86.0, 0.004, 0.0, 60.0, 0.0, -0.004];
        let origin = |map| resolve(&info(HorizontalUnit::Unknown, map), None).unwrap().1;
        assert!(matches!(origin(tiny), SpacingOrigin::Degrees { .. }));
        assert_eq!(origin([86.0, 4.0, 0.0, 60.0, 0.0, -4.0]), SpacingOrigin::Dem);
        assert_eq!(origin([500_000.0, 0.01, 0.0, 60.0, 0.0, -0.01]), SpacingOrigin::Dem);
    }

    #[test]
    fn rows_are_counted_from_the_south_in_the_file() {
        let m = sample_to_crs(&info(HorizontalUnit::Metre, [500.0, 10.0, 0.0, 900.0, 0.0, -20.0])).unwrap();
        assert_eq!(m, [500.0, 10.0, -0.0, 500.0, 0.0, 20.0]);
    }
}
