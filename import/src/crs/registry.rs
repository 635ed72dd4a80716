//! The EPSG registry: crate `crs-definitions`, and tables of what it lacks: vertical systems, the parts of compound ones, units, and systems added since.
//!
//! The tables beside this file are made from PROJ's copy of the EPSG dataset by `data-scripts/make-crs-tables.py`. Cost: a search of a sorted table in memory, some microseconds.

use crate::reader::HorizontalSize;

const VERTICAL: &str = include_str!("registry/vertical.txt");
const COMPOUND: &str = include_str!("registry/compound.txt");
const MISSING: &str = include_str!("registry/missing.txt");
const UNITS: &str = include_str!("registry/units.txt");
const SHIFTS: &str = include_str!("registry/shifts.txt");
const DATUMS: &str = include_str!("registry/datums.txt");
const REACH: &str = include_str!("registry/reach.txt");

/// PROJ strings that the list of definitions has wrong: a false easting of 40,000 chains taken for metres; a sphere for whose latitudes those of the ellipsoid are taken as they are.
const MENDED: [(u32, &str); 2] = [
    (
        3167,
        "+proj=omerc +lat_0=4 +lonc=102.25 +alpha=323.0257905 +k=0.99984 +x_0=804670.24 +y_0=0 +no_uoff +gamma=323.1301023611111 +a=6377295.664 +b=6356094.667915204 +to_meter=20.116756 +no_defs",
    ),
    (4055, "+proj=longlat +a=6378137 +b=6378137 +nadgrids=@null +no_defs"),
];

/// Datums by their words in PROJ strings, with PROJ's shifts to WGS 84. NAD27's is a grid; those of Germany and Austria (potsdam, hermannskogel) differ from region to region.
const SHIFTS_OF_WORDS: [(&str, &str); 5] = [
    ("GGRS87", "-199.87,74.79,246.62"),
    ("carthage", "-263,6,431"),
    ("ire65", "482.53,-130.596,564.557,-1.042,-0.214,-0.631,8.15"),
    ("nzgd49", "59.47,-5.04,187.44,0.47,-0.1,1.024,-4.5993"),
    ("OSGB36", "446.448,-125.157,542.06,0.1502,0.247,0.8421,-20.4894"),
];

/// A horizontal system.
pub(super) enum Horizontal {
    /// Its WKT and its PROJ string.
    Text { wkt: &'static str, proj: &'static str },
    /// Its parts.
    Parts {
        name: &'static str,
        unit_name: &'static str,
        size: HorizontalSize,
        datum: &'static str,
        proj: &'static str,
    },
}

/// A vertical system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VerticalEntry {
    pub(super) name: &'static str,
    pub(super) unit_name: &'static str,
    pub(super) metres: f64,
    pub(super) is_down: bool,
}

/// The fields after the code, of the line that begins with it.
fn line<const N: usize>(table: &'static str, code: u32) -> Option<[&'static str; N]> {
    let wanted = code.to_string();
    let rest = table.lines().find_map(|line| line.strip_prefix(&wanted)?.strip_prefix('|'))?;
    let mut fields = rest.splitn(N, '|');
    let fields = std::array::from_fn(|_| fields.next().unwrap_or(""));
    Some(fields)
}

/// The horizontal system of a code; compound ones are none.
pub(super) fn horizontal(code: u32) -> Option<Horizontal> {
    let known = u16::try_from(code).ok().and_then(crs_definitions::from_code);
    if let Some(def) = known.filter(|def| !def.wkt.is_empty() && !def.wkt.starts_with("COMPD_CS")) {
        let mended = MENDED.iter().find(|(mended, _)| *mended == code).map(|(_, proj)| *proj);
        return Some(Horizontal::Text { wkt: def.wkt, proj: mended.unwrap_or(def.proj4) });
    }
    let [name, kind, unit_name, size, datum, proj] = line(MISSING, code)?;
    let size: f64 = size.parse().ok()?;
    let size = if kind == "p" { HorizontalSize::Metres(size) } else { HorizontalSize::Radians(size) };
    Some(Horizontal::Parts { name, unit_name, size, datum, proj })
}

/// The PROJ string of a code with the shift to WGS 84 as PROJ has it, and the metres by which places may still be off: where PROJ's shifts differ from region to region, and where it has none.
pub(super) fn tied(code: u32, proj: &str) -> (String, Option<f64>) {
    let Some([shift, off_m]) = line(SHIFTS, code) else { return (proj.to_owned(), None) };
    let off_m = off_m.parse().ok().filter(|off_m: &f64| *off_m > 0.0);
    let proj = if shift.is_empty() { proj.to_owned() } else { shifted(proj, &format!("+towgs84={shift}")) };
    (proj, off_m)
}

/// The shift to WGS 84 of the datum of a name, in small letters and digits alone, as a word of a PROJ string; the metres by which places may be off; and the code of its longitudes and latitudes.
pub(super) fn shift_of_datum(name: &str) -> Option<(String, Option<f64>, u32)> {
    let code = code_of_datum(name)?;
    let (Horizontal::Text { proj, .. } | Horizontal::Parts { proj, .. }) = horizontal(code)?;
    let (proj, off_m) = tied(code, proj);
    let word = proj.split_whitespace().find_map(|word| match word.strip_prefix("+datum=") {
        Some(datum) => shift_of_word(datum).map(|shift| format!("+towgs84={shift}")),
        None => word.starts_with("+towgs84=").then(|| word.to_owned()),
    })?;
    Some((word, off_m, code))
}

