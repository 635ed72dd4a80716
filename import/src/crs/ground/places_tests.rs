//! Places of some two thousand systems, held against PROJ's: without PROJ by a table of its places, and against `gdaltransform` where that is installed.

use super::super::resolve::by_text;
use super::*;
use std::io::Write;
use std::process::{Command, Stdio};

const PLACES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/crs_places.txt");
/// How far a place may lie from PROJ's without a word.
const NEAR_M: f64 = 4.0;

/// PROJ 9.1 has these wrong: a scale of a millionth, maps of the meridian of Rome whose own is Greenwich's, a turn for Kosovo of the other sign, and an origin of 45.45 degrees in Michigan (GDAL takes
/// EPSG:6966 for it).
const WRONG_IN_PROJ: [u32; 7] = [6996, 6997, 26591, 26592, 6204, 9945, 6200];

struct Place {
    code: u32,
    at: [f64; 2],
    world_deg: [f64; 2],
}

fn places() -> Vec<Place> {
    let table = std::fs::read_to_string(PLACES).unwrap();
    let place = |line: &str| {
        let mut fields = line.split('|');
        let code = fields.next().unwrap().parse().unwrap();
        let [x, y, lon, lat] = std::array::from_fn(|_| fields.next().unwrap().parse().unwrap());
        Place { code, at: [x, y], world_deg: [lon, lat] }
    };
    table.lines().filter(|line| !line.starts_with('#')).map(place).collect()
}

fn apart_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    let across = (a[0] - b[0] + 180.0).rem_euclid(360.0) - 180.0;
    hypot(across * 111_320.0 * sin_cos(b[1].to_radians()).1, (a[1] - b[1]) * 110_900.0)
}

/// What is wrong and not told: places further from PROJ's than a few metres, or than is told. How many systems have a way to the ground.
fn untold(world_deg: impl Fn(&Place) -> Option<[f64; 2]>) -> (Vec<String>, u32) {
    let world = Ground::new(&by_text("EPSG:4326").unwrap()).unwrap();
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for place in places().into_iter().filter(|place| !WRONG_IN_PROJ.contains(&place.code)) {
        let Some(ground) = by_text(&format!("EPSG:{}", place.code)).and_then(|system| Ground::new(&system))
        else {
            continue;
        };
        let (Some(found), Some(there)) = (ground.world(place.at), world_deg(&place)) else { continue };
        seen += 1;
        let away_m = apart_m(found.map(f64::to_degrees), there);
        let told_m = match ground.doubt(&world, &[place.at]) {
            Some(Doubt::Unknown) => 1500.0,
            Some(Doubt::OffM(off_m) | Doubt::BeyondM(off_m)) => off_m + 1.0,
            None => NEAR_M,
        };
        if away_m > told_m {
            wrong.push(format!("EPSG:{}: {away_m:.1} m, told {told_m} m", place.code));
        }
    }
    (wrong, seen)
}

#[test]
fn places_of_all_datums_are_those_of_proj_or_told() {
    let (wrong, seen) = untold(|place| Some(place.world_deg));
    assert!(wrong.is_empty() && seen > 1200, "{seen}: {wrong:#?}");
}

