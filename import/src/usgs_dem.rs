//! USGS DEM, the text of the Digital Elevation Model standards of 1987 to 1998, and CDED, which follows them.
//!
//! Records of fixed columns, written by Fortran: A says what there is, a B for each profile from west to east, a C may follow. A profile begins at its own height above the south, so columns of
//! a sheet that lies askew in its projection are of different lengths; what they leave free is void. (GDAL counts rows from whole multiples of the spacing, which real sheets keep; here they
//! lie where the profiles say.) Files have an A of 1024 bytes, older ones one of 864 or 893, and some end each record with
//! a line feed; so numbers are read one after the other, wherever records end. One thread reads the text, a block of profiles at a time.

use crate::WINDOW_SAMPLES;
use crate::input;
use crate::reader::{Declared, HorizontalSize, Reader, Said, VerticalUnit};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Bytes of the A record that mean something.
const HEAD_BYTES: usize = 1024;
/// Where the first profile may lie.
const BEGINS: [u64; 4] = [1024, 1025, 864, 893];
/// Samples that a byte of the file can stand for at most: profiles of a sheet that lies askew fill more than half of it.
const MOST_SAMPLES_PER_BYTE: u64 = 16;
/// Heights of a profile, at most.
const MOST_ROWS: f64 = 1_048_576.0;
/// What stands for no height.
const VOID: i64 = -32767;

/// Whether a file begins so: the pattern is regular, and the reference system one that there is.
pub(crate) fn is_usgs_dem(head: &[u8]) -> bool {
    let field = |from: usize| head.get(from..from + 6);
    matches!(field(150), Some(b"     1" | b"     4"))
        && matches!(field(156), Some(b"     0" | b"     1" | b"     2" | b"     3" | b" -9999"))
}

/// A USGS DEM.
#[derive(Debug)]
pub(crate) struct UsgsDem {
    path: PathBuf,
    declared: Declared,
    /// Where the first profile lies.
    begin: u64,
    /// North of the first row, and between rows, in units of the file.
    south: f64,
    up: f64,
    /// Units of height a number.
    scale: f64,
}

impl UsgsDem {
    /// Reads the A record and the begin of the first profile.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let cannot_read = |source| LayoutError::io(path, "cannot read the USGS DEM file", source);
        let file = input::open(path, "cannot open the USGS DEM file")?;
        let bytes = file.metadata().map_err(cannot_read)?.len();
        let mut head = Vec::new();
        (&file).take(HEAD_BYTES as u64).read_to_end(&mut head).map_err(cannot_read)?;
        let head = Head { path, bytes: &head };
        let profiles = head.whole("number of profiles", 858, 6)?;
        let steps = [head.real("spacing", 816, 12)?, head.real("spacing", 828, 12)?];
        let scale = head.real("resolution of heights", 840, 12)?;
        if !steps.iter().chain([&scale]).all(|step| step.is_finite() && *step > 0.0) {
            return Err(
                head.damaged(format!("a spacing of {} x {} x {scale} makes no grid", steps[0], steps[1]))
            );
        }
        let mut begin = None;
        for at in BEGINS {
            let mut text = Text::open(&file, at).map_err(cannot_read)?;
            // A number of a profile and a column, then its heights and their columns.
            let first =
                [text.whole(), text.whole(), text.whole(), text.whole()].map(|number| number.ok().flatten());
            if let [Some(1), Some(0 | 1), Some(1..), Some(1)] = first {
                let reals = [text.real(), text.real(), text.real()].map(|number| number.ok().flatten());
                begin = reals[0]
                    .zip(reals[1])
                    .zip(reals[2])
                    .map(|((west, south), datum)| (at, west, south, datum));
                break;
            }
        }
        let Some((begin, west, first_south, datum)) = begin else {
            return Err(head.damaged("no profile follows the A record".into()));
        };
        let corners: Vec<f64> =
            (0..8).map(|at| head.real("corner", 546 + 24 * at, 24)).collect::<Result<_, _>>()?;
        let lowest = |first: usize| corners[first..].iter().step_by(2).copied().fold(f64::INFINITY, f64::min);
        let highest =
            |first: usize| corners[first..].iter().step_by(2).copied().fold(f64::NEG_INFINITY, f64::max);
        let is_geographic = head.whole("reference system", 156, 6)? == 0;
        // Corners are those of the sheet, samples those of the grid around it: as far apart from the first profile's begin as makes whole steps.
        let steps_to = |north: f64| (north - first_south) / steps[1];
        let south = first_south + (steps_to(lowest(1)) + 1e-6).floor() * steps[1];
        let north = first_south + (steps_to(highest(1)) - 1e-6).ceil() * steps[1];
        let rows = ((north - south) / steps[1] + 1.0).round();
        let is_side = |side: f64| (2.0..=MOST_ROWS).contains(&side);
        let samples = rows * profiles as f64;
        if !is_side(rows) || !is_side(profiles as f64) || samples > (bytes * MOST_SAMPLES_PER_BYTE) as f64 {
            return Err(head.damaged(format!(
                "{profiles} profiles of {rows} heights do not go with a file of {bytes} bytes; it is cut short or damaged"
            )));
        }
        // Both were found to be small whole numbers.
        let is_whole = scale == 1.0 && datum == 0.0;
        let sample_type = if is_whole { SampleType::I32 } else { SampleType::F64 };
        let mut declared = Declared::new([profiles as u32, rows as u32], sample_type, "USGS DEM");
        declared.place = Some(Said::new([west, steps[0], 0.0, south, 0.0, steps[1]], "record A"));
        declared.value.scale = (scale != 1.0).then(|| Said::new(scale, "record A"));
        head.declare(is_geographic, &mut declared)?;
        Ok(Self { path: path.to_owned(), declared, begin, south, up: steps[1], scale })
    }
}

