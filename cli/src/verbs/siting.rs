//! Where a terrain lies, in the words that `info` prints and that meshes and pictures carry.
//!
//! Cost: some thousand projections, for the bounds in longitude and latitude.

use super::output::{complain, decimal};
use super::terrain;
use anyhow::{Context, Result};
use serde::Serialize;
use terrasoar_import::places::{Crs, Frame, coordinate_unit_m};
use terrasoar_lab::mesh_file::Placing;
use terrasoar_layout::file::header::Header;

/// How the samples lie on the ground.
#[derive(Debug, Serialize)]
pub(super) struct Placement {
    /// "north-up", or how else rows and columns run; what was done to the elevation model to have them so.
    words: Vec<String>,
    /// Samples east and north of the south-west one to coordinates: x = m0 + m1 x + m2 y, y = m3 + m4 x + m5 y.
    sample_to_crs: Option<[f64; 6]>,
}

/// Where the terrain lies.
#[derive(Debug, Serialize)]
pub(super) struct Siting {
    placement: Placement,
    /// Least x and y and greatest x and y of the samples, in the DEM's coordinates.
    bounds: Option<[f64; 4]>,
    /// West, south, east and north in degrees of WGS 84; west is greater than east across the antimeridian. Null where it cannot be known.
    bounds_wgs84: Option<[f64; 4]>,
}

impl Siting {
    pub(super) fn of(header: &Header) -> Self {
        let done = header.about.origins.iter().filter(|(what, _)| what == "placement");
        let mut words = vec![lie(header).to_owned()];
        words.extend(done.map(|(_, words)| words.clone()));
        let world = Frame::wgs84(header);
        let doubt = world.as_ref().and_then(Frame::doubt);
        words.extend(doubt.map(|doubt| format!("the shift between its datum and that of WGS 84 {doubt}")));
        Self {
            placement: Placement { words, sample_to_crs: header.sample_to_crs },
            bounds: Frame::own(header).and_then(|frame| frame.bounds()),
            bounds_wgs84: world.and_then(|frame| frame.bounds_deg()),
        }
    }

    /// Rows of `info`.
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let corners = |[x0, y0, x1, y1]: [f64; 4], digits| {
            let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(|value| decimal(value, digits));
            format!("{x0},{y0} to {x1},{y1}")
        };
        let mut rows = vec![("placement", self.placement.words.join("; "))];
        rows.extend(
            self.bounds
                .map(|bounds| ("bounds", format!("{} (x,y of the outermost samples)", corners(bounds, 7)))),
        );
        rows.extend(self.placement.sample_to_crs.map(|map| ("sample to x,y", in_words(map))));
        rows.extend(
            self.bounds_wgs84
                .map(|bounds| ("longitude, latitude", format!("{} (WGS 84)", corners(bounds, 7)))),
        );
        rows
    }
}

/// A map from samples to coordinates as two sums: "x = 500000 + 30 * column, y = 4000000 + 30 * row, from the south-west sample".
fn in_words([x, a, b, y, d, e]: [f64; 6]) -> String {
    let sum = |from: f64, column: f64, row: f64| {
        let mut text = format!("{from}");
        for (factor, name) in [(column, "column"), (row, "row")] {
            if factor != 0.0 {
                text.push_str(&format!(
                    " {} {} * {name}",
                    if factor < 0.0 { '-' } else { '+' },
                    factor.abs()
                ));
            }
        }
        text
    };
    format!(
        "x = {}, y = {}, columns east and rows north of the south-west sample",
        sum(x, a, b),
        sum(y, d, e)
    )
}

/// How rows and columns run by the map alone.
fn lie(header: &Header) -> &'static str {
    let Some([_, a, b, _, d, e]) = header.sample_to_crs else { return "unknown" };
    match (b == 0.0 && d == 0.0, a > 0.0, e > 0.0) {
        (true, true, true) => "north-up",
        (true, false, false) => "north-up, in a system that counts to the west and south",
        (true, false, true) => "north-up, in a system that counts to the west",
        (true, true, false) => "north-up, in a system that counts to the south",
        (false, ..) => "turned or sheared",
    }
}