/// The same against the library that is installed, which may know more.
#[test]
#[ignore = "needs gdaltransform"]
fn places_of_all_datums_are_those_of_gdaltransform_or_told() {
    let (wrong, seen) = untold(|place| {
        let mut child = Command::new("gdaltransform")
            .env("OSR_USE_NON_DEPRECATED", "NO")
            .args(["-output_xy", "-s_srs", &format!("EPSG:{}", place.code), "-t_srs", "EPSG:4326"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("gdaltransform is installed");
        let written = writeln!(child.stdin.take().unwrap(), "{} {}", place.at[0], place.at[1]);
        let out = child.wait_with_output().unwrap();
        written.unwrap();
        let out = String::from_utf8(out.stdout).ok()?;
        let mut numbers = out.split_whitespace().map(|word| word.parse::<f64>().unwrap_or(f64::NAN));
        let found = [numbers.next()?, numbers.next()?];
        found.iter().all(|value| value.is_finite()).then_some(found)
    });
    assert!(wrong.is_empty() && seen > 1000, "{seen}: {wrong:#?}");
}

/// Shifts that were older than PROJ's, in every way to name a system. Places by PROJ 9.1.
#[test]
fn texts_and_codes_have_the_same_shift() {
    let wkt = |code: u16| crs_definitions::from_code(code).unwrap().wkt.to_owned();
    for (code, at, [lon, lat]) in [
        (2039, [200_000.0, 600_000.0], [34.999_662_433_754_74, 31.491_931_155_473_3]),
        (2082, [2_500_000.0, 4_900_000.0], [-69.002_785_195_6, -46.053_608_438_2]),
    ] {
        for text in [format!("EPSG:{code}"), format!("+init=epsg:{code}"), wkt(code)] {
            let found = ground_of(&text).world(at).unwrap().map(f64::to_degrees);
            assert!(apart_m(found, [lon, lat]) < 1.0, "{text}: {found:?}");
        }
    }
    let world = ground_of("EPSG:4326");
    let europe = ground_of("EPSG:4230");
    assert_eq!(europe.doubt(&world, &[[8.0, 50.0]]), Some(Doubt::OffM(10.0)));
    assert_eq!(europe.doubt(&ground_of("EPSG:23032"), &[[8.0, 50.0]]), None);
    assert!(matches!(ground_of("EPSG:4142").doubt(&world, &[]), Some(Doubt::OffM(off_m)) if off_m > 400.0));
}

/// Texts of ESRI's name no code: the datum's name tells the shift. Places by gdaltransform.
#[test]
fn datums_by_name_have_their_shift() {
    let degrees = |datum: &str, body: &str| {
        format!(
            "GEOGCS[\"g\",DATUM[\"{datum}\",SPHEROID[\"s\",{body}]],PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]]"
        )
    };
    let world = ground_of("EPSG:4326");
    let in_israel = [[35.0, 31.5]];
    let israel = ground_of(&degrees("D_Israel", "6378137.0,298.257222101"));
    let found = israel.world([35.0, 31.5]).unwrap().map(f64::to_degrees);
    assert!(apart_m(found, [35.000_695_063_569_8, 31.500_372_037_396_8]) < 0.01, "{found:?}");
    assert_eq!(israel.doubt(&world, &in_israel), None);
    let europe = ground_of(&degrees("D_European_1950", "6378388.0,297.0"));
    assert_eq!(europe.doubt(&world, &[]), Some(Doubt::OffM(10.0)));
    // Two names of one datum.
    assert_eq!(europe.doubt(&ground_of("EPSG:23032"), &[[8.0, 50.0]]), None);
    // The name of one on another body, and a shift that the text states itself.
    assert_eq!(
        ground_of(&degrees("D_Israel", "6377397.155,299.1528128")).doubt(&world, &in_israel),
        Some(Doubt::Unknown)
    );
    let stated =
        degrees("D_Israel", "6378137.0,298.257222101").replace("]],PRIMEM", "],TOWGS84[-48,55,52]],PRIMEM");
    let found = ground_of(&stated).world([35.0, 31.5]).unwrap().map(f64::to_degrees);
    assert!(apart_m(found, [35.000_764_035_381_2, 31.500_436_496_968_7]) < 0.01, "{found:?}");
}

/// Outside of the regions for which there is a shift PROJ makes none, and it is told how large it is. Places by gdaltransform.
#[test]
fn shifts_that_are_taken_further_are_told() {
    let world = ground_of("EPSG:4326");
    // In Germany, and west of Iceland.
    let europe = ground_of("EPSG:4230");
    let (inside, outside) = ([8.0, 50.0], [-30.0, 60.0]);
    assert_eq!(europe.doubt(&world, &[inside]), Some(Doubt::OffM(10.0)));
    let Some(Doubt::BeyondM(told_m)) = europe.doubt(&world, &[inside, outside]) else {
        panic!("{:?}", europe.doubt(&world, &[outside]))
    };
    let shifted = europe.world(outside).unwrap().map(f64::to_degrees);
    assert!((apart_m(shifted, outside) - told_m).abs() < 2.0 && told_m > 50.0, "{told_m}");
    // Either way round, and not between systems of one datum.
    assert_eq!(world.doubt(&europe, &[shifted]), Some(Doubt::BeyondM(told_m)));
    assert_eq!(europe.doubt(&ground_of("EPSG:23028"), &[outside]), None);
    // PROJ takes the shift of Belgium's datum as far as one likes.
    assert_eq!(ground_of("EPSG:31370").doubt(&world, &[[20_000.0, 350_000.0]]), None);
    let words = Doubt::BeyondM(told_m).to_string();
    assert!(
        words.contains("stated for other regions") && words.ends_with(&format!("{told_m:.0} m")),
        "{words}"
    );
}

/// Of Bogota, Medellin, New Zealand, Michigan and Guam, on their own datums, by gdaltransform.
const METHODS: [(u32, [f64; 2], [f64; 2]); 8] = [
    (6247, [92_334.879, 109_320.965], [-74.146_591_666_666_7, 4.680_486_111_111_11]),
    (6247, [100_000.0, 120_000.0], [-74.077_523_911_800_1, 4.777_015_325_425_9]),
    (6257, [830_000.0, 1_170_000.0], [-75.613_468_782_801_1, 6.131_417_008_197_7]),
    (27200, [2_510_000.0, 6_023_150.0], [173.0, -41.0]),
    (27200, [2_700_000.0, 6_100_000.0], [175.234_629_832_531, -40.286_030_743_040_8]),
    (27200, [2_200_000.0, 5_500_000.0], [169.023_665_788_122, -45.642_239_866_831_7]),
    (6201, [2_000_000.0, 500_000.0], [-84.333_333_333_333_3, 44.688_120_395_281_8]),
    (3993, [60_000.0, 40_000.0], [144.841_071_630_153, 13.382_056_281_062_4]),
];

/// Methods that the library lacks, and systems of which the list of definitions has no text.
#[test]
fn methods_of_our_own_lead_to_projs_places_and_back() {
    for (code, at, world_deg) in METHODS {
        let ground = ground_of(&format!("EPSG:{code}"));
        let found = ground.own(at).unwrap();
        let away_m = apart_m(found.map(f64::to_degrees), world_deg);
        assert!(away_m < 0.001, "EPSG:{code}: {away_m} m");
        let back = ground.across_to(&ground, at).unwrap();
        assert!((0..2).all(|axis| (back[axis] - at[axis]).abs() < 0.03), "EPSG:{code}: {back:?}");
        assert!(ground.turn().is_none(), "EPSG:{code}");
    }
}

fn ground_of(text: &str) -> Ground {
    Ground::new(&by_text(text).unwrap()).unwrap()
}
