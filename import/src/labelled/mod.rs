//! Plain numbers with a label beside them: `.flt`, `.bil`, `.bip`, `.bsq` and GTOPO30's `.dem` with ESRI's `.hdr`, and anything with ENVI's `.hdr`.
//!
//! The label is a text ([`esri`], [`envi`]) that says how the numbers lie in the data file; both become a [`Label`], and [`crate::plain`] reads the band that is asked for. A person
//! may name either of the two files. Cost: reading the label. Of the data only the length is looked at.

mod beside;
mod envi;
mod esri;

use crate::OpenOptions;
use crate::plain::{Kind, Plain};
use crate::reader::{Corrects, CrsSaid, Declared, Reader, Said, VerticalUnit};
use crate::value::band;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, Warning};
use terrasoar_layout::error::LayoutError;

/// Extensions of data files, the usual ones first; none is a data file as well.
const DATA_EXTENSIONS: [&str; 9] = ["flt", "bil", "bip", "bsq", "dem", "img", "dat", "raw", "bin"];

/// How bands lie among each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Interleave {
    /// A row of every band, then the next row.
    #[default]
    Line,
    /// A sample of every band, then the next sample.
    Pixel,
    /// One band after the other.
    Sequential,
}

impl Interleave {
    fn parse(text: &str) -> Option<Self> {
        match text.to_ascii_lowercase().as_str() {
            "bil" => Some(Self::Line),
            "bip" => Some(Self::Pixel),
            "bsq" => Some(Self::Sequential),
            _ => None,
        }
    }
}

/// What a label says.
#[derive(Debug, Clone, PartialEq)]
struct Label {
    format: &'static str,
    samples: [u32; 2],
    bands: u32,
    kind: Kind,
    interleave: Interleave,
    /// Bytes before the first sample.
    skip: u64,
    /// Bytes of a row of one band, and of all bands, where they are said.
    row_bytes: [Option<u64>; 2],
    /// Bytes between bands that follow each other.
    band_gap: u64,
    place: Option<Said<[f64; 6]>>,
    crs: CrsSaid,
    nodata: Option<Said<String>>,
    /// Names, factors and offsets of the bands, as many as are said.
    names: Vec<String>,
    gains: Vec<f64>,
    offsets: Vec<f64>,
    unit: Option<Said<VerticalUnit>>,
    notes: Vec<String>,
    warnings: Vec<Warning>,
    corrects: Corrects,
}

/// Whether there is a label for the data file at `path`, or `path` is one.
pub(crate) fn is_labelled(path: &Path) -> bool {
    files(path).is_some()
}

/// The data file and its label.
fn files(path: &Path) -> Option<(PathBuf, PathBuf)> {
    let is_label =
        |path: &Path| beside::text(path).is_ok_and(|text| envi::is_label(&text) || esri::is_label(&text));
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hdr")) {
        let stem = path.with_extension("");
        let data = if stem.is_file() {
            Some(stem)
        } else {
            DATA_EXTENSIONS.iter().find_map(|extension| beside::find(path, extension))
        };
        return data.filter(|_| is_label(path)).map(|data| (data, path.to_owned()));
    }
    let label = beside::find(path, "hdr").filter(|label| is_label(label))?;
    Some((path.to_owned(), label))
}

/// Plain numbers with a label.
#[derive(Debug)]
pub(crate) struct LabelledDem {
    plain: Plain,
    declared: Declared,
}

impl LabelledDem {
    /// Reads the label of the data file at `path`, or the label at `path`.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let Some((data, label_path)) = files(path) else {
            return Err(LayoutError::not_this_format(
                path,
                "there is no label (.hdr) beside the file that says what it holds",
            ));
        };
        let text = beside::text(&label_path)?;
        let length = std::fs::metadata(&data)
            .map_err(|source| LayoutError::io(&data, "cannot open the elevation file", source))?
            .len();
        let label = match envi::is_label(&text) {
            true => envi::parse(&label_path, &text)?,
            false => esri::parse(&label_path, &text, &data, length)?,
        };
        Self::with_label(&data, &label_path, label, length, options)
    }

    fn with_label(
        data: &Path,
        label_path: &Path,
        label: Label,
        length: u64,
        options: &OpenOptions,
    ) -> Result<Self, LayoutError> {
        let names: Vec<&str> = label.names.iter().map(String::as_str).collect();
        let number = match &options.band {
            Some(word) => band(data, word, label.bands as usize, &names)?,
            None => 0,
        };
        let (at, steps) = label.layout(label_path, number as u64)?;
        let plain = Plain::checked(data, label.samples, label.kind, at, steps)?;
        let more = length.saturating_sub(label.length(steps));
        let mut declared = Declared::new(label.samples, label.kind.sample_type, label.format);
        if label.bands > 1 && options.band.is_none() {
            let words = format!("band 1 of {} was read", label.bands);
            declared
                .warnings
                .push(Warning::new(words).mended_by(terrasoar_layout::remedy::Remedy::Band, "2"));
        }
        let of_band = |values: &[f64], idle: f64, by: &str| {
            let value = values.get(number).copied().filter(|value| *value != idle);
            value.map(|value| Said::new(value, by))
        };
        if more > 0 {
            declared.warnings.push(Warning::new(format!(
                "the file has {more} bytes more than {} says, so that this label may be another file's; compare the heights with what they should be",
                beside::name(label_path)
            )));
        }
        declared.corrects = label.corrects;
        declared.value.scale = of_band(&label.gains, 1.0, "data gain values");
        declared.value.offset = of_band(&label.offsets, 0.0, "data offset values");
        declared.value.unit = label.unit;
        declared.value.nodata.extend(label.nodata);
        declared.place = label.place;
        declared.crs = label.crs;
        declared.notes.extend(label.notes);
        declared.warnings.extend(label.warnings);
        Ok(Self { plain, declared })
    }
}