/// The A record.
struct Head<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

impl Head<'_> {
    fn damaged(&self, problem: String) -> LayoutError {
        LayoutError::damaged(self.path, "record A", format!("{problem}; fetch the file again"))
    }

    fn text(&self, from: usize, length: usize) -> String {
        String::from_utf8_lossy(self.bytes.get(from..from + length).unwrap_or_default()).trim().to_owned()
    }

    fn whole(&self, what: &str, from: usize, length: usize) -> Result<i64, LayoutError> {
        let text = self.text(from, length);
        text.parse().map_err(|_| self.damaged(format!("its {what} is \"{}\"", harmless(&text, 20))))
    }

    fn real(&self, what: &str, from: usize, length: usize) -> Result<f64, LayoutError> {
        let text = self.text(from, length);
        real(&text).ok_or_else(|| self.damaged(format!("its {what} is \"{}\"", harmless(&text, 30))))
    }

    /// Reference system, units, datum.
    fn declare(&self, is_geographic: bool, declared: &mut Declared) -> Result<(), LayoutError> {
        // Old records end before the datum, and mean that of their time.
        let datum = self.text(890, 2).parse().unwrap_or(1);
        let (geographic, utm, zones) = match datum {
            2 => (4322, 32200, 1..=60),
            3 => (4326, 32600, 1..=60),
            4 => (4269, 26900, 1..=23),
            _ => (4267, 26700, 1..=22),
        };
        let system = self.whole("reference system", 156, 6)?;
        let unit = self.whole("unit of places", 528, 6)?;
        let said = |code| Some(Said::new(code, "record A"));
        if is_geographic {
            declared.crs.code = said(geographic);
            let degrees = match unit {
                0 => 1f64.to_degrees(),
                // Some writers say metres of what are arc-seconds, for there is nothing else a place on a sphere can be.
                _ => 1.0 / 3600.0,
            };
            if let Some(place) = &mut declared.place {
                place.value = place.value.map(|value| value * degrees);
            }
        } else {
            let zone = self.whole("zone", 162, 6).unwrap_or(0);
            if system == 1 && zones.contains(&zone.abs()) {
                let south = if zone < 0 && datum == 3 { 100 } else { 0 };
                declared.crs.code = (zone > 0 || datum == 3)
                    .then(|| Said::new(utm + zone.unsigned_abs() as u32 + south, "record A"));
            } else if system == 2 {
                declared.crs.name = format!("State plane zone {zone}");
            }
            let metres = if unit == 1 { crate::value::US_SURVEY_FOOT_M } else { 1.0 };
            declared.crs.unit = Some(Said::new(HorizontalSize::Metres(metres), "record A"));
        }
        match self.text(888, 2).as_str() {
            "2" => declared.crs.vertical_code = said(5702),
            "3" => declared.crs.vertical_code = said(5703),
            _ => {}
        }
        let metres = if self.whole("unit of heights", 534, 6)? == 1 { 0.3048 } else { 1.0 };
        // Codes of a vertical system bring a unit with them, which is not that of the numbers here.
        declared.value.unit = Some(Said::new(VerticalUnit::Metres(metres), "record A"));
        declared.value.nodata.push(Said::new(VOID.to_string(), "the format"));
        Ok(())
    }
}

/// A number as Fortran writes it: "0.29D+07", "1.0E+01", blank for 0.
fn real(text: &str) -> Option<f64> {
    if text.is_empty() {
        return Some(0.0);
    }
    text.replace(['D', 'd'], "E").replace(' ', "").parse().ok().filter(|number: &f64| number.is_finite())
}

/// Numbers one after the other.
struct Text {
    input: BufReader<File>,
}

impl Text {
    fn open(file: &File, at: u64) -> std::io::Result<Self> {
        let mut file = file.try_clone()?;
        file.seek(SeekFrom::Start(at))?;
        Ok(Self { input: BufReader::with_capacity(1 << 16, file) })
    }

    fn peek(&mut self) -> std::io::Result<Option<u8>> {
        Ok(self.input.fill_buf()?.first().copied())
    }

    fn skip_blanks(&mut self) -> std::io::Result<()> {
        while self.peek()?.is_some_and(|byte| byte.is_ascii_whitespace() || byte == 0) {
            self.input.consume(1);
        }
        Ok(())
    }

