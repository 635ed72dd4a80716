//! From a tree of well-known text to a [`System`]: names, codes, units, axes, the ellipsoid; projections by crate `proj4wkt`.

use super::bound;
use super::from_proj;
use super::registry;
use super::system::{Kind, System, Unit, Vertical, exact_metres, exact_radians};
use super::wkt::{self, Node};
use crate::guard::quiet;
use crate::reader::HorizontalSize;

const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
const GEOGRAPHIC: [&str; 5] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS"];
const GEOCENTRIC: [&str; 1] = ["GEOCCS"];
const LOCAL: [&str; 3] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
const DATUM: [&str; 5] = ["DATUM", "GEODETICDATUM", "GEODETICREFERENCEFRAME", "TRF", "ENSEMBLE"];
const UNITS: [&str; 3] = ["UNIT", "LENGTHUNIT", "ANGLEUNIT"];

/// The system that a text describes; `None` if it is no such text or says nothing of the horizontal.
pub(super) fn system(text: &str) -> Option<System> {
    let nodes = wkt::parse(text)?;
    let mut system = horizontal_of(&nodes)?;
    if let Some(vertical) = nodes.iter().find_map(vertical_of) {
        system.vertical = Some(vertical);
    }
    system.text = text.trim_start_matches('\u{feff}').trim().to_owned();
    Some(system)
}

fn horizontal_of(nodes: &[Node]) -> Option<System> {
    nodes.iter().find_map(|node| horizontal(node, 0))
}

/// The horizontal system in a node: itself, the first part of a compound one, or what a bound one binds.
fn horizontal(node: &Node, depth: u32) -> Option<System> {
    let key = node.key.as_str();
    if depth > 4 {
        return None;
    }
    if COMPOUND.contains(&key) || key == "BOUNDCRS" || key == "SOURCECRS" {
        let mut inner = node.values.iter().find_map(|value| match value {
            wkt::Value::Node(child) => horizontal(child, depth + 1),
            _ => None,
        })?;
        if let Some(shift) = bound::shift(node) {
            inner.proj = inner.proj.map(|proj| registry::shifted(&proj, &shift));
            (inner.off_m, inner.reach_deg) = (None, Vec::new());
        }
        return Some(inner);
    }
    let kind = match key {
        _ if PROJECTED.contains(&key) => Kind::Projected,
        _ if GEOGRAPHIC.contains(&key) => Kind::Geographic,
        _ if LOCAL.contains(&key) => Kind::Local,
        _ => return None,
    };
    let mut system = System::unknown();
    system.kind = kind;
    system.name = plain_name(node.text(0).unwrap_or(""));
    system.code = code(node);
    system.unit = unit(node, kind);
    let spheroid = node.find(&["SPHEROID", "ELLIPSOID"]);
    let length = |spheroid: &Node| {
        spheroid.child(&["LENGTHUNIT", "UNIT"]).and_then(|unit| unit.number(1)).unwrap_or(1.0)
    };
    system.radius_m =
        spheroid.and_then(|found| Some(found.number(1)? * length(found))).filter(|radius| *radius > 0.0);
    system.datum = node.find(&DATUM).and_then(|datum| datum.text(0)).map(datum_key).unwrap_or_default();
    let geographic =
        if kind == Kind::Geographic { system.code } else { node.find(&GEOGRAPHIC).and_then(code) };
    if let Some(name) = geographic.and_then(registry::name_of_datum) {
        name.clone_into(&mut system.datum);
    }
    (system.signs, system.is_south_first) = axes(node);
    if kind != Kind::Local {
        (system.proj, system.off_m) = projection(node, system.code);
        if system.code.is_some() {
            system.reach_deg =
                registry::reach(&[system.code, geographic, registry::code_of_datum(&system.datum)]);
        } else if node.find(&["TOWGS84"]).is_none() && extension(node).is_none() {
            tie(&mut system);
        }
        // A grid is named where the registry does not tell the shift.
        if system.code.is_none()
            && let Some(grids) = bound::grids(node)
        {
            system.proj = system.proj.map(|proj| registry::shifted(&proj, &grids));
        }
    }
    if kind == Kind::Geographic {
        system.vertical = ellipsoidal(node);
    }
    Some(system)
}

