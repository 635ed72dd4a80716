//! Texts of systems without codes: words that count in PROJ strings, and what their parsers pass over. Places by gdaltransform.

use super::super::resolve::by_text;
use super::*;

fn place_deg(text: &str, at: [f64; 2]) -> Option<[f64; 2]> {
    let ground = Ground::new(&by_text(text)?)?;
    Some(ground.world(at)?.map(f64::to_degrees))
}

fn lies(text: &str, at: [f64; 2], [lon, lat]: [f64; 2]) {
    let [x, y] = place_deg(text, at).unwrap_or_else(|| panic!("{text}"));
    assert!((x - lon).abs() < 3e-5 && (y - lat).abs() < 3e-5, "{text}: {x} {y}");
}

#[test]
fn words_of_proj_strings_count_as_in_proj() {
    // A named unit counts before a size.
    lies(
        "+proj=utm +zone=32 +datum=WGS84 +units=us-ft +to_meter=1",
        [500_000.0 / 0.3048, 5_000_000.0 / 0.3048],
        [9.000_012_721_947_27, 45.153_567_200_376_3],
    );
    // Miller's map is drawn on the sphere of the ellipsoid's area.
    lies("+proj=mill +datum=WGS84", [1_000_000.0, 3_000_000.0], [8.993_205_922_481_45, 26.363_259_375_673_7]);
    // Northings first is how GDAL's texts say it, and data has eastings first all the same.
    lies("+proj=utm +zone=32 +datum=WGS84 +axis=neu", [500_000.0, 5_000_000.0], [9.0, 45.153_477_183_356]);
    // Axes that cross, and spheres that are not known here, lead to no place.
    for text in [
        "+proj=utm +zone=32 +datum=WGS84 +axis=nwu",
        "+proj=utm +zone=32 +datum=WGS84 +axis=seu",
        "+proj=merc +ellps=WGS84 +R_lat_a=45",
        "+proj=merc +ellps=WGS84 +R_lat_g=45",
    ] {
        assert_eq!(place_deg(text, [500_000.0, 5_000_000.0]), None, "{text}");
    }
}

#[test]
fn heights_of_strings_are_in_the_named_unit() {
    let metres = |words: &str| {
        by_text(&format!("+proj=utm +zone=32 +datum=WGS84 {words}")).unwrap().vertical.unwrap().metres
    };
    assert_eq!(metres("+vunits=km +vto_meter=0.3048"), 1000.0);
    assert_eq!(metres("+vto_meter=0.3048"), 0.3048);
}

const GREECE: &str = "GEOGCS[\"GGRS87\",DATUM[\"Greek_Geodetic_Reference_System_1987\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]";

/// The registry has this datum by its word, and not by parameters.
#[test]
fn datums_that_the_registry_has_by_a_word_are_shifted_in_texts() {
    let there = [23.001_673_009_110_1, 38.002_609_228_995_9];
    lies("EPSG:4121", [23.0, 38.0], there);
    lies(GREECE, [23.0, 38.0], there);
    lies(&GREECE.replace("Greek_Geodetic_Reference_System_1987", "D_GGRS_1987"), [23.0, 38.0], there);
    // ESRI's datums on the ellipsoid of WGS 84 that lie apart from it are told.
    let world = Ground::new(&by_text("EPSG:4326").unwrap()).unwrap();
    let doubt = |name: &str| {
        let text = GREECE.replace("Greek_Geodetic_Reference_System_1987", name);
        Ground::new(&by_text(&text).unwrap()).unwrap().doubt(&world, &[[0.0, 51.0]])
    };
    assert_eq!(doubt("D_Xrail84"), Some(Doubt::OffM(80.0)));
    assert_eq!(doubt("D_ETRS_1989"), None);
}

