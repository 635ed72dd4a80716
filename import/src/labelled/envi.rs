//! ENVI's label: `key = value` lines after the word ENVI; a value in braces may take several lines.
//!
//! The point that "map info" ties is counted from 1 at the outer corner of the north-western sample, so 1.5 is that sample's middle.

use super::{Interleave, Label, beside, side, whole};
use crate::plain::Kind;
use crate::reader::{Corrects, CrsSaid, HorizontalSize, Said};
use crate::text::number;
use crate::value::unit_m;
use std::collections::BTreeMap;
use std::path::Path;
use terrasoar_layout::dem::{SampleType, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::sin_cos;

/// Keys in small letters, and values.
type Values = BTreeMap<String, String>;

/// Whether a text is such a label.
pub(super) fn is_label(text: &str) -> bool {
    text.trim_start().get(..4).is_some_and(|word| word.eq_ignore_ascii_case("ENVI"))
}

fn values(text: &str) -> Values {
    let mut values = Values::new();
    let mut lines = text.lines().skip(1);
    while let Some(line) = lines.next() {
        let Some((key, value)) = line.split_once('=') else { continue };
        let mut value = value.trim().to_owned();
        if value.starts_with('{') {
            while !value.contains('}') {
                let Some(more) = lines.next() else { break };
                value.push('\n');
                value.push_str(more);
            }
            let inner = value.trim_start_matches('{');
            value = inner.split('}').next().unwrap_or(inner).trim().to_owned();
        }
        let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
        values.entry(key).or_insert(value);
    }
    values
}

/// The items of a list.
fn items(text: &str) -> Vec<&str> {
    text.split(',').map(str::trim).collect()
}

/// The label in `text`, of the file at `path`.
pub(super) fn parse(path: &Path, text: &str) -> Result<Label, LayoutError> {
    let values = values(text);
    let value = |key: &str| values.get(key).map(String::as_str).filter(|text| !text.is_empty());
    let count = |key: &str| value(key).map(|text| whole(path, key, text)).transpose();
    refuse_what_is_not_read(path, &values)?;
    let samples = [side(path, "samples", value("samples"))?, side(path, "lines", value("lines"))?];
    let bands = count("bands")?.unwrap_or(1);
    let bands = u32::try_from(bands).ok().filter(|bands| *bands > 0).ok_or_else(|| {
        LayoutError::damaged(
            path,
            "header",
            format!("{bands} bands are none that can be read; mend \"bands\""),
        )
    })?;
    let code = count("data type")?;
    let sample_type = match code {
        Some(1) => SampleType::U8,
        Some(2) => SampleType::I16,
        Some(3) => SampleType::I32,
        Some(4) => SampleType::F32,
        Some(5) => SampleType::F64,
        Some(12) => SampleType::U16,
        Some(13) => SampleType::U32,
        Some(14) => SampleType::I64,
        Some(15) => SampleType::U64,
        _ => {
            let shown = code.map_or_else(|| "none".to_owned(), |code| code.to_string());
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "its data type ({shown}) is none of real or whole numbers (1 to 5, 12 to 15); write the data again: gdal_translate -ot Float32 INPUT output.tif"
                ),
            ));
        }
    };
    let interleave = match value("interleave") {
        None => Interleave::Sequential,
        Some(text) => Interleave::parse(text).ok_or_else(|| {
            let shown = crate::text::shown(text.as_bytes());
            LayoutError::unsupported(
                path,
                format!("the interleave {shown} is unknown; it is bil, bip or bsq"),
            )
        })?,
    };
    let reals = |key: &str| {
        value(key).map_or_else(Vec::new, |text| {
            items(text).iter().filter_map(|item| number(item.as_bytes())).collect()
        })
    };
    let mut warnings = Vec::new();
    let (place, crs) = match value("map info") {
        Some(info) => map_info(path, info, &mut warnings)?,
        None => (None, CrsSaid::default()),
    };
    let text = value("coordinate system string").map(|text| Said::new(text.to_owned(), beside::name(path)));
    Ok(Label {
        corrects: Corrects { nodata: true, scale: true, ..Corrects::default() },
        format: "ENVI grid of plain numbers (.hdr)",
        samples,
        bands,
        kind: Kind { sample_type, is_big: count("byte order")? == Some(1) },
        interleave,
        skip: count("header offset")?.unwrap_or(0),
        row_bytes: [None; 2],
        band_gap: 0,
        place: place.map(|place| Said::new(place, format!("map info in {}", beside::name(path)))),
        // The words of units are few: feet of surveys are "Feet" too.
        crs: CrsSaid { unit_yields: text.is_some(), text: text.or(crs.text.clone()), ..crs },
        nodata: value("data ignore value")
            .map(|text| Said::new(text.to_owned(), format!("data ignore value in {}", beside::name(path)))),
        names: value("band names")
            .map_or_else(Vec::new, |text| items(text).iter().map(|name| (*name).to_owned()).collect()),
        gains: reals("data gain values"),
        offsets: reals("data offset values"),
        unit: None,
        notes: Vec::new(),
        warnings,
    })
}