/// Ends of the names of ESRI's datums that lie apart from WGS 84 though their ellipsoid is that one, and by how many metres.
const APART: [(&str, f64); 2] = [("xrail84", 80.0), ("georgiageodeticdatum", 8.0)];

/// Gives a system of which neither a code nor the text tells the shift that of its datum, by the datum's name.
fn tie(system: &mut System) {
    let Some((shift, off_m, code)) = registry::shift_of_datum(&system.datum) else {
        let apart = APART.iter().find(|(name, _)| system.datum.ends_with(name));
        system.off_m = apart.map(|(_, off_m)| *off_m);
        return;
    };
    let radius_m = match registry::horizontal(code) {
        Some(registry::Horizontal::Text { wkt, .. }) => {
            wkt::parse(wkt).and_then(|nodes| nodes[0].find(&["SPHEROID"])?.number(1))
        }
        _ => None,
    };
    // Another body of that name has another shift.
    if radius_m.zip(system.radius_m).is_some_and(|(a, b)| (a - b).abs() > 1.0) {
        return;
    }
    system.proj = system.proj.as_ref().map(|proj| registry::shifted(proj, &shift));
    system.off_m = off_m;
    system.reach_deg = registry::reach(&[Some(code)]);
}

/// Names of ESRI's have underscores for spaces, and some begin with the kind.
fn plain_name(name: &str) -> String {
    let name = name.trim();
    if name.contains(' ') { name.to_owned() } else { name.replace('_', " ") }
}

/// The name of a datum as it is compared: EPSG's, letters and digits alone; empty for one that only says that it is not known.
pub(super) fn datum_key(name: &str) -> String {
    let key = squeezed(name);
    let is_unknown = ["unknown", "unnamed", "notspecified"].iter().any(|word| key.contains(word));
    if is_unknown {
        return String::new();
    }
    registry::code_of_datum(&key).and_then(registry::name_of_datum).map_or(key, str::to_owned)
}

/// Small letters and digits alone.
fn squeezed(text: &str) -> String {
    text.chars().filter(char::is_ascii_alphanumeric).map(|letter| letter.to_ascii_lowercase()).collect()
}

/// The EPSG code of a node itself.
fn code(node: &Node) -> Option<u32> {
    let id = node.children(&["AUTHORITY", "ID"]).last()?;
    let is_epsg = id.text(0).is_some_and(|name| name.eq_ignore_ascii_case("EPSG"));
    let number = id.number(1).filter(|number| number.fract() == 0.0 && (1.0..1e9).contains(number))?;
    is_epsg.then_some(number as u32)
}

/// The unit of the axes: of the node itself, or of its first axis.
fn unit(node: &Node, kind: Kind) -> Option<Unit> {
    let own =
        node.children(&UNITS).last().or_else(|| node.child(&["AXIS"]).and_then(|axis| axis.child(&UNITS)));
    let of_base = || (kind == Kind::Geographic).then(|| node.find(&["ANGLEUNIT"])).flatten();
    let found = own.or_else(of_base)?;
    let size = found.number(1).filter(|size| *size > 0.0)?;
    let name = found.text(0).unwrap_or("").to_owned();
    let size = match kind {
        Kind::Geographic => HorizontalSize::Radians(exact_radians(size)),
        _ => HorizontalSize::Metres(exact_metres(size)),
    };
    Some(Unit { name, size })
}

/// Whether the axis of eastings points west and that of northings south, and whether the one to the south comes first.
fn axes(node: &Node) -> ([f64; 2], bool) {
    let directions: Vec<Option<&str>> = node.children(&["AXIS"]).map(direction).collect();
    match directions.as_slice() {
        [] => unsaid_axes(node),
        [first, second, ..] => (signs(node), *first == Some("SOUTH") && *second == Some("WEST")),
        _ => (signs(node), false),
    }
}

