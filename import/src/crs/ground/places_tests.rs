//! Places of some two thousand systems, held against PROJ's: without PROJ by a table of its places, and against `gdaltransform` where that is installed.

use super::super::resolve::by_text;
use super::*;
use std::io::Write;
use std::process::{Command, Stdio};

const PLACES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/crs_places.txt");
/// How far a place may lie from PROJ's without a word.
const NEAR_M: f64 = 4.0;

/// PROJ 9.1 has these wrong: a scale of a millionth, maps of the meridian of Rome whose own is Greenwich's, and a turn for Kosovo of the other sign.
const WRONG_IN_PROJ: [u32; 6] = [6996, 6997, 26591, 26592, 6204, 9945];

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
        let told_m = match ground.doubt(&world) {
            Some(Doubt::Unknown) => 1500.0,
            Some(Doubt::OffM(off_m)) => off_m,
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
    assert_eq!(ground_of("EPSG:4230").doubt(&world), Some(Doubt::OffM(10.0)));
    assert_eq!(ground_of("EPSG:4230").doubt(&ground_of("EPSG:23032")), None);
    assert!(matches!(ground_of("EPSG:4142").doubt(&world), Some(Doubt::OffM(off_m)) if off_m > 400.0));
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
    let israel = ground_of(&degrees("D_Israel", "6378137.0,298.257222101"));
    let found = israel.world([35.0, 31.5]).unwrap().map(f64::to_degrees);
    assert!(apart_m(found, [35.000_695_063_569_8, 31.500_372_037_396_8]) < 0.01, "{found:?}");
    assert_eq!(israel.doubt(&world), None);
    let europe = ground_of(&degrees("D_European_1950", "6378388.0,297.0"));
    assert_eq!(europe.doubt(&world), Some(Doubt::OffM(10.0)));
    // The name of one on another body, and a shift that the text states itself.
    assert_eq!(
        ground_of(&degrees("D_Israel", "6377397.155,299.1528128")).doubt(&world),
        Some(Doubt::Unknown)
    );
    let stated =
        degrees("D_Israel", "6378137.0,298.257222101").replace("]],PRIMEM", "],TOWGS84[-48,55,52]],PRIMEM");
    let found = ground_of(&stated).world([35.0, 31.5]).unwrap().map(f64::to_degrees);
    assert!(apart_m(found, [35.000_764_035_381_2, 31.500_436_496_968_7]) < 0.01, "{found:?}");
}

fn ground_of(text: &str) -> Ground {
    Ground::new(&by_text(text).unwrap()).unwrap()
}
