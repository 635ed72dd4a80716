use super::*;
use crate::crs::System as AnySystem;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{Georeference, MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;

/// The header of a terrain in a system, with the centre of the north-west sample and steps to the east and south.
fn header(crs: &str, samples: [u32; 2], [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> Header {
    let folder = tempfile::tempdir().unwrap();
    let mut dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| f64::from(x + y));
    let system = by_text(crs).unwrap_or_else(AnySystem::unknown);
    let info = dem.info_mut();
    info.georeference = Georeference {
        spacing_m: Some([30.0, 20.0]),
        ..crate::crs::georeference(&system, Some([x, dx, 0.0, y, 0.0, -dy]))
    };
    info.about.crs_text.clone_from(&system.text);
    build(&dem, &folder.path().join("t.iqt"), &BuildOptions::default(), &Silent).unwrap()
}

fn is_near(found: Option<[f64; 2]>, wanted: [f64; 2], tolerance: f64) -> bool {
    found.is_some_and(|found| (0..2).all(|axis| (found[axis] - wanted[axis]).abs() <= tolerance))
}

#[test]
fn own_coordinates_are_arithmetic() {
    let header = header("EPSG:32632", [101, 51], [500_000.0, 5_001_000.0], [10.0, 20.0]);
    let own = Frame::own(&header).unwrap();
    assert_eq!(own.coordinates([0.0, 0.0]), Some([500_000.0, 5_000_000.0]));
    assert_eq!(own.place_m([500_000.0, 5_000_000.0]), Some([0.0, 0.0]));
    // A step of 10 in the system is 30 m here, one of 20 is 20 m.
    assert_eq!(own.place_m([500_015.0, 5_000_030.0]), Some([45.0, 30.0]));
    assert_eq!(own.bounds(), Some([500_000.0, 5_000_000.0, 501_000.0, 5_001_000.0]));
    assert_eq!(own.bounds_deg(), None);
    assert_eq!(own.crs().unwrap().name(), "WGS 84 / UTM zone 32N (EPSG:32632)");
    let same = Frame::of(&header, &Crs::named("EPSG:32632").unwrap()).unwrap();
    assert_eq!(same.place_m([500_015.0, 5_000_030.0]), Some([45.0, 30.0]));
    assert_eq!(same.doubt(), None);
}

/// A part of a site is compared with the whole in the site's own numbers; another site's are others.
#[test]
fn sites_of_one_name_are_one() {
    let at = |crs: &str, corner| header(crs, [11, 11], corner, [10.0; 2]);
    let [whole, part] = [at("local", [100.0, 400.0]), at("local", [150.0, 350.0])];
    let there = Frame::of(&whole, &Crs::of(&part).unwrap()).unwrap();
    assert_eq!(there.coordinates([0.0, 0.0]), Some([100.0, 300.0]));
    let named = |name: &str| format!("LOCAL_CS[\"{name}\",UNIT[\"metre\",1]]");
    let pit = at(&named("pit"), [100.0, 400.0]);
    assert!(Frame::of(&pit, &Crs::of(&at(&named("pit"), [150.0, 350.0])).unwrap()).is_ok());
    for other in [at(&named("dam"), [150.0, 350.0]), at("EPSG:32632", [500_000.0, 5_001_000.0])] {
        assert!(Frame::of(&pit, &Crs::of(&other).unwrap()).is_err());
    }
}

/// Longitudes and latitudes by gdaltransform (PROJ 9.1).
#[test]
fn other_systems_come_to_the_same_places() {
    let header = header("EPSG:32632", [101, 51], [500_000.0, 5_001_000.0], [10.0, 20.0]);
    let world = Frame::wgs84(&header).unwrap();
    assert!(is_near(world.coordinates([0.0, 0.0]), [9.0, 45.153_477_183_356], 1e-10));
    // A sample is met exactly, whatever is rounded on the way.
    assert_eq!(world.place_m([9.0, 45.153_477_183_356]), Some([0.0, 0.0]));
    assert_eq!(world.place_m([369.0, 45.153_477_183_356]), Some([0.0, 0.0]), "a full turn on");
    let [west, south, east, north] = world.bounds_deg().unwrap();
    assert!((west - 9.0).abs() < 1e-9 && east > 9.012 && east < 9.013, "{west} {east}");
    assert!((south - 45.153_477).abs() < 1e-5 && (north - 45.162_477).abs() < 2e-5, "{south} {north}");
    // Into feet: the unit is the system's own.
    let feet = Crs::named("+proj=utm +zone=32 +datum=WGS84 +units=us-ft").unwrap();
    let feet = Frame::of(&header, &feet).unwrap();
    let foot = 1200.0 / 3937.0;
    assert!(is_near(feet.coordinates([0.0, 0.0]), [500_000.0 / foot, 5_000_000.0 / foot], 1e-3));
    assert!(is_near(feet.place_m([500_015.0 / foot, 5_000_030.0 / foot]), [45.0, 30.0], 1e-4));
}

#[test]
fn longitudes_are_taken_with_any_turn() {
    let to_360 = header("EPSG:4326", [360, 181], [0.0, 90.0], [1.0, 1.0]);
    let (own, world) = (Frame::own(&to_360).unwrap(), Frame::wgs84(&to_360).unwrap());
    for frame in [&own, &world] {
        assert_eq!(frame.place_m([-74.0, 40.0]), Some([286.0 * 30.0, 130.0 * 20.0]));
        assert_eq!(frame.place_m([286.0, 40.0]), Some([286.0 * 30.0, 130.0 * 20.0]));
    }
    assert_eq!(own.coordinates([286.0 * 30.0, 0.0]), Some([286.0, -90.0]));
    assert_eq!(world.coordinates([286.0 * 30.0, 0.0]), Some([-74.0, -90.0]));
    assert_eq!(world.bounds_deg(), Some([0.0, -90.0, -1.0, 90.0]), "to the east of 0 until 1 west");
    let across = header("EPSG:4326", [21, 11], [175.0, 5.0], [0.5, 1.0]);
    let world = Frame::wgs84(&across).unwrap();
    assert_eq!(world.bounds_deg(), Some([175.0, -5.0, -175.0, 5.0]));
    assert_eq!(world.place_m([-175.0, 0.0]), Some([600.0, 100.0]));
    assert_eq!(world.place_m([185.0, 0.0]), Some([600.0, 100.0]));
}

/// The web's map ends at 180 degrees, and a terrain on it may go on.
#[test]
fn places_beyond_the_seam_of_a_map_are_found() {
    const HALF: f64 = 20_037_508.342_789_244;
    let across = header("EPSG:3857", [21, 11], [HALF - 10_000.0, 5_000.0], [1000.0, 1000.0]);
    let (own, world) = (Frame::own(&across).unwrap(), Frame::wgs84(&across).unwrap());
    // 5 km of the map beyond it.
    let lon = -180.0 + 5_000.0 / HALF * 180.0;
    let place = world.place_m([lon, 0.0]);
    assert!(is_near(place, [450.0, 100.0], 1e-6), "{place:?}");
    assert!(is_near(world.coordinates([450.0, 100.0]), [lon, 0.0], 1e-9));
    assert_eq!(own.place_m([5_000.0 - HALF, 0.0]).map(|at| at.map(f64::round)), Some([450.0, 100.0]));
    let [west, _, east, _] = world.bounds_deg().unwrap();
    assert!((west - 179.910_169).abs() < 1e-5 && (east + 179.910_169).abs() < 1e-5, "{west} {east}");
}

/// A square around the South Pole has every longitude.
#[test]
fn around_a_pole_there_are_all_longitudes() {
    let polar = header("EPSG:3031", [101, 101], [-500_000.0, 500_000.0], [10_000.0, 10_000.0]);
    let [west, south, east, north] = Frame::wgs84(&polar).unwrap().bounds_deg().unwrap();
    assert_eq!([west, south, east], [-180.0, -90.0, 180.0]);
    // The corners are 707 km off the pole on the map, of which the scale there is 0.9728.
    assert!((-83.6..-83.4).contains(&north), "{north}");
}

#[test]
fn what_cannot_be_known_is_said() {
    let said = |header: &Header, crs: &str| {
        Frame::of(header, &Crs::named(crs).unwrap()).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let unplaced = Header { sample_to_crs: None, ..header("EPSG:32632", [9, 9], [0.0; 2], [1.0; 2]) };
    assert!(Frame::own(&unplaced).is_none() && Frame::wgs84(&unplaced).is_none());
    assert!(said(&unplaced, "EPSG:4326").contains("does not know where"));
    let nameless = header("", [9, 9], [0.0; 2], [1.0; 2]);
    assert!(Frame::own(&nameless).is_some() && Frame::wgs84(&nameless).is_none());
    assert!(said(&nameless, "EPSG:4326").contains("does not know its reference system"));
    let local = header("LOCAL_CS[\"dig\",UNIT[\"metre\",1]]", [9, 9], [0.0; 2], [1.0; 2]);
    assert!(said(&local, "EPSG:4326").contains("dig"));
    let moon = header("+proj=longlat +R=1737400 +no_defs", [9, 9], [0.0; 2], [1.0; 2]);
    assert!(said(&moon, "EPSG:4326").contains("another body"));
    assert!(Frame::wgs84(&moon).is_none());
    assert!(Crs::named("EPSG:1").unwrap_err().to_string().contains("EPSG:1"));
    assert!(Crs::named("local").unwrap_err().to_string().contains("no place on the ground"));
    // Where projections end: an answer or none, and no panic.
    let utm = header("EPSG:32632", [9, 9], [500_000.0, 5_000_000.0], [10.0; 2]);
    let world = Frame::wgs84(&utm).unwrap();
    for wild in [[1e300, 1e300], [f64::NAN, 0.0], [-171.0, 0.0], [9.0, 90.0], [9.0, 400.0]] {
        let found = world.place_m(wild);
        assert!(found.is_none_or(|m| m.iter().all(|m| m.is_finite())), "{wild:?}: {found:?}");
    }
}

/// A text from the registry leads to the same axes and the same projection as its code, so that a file that keeps the text is where the one with the code was.
#[test]
fn texts_and_codes_of_the_registry_agree() {
    let mut seen = 0;
    for code in 2000..=32_800u32 {
        let Some(by_code) = by_text(&format!("EPSG:{code}")) else { continue };
        let Some(again) = by_text(&by_code.text) else { continue };
        seen += 1;
        assert_eq!(again.signs, by_code.signs, "EPSG:{code}");
        let size = |system: &AnySystem| system.unit.as_ref().map(|unit| unit.size);
        assert_eq!(size(&again), size(&by_code), "EPSG:{code}");
    }
    assert!(seen > 5000, "{seen}");
}

/// A system that the registry gives by its parts keeps its code and name in a terrain file, and a note about datums is made where they differ alone.
#[test]
fn systems_of_parts_keep_their_code() {
    let file = header("EPSG:21226", [9, 9], [26_250_000.0, 6_000_000.0], [10.0; 2]);
    assert_eq!(Crs::of(&file).unwrap().name(), "GSK-2011 / GSK 3GK zone 26 (EPSG:21226)");
    let old = header("EPSG:26714", [9, 9], [500_000.0, 5_000_000.0], [10.0; 2]);
    let is_rough = |crs: &str| Frame::of(&old, &Crs::named(crs).unwrap()).unwrap().doubt().is_some();
    assert!(is_rough("EPSG:4326") && !is_rough("EPSG:4267") && !is_rough("EPSG:26714"));
}
