use super::super::resolve::by_text;
use super::*;

fn ground(text: &str) -> Ground {
    Ground::new(&by_text(text).unwrap()).unwrap_or_else(|| panic!("{text}"))
}

/// Positions by gdaltransform (PROJ 9.1): x, y, longitude, latitude in degrees. Datums are shifted by few parameters here and by grids there, hence some metres.
#[test]
fn places_are_those_of_proj() {
    for (system, [x, y], [lon, lat], tolerance_deg) in [
        ("EPSG:32632", [500_000.0, 5_000_000.0], [9.0, 45.153_477_183_356], 1e-9),
        ("EPSG:3857", [1_200_000.0, 8_400_047.889_818], [10.779_783_409_434_3, 60.001_392_359_384_9], 1e-9),
        ("EPSG:2263", [980_000.0, 200_000.0], [-74.015_331_015_319_3, 40.715_629_477_243_7], 1e-8),
        ("EPSG:3035", [4_321_000.0, 3_210_000.0], [10.0, 52.0], 1e-9),
        ("EPSG:3031", [1_000_000.0, 500_000.0], [63.434_948_822_922, -79.736_420_851_25], 1e-9),
        ("EPSG:2193", [1_600_000.0, 5_400_000.0], [173.0, -41.551_664_523_452_8], 1e-9),
        ("EPSG:2154", [700_000.0, 6_600_000.0], [3.0, 46.5], 1e-9),
        ("EPSG:5070", [100_000.0, 1_500_000.0], [-94.872_589_251_067_4, 36.541_672_730_115_9], 1e-8),
        ("EPSG:2046", [50_000.0, 3_000_000.0], [14.495_755_477_362_1, -27.110_730_617_771_7], 1e-8),
        ("EPSG:4807", [2.0, 50.0], [4.136_623_906_269_87, 44.999_984_761_451_1], 1e-5),
        ("EPSG:21781", [600_000.0, 200_000.0], [7.438_632_420_871_81, 46.951_082_771_871_1], 1e-5),
        ("EPSG:27700", [400_000.0, 300_000.0], [-2.001_433_115_510_89, 52.597_792_430_833_8], 1e-4),
        ("EPSG:28992", [155_000.0, 463_000.0], [5.387_203_508_413_77, 52.155_172_301_192_2], 1e-4),
        ("EPSG:26710", [565_000.0, 4_756_000.0], [-122.204_252_342_292, 42.955_620_123_025_6], 2e-3),
        ("+proj=utm +zone=32 +datum=WGS84 +units=km", [500.0, 5000.0], [9.0, 45.153_477_183_356], 1e-9),
    ] {
        let ground = ground(system);
        let found = ground.world([x, y]).unwrap().map(f64::to_degrees);
        let away = (found[0] - lon).abs().max((found[1] - lat).abs());
        assert!(away <= tolerance_deg, "{system}: {found:?} is {away} from {lon}, {lat}");
        let back = ground.of_world(found.map(f64::to_radians)).unwrap();
        let [dx, dy] = [back[0] - x, back[1] - y];
        assert!(dx.hypot(dy) < 1e-4 * x.abs().max(1.0), "{system}: {back:?}");
    }
}