    /// The next whole number, which ends where no digit follows: numbers of six columns may stand without a gap.
    fn whole(&mut self) -> std::io::Result<Option<i64>> {
        self.skip_blanks()?;
        let is_negative = self.peek()? == Some(b'-');
        if is_negative || self.peek()? == Some(b'+') {
            self.input.consume(1);
        }
        let (mut number, mut digits) = (0i64, 0);
        while let Some(byte) = self.peek()?.filter(u8::is_ascii_digit) {
            number = number.saturating_mul(10).saturating_add(i64::from(byte - b'0'));
            digits += 1;
            self.input.consume(1);
        }
        Ok((digits > 0).then_some(if is_negative { -number } else { number }))
    }

    /// The next real number, of 24 columns at most. Its exponent may follow a blank, and another number follow it without one.
    fn real(&mut self) -> std::io::Result<Option<f64>> {
        self.skip_blanks()?;
        let mut text = String::new();
        while let Some(byte) = self.peek()?.filter(|_| text.len() < 24) {
            let after_exponent = matches!(text.as_bytes().last(), Some(b'D' | b'd' | b'E' | b'e'));
            let is_sign = matches!(byte, b'+' | b'-');
            let belongs = byte.is_ascii_digit()
                || matches!(byte, b'.' | b'D' | b'd' | b'E' | b'e')
                || (is_sign && (text.is_empty() || after_exponent));
            if !belongs {
                break;
            }
            text.push(char::from(byte));
            self.input.consume(1);
        }
        Ok(if text.is_empty() { None } else { real(&text) })
    }
}

impl Reader for UsgsDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        // A column may be longer than a window.
        8 * u64::from(self.declared.samples[1]).saturating_sub(WINDOW_SAMPLES)
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let cannot_read = |source| LayoutError::io(&self.path, "cannot read the USGS DEM file", source);
        let [columns, rows] = self.declared.samples;
        let file = input::open(&self.path, "cannot open the USGS DEM file")?;
        let mut text = Text::open(&file, self.begin).map_err(cannot_read)?;
        let block = u32::try_from(WINDOW_SAMPLES / u64::from(rows)).unwrap_or(u32::MAX).clamp(1, columns);
        let mut samples = Vec::new();
        for col in (0..columns).step_by(block as usize) {
            let window = Window { col, row: 0, width: block.min(columns - col), height: rows };
            samples.clear();
            samples.resize(window.width as usize * rows as usize, f64::NAN);
            for across in 0..window.width {
                self.profile(&mut text, col + across, across as usize, window.width as usize, &mut samples)?;
            }
            sink.put(window, &samples)?;
        }
        Ok(())
    }
}

impl UsgsDem {
    /// Reads a profile into a column of `samples`, which are `width` wide.
    fn profile(
        &self,
        text: &mut Text,
        number: u32,
        across: usize,
        width: usize,
        samples: &mut [f64],
    ) -> Result<(), LayoutError> {
        let damaged = |problem: &str| {
            LayoutError::damaged(
                &self.path,
                format!("profile {}", number + 1),
                format!("{problem}; fetch the file again"),
            )
        };
        let read = |value: std::io::Result<Option<f64>>| {
            let value = value
                .map_err(|source| LayoutError::io(&self.path, "cannot read the USGS DEM file", source))?;
            value.ok_or_else(|| damaged("it ends before what it declares, or holds no numbers"))
        };
        let whole = |text: &mut Text| read(text.whole().map(|number| number.map(|number| number as f64)));
        let [_, _, count, across_count] = [whole(text)?, whole(text)?, whole(text)?, whole(text)?];
        let [_, south, datum, _, _] = [
            read(text.real())?,
            read(text.real())?,
            read(text.real())?,
            read(text.real())?,
            read(text.real())?,
        ];
        let rows = self.declared.samples[1];
        let first = ((south - self.south) / self.up + 0.5).floor();
        if across_count != 1.0 || !(0.0..=MOST_ROWS).contains(&count) || first.abs() > MOST_ROWS {
            return Err(damaged("its begin is none of a profile"));
        }
        for row in first as i64..first as i64 + count as i64 {
            let value = whole(text)?;
            if let Ok(row) = u32::try_from(row)
                && row < rows
            {
                let is_void = value == VOID as f64;
                samples[row as usize * width + across] =
                    if is_void { f64::NAN } else { value + datum / self.scale };
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn numbers_as_fortran_leaves_them() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"     1   -32767-32767 12\n 0.5D+01-0.25E+2   1.5   x").unwrap();
        let mut text = Text::open(&file, 0).unwrap();
        let whole: Vec<_> = (0..4).map(|_| text.whole().unwrap()).collect();
        assert_eq!(whole, [Some(1), Some(-32767), Some(-32767), Some(12)]);
        let reals: Vec<_> = (0..4).map(|_| text.real().unwrap()).collect();
        assert_eq!(reals, [Some(5.0), Some(-25.0), Some(1.5), None]);
        assert_eq!(
            [real("0.1D+03"), real(""), real("x"), real("1E999")],
            [Some(100.0), Some(0.0), None, None]
        );
    }
}