/// What a file made of a terrain says of where that lies: names and values. Nothing that is not known.
pub(super) fn notes(header: &Header) -> Vec<(&'static str, String)> {
    let mut notes = Vec::new();
    if let Some(name) = terrain::crs(header) {
        notes.push(("Reference system", name));
    }
    if let Some([x, a, b, y, d, e]) = header.sample_to_crs {
        let [east_m, north_m] = header.grid.spacing_m();
        let sum = |from: f64, east: f64, north: f64| {
            let mut text = format!("{from}");
            for (factor, name) in [(east / east_m, "east"), (north / north_m, "north")] {
                if factor != 0.0 {
                    let sign = if factor < 0.0 { '-' } else { '+' };
                    text.push_str(&format!(" {sign} {} * {name}", factor.abs()));
                }
            }
            text
        };
        notes.push(("Coordinates", format!("x = {}; y = {}", sum(x, a, b), sum(y, d, e))));
    }
    let above = &header.about.vertical_name;
    if !above.is_empty() {
        let code = header.about.vertical_epsg.map(|code| format!(" (EPSG:{code})")).unwrap_or_default();
        notes.push(("Heights", format!("metres, {above}{code}")));
    }
    notes
}

/// How metres from the south-west sample become coordinates of the elevation model, heights in their unit where that is a length; and whether they are angles. `None` where nothing is known.
pub(super) fn placing(header: &Header) -> Option<(Placing, bool)> {
    let [x, a, b, y, d, e] = header.sample_to_crs?;
    let [east_m, north_m] = header.grid.spacing_m();
    let unit_m = coordinate_unit_m(header);
    let is_angle = unit_m.is_none() && Crs::of(header).is_some_and(|crs| crs.is_geographic());
    let map = [x, a / east_m, b / north_m, y, d / east_m, e / north_m];
    Some((Placing { map, height_factor: 1.0 / unit_m.unwrap_or(1.0) }, is_angle))
}

/// [`notes`] for a mesh, in local coordinates or in those of the elevation model.
pub(super) fn mesh_notes(header: &Header, is_dem: bool) -> Vec<(&'static str, String)> {
    let mut notes = notes(header);
    if !is_dem {
        return notes;
    }
    notes.retain(|(name, _)| *name != "Coordinates");
    let (unit, heights) = (terrain::horizontal_unit(header), placing(header));
    let unit = match heights {
        Some((placing, false)) if placing.height_factor != 1.0 => {
            unit.unwrap_or_else(|| "the unit of x and y".into())
        }
        _ => "metres".into(),
    };
    match notes.iter_mut().find(|(name, _)| *name == "Heights") {
        Some((_, words)) => *words = words.replacen("metres", &unit, 1),
        None => notes.push(("Heights", unit)),
    }
    notes
}

/// The system in full, where it is known by text or code.
pub(super) fn crs_text(header: &Header) -> Option<String> {
    let kept = &header.about.crs_text;
    if !kept.is_empty() {
        return Some(kept.clone());
    }
    Crs::of(header).map(|crs| crs.text().to_owned()).filter(|text| !text.is_empty())
}

/// The terrain in the system that places are given in; nothing for metres from its corner. Says what may be off.
pub(super) fn frame(header: &Header, crs: Option<&str>) -> Result<Option<Frame>> {
    let Some(text) = crs else { return Ok(None) };
    let frame = if text.trim().eq_ignore_ascii_case("dem") {
        Frame::own(header).context(
            "the terrain does not know where on the ground it lies, for its elevation model did not say; leave --crs away and give metres from its corner",
        )?
    } else {
        Frame::of(header, &Crs::named(text)?)?
    };
    if let Some(doubt) = frame.doubt() {
        complain(&format!("note: the shift between the two datums {doubt}"));
    }
    Ok(Some(frame))
}

/// The system of a frame in words.
pub(super) fn system_name(frame: &Frame) -> String {
    frame.crs().map_or_else(|| "its own coordinates".into(), Crs::name)
}

/// From where to where the terrain extends, in a system, or in metres from its corner: "from 0,0 to 5000,4000 metres".
pub(super) fn reach(header: &Header, frame: Option<&Frame>) -> Option<String> {
    let Some(frame) = frame else {
        let [east, north] = header.grid.extent_m().map(|m| decimal(m, 4));
        return Some(format!("from 0,0 to {east},{north} metres"));
    };
    let digits = if frame.crs().is_some_and(Crs::is_geographic) { 7 } else { 3 };
    let [x0, y0, x1, y1] = frame.bounds()?.map(|value| decimal(value, digits));
    Some(format!("from {x0},{y0} to {x1},{y1} in {}", system_name(frame)))
}