/// Shifts that a system carries in WKT 2 or 1 are made; those of grids, which are not here, are told. Positions by gdaltransform (GDAL 3.10).
#[test]
fn shifts_of_bound_systems_are_made_or_told() {
    let base = "PROJCRS[\"a\",BASEGEOGCRS[\"b\",DATUM[\"c\",ELLIPSOID[\"Bessel 1841\",6377397.155,299.1528128]],PRIMEM[\"Greenwich\",0]],\
        CONVERSION[\"d\",METHOD[\"Transverse Mercator\",ID[\"EPSG\",9807]],PARAMETER[\"Latitude of natural origin\",0,ANGLEUNIT[\"degree\",0.0174532925199433],ID[\"EPSG\",8801]],\
        PARAMETER[\"Longitude of natural origin\",9,ANGLEUNIT[\"degree\",0.0174532925199433],ID[\"EPSG\",8802]],PARAMETER[\"Scale factor at natural origin\",1,SCALEUNIT[\"unity\",1],ID[\"EPSG\",8805]],\
        PARAMETER[\"False easting\",3500000,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8806]],PARAMETER[\"False northing\",0,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8807]]],\
        CS[Cartesian,2],AXIS[\"E\",east,ORDER[1],LENGTHUNIT[\"metre\",1]],AXIS[\"N\",north,ORDER[2],LENGTHUNIT[\"metre\",1]]]";
    let bound = |transformation: &str| {
        let target = "TARGETCRS[GEOGCRS[\"WGS 84\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563]],\
            CS[ellipsoidal,2],AXIS[\"lat\",north],AXIS[\"lon\",east],ANGLEUNIT[\"degree\",0.0174532925199433]]]";
        ground(&format!(
            "BOUNDCRS[SOURCECRS[{base}],{target},ABRIDGEDTRANSFORMATION[\"t\",{transformation}]]"
        ))
    };
    let parameters = |method: &str, turn: f64| {
        let values = [598.1, 73.7, 418.2, 0.202 * turn, 0.045 * turn, -2.455 * turn, 1.000_006_7];
        let all = values
            .iter()
            .zip(8605..)
            .map(|(value, code)| format!("PARAMETER[\"p\",{value},ID[\"EPSG\",{code}]]"));
        format!("METHOD[\"{method}\"],{}", all.collect::<Vec<_>>().join(","))
    };
    let at = [3_515_000.0, 5_540_000.0];
    let is = |ground: &Ground, [lon, lat]: [f64; 2]| {
        let found = ground.world(at).unwrap().map(f64::to_degrees);
        assert!((found[0] - lon).abs() < 1e-8 && (found[1] - lat).abs() < 1e-8, "{found:?}");
    };
    let shifted = [9.208_161_151_436_43, 49.996_152_069_197_9];
    for (method, turn) in [
        ("Position Vector transformation (geog2D domain)", 1.0),
        ("Coordinate Frame rotation (geog2D domain)", -1.0),
    ] {
        let ground = bound(&parameters(method, turn));
        is(&ground, shifted);
        assert!(!ground.is_shift_lost());
    }
    let grid =
        bound("METHOD[\"NTv2\"],PARAMETERFILE[\"Latitude and longitude difference file\",\"BETA2007.gsb\"]");
    assert!(
        grid.is_shift_lost()
            && grid.doubt(&ground("EPSG:4326"), &[]).is_some()
            && grid.doubt(&grid, &[]).is_none()
    );
    let in_one = ground(
        "GEOGCS[\"a\",DATUM[\"b\",SPHEROID[\"Bessel 1841\",6377397.155,299.1528128],EXTENSION[\"PROJ4_GRIDS\",\"BETA2007.gsb\"]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]",
    );
    assert!(in_one.is_shift_lost() && in_one.doubt(&grid, &[]).is_none());
    assert!(ground("EPSG:4267").doubt(&ground("EPSG:4326"), &[]).is_some());
    assert!(ground("EPSG:26714").doubt(&ground("EPSG:4267"), &[]).is_none());
}

/// Miller's map is drawn on the sphere of the ellipsoid's area, and latitudes stay the ellipsoid's. Positions by gdaltransform.
#[test]
fn spheres_of_equal_area_shift_no_datum() {
    for text in [
        "+proj=mill +R_A +lon_0=3 +datum=WGS84",
        "PROJCS[\"a\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],\
         PROJECTION[\"Miller_Cylindrical\"],PARAMETER[\"latitude_of_center\",0],PARAMETER[\"longitude_of_center\",3],PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
    ] {
        let [lon, lat] = ground(text).world([15_000.0, 15_000.0]).unwrap().map(f64::to_degrees);
        let away = (lon - 3.134_898_088_837_22).abs().max((lat - 0.134_898_009_074_42).abs());
        assert!(away < 1e-8, "{text}: {lon} {lat}");
    }
}