impl Label {
    /// Where a band begins, and its steps along a row and from row to row.
    fn layout(&self, path: &Path, band: u64) -> Result<(u64, [u64; 2]), LayoutError> {
        let size = self.kind.bytes();
        let [wide, high] = self.samples.map(u64::from);
        let bands = u64::from(self.bands);
        // Below 2^32 samples of 8 bytes: products of two sides fit, of three factors may not.
        let row = wide * size;
        let too_large = || {
            LayoutError::damaged(
                path,
                "header",
                "what it says of the file's shape is beyond any file; mend it",
            )
        };
        let [band_row, all_rows] = self.row_bytes;
        let (from_start, along, down, least) = match self.interleave {
            Interleave::Sequential => {
                let down = band_row.unwrap_or(row);
                let one = down
                    .checked_mul(high)
                    .and_then(|all| all.checked_add(self.band_gap))
                    .ok_or_else(too_large)?;
                (one.checked_mul(band).ok_or_else(too_large)?, size, down, row)
            }
            Interleave::Line => {
                let one = band_row.unwrap_or(row);
                let all = one.checked_mul(bands).ok_or_else(too_large)?;
                if one < row {
                    return Err(self.short_rows(path, one, row));
                }
                (one.checked_mul(band).ok_or_else(too_large)?, size, all_rows.unwrap_or(all), all)
            }
            Interleave::Pixel => {
                let all = row.checked_mul(bands).ok_or_else(too_large)?;
                (band * size, size * bands, all_rows.unwrap_or(all), all)
            }
        };
        if down < least {
            return Err(self.short_rows(path, down, least));
        }
        let at = self.skip.checked_add(from_start).ok_or_else(too_large)?;
        Ok((at, [along, down]))
    }

    /// Bytes of the whole file, for rows that are so far apart.
    fn length(&self, [_, down]: [u64; 2]) -> u64 {
        let rows = down.saturating_mul(u64::from(self.samples[1]));
        let bands = match self.interleave {
            Interleave::Sequential => {
                rows.saturating_add(self.band_gap).saturating_mul(u64::from(self.bands))
            }
            Interleave::Line | Interleave::Pixel => rows,
        };
        self.skip.saturating_add(bands)
    }

    fn short_rows(&self, path: &Path, said: u64, needed: u64) -> LayoutError {
        LayoutError::damaged(
            path,
            "header",
            format!(
                "rows of {said} bytes do not hold {} samples a row, which take {needed}; mend BANDROWBYTES or TOTALROWBYTES, or leave them out",
                self.samples[0]
            ),
        )
    }
}

/// A side of the grid.
fn side(path: &Path, key: &str, text: Option<&str>) -> Result<u32, LayoutError> {
    let refused = |shown: &str| {
        let shown = crate::text::shown(shown.as_bytes());
        LayoutError::damaged(
            path,
            "header",
            format!("{key} {shown} makes no grid; at least 2 x 2 samples are needed"),
        )
    };
    let text =
        text.ok_or_else(|| LayoutError::damaged(path, "header", format!("it says no {key}; add it")))?;
    text.trim().parse::<u32>().ok().filter(|side| *side >= 2).ok_or_else(|| refused(text))
}

/// A whole number that is not negative.
fn whole(path: &Path, key: &str, text: &str) -> Result<u64, LayoutError> {
    text.trim().parse::<u64>().map_err(|_| {
        let shown = crate::text::shown(text.as_bytes());
        LayoutError::damaged(path, "header", format!("{key} {shown} is no number of bytes or bands; mend it"))
    })
}

impl Reader for LabelledDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.plain.stream(sink)
    }
}
