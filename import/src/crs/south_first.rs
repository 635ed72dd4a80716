//! Systems whose first number counts to the south and whose second counts to the west, as Krovak's of old.
//!
//! Columns of a grid in such a system go along its first number and rows along its second, as GDAL has it, so that they cross. Such a grid is taken into the same map with eastings and
//! northings, which is exact: easting is less the second number, northing less the first.

use super::resolve::by_code;
use super::{System, from_proj};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::words::harmless;

/// Codes of maps that count to the south and west, and of the same maps that count to the east and north.
const SIBLINGS: [(u32, u32); 5] = [(5513, 5514), (2065, 5221), (5515, 5516), (5224, 5225), (8352, 8353)];

/// A place as easting and northing, or back.
pub(super) fn crossed([south, west]: [f64; 2]) -> [f64; 2] {
    [-west, -south]
}

/// The system with eastings and northings in place of one that counts to the south first, and the grid's `map` in it. Says what was done.
pub(crate) fn turned(system: &mut System, map: Option<&mut [f64; 6]>) -> Option<Warning> {
    if !system.is_south_first {
        return None;
    }
    let name = harmless(&system.name, 80);
    *system = east_north(system);
    if let Some(map) = map {
        let [x, dx, ex, y, dy, ey] = *map;
        *map = [-y, -dy, -ey, -x, -dx, -ex];
    }
    Some(Warning::new(format!(
        "{name} counts to the south first and to the west second; so columns go by its southings and rows by its westings, as in GDAL, and the grid was turned to the eastings and northings of {}; if the file has westings first, name that system instead",
        match system.code {
            Some(code) => format!("EPSG:{code}"),
            None => "the same map".to_owned(),
        }
    )))
}

/// The same map with eastings and northings.
pub(crate) fn east_north(system: &System) -> System {
    let sibling = system.code.and_then(|code| SIBLINGS.iter().find(|(south, _)| *south == code));
    if let Some(mut found) = sibling.and_then(|(_, code)| by_code(*code)) {
        found.vertical.clone_from(&system.vertical);
        found.by.clone_from(&system.by);
        return found;
    }
    let words = |proj: &String| {
        let kept: Vec<&str> =
            proj.split_whitespace().filter(|word| from_proj::word(word, "axis").is_none()).collect();
        kept.join(" ")
    };
    let proj = system.proj.as_ref().map(words);
    System {
        code: None,
        name: format!("{} with eastings and northings", system.name).trim().to_owned(),
        text: proj.clone().unwrap_or_default(),
        proj,
        signs: [1.0; 2],
        is_south_first: false,
        ..system.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::super::resolve::by_text;
    use super::*;
    use crate::crs::Ground;

    /// Places by gdaltransform, which takes southings first; by another shift of the datum in the second, by a metre.
    #[test]
    fn grids_that_count_south_first_are_turned_and_lie_where_gdal_has_them() {
        for (code, at, [lon, lat], tolerance_deg) in [
            (5513, [1_144_001.885_955_7, 544_004.743_502_93], [17.325, 49.395], 1e-7),
            (2065, [1_144_001.885_955_7, 544_004.743_502_93], [17.325, 49.395], 2e-5),
            (8352, [1_238_665.023_480_96, 377_603.613_222_99], [19.7, 48.67], 1e-6),
        ] {
            let mut system = by_text(&format!("EPSG:{code}")).unwrap();
            let ground = Ground::new(&system).unwrap();
            let is = |found: [f64; 2]| {
                let [x, y] = found.map(f64::to_degrees);
                assert!(
                    (x - lon).abs() < tolerance_deg && (y - lat).abs() < tolerance_deg,
                    "{code}: {x} {y}"
                );
            };
            is(ground.world(at).unwrap());
            let mut map = [at[0], 10.0, 0.0, at[1], 0.0, -20.0];
            let words = turned(&mut system, Some(&mut map)).unwrap().words;
            assert!(words.contains("southings") && !system.is_south_first, "{words}");
            is(Ground::new(&system).unwrap().world([map[0], map[3]]).unwrap());
            // A column leads to the south, a row of falling westings to the east.
            assert_eq!([map[1], map[2], map[4], map[5]], [0.0, 20.0, -10.0, 0.0]);
            assert!(turned(&mut system, None).is_none());
        }
    }

    #[test]
    fn maps_without_a_sibling_keep_their_projection() {
        for text in ["EPSG:8044", "+proj=krovak +axis=swu +lat_0=49.5 +lon_0=24.8333333333333 +ellps=bessel"]
        {
            let old = by_text(text).unwrap();
            let mut new = old.clone();
            assert!(turned(&mut new, None).is_some(), "{text}");
            let at = [-100_000.0, -20_000.0];
            let [a, b] =
                [(&old, at), (&new, crossed(at))].map(|(system, at)| Ground::new(system).unwrap().world(at));
            assert_eq!(a, b, "{text}");
            assert_eq!(new.code, None);
            assert!(!by_text(&new.text).unwrap().is_south_first, "{text}");
        }
    }
}