/// Once around leads to the same place, and what lies beyond the seam of a map is where it is.
#[test]
fn maps_go_round_where_longitudes_do() {
    for (system, turn) in [
        ("EPSG:4326", Some(360.0)),
        ("EPSG:3857", Some(40_075_016.685_578_49)),
        ("+proj=merc +lat_ts=41 +lon_0=150 +x_0=1000000 +datum=WGS84 +units=km", Some(30_288.666_64)),
        ("EPSG:32632", None),
        ("EPSG:3035", None),
    ] {
        let ground = ground(system);
        let found = ground.turn();
        assert!(found.zip(turn).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-8), "{system}: {found:?}");
        assert_eq!(found.is_some(), turn.is_some(), "{system}");
        let Some(turn) = found else { continue };
        let [x, y] = ground.of_world([3.0, 0.3]).unwrap();
        for turns in [-1.0, 0.0, 1.0] {
            let [lon, lat] = ground.world([x + turns * turn, y]).unwrap();
            let away = (lon - 3.0).rem_euclid(std::f64::consts::TAU);
            let away = away.min(std::f64::consts::TAU - away);
            assert!(away < 1e-9 && (lat - 0.3).abs() < 1e-9, "{system}: {lon} {lat} after {turns} turns");
        }
    }
}

#[test]
fn steps_are_as_long_as_on_the_ground() {
    let mercator = ground("EPSG:3857");
    let ([east, north], latitude) =
        mercator.steps_m([1_200_000.0, 8_399_737.889_818], [[20.0, 0.0], [0.0, -20.0]]).unwrap();
    // 20 cos 60 on the sphere by whose formulas the map is drawn, times the ellipsoid's radii over the sphere's: N and M of
    // latitude 60 are 6,394,209.17 and 6,383,453.86 m.
    assert!((latitude.to_degrees() - 60.0).abs() < 1e-6, "{latitude}");
    let [wanted_east, wanted_north] = [6_394_209.17, 6_383_453.86].map(|radius| 10.0 * radius / 6_378_137.0);
    assert!((east - wanted_east).abs() < 1e-6, "{east} {wanted_east}");
    assert!((north - wanted_north).abs() < 1e-6, "{north} {wanted_north}");
    for same in ["EPSG:900913", "+proj=webmerc +datum=WGS84", "EPSG:3785"] {
        let steps =
            ground(same).steps_m([1_200_000.0, 8_399_737.889_818], [[20.0, 0.0], [0.0, -20.0]]).unwrap();
        assert_eq!(steps.0.map(|m| (m * 1e6).round()), [east, north].map(|m| (m * 1e6).round()), "{same}");
    }
    let utm = ground("EPSG:32632");
    let ([east, north], _) = utm.steps_m([500_000.0, 5_000_000.0], [[10.0, 0.0], [0.0, -10.0]]).unwrap();
    assert!((east - 10.004).abs() < 1e-4 && (north - 10.004).abs() < 1e-4, "{east} {north}");
}

/// The registry has other parameters for one datum in different countries, and none for some. Between a map and the longitudes and latitudes that it is made of, nothing is shifted.
/// Positions by PROJ 9.5.
#[test]
fn systems_of_one_datum_are_not_shifted() {
    for (map, degrees, at, [lon, lat]) in [
        ("EPSG:3844", "EPSG:4179", [500_000.0, 400_000.0], [25.0, 45.100_063_284_297_3]),
        ("EPSG:8686", "EPSG:3906", [500_000.0, 100_000.0], [15.0, 0.904_545_877_638_88]),
        ("EPSG:9821", "EPSG:5561", [300_000.0, 5_600_000.0], [30.5, 50.530_902_719_715_23]),
        ("EPSG:3396", "EPSG:4746", [3_500_000.0, 5_600_000.0], [9.0, 50.536_950_235_857_52]),
        // A false easting in chains; a map on the sphere of an ellipsoid's area.
        ("EPSG:3167", "EPSG:4751", [20_000.0, 22_000.0], [101.614_796_582_827_24, 3.999_923_828_378_03]),
        ("EPSG:9311", "EPSG:4267", [300_000.0, -400_000.0], [-96.406_796_279_559_43, 41.343_206_445_700_2]),
    ] {
        let [map_ground, degree_ground] = [map, degrees].map(ground);
        let found = map_ground.across_to(&degree_ground, at).unwrap();
        let away = (found[0] - lon).abs().max((found[1] - lat).abs());
        assert!(away < 1e-8, "{map}: {found:?} is {away} from {lon}, {lat}");
        let back = degree_ground.across_to(&map_ground, found).unwrap();
        assert!((0..2).all(|axis| (back[axis] - at[axis]).abs() < 1e-3), "{map}: {back:?}");
    }
}

