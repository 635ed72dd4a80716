//! The shift to WGS 84 that a bound system of WKT 2 carries, `BOUNDCRS[SOURCECRS, TARGETCRS, ABRIDGEDTRANSFORMATION]`, and grids that GDAL names in WKT 1, as words of a PROJ string.
//!
//! Three and seven parameters are read (EPSG methods 9603, 9606 and 9607, and their like), rotations in seconds of arc and the scale as a factor. Any other transformation is told as a grid
//! that is not here, so that places are known to be rough.

use super::wkt::Node;

/// Parameters by EPSG's codes, in PROJ's order.
const PARAMETERS: [(u32, &str); 7] = [
    (8605, "X-axis translation"),
    (8606, "Y-axis translation"),
    (8607, "Z-axis translation"),
    (8608, "X-axis rotation"),
    (8609, "Y-axis rotation"),
    (8610, "Z-axis rotation"),
    (8611, "Scale difference"),
];

/// The word for the transformation of a bound system of longitudes and latitudes; `None` for none.
pub(super) fn shift(bound: &Node) -> Option<String> {
    let transformation = bound.child(&["ABRIDGEDTRANSFORMATION"])?;
    // What leads to heights is none of a plane's.
    if bound.child(&["TARGETCRS"]).is_some_and(|target| target.find(&["VERTCRS", "VERTICALCRS"]).is_some()) {
        return None;
    }
    Some(parameters(transformation).unwrap_or_else(|| {
        let file =
            transformation.child(&["PARAMETERFILE"]).and_then(|file| file.text(1)).unwrap_or("unknown");
        grid(file)
    }))
}

/// The word for a grid that GDAL names in a datum of WKT 1.
pub(super) fn grids(system: &Node) -> Option<String> {
    let datum = system.find(&["DATUM"])?;
    let mut extensions = datum.children(&["EXTENSION"]);
    let file = extensions.find(|extension| extension.text(0) == Some("PROJ4_GRIDS"))?.text(1)?;
    Some(grid(file))
}

fn grid(file: &str) -> String {
    format!("+nadgrids={}", file.split_whitespace().collect::<Vec<_>>().join("_"))
}

fn parameters(transformation: &Node) -> Option<String> {
    let method = transformation.child(&["METHOD", "PROJECTION"])?.text(0)?.to_ascii_lowercase();
    let (count, turn) = match method {
        _ if method.starts_with("geocentric translations") => (3, 1.0),
        _ if method.starts_with("position vector") => (7, 1.0),
        _ if method.starts_with("coordinate frame") => (7, -1.0),
        _ => return None,
    };
    let mut values = [0.0; 7];
    for (at, (code, name)) in PARAMETERS.iter().enumerate().take(count) {
        let mut all = transformation.children(&["PARAMETER"]);
        let found = all.find(|parameter| {
            let is_code = parameter.child(&["ID"]).and_then(|id| id.number(1)) == Some(f64::from(*code));
            is_code || parameter.text(0).is_some_and(|text| text.eq_ignore_ascii_case(name))
        });
        let value = found?.number(1)?;
        values[at] = match at {
            3..=5 => turn * value,
            // A factor near 1; digits beyond the ones that were written are none.
            6 => ((value - 1.0) * 1e6 * 1e9).round() / 1e9,
            _ => value,
        };
    }
    let words: Vec<String> = values.iter().take(count).map(f64::to_string).collect();
    Some(format!("+towgs84={}", words.join(",")))
}