/// The axes of a text that leaves them out, as its projection has them: GDAL writes none for the grids of South Africa, which count to the west and south, and ESRI turns Krovak's by
/// parameters.
fn unsaid_axes(node: &Node) -> ([f64; 2], bool) {
    let method = node.find(&["PROJECTION", "METHOD"]).and_then(|method| method.text(0)).map(squeezed);
    match method.as_deref() {
        Some("transversemercatorsouthorientated") => ([-1.0; 2], false),
        // GDAL writes neither axes nor these parameters for Krovak's old maps.
        Some("krovak")
            if parameter(node, "XY_Plane_Rotation").unwrap_or(0.0) == 0.0
                && parameter(node, "X_Scale").unwrap_or(1.0) == 1.0 =>
        {
            ([-1.0; 2], true)
        }
        _ => ([1.0; 2], false),
    }
}

/// The number of a parameter of WKT 1.
fn parameter(node: &Node, name: &str) -> Option<f64> {
    let mut all = node.children(&["PARAMETER"]);
    all.find(|parameter| parameter.text(0).is_some_and(|text| text.eq_ignore_ascii_case(name)))?.number(1)
}

/// The word for where an axis points.
fn direction(axis: &Node) -> Option<&str> {
    axis.values.iter().rev().find_map(|value| match value {
        wkt::Value::Node(word) if word.values.is_empty() => Some(word.key.as_str()),
        _ => None,
    })
}

fn signs(node: &Node) -> [f64; 2] {
    let mut signs = [1.0; 2];
    for axis in node.children(&["AXIS"]) {
        let direction = direction(axis);
        // Both axes of a polar projection point north, or south, from the pole: no turn is meant.
        let along_meridian = axis.child(&["MERIDIAN"]).is_some();
        match direction {
            Some("WEST") => signs[0] = -1.0,
            Some("SOUTH") if !along_meridian => signs[1] = -1.0,
            _ => {}
        }
    }
    let axes: Vec<&Node> = node.children(&["AXIS"]).collect();
    let both = |word: &str| {
        axes.len() >= 2
            && axes
                .iter()
                .take(2)
                .all(|axis| axis.values.iter().any(|v| matches!(v, wkt::Value::Node(n) if n.key == word)))
    };
    if both("SOUTH") || both("NORTH") { [1.0; 2] } else { signs }
}

/// How the system is projected, by its code or by its own parameters, and by how many metres places may be off.
fn projection(node: &Node, code: Option<u32>) -> (Option<String>, Option<f64>) {
    if let Some((code, known)) = code.and_then(|code| Some((code, registry::horizontal(code)?))) {
        let (registry::Horizontal::Text { proj, .. } | registry::Horizontal::Parts { proj, .. }) = known;
        if !proj.is_empty() {
            let (proj, off_m) = registry::tied(code, proj);
            return (Some(proj), off_m);
        }
    }
    if let Some(proj) = extension(node) {
        return (Some(proj.to_owned()), None);
    }
    // Another's parser on a stranger's text.
    let proj = quiet(|| proj4wkt::wkt_to_projstring(&written(node)).ok()).flatten();
    (
        proj.filter(|proj| proj.contains("+proj="))
            .and_then(|proj| Some(completed(middled(proj, node)?, node))),
        None,
    )
}

/// The PROJ string that GDAL puts into a text that cannot say the map, as that of the web's Mercator; it counts before the text.
fn extension(node: &Node) -> Option<&str> {
    let mut all = node.children(&["EXTENSION"]);
    all.find(|extension| extension.text(0) == Some("PROJ4"))?.text(1).filter(|proj| proj.contains("+proj="))
}

