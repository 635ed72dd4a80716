//! ESRI's label: a keyword and its value a line, in any order and any letters.
//!
//! Two spellings mean the same: that of `.bil` (ULXMAP, XDIM: the middle of the north-western sample) and that of `.flt` (xllcorner, cellsize: the grid's south-western corner).
//! Where PIXELTYPE is left out, whole numbers have a sign if the value for "no data" has one; so GDAL reads them too.

use super::{Interleave, Label, beside, side, whole};
use crate::plain::Kind;
use crate::reader::{Corrects, CrsSaid, Said};
use crate::text::number;
use std::collections::BTreeMap;
use std::path::Path;
use terrasoar_layout::dem::{SampleType, Warning};
use terrasoar_layout::error::LayoutError;

/// Most lines that are looked at; labels have some twenty.
const MOST_LINES: usize = 1000;

/// Keywords and values, small letters.
type Words = BTreeMap<String, String>;

fn words(text: &str) -> Words {
    let pairs = text.lines().take(MOST_LINES).filter_map(|line| {
        let mut words = line.split_whitespace();
        let key = words.next()?.trim_end_matches([':', '=']).to_ascii_lowercase();
        let value = words.find(|word| *word != "=")?;
        Some((key, value.to_owned()))
    });
    let mut found = Words::new();
    // Of a keyword that is there twice the first one counts.
    pairs.for_each(|(key, value)| {
        found.entry(key).or_insert(value);
    });
    found
}

/// Whether a text is such a label.
pub(super) fn is_label(text: &str) -> bool {
    let words = words(text);
    words.contains_key("nrows") && words.contains_key("ncols")
}

/// The label in `text`, of the file at `path`, for a data file of `length` bytes.
pub(super) fn parse(path: &Path, text: &str, data: &Path, length: u64) -> Result<Label, LayoutError> {
    let words = words(text);
    let word = |keys: &[&str]| keys.iter().find_map(|key| words.get(*key)).map(String::as_str);
    let bytes = |key: &str| words.get(key).map(|text| whole(path, key, text)).transpose();
    let samples = [side(path, "ncols", word(&["ncols"]))?, side(path, "nrows", word(&["nrows"]))?];
    let bands = bytes("nbands")?.unwrap_or(1);
    let bands = u32::try_from(bands).ok().filter(|bands| *bands > 0).ok_or_else(|| {
        LayoutError::damaged(path, "header", format!("{bands} bands are none that can be read; mend nbands"))
    })?;
    let interleave = match word(&["layout"]) {
        None => Interleave::default(),
        Some(text) => Interleave::parse(text).ok_or_else(|| {
            let shown = crate::text::shown(text.as_bytes());
            LayoutError::unsupported(path, format!("the layout {shown} is unknown; it is BIL, BIP or BSQ"))
        })?,
    };
    let skip = bytes("skipbytes")?.unwrap_or(0);
    let nodata = word(&["nodata", "nodata_value"]).map(|text| text.replace(',', "."));
    let mut warnings = Vec::new();
    let per_sample = {
        let count = u64::from(samples[0]) * u64::from(samples[1]);
        length.saturating_sub(skip) / count.saturating_mul(u64::from(bands)).max(1)
    };
    let sample_type = sample_type(path, data, &words, nodata.as_deref(), per_sample, &mut warnings)?;
    let is_big =
        match word(&["byteorder"]).and_then(|text| text.chars().next()).map(|c| c.to_ascii_uppercase()) {
            None | Some('I' | 'L') => false,
            Some('M' | 'B') => true,
            Some(_) => {
                return Err(LayoutError::unsupported(
                    path,
                    "its byte order is neither I (low byte first) nor M (high byte first); mend byteorder",
                ));
            }
        };
    Ok(Label {
        corrects: Corrects::default(),
        format: "ESRI grid of plain numbers (.hdr)",
        samples,
        bands,
        kind: Kind { sample_type, is_big },
        interleave,
        skip,
        row_bytes: [bytes("bandrowbytes")?, bytes("totalrowbytes")?],
        band_gap: bytes("bandgapbytes")?.unwrap_or(0),
        place: place(path, &words, samples)?.map(|place| Said::new(place, beside::name(path))),
        crs: CrsSaid::default(),
        nodata: nodata.map(|text| Said::new(text, format!("NODATA in {}", beside::name(path)))),
        names: Vec::new(),
        gains: Vec::new(),
        offsets: Vec::new(),
        unit: None,
        notes: Vec::new(),
        warnings,
    })
}