/// GDAL's WKT 1 of the web's maps is Mercator's of the ellipsoid but for the PROJ string in it, some 20 km apart.
#[test]
fn a_proj_string_in_a_text_counts() {
    let text = |extension: &str| {
        format!(
            "PROJCS[\"WGS 84 / Pseudo-Mercator\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],\
             PROJECTION[\"Mercator_1SP\"],PARAMETER[\"central_meridian\",0],PARAMETER[\"scale_factor\",1],PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1],\
             AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]{extension}]"
        )
    };
    let at = [1_000_000.0, 6_000_000.0];
    let by_string = ",EXTENSION[\"PROJ4\",\"+proj=merc +a=6378137 +b=6378137 +lat_ts=0 +lon_0=0 +x_0=0 +y_0=0 +k=1 +units=m +nadgrids=@null +wktext +no_defs\"]";
    lies(&text(by_string), at, [8.983_152_841_195_21, 47.353_704_702_433_1]);
    lies(&text(""), at, [8.983_152_841_195_21, 47.545_309_636_380_7]);
}

/// GDAL leaves the axes of Krovak's old maps out of WKT 1, and reads southings first.
#[test]
fn krovak_without_axes_counts_south_first() {
    let text = "PROJCS[\"S-JTSK / Krovak\",GEOGCS[\"S-JTSK\",DATUM[\"System_of_the_Unified_Trigonometrical_Cadastral_Network\",SPHEROID[\"Bessel 1841\",6377397.155,299.1528128]],\
                PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Krovak\"],PARAMETER[\"latitude_of_center\",49.5],\
                PARAMETER[\"longitude_of_center\",24.8333333333333],PARAMETER[\"azimuth\",30.2881397527778],PARAMETER[\"pseudo_standard_parallel_1\",78.5],PARAMETER[\"scale_factor\",0.9999],\
                PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]";
    assert!(by_text(text).unwrap().is_south_first);
    lies(text, [1_144_001.885_955_7, 544_004.743_502_93], [17.325, 49.395]);
}

/// The parser of texts passes over the middle of equidistant conic maps in WKT 2.
#[test]
fn the_middle_of_a_map_is_never_passed_over() {
    let text = |method: &str| {
        let degree = "ANGLEUNIT[\"Degree\",0.0174532925199433]";
        format!(
            "PROJCRS[\"USA\",BASEGEOGCRS[\"WGS 84\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563,LENGTHUNIT[\"metre\",1]]],PRIMEM[\"Greenwich\",0,{degree}]],\
             CONVERSION[\"USA\",METHOD[\"{method}\"],PARAMETER[\"Latitude of natural origin\",39,{degree}],PARAMETER[\"Longitude of natural origin\",-96,{degree}],\
             PARAMETER[\"Latitude of 1st standard parallel\",33,{degree}],PARAMETER[\"Latitude of 2nd standard parallel\",45,{degree}],PARAMETER[\"False easting\",1,LENGTHUNIT[\"kilometre\",1000]],\
             PARAMETER[\"False northing\",0,LENGTHUNIT[\"metre\",1]]],CS[Cartesian,2],AXIS[\"(E)\",east,LENGTHUNIT[\"metre\",1]],AXIS[\"(N)\",north,LENGTHUNIT[\"metre\",1]]]"
        )
    };
    lies(&text("Equidistant Conic"), [501_000.0, 200_000.0], [-90.053_291_680_310_4, 40.654_434_816_445_1]);
    let at_greenwich = text("Equidistant Conic").replace("-96", "0");
    lies(&at_greenwich, [501_000.0, 200_000.0], [5.946_708_319_689_6, 40.654_434_816_445_1]);
}

/// GDAL and ESRI write known meridians in degrees, though all else may be in grads.
#[test]
fn known_meridians_are_in_degrees() {
    let meridian = |pm: &str| {
        let text = format!(
            "GEOGCS[\"a\",DATUM[\"b\",SPHEROID[\"s\",6376523,308.64]],PRIMEM[{pm}],UNIT[\"grad\",0.0157079632679489]]"
        );
        let system = by_text(&text).unwrap();
        system.proj.as_deref().and_then(|proj| from_proj::word(proj, "pm")?.parse::<f64>().ok()).unwrap()
    };
    for (pm, degrees) in [
        ("\"Paris RGS\",2.33720833333333", 2.337_208_333),
        ("\"Paris_RGS\",2.596898", 2.337_208_2),
        ("\"Ferro\",-17.6666666666667", -17.666_666_667),
        ("\"Madrid\",-3.687375", -3.687_375),
        ("\"Foo\",2.5", 2.25),
    ] {
        assert!((meridian(pm) - degrees).abs() < 1e-8, "{pm}: {}", meridian(pm));
    }
}