/// Names of the parameters for the middle of a map in small letters, and their words in a PROJ string. The first is the one that no map can do without.
const MIDDLES: [(&str, &[&str]); 4] = [
    (
        "lon_0",
        &[
            "longitudeofnaturalorigin",
            "longitudeoffalseorigin",
            "longitudeoforigin",
            "longitudeofcenter",
            "centralmeridian",
        ],
    ),
    ("lat_0", &["latitudeofnaturalorigin", "latitudeoffalseorigin", "latitudeoforigin", "latitudeofcenter"]),
    ("x_0", &["falseeasting", "eastingatfalseorigin"]),
    ("y_0", &["falsenorthing", "northingatfalseorigin"]),
];

/// A string with the middle of the map where its parser leaves that out, as of equidistant conic maps in WKT 2; `None` for a map of another kind without one, which would lie anywhere.
fn middled(proj: String, node: &Node) -> Option<String> {
    let around = node.child(&["CONVERSION"]).unwrap_or(node);
    let value = |names: &[&str]| {
        let mut all = around.children(&["PARAMETER"]);
        let found =
            all.find(|one| one.text(0).is_some_and(|name| names.contains(&squeezed(name).as_str())))?;
        let size = |keys: &[&str], whole: f64| {
            found.child(keys).and_then(|unit| unit.number(1)).map_or(1.0, |size| size / whole)
        };
        Some(found.number(1)? * size(&["ANGLEUNIT"], 1f64.to_radians()) * size(&["LENGTHUNIT"], 1.0))
    };
    let is_centred =
        ["lon_0", "lonc", "lon_1", "lon_2", "zone"].iter().any(|word| from_proj::word(&proj, word).is_some());
    if is_centred {
        return Some(proj);
    }
    // Without a word the middle is Greenwich.
    if from_proj::word(&proj, "proj") != Some("eqdc") {
        return value(MIDDLES[0].1).is_none_or(|lon| lon == 0.0).then_some(proj);
    }
    let words = MIDDLES.iter().filter_map(|(word, names)| Some(format!(" +{word}={}", value(names)?)));
    Some(words.fold(proj, |proj, word| proj + &word))
}

/// A string with what its parser leaves out.
fn completed(proj: String, node: &Node) -> String {
    let has = |words: &[&str]| {
        proj.split_whitespace().any(|word| words.iter().any(|start| word.starts_with(start)))
    };
    // Miller's is drawn on the sphere of the ellipsoid's area.
    if has(&["+proj=mill"]) {
        return format!("{proj} +R_A");
    }
    // The parser makes a sphere of the ellipsoid where the method's formulas are the sphere's. Latitudes stay the ellipsoid's, so no datum is shifted.
    let flattened =
        node.find(&["SPHEROID", "ELLIPSOID"]).and_then(|body| body.number(2)).filter(|rf| *rf > 0.0);
    if let Some((radius_m, rf)) = from_proj::word(&proj, "R").zip(flattened) {
        let is_of_area = has(&["+proj=laea"]);
        let left_out: &[&str] = if is_of_area { &["+towgs84=", "+R="] } else { &["+towgs84="] };
        let kept =
            proj.split_whitespace().filter(|word| !left_out.iter().any(|start| word.starts_with(start)));
        let kept = kept.collect::<Vec<_>>().join(" ");
        // Lambert's equal areas are those of the sphere of the ellipsoid's area, as in the registry's maps by this method.
        return if is_of_area { format!("{kept} +a={radius_m} +rf={rf} +R_A") } else { kept };
    }
    // ESRI scales maps with two standard parallels, as those of Michigan are.
    let scale = parameter(node, "Scale_Factor").filter(|scale| *scale > 0.0 && *scale != 1.0);
    match scale {
        Some(scale) if has(&["+proj=lcc"]) && !has(&["+k=", "+k_0="]) => format!("{proj} +k_0={scale}"),
        _ => proj,
    }
}