fn sample_type(
    path: &Path,
    data: &Path,
    words: &Words,
    nodata: Option<&str>,
    per_sample: u64,
    warnings: &mut Vec<Warning>,
) -> Result<SampleType, LayoutError> {
    let has_extension = |wanted: &str| data.extension().is_some_and(|e| e.eq_ignore_ascii_case(wanted));
    let class = match words.get("pixeltype").and_then(|text| text.chars().next()) {
        Some(letter) => Some(letter.to_ascii_uppercase()),
        None if has_extension("flt") => Some('F'),
        None => None,
    };
    let bits = match words.get("nbits") {
        Some(text) => whole(path, "nbits", text)?,
        None if class == Some('F') => {
            if per_sample == 8 {
                64
            } else {
                32
            }
        }
        // As long as the file lets them be.
        None => match per_sample {
            8.. => 64,
            4..8 => 32,
            2 | 3 => 16,
            _ => 8,
        },
    };
    let is_signed = nodata.and_then(|text| number(text.as_bytes())).is_some_and(|value| value < 0.0)
        || has_extension("dem");
    let is_said = words.contains_key("nbits");
    let class = class.unwrap_or_else(|| match bits {
        // Where even the size had to be found out, four or eight bytes are reals.
        32 | 64 if !is_said => 'F',
        64 => 'F',
        8 => 'U',
        bits => {
            let sign = if is_signed { 'S' } else { 'U' };
            let what = if is_signed { "with" } else { "without" };
            warnings.push(Warning::new(format!(
                "{} does not say what its {bits}-bit numbers are (PIXELTYPE); whole numbers {what} a sign were assumed; if that is wrong, add a line \
                 PIXELTYPE SIGNEDINT, UNSIGNEDINT or FLOAT to it",
                beside::name(path)
            )));
            sign
        }
    });
    Ok(match (bits, class) {
        (8, 'S') => SampleType::I8,
        (8, 'U') => SampleType::U8,
        (16, 'S') => SampleType::I16,
        (16, 'U') => SampleType::U16,
        (32, 'S') => SampleType::I32,
        (32, 'U') => SampleType::U32,
        (32, 'F') => SampleType::F32,
        (64, 'S') => SampleType::I64,
        (64, 'U') => SampleType::U64,
        (64, 'F') => SampleType::F64,
        (bits, class) => {
            let shown = crate::text::shown(class.to_string().as_bytes());
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "numbers of {bits} bits of type {shown} are not read; there are SIGNEDINT and UNSIGNEDINT of 8, 16, 32 and 64 bits, and FLOAT of 32 and 64; \
                     write the data again: gdal_translate INPUT output.tif"
                ),
            ));
        }
    })
}

/// Affine map of sample centres, row 0 in the north.
fn place(path: &Path, words: &Words, [_, high]: [u32; 2]) -> Result<Option<[f64; 6]>, LayoutError> {
    let measure = |keys: &[&str]| {
        let Some((key, text)) = keys.iter().find_map(|key| Some((key, words.get(*key)?))) else {
            return Ok(None);
        };
        let value = number(text.as_bytes()).filter(|value| value.is_finite());
        value.map(Some).ok_or_else(|| {
            let shown = crate::text::shown(text.as_bytes());
            LayoutError::damaged(path, "header", format!("{key} {shown} is no number; mend it"))
        })
    };
    let (dx, dy) = (measure(&["xdim", "dx", "cellsize"])?, measure(&["ydim", "dy", "cellsize"])?);
    let (Some(dx), Some(dy)) = (dx, dy) else { return Ok(None) };
    if dx <= 0.0 || dy <= 0.0 {
        return Err(LayoutError::damaged(
            path,
            "header",
            "a distance between samples is not above 0; mend xdim, ydim or cellsize",
        ));
    }
    let north_of = |south: f64| south + f64::from(high - 1) * dy;
    let x = match (measure(&["ulxmap", "xllcenter", "xllcentre"])?, measure(&["xllcorner"])?) {
        (Some(centre), _) => Some(centre),
        (None, corner) => corner.map(|corner| corner + 0.5 * dx),
    };
    let y = match (measure(&["ulymap"])?, measure(&["yllcenter", "yllcentre"])?, measure(&["yllcorner"])?) {
        (Some(north), ..) => Some(north),
        (None, Some(south), _) => Some(north_of(south)),
        (None, None, corner) => corner.map(|corner| north_of(corner + 0.5 * dy)),
    };
    Ok(x.zip(y).map(|(x, y)| [x, dx, 0.0, y, 0.0, -dy]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_that_says_what_its_numbers_are_is_not_told_that_it_does_not() {
        for (said, sample_type, warned) in [
            ("NBITS 32\nPIXELTYPE FLOAT\n", SampleType::F32, false),
            ("NBITS 16\nPIXELTYPE SIGNEDINT\n", SampleType::I16, false),
            ("NBITS 32\nPIXELTYPE UNSIGNEDINT\n", SampleType::U32, false),
            ("NBITS 16\n", SampleType::U16, true),
            ("NBITS 32\nNODATA -1\n", SampleType::I32, true),
        ] {
            let text = format!("NROWS 2\nNCOLS 2\n{said}");
            let label = parse(Path::new("e.hdr"), &text, Path::new("e.bil"), 16).unwrap();
            assert_eq!((label.kind.sample_type, !label.warnings.is_empty()), (sample_type, warned), "{said}");
        }
    }
}
