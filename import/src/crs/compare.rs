//! Whether two geographic systems, as words of PROJ strings, put the same numbers at the same place: by trying, at some places around the globe.

use super::{Ground, by_text};
use terrasoar_layout::portable::sin_cos;

/// How far apart two places may be that are called the same.
const SAME_WITHIN_M: f64 = 5.0;
const RADIUS_M: f64 = 6.4e6;

/// Whether a longitude and latitude lies at two places, metres apart. Where one of both shifts by a grid, which is not here, the ellipsoids alone decide.
pub(crate) fn places_differ(a: &str, b: &str) -> bool {
    let Some([a, b]) = grounds([a, b]) else { return false };
    if a.is_shift_lost() != b.is_shift_lost() {
        return a.shape_differs(&b);
    }
    [[0.1, 0.8], [1.5, -0.6], [-1.5, 0.3], [3.0, 0.9]].into_iter().any(|[lon, lat]: [f64; 2]| {
        let at = [lon.to_degrees(), lat.to_degrees()];
        let (Some(a), Some(b)) = (a.world(at), b.world(at)) else { return false };
        let turn = std::f64::consts::TAU;
        let across = (a[0] - b[0] + turn / 2.0).rem_euclid(turn) - turn / 2.0;
        let metres = RADIUS_M * (across * sin_cos(lat).1).abs().max((a[1] - b[1]).abs());
        metres > SAME_WITHIN_M
    })
}

/// Whether the ellipsoids differ by metres.
pub(crate) fn figures_differ(a: &str, b: &str) -> bool {
    grounds([a, b]).is_some_and(|[a, b]| a.shape_differs(&b))
}

fn grounds(words: [&str; 2]) -> Option<[Ground; 2]> {
    let [a, b] = words.map(|words| Ground::new(&by_text(&format!("+proj=longlat {words}"))?));
    Some([a?, b?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_datums_meridians_and_shifts_are_other_places() {
        let wgs84 = "+datum=WGS84";
        for same in ["+ellps=GRS80 +towgs84=0,0,0,0,0,0,0", "+ellps=WGS84", "+datum=NAD83"] {
            assert!(!places_differ(wgs84, same), "{same}");
        }
        for other in [
            "+ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7",
            "+datum=WGS84 +pm=paris",
            "+ellps=GRS80 +towgs84=20,0,0",
        ] {
            assert!(places_differ(wgs84, other), "{other}");
        }
        assert!(figures_differ(wgs84, "+ellps=bessel") && !figures_differ(wgs84, "+ellps=GRS80"));
    }
}