/// A datum whose shift to that of WGS 84 nobody states is told: in Saxony it is 130 m, in Anguilla 370.
#[test]
fn shifts_that_are_not_known_are_told() {
    let world = ground("EPSG:4326");
    for untied in ["EPSG:3396", "EPSG:3398", "EPSG:2000", "EPSG:4267", "+proj=utm +zone=32 +ellps=intl"] {
        assert!(
            ground(untied).doubt(&world, &[]).is_some() && world.doubt(&ground(untied), &[]).is_some(),
            "{untied}"
        );
    }
    for (a, b) in [
        ("EPSG:3396", "EPSG:4746"),
        ("EPSG:9821", "EPSG:5561"),
        ("EPSG:26714", "EPSG:4267"),
        ("+proj=utm +zone=32 +ellps=intl", "+proj=longlat +ellps=intl"),
    ] {
        assert!(ground(a).doubt(&ground(b), &[]).is_none(), "{a} {b}");
    }
    for tied in [
        "EPSG:32632",
        "EPSG:31467",
        "EPSG:5681",
        "EPSG:2097",
        "EPSG:9821",
        "EPSG:6318",
        "EPSG:3857",
        "EPSG:2154",
        "+proj=longlat +R=6371229",
    ] {
        assert!(ground(tied).doubt(&world, &[]).is_none(), "{tied}");
    }
}

/// GDAL's texts of South Africa's grids leave out that they count to the west and south, ESRI's of Krovak's say it by parameters. Positions by PROJ 9.5.
#[test]
fn axes_that_a_text_leaves_out_are_those_of_its_projection() {
    let base = |datum: &str, spheroid: &str| {
        format!(
            "GEOGCS[\"b\",DATUM[\"{datum}\",SPHEROID[\"s\",{spheroid}]],PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]]"
        )
    };
    let south = |base: &str, middle: &str, rest: &str| {
        format!(
            "PROJCS[\"Lo\",{base},PROJECTION[\"Transverse_Mercator_South_Orientated\"],PARAMETER[\"latitude_of_origin\",0.0],PARAMETER[\"central_meridian\",{middle}],\
             PARAMETER[\"scale_factor\",1.0],PARAMETER[\"false_easting\",0.0],PARAMETER[\"false_northing\",0.0],UNIT[\"Meter\",1.0]{rest}]"
        )
    };
    let hartebeesthoek = base("D_Hartebeesthoek_1994", "6378137.0,298.257223563");
    let cape = base("D_Cape", "6378249.145,293.4663077");
    for (text, [lon, lat]) in [
        (south(&hartebeesthoek, "15.0", ""), [14.495_755_477_362_1, -27.110_730_617_771_7]),
        (
            south(&hartebeesthoek, "15.0", ",AUTHORITY[\"EPSG\",\"2046\"]"),
            [14.495_755_477_362_1, -27.110_730_617_771_7],
        ),
        (south(&cape, "21.0", ""), [20.495_760_288_669_8, -27.112_911_792_448_4]),
    ] {
        let found = ground(&text).own([50_000.0, 3_000_000.0]).unwrap().map(f64::to_degrees);
        assert!((found[0] - lon).abs() < 1e-8 && (found[1] - lat).abs() < 1e-8, "{text}: {found:?}");
    }
    let krovak = |turned: &str| {
        by_text(&format!(
            "PROJCS[\"k\",{},PROJECTION[\"Krovak\"],PARAMETER[\"False_Easting\",0.0],PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Pseudo_Standard_Parallel_1\",78.5],\
             PARAMETER[\"Scale_Factor\",0.9999],PARAMETER[\"Azimuth\",30.28813975277778],PARAMETER[\"Longitude_Of_Center\",24.83333333333333],PARAMETER[\"Latitude_Of_Center\",49.5],\
             {turned},UNIT[\"Meter\",1.0]]",
            base("D_S_JTSK", "6377397.155,299.1528128")
        ))
        .unwrap()
    };
    let east = krovak(
        "PARAMETER[\"X_Scale\",-1.0],PARAMETER[\"Y_Scale\",1.0],PARAMETER[\"XY_Plane_Rotation\",90.0]",
    );
    assert!(east.signs == [1.0; 2] && !east.is_south_first);
    let south =
        krovak("PARAMETER[\"X_Scale\",1.0],PARAMETER[\"Y_Scale\",1.0],PARAMETER[\"XY_Plane_Rotation\",0.0]");
    assert!(south.signs == [-1.0; 2] && south.is_south_first);
    assert!(by_text("EPSG:5513").unwrap().is_south_first && !by_text("EPSG:2046").unwrap().is_south_first);
}