/// The shift that PROJ has for a datum of its strings.
fn shift_of_word(datum: &str) -> Option<&'static str> {
    SHIFTS_OF_WORDS.iter().find(|(word, _)| *word == datum).map(|(_, shift)| *shift)
}

/// The code of the longitudes and latitudes of a datum.
pub(super) fn code_of_datum(name: &str) -> Option<u32> {
    DATUMS.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('|')?.parse().ok())
}

/// The EPSG registry's own name of the datum of longitudes and latitudes of a code; `None` for datums that have no other name.
pub(super) fn name_of_datum(code: u32) -> Option<&'static str> {
    DATUMS.lines().find_map(|line| {
        let (name, of) = line.split_once('|')?;
        (of.parse() == Ok(code)).then_some(name)
    })
}

/// Rectangles of longitude and latitude of WGS 84, west, south, east and north in degrees, for which the shift of a system or of its datum is known, by the first of `codes` that the table has;
/// empty where the shift is good everywhere, or nothing is known of that.
pub(super) fn reach(codes: &[Option<u32>]) -> Vec<[f64; 4]> {
    let Some([boxes]) = codes.iter().flatten().find_map(|code| line(REACH, *code)) else { return Vec::new() };
    let numbers = |text: &str| {
        let mut sides = text.split(',').map(|side| side.parse().ok());
        let mut next = || sides.next().flatten();
        Some([next()?, next()?, next()?, next()?])
    };
    boxes.split(';').filter_map(numbers).collect()
}

/// The string with another shift of datum.
pub(super) fn shifted(proj: &str, shift: &str) -> String {
    let is_kept = |word: &&str| !["+towgs84=", "+nadgrids="].iter().any(|start| word.starts_with(start));
    let kept: Vec<&str> = proj.split_whitespace().filter(is_kept).collect();
    format!("{} {shift}", kept.join(" "))
}

/// Whether a system's own first axis goes north: so do those of longitudes and latitudes, and projected ones of which the list of definitions leaves the axes out, for such programs of
/// maps turned round. `None` for what is not in the list.
pub(crate) fn is_north_first(code: u32) -> Option<bool> {
    let wkt = u16::try_from(code).ok().and_then(crs_definitions::from_code)?.wkt;
    Some(wkt.starts_with("GEOGCS") || (wkt.starts_with("PROJCS") && !wkt.contains("AXIS[")))
}

/// Codes of the horizontal and the vertical part of a compound system.
pub(super) fn compound(code: u32) -> Option<(u32, u32)> {
    let [horizontal, vertical, _name] = line(COMPOUND, code)?;
    Some((horizontal.parse().ok()?, vertical.parse().ok()?))
}

/// The vertical system of a code.
pub(super) fn vertical(code: u32) -> Option<VerticalEntry> {
    let [name, unit_name, metres, direction] = line(VERTICAL, code)?;
    Some(VerticalEntry { name, unit_name, metres: metres.parse().ok()?, is_down: direction == "down" })
}

/// The code of the vertical system that counts heights in metres from where that of `code` counts them: itself, or the one that differs in its unit alone.
pub(crate) fn vertical_in_metres(code: u32) -> Option<u32> {
    let given = vertical(code)?;
    if given.metres == 1.0 && !given.is_down {
        return Some(code);
    }
    // "NAVD88 height (ftUS)" and "NAVD88 height".
    let plain = given.name.rsplit_once(" (").filter(|(_, unit)| unit.ends_with(')'))?.0;
    VERTICAL.lines().find_map(|line| {
        let (code, rest) = line.split_once('|')?;
        let code = code.parse().ok().filter(|_| rest.split('|').next() == Some(plain))?;
        vertical(code).filter(|entry| entry.metres == 1.0 && !entry.is_down).map(|_| code)
    })
}

/// Name and size of the unit of a code.
pub(crate) fn unit(code: u32) -> Option<(&'static str, HorizontalSize)> {
    let [name, kind, size] = line(UNITS, code)?;
    let size = size.parse().ok()?;
    Some((name, if kind == "length" { HorizontalSize::Metres(size) } else { HorizontalSize::Radians(size) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_found_in_either_table() {
        assert!(
            matches!(horizontal(2263), Some(Horizontal::Text { wkt, .. }) if wkt.contains("Long Island"))
        );
        let Some(Horizontal::Parts { size, .. }) = horizontal(2221) else { panic!("2221 is missing") };
        assert_eq!(size, HorizontalSize::Metres(1.0));
        assert_eq!([4326, 3035, 32632, 3857].map(is_north_first), [true, true, false, false].map(Some));
        assert!(horizontal(7415).is_none() && horizontal(5709).is_none() && horizontal(1).is_none());
        assert_eq!(compound(7415), Some((28992, 5709)));
        let feet = vertical(6360).unwrap();
        assert!((feet.metres - 1200.0 / 3937.0).abs() < 1e-15 && !feet.is_down);
        assert_eq!(vertical(8228).unwrap().metres, 0.3048);
        assert_eq!(
            [6360, 8228, 5703, 5773].map(vertical_in_metres),
            [Some(5703), Some(5703), Some(5703), Some(5773)]
        );
        assert_eq!([5715, 32632].map(vertical_in_metres), [None, None]);
        assert!(vertical(5715).unwrap().is_down && vertical(32632).is_none());
        assert_eq!(unit(9005).unwrap().1, HorizontalSize::Metres(0.3047972654));
        assert_eq!(unit(9001).unwrap().1, HorizontalSize::Metres(1.0));
    }
}