/// Prime meridians in degrees: Ferro, Lisbon, Paris (RGS), Rome, Bern, Athens, Stockholm, Oslo, Brussels, Madrid, Bogota, Jakarta. GDAL and ESRI write them so whatever the unit beside; Paris itself is known to the parser.
const IN_DEGREES: [f64; 12] = [
    -17.666_666_666_7,
    -9.131_906_111_1,
    2.337_208_333_3,
    12.452_333_333_3,
    7.439_583_333_3,
    23.716_337_5,
    18.058_277_777_8,
    10.722_916_666_7,
    4.367_975,
    -3.687_375,
    -74.080_916_666_7,
    106.807_719_444_4,
];

/// The node as text again, for a parser that wants one system and nothing around it.
fn written(node: &Node) -> String {
    let mut values: Vec<String> = node
        .values
        .iter()
        .map(|value| match value {
            wkt::Value::Text(text) => format!("\"{}\"", text.replace('"', "")),
            wkt::Value::Number(number) => number.to_string(),
            wkt::Value::Node(node) if node.values.is_empty() => node.key.clone(),
            wkt::Value::Node(node) => written(node),
        })
        .collect();
    let is_in_degrees = |degrees: f64| IN_DEGREES.iter().any(|known| (known - degrees).abs() < 1e-8);
    if node.key.starts_with("PRIMEM")
        && node.number(1).is_some_and(is_in_degrees)
        && node.child(&UNITS).is_none()
    {
        values.push("ANGLEUNIT[\"degree\",0.0174532925199433]".to_owned());
    }
    format!("{}[{}]", node.key, values.join(","))
}

/// The vertical system in a node.
fn vertical_of(node: &Node) -> Option<Vertical> {
    let found = node.find(&VERTICAL)?;
    let code = code(found);
    let entry = code.and_then(registry::vertical);
    let unit = found
        .children(&["UNIT", "LENGTHUNIT"])
        .last()
        .or_else(|| found.child(&["AXIS"]).and_then(|axis| axis.child(&["LENGTHUNIT", "UNIT"])));
    let metres = unit.and_then(|unit| unit.number(1)).filter(|metres| *metres > 0.0);
    let axis = found.child(&["AXIS"]).is_some_and(|axis| {
        axis.values.iter().any(|value| matches!(value, wkt::Value::Node(word) if word.key == "DOWN"))
    });
    // ESRI counts depths by a parameter.
    let parameter = found.children(&["PARAMETER"]).any(|parameter| {
        parameter.text(0).is_some_and(|name| name.eq_ignore_ascii_case("direction"))
            && parameter.number(1) == Some(-1.0)
    });
    Some(Vertical {
        name: plain_name(found.text(0).unwrap_or("")),
        code,
        unit_name: unit
            .and_then(|unit| unit.text(0))
            .or(entry.map(|entry| entry.unit_name))
            .unwrap_or("metre")
            .to_owned(),
        metres: exact_metres(metres.or(entry.map(|entry| entry.metres)).unwrap_or(1.0)),
        is_down: axis || parameter,
    })
}

/// Heights of a geographic system of three dimensions are above its ellipsoid.
fn ellipsoidal(node: &Node) -> Option<Vertical> {
    let axis = node.children(&["AXIS"]).nth(2)?;
    let unit = axis.child(&["LENGTHUNIT", "UNIT"]);
    Some(Vertical {
        name: "height above the ellipsoid".into(),
        code: None,
        unit_name: unit.and_then(|unit| unit.text(0)).unwrap_or("metre").to_owned(),
        metres: exact_metres(unit.and_then(|unit| unit.number(1)).filter(|m| *m > 0.0).unwrap_or(1.0)),
        is_down: false,
    })
}

/// Whether a text is a system that no place on the ground follows from.
pub(super) fn is_geocentric(text: &str) -> bool {
    wkt::parse(text).is_some_and(|nodes| nodes.iter().any(|node| node.find(&GEOCENTRIC).is_some()))
}