/// ESRI scales maps of two standard parallels. Position by PROJ 9.5.
#[test]
fn scales_of_conic_maps_count() {
    let michigan = "PROJCS[\"NAD27_Michigan_Central\",GEOGCS[\"GCS_North_American_1927\",DATUM[\"D_North_American_1927\",SPHEROID[\"Clarke_1866\",6378206.4,294.978698213898]],\
        PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Lambert_Conformal_Conic\"],PARAMETER[\"False_Easting\",2000000.0],PARAMETER[\"False_Northing\",0.0],\
        PARAMETER[\"Central_Meridian\",-84.3333333333333],PARAMETER[\"Standard_Parallel_1\",44.1833333333333],PARAMETER[\"Standard_Parallel_2\",45.7],PARAMETER[\"Scale_Factor\",1.0000382],\
        PARAMETER[\"Latitude_Of_Origin\",43.3166666666667],UNIT[\"US survey foot\",0.304800609601219]]";
    let found = ground(michigan).own([2_100_000.0, 500_000.0]).unwrap().map(f64::to_degrees);
    assert!(
        (found[0] + 83.948_839_506_58).abs() < 1e-8 && (found[1] - 44.687_470_243_166_8).abs() < 1e-8,
        "{found:?}"
    );
}

/// Orthographic maps of the ellipsoid, against PROJ, wherever they are centred.
#[test]
fn orthographic_maps_of_an_ellipsoid_are_its_own() {
    let near_and_far = [[15_000.0, 15_000.0], [1_500_000.0, -1_000_000.0]];
    for (centre_deg, places) in [
        (0.0, [[3.134_747_791_980_31, 0.135_655_545_752_89], [16.776_998_074_247_3, -9.080_911_186_129_49]]),
        (20.0, [[3.143_462_165_034_66, 20.135_437_178_455_3], [16.830_256_798_300_4, 10.354_926_822_499_9]]),
        (46.0, [[3.194_112_328_786_33, 46.134_785_251_972_4], [19.772_017_130_138_8, 35.504_057_723_102_4]]),
        (80.0, [[3.783_832_124_967_83, 80.133_431_090_069_8], [39.180_612_683_481_9, 66.593_109_101_184_9]]),
        (-30.0, [[3.155_252_370_432_22, -29.864_591_801_073], [20.343_971_555_920_6, -38.010_062_160_296_8]]),
        (90.0, [[138.0, 89.810_077_112_907_7], [59.309_932_474_020_2, 73.633_713_289_007_4]]),
        (-90.0, [[48.0, -89.810_077_112_907_7], [126.690_067_525_98, -73.633_713_289_007_4]]),
    ] {
        let text = format!("+proj=ortho +lat_0={centre_deg} +lon_0=3 +datum=WGS84");
        let ground = Ground::new(&by_text(&text).unwrap()).unwrap();
        for (at, place) in near_and_far.into_iter().zip(places) {
            let found = ground.world(at).unwrap().map(f64::to_degrees);
            let away = (found[0] - place[0]).abs().max((found[1] - place[1]).abs());
            assert!(away < 1e-9, "{text} {at:?}: {found:?}");
        }
    }
}