fn refuse_what_is_not_read(path: &Path, values: &Values) -> Result<(), LayoutError> {
    let is_zero = |text: &String| items(text).iter().all(|item| matches!(*item, "" | "0"));
    if !values.get("file compression").is_none_or(is_zero) {
        return Err(LayoutError::unsupported(
            path,
            "its data is compressed; write it again: gdal_translate INPUT output.tif",
        ));
    }
    for key in ["major frame offsets", "minor frame offsets"] {
        if !values.get(key).is_none_or(is_zero) {
            return Err(LayoutError::unsupported(
                path,
                format!("its rows have frames ({key}), which are not read; write it again without them"),
            ));
        }
    }
    Ok(())
}

/// Place of sample centres and the system that the projection's name and datum make.
fn map_info(
    path: &Path,
    info: &str,
    warnings: &mut Vec<Warning>,
) -> Result<(Option<[f64; 6]>, CrsSaid), LayoutError> {
    let items = items(info);
    let mut numbers = [0.0; 6];
    for (to, item) in numbers.iter_mut().zip(items.iter().skip(1)) {
        *to = number(item.as_bytes()).filter(|value| value.is_finite()).ok_or_else(|| {
            let shown = crate::text::shown(item.as_bytes());
            LayoutError::damaged(path, "header", format!("{shown} in \"map info\" is no number; mend it"))
        })?;
    }
    let named = |key: &str| {
        items.iter().find_map(|item| {
            let (name, value) = item.split_once('=')?;
            name.trim().eq_ignore_ascii_case(key).then(|| value.trim())
        })
    };
    // Longitudes and latitudes may be counted in parts of degrees, which GDAL takes into degrees.
    let is_geographic = items[0].to_ascii_lowercase().starts_with("geographic");
    let parts = match named("units").map(str::to_ascii_lowercase).as_deref() {
        Some("seconds") if is_geographic => 3600.0,
        Some("minutes") if is_geographic => 60.0,
        _ => 1.0,
    };
    let [column, row] = [numbers[0], numbers[1]];
    let [x, y, dx, dy] = [2, 3, 4, 5].map(|at| numbers[at] / parts);
    if items.len() < 7 || dx == 0.0 || dy == 0.0 {
        return Ok((None, CrsSaid::default()));
    }
    let turn_deg = named("rotation").and_then(|text| number(text.as_bytes())).unwrap_or(0.0);
    let (sin, cos) = sin_cos(turn_deg.to_radians());
    // Steps of a column and of a row, in x and y.
    let [mut xc, mut xr, mut yc, mut yr] = [cos * dx, sin * dx, sin * dy, -cos * dy];
    if turn_deg.abs() == 180.0 {
        [xc, xr, yc, yr] = [dx, 0.0, 0.0, dy];
        warnings.push(Warning::new(format!(
            "the rotation of 180 degrees in {} was taken for rows from the south, for which GDAL writes it; if the grid was turned, so that columns run from the east, write it as another format",
            beside::name(path)
        )));
    }
    let (across, down) = (1.5 - column, 1.5 - row);
    let place = [x + across * xc + down * xr, xc, xr, y + across * yc + down * yr, yc, yr];
    Ok((Some(place), system(path, &items, named("units"))))
}

fn system(path: &Path, items: &[&str], units: Option<&str>) -> CrsSaid {
    let name = items[0].to_ascii_lowercase();
    let item = |at: usize| items.get(at).copied().unwrap_or_default().to_ascii_lowercase();
    // A place's own zone and hemisphere stand before the datum.
    let is_utm = name == "utm";
    let datum = match item(if is_utm { 9 } else { 7 }).as_str() {
        "wgs-84" | "wgs84" | "wgs 84" => Some("+datum=WGS84"),
        "north america 1983" | "nad83" | "nad-83" => Some("+datum=NAD83"),
        "north america 1927" | "nad27" | "nad-27" => Some("+datum=NAD27"),
        "etrs89" | "etrs-89" => Some("+ellps=GRS80"),
        _ => None,
    };
    let zone = item(7).parse::<u32>().ok().filter(|zone| (1..=60).contains(zone));
    let text = match (datum, zone) {
        (Some(datum), Some(zone)) if is_utm => {
            let south = if item(8).starts_with('s') { " +south" } else { "" };
            Some(format!("+proj=utm +zone={zone}{south} {datum} +units=m +no_defs"))
        }
        (Some(datum), _) if name.starts_with("geographic") => Some(format!("+proj=longlat {datum} +no_defs")),
        _ => None,
    };
    let unit = units.and_then(|units| match units.to_ascii_lowercase().as_str() {
        "radians" => Some(HorizontalSize::Radians(1.0)),
        "degrees" => Some(HorizontalSize::Radians(1f64.to_radians())),
        units => unit_m(units).map(HorizontalSize::Metres),
    });
    let by = || format!("map info in {}", beside::name(path));
    CrsSaid {
        text: text.map(|text| Said::new(text, by())),
        name: terrasoar_layout::words::harmless(items[0], 60),
        unit: unit.map(|unit| Said::new(unit, by())),
        is_local: name == "arbitrary",
        ..CrsSaid::default()
    }
}