/// Maps of an ellipsoid by the sphere's formulas, as ESRI's orthographic ones and some methods of WKT 2 are, and those of a sphere. Positions by gdaltransform; of Lambert's, on the sphere of the
/// ellipsoid's area.
#[test]
fn maps_by_the_sphere_keep_latitudes() {
    let degree = "0.0174532925199433";
    let old = |body: &str, names: [&str; 2]| {
        format!(
            "PROJCS[\"x\",GEOGCS[\"y\",DATUM[\"z\",SPHEROID[\"s\",{body}]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",{degree}]],PROJECTION[\"Orthographic\"],PARAMETER[\"False_Easting\",0],\
             PARAMETER[\"False_Northing\",0],PARAMETER[\"{}\",3],PARAMETER[\"{}\",46],UNIT[\"metre\",1]]",
            names[0], names[1]
        )
    };
    let new = |method: &str, body: &str| {
        format!(
            "PROJCRS[\"x\",BASEGEOGCRS[\"y\",DATUM[\"z\",ELLIPSOID[\"s\",{body},LENGTHUNIT[\"metre\",1]]],PRIMEM[\"Greenwich\",0,ANGLEUNIT[\"degree\",{degree}]]],CONVERSION[\"c\",METHOD[{method}],\
             PARAMETER[\"Latitude of natural origin\",46,ANGLEUNIT[\"degree\",{degree}],ID[\"EPSG\",8801]],PARAMETER[\"Longitude of natural origin\",3,ANGLEUNIT[\"degree\",{degree}],ID[\"EPSG\",8802]],\
             PARAMETER[\"False easting\",0,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8806]],PARAMETER[\"False northing\",0,LENGTHUNIT[\"metre\",1],ID[\"EPSG\",8807]]],CS[Cartesian,2],\
             AXIS[\"E\",east,LENGTHUNIT[\"metre\",1]],AXIS[\"N\",north,LENGTHUNIT[\"metre\",1]]]"
        )
    };
    let (earth, moon) = ("6378137,298.257223563", "1737400,0");
    let gdals = ["central_meridian", "latitude_of_origin"];
    let esris = ["Longitude_Of_Center", "Latitude_Of_Center"];
    let own = "\"Orthographic\",ID[\"EPSG\",9840]";
    let ellipsoid = [4.905_561_999_084_92, 45.084_068_441_410_1];
    let by_sphere = [4.908_817_554_341_27, 45.085_498_357_257_3];
    let of_moon = [9.723_848_017_883_56, 42.490_986_440_053_5];
    for (text, [lon, lat]) in [
        (old(earth, gdals), ellipsoid),
        (new(own, earth), ellipsoid),
        ("+proj=ortho +lat_0=46 +lon_0=3 +a=6378137 +f=0.0033528106647474805".to_owned(), ellipsoid),
        (old(earth, esris), by_sphere),
        (new("\"Orthographic (Spherical)\"", earth), by_sphere),
        ("+proj=ortho +f=0 +lat_0=46 +lon_0=3 +datum=WGS84".to_owned(), by_sphere),
        (
            new("\"Equidistant Cylindrical (Spherical)\",ID[\"EPSG\",1029]", earth)
                .replace("natural origin\",46", "1st standard parallel\",46")
                .replace("8801", "8823"),
            [4.939_763_462_85, -0.898_315_284_119_521],
        ),
        (
            new("\"Lambert Azimuthal Equal Area (Spherical)\",ID[\"EPSG\",1027]", earth),
            [4.910_731_446_477_18, 45.084_550_280_270_5],
        ),
        (old(moon, gdals), of_moon),
        (old(moon, esris), of_moon),
        (new(own, moon), of_moon),
    ] {
        let ground = ground(&text);
        let found = ground.world([150_000.0, -100_000.0]).unwrap().map(f64::to_degrees);
        let away = (found[0] - lon).abs().max((found[1] - lat).abs());
        assert!(away < 1e-9, "{text}: {found:?}");
    }
}
