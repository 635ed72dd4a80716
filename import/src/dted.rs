//! DTED, levels 0 to 2 (MIL-PRF-89020B): a cell of one degree, from 121 x 121 to 3601 x 3601 samples.
//!
//! Three heads of fixed length (UHL 80 bytes, DSI 648, ACC 2700), perhaps behind labels of 80 bytes, then a record for each line of longitude from west to east: a mark, three
//! counts, heights from south to north in two bytes, the sign apart from the number, and the sum of all bytes. Towards the poles lines are further apart, as the head says. A line
//! that the file leaves out is void. A wrong sum is damage, unless no line has a right one: then its writer wrote no sums. Lines are read in blocks, blocks in parallel.

use crate::WINDOW_SAMPLES;
use crate::input;
use crate::parallel::each_task;
use crate::reader::{Declared, Reader, Said, VerticalUnit};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;
use terrasoar_layout::words::harmless;

/// Bytes of the heads together.
const HEAD_BYTES: usize = 80 + 648 + 2700;
/// Labels of 80 bytes that may stand before them.
const MOST_LABELS: usize = 4;
/// Bytes of a record beside its heights: mark and counts before, the sum behind.
const FRAME_BYTES: u64 = 12;
/// First byte of a record.
const MARK: u8 = 0xaa;
/// Lines whose sums are looked at when the file is opened.
const LOOKED_AT: u64 = 8;

/// Whether a file begins so.
pub(crate) fn is_dted(head: &[u8]) -> bool {
    labels(head).is_some()
}

/// Labels before the first head.
fn labels(head: &[u8]) -> Option<usize> {
    let first = |at: usize| head.get(80 * at..80 * at + 3);
    let labels = (0..MOST_LABELS).take_while(|at| matches!(first(*at), Some(b"VOL" | b"HDR"))).count();
    (first(labels) == Some(b"UHL")).then_some(labels)
}

/// A DTED cell.
#[derive(Debug)]
pub(crate) struct DtedDem {
    path: PathBuf,
    declared: Declared,
    /// Where the record of each line lies; nothing for one left out.
    lines: Vec<Option<u64>>,
    /// Whether the sums mean something.
    is_summed: bool,
}

impl DtedDem {
    /// Reads the heads, and a few lines.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let cannot_read = |source| LayoutError::io(path, "cannot read the DTED file", source);
        let file = input::open(path, "cannot open the DTED file")?;
        let bytes = file.metadata().map_err(cannot_read)?.len();
        let mut head =
            vec![0; (80 * MOST_LABELS + HEAD_BYTES).min(usize::try_from(bytes).unwrap_or(usize::MAX))];
        read_at(&file, &mut head, 0).map_err(cannot_read)?;
        let begin = labels(&head).unwrap_or(0) * 80;
        let Some(heads) = head.get(begin..begin + HEAD_BYTES) else {
            return Err(LayoutError::damaged(
                path,
                "header",
                format!(
                    "{bytes} bytes are less than the heads of a DTED file; it is cut short: fetch it again"
                ),
            ));
        };
        let declared = declared(path, heads)?;
        let record = record_bytes(declared.samples[1]);
        let lines = lines(path, &file, &declared, (begin + HEAD_BYTES) as u64, bytes)?;
        let mut this = Self { path: path.to_owned(), declared, lines, is_summed: true };
        let mut scratch = vec![0; record as usize];
        let there: Vec<u64> = this.lines.iter().flatten().copied().take(LOOKED_AT as usize).collect();
        let mut right = 0;
        for at in &there {
            read_at(&file, &mut scratch, *at).map_err(cannot_read)?;
            right += u64::from(sum_is_right(&scratch));
        }
        if right == 0 && !there.is_empty() {
            this.is_summed = false;
            let words = "the checksums of its lines are wrong throughout, as some writers leave them; damage would not be noticed";
            this.declared.warnings.push(Warning::new(words));
        }
        let absent = this.lines.iter().filter(|line| line.is_none()).count();
        if absent > 0 {
            let words =
                format!("{absent} of its {} lines of longitude are left out and void", this.lines.len());
            this.declared.notes.push(words);
        }
        Ok(this)
    }
}

/// Bytes of the record of a line.
fn record_bytes(samples: u32) -> u64 {
    FRAME_BYTES + 2 * u64::from(samples)
}

/// Where the lines lie: one after the other, or by the number each bears where some are missing.
fn lines(
    path: &Path,
    file: &File,
    declared: &Declared,
    begin: u64,
    bytes: u64,
) -> Result<Vec<Option<u64>>, LayoutError> {
    let [columns, rows] = declared.samples;
    let record = record_bytes(rows);
    let whole = bytes.saturating_sub(begin) / record;
    if whole >= u64::from(columns) {
        return Ok((0..u64::from(columns)).map(|line| Some(begin + line * record)).collect());
    }
    let cut_short = || {
        LayoutError::damaged(
            path,
            "samples",
            format!(
                "{columns} lines of {rows} heights need {} bytes and the file has {bytes}: it is cut short; fetch it again",
                begin + u64::from(columns) * record
            ),
        )
    };
    // A cell with lines left out ends with a whole one.
    if whole == 0 || begin + whole * record != bytes {
        return Err(cut_short());
    }
    let mut lines = vec![None; columns as usize];
    let mut head = [0; 8];
    for number in 0..whole {
        let at = begin + number * record;
        read_at(file, &mut head, at)
            .map_err(|source| LayoutError::io(path, "cannot read the DTED file", source))?;
        let column = usize::from(u16::from_be_bytes([head[4], head[5]]));
        match lines.get_mut(column) {
            Some(line @ None) if head[0] == MARK => *line = Some(at),
            _ => return Err(cut_short()),
        }
    }
    // Cut between two lines it would look so too; but what is left out lies anywhere, not at the end alone.
    if lines[..whole as usize].iter().all(Option::is_some) {
        return Err(cut_short());
    }
    Ok(lines)
}

/// Whether the sum of a record is that of its bytes.
fn sum_is_right(record: &[u8]) -> bool {
    let Some((body, sum)) = record.split_last_chunk::<4>() else { return false };
    body.iter().map(|byte| u32::from(*byte)).fold(0, u32::wrapping_add) == u32::from_be_bytes(*sum)
}

/// A height: sign and number. Some writers left it as two's complement, which would lie deeper than any sea.
fn height(bytes: [u8; 2]) -> f64 {
    let word = u16::from_be_bytes(bytes);
    let number = i32::from(word & 0x7fff);
    f64::from(match word & 0x8000 {
        0 => number,
        _ if number > 16_000 && number != 32_767 => i32::from(word as i16),
        _ => -number,
    })
}

impl Reader for DtedDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [columns, rows] = self.declared.samples;
        let block = u32::try_from(WINDOW_SAMPLES / u64::from(rows)).unwrap_or(u32::MAX).clamp(1, columns);
        let file = input::open(&self.path, "cannot open the DTED file")?;
        let record = record_bytes(rows) as usize;
        let open = || Ok((vec![0; record], Vec::new()));
        each_task(u64::from(columns.div_ceil(block)), usize::MAX, open, |(bytes, samples), task| {
            // Below the number of columns.
            let col = task as u32 * block;
            let window = Window { col, row: 0, width: block.min(columns - col), height: rows };
            samples.clear();
            samples.resize(window.width as usize * rows as usize, f64::NAN);
            for across in 0..window.width as usize {
                if let Some(at) = self.lines[col as usize + across] {
                    self.read(&file, at, col as usize + across, bytes)?;
                    let heights = bytes[8..record - 4].as_chunks::<2>().0;
                    let column = samples.iter_mut().skip(across).step_by(window.width as usize);
                    column.zip(heights).for_each(|(sample, bytes)| *sample = height(*bytes));
                }
            }
            sink.put(window, samples)
        })
    }
}

impl DtedDem {
    /// Reads and checks the record of a line.
    fn read(&self, file: &File, at: u64, line: usize, bytes: &mut [u8]) -> Result<(), LayoutError> {
        let damaged =
            |problem: &str| LayoutError::damaged(&self.path, format!("line of longitude {line}"), problem);
        read_at(file, bytes, at).map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => damaged("the file was cut short while it was read; start again"),
            _ => LayoutError::io(&self.path, "cannot read the DTED file", source),
        })?;
        if bytes[0] != MARK {
            return Err(damaged("it does not begin with the mark of a line; fetch the file again"));
        }
        if self.is_summed && !sum_is_right(bytes) {
            return Err(damaged("its checksum is wrong; fetch the file again"));
        }
        Ok(())
    }
}

/// What the heads say.
fn declared(path: &Path, heads: &[u8]) -> Result<Declared, LayoutError> {
    let text =
        |from: usize, length: usize| String::from_utf8_lossy(&heads[from..from + length]).trim().to_owned();
    let damaged = |what: &str, shown: String| {
        LayoutError::damaged(
            path,
            "header",
            format!("its {what} is \"{}\"; fetch the file again", harmless(&shown, 20)),
        )
    };
    let number = |what: &str, from: usize, length: usize| {
        text(from, length).parse::<u32>().map_err(|_| damaged(what, text(from, length)))
    };
    let angle = |what: &str, from: usize| degrees(&text(from, 8)).ok_or_else(|| damaged(what, text(from, 8)));
    let (west, south) = (angle("longitude", 4)?, angle("latitude", 12)?);
    let step = |what: &str, from: usize| match number(what, from, 4)? {
        0 => Err(damaged(what, text(from, 4))),
        tenths => Ok(f64::from(tenths) / 36_000.0),
    };
    let (across, up) = (step("interval of longitude", 20)?, step("interval of latitude", 24)?);
    let samples = [number("number of lines", 47, 4)?, number("number of heights in a line", 51, 4)?];
    if samples.iter().any(|side| *side < 2) {
        return Err(damaged("size", format!("{} x {}", samples[0], samples[1])));
    }
    // The series, the datums of heights and of places stand in the second head.
    let series = text(80 + 59, 5);
    let level = series.strip_prefix("DTED").filter(|level| ["0", "1", "2"].contains(level));
    let format = level.map_or_else(|| "DTED".to_owned(), |level| format!("DTED level {level}"));
    let mut declared = Declared::new(samples, SampleType::I16, format);
    declared.place = Some(Said::new([west, across, 0.0, south, 0.0, up], "head UHL"));
    declared.corrects.system = true;
    let code = if text(80 + 144, 5) == "WGS72" { 4322 } else { 4326 };
    declared.crs.code = Some(Said::new(code, "head DSI"));
    if text(80 + 141, 3) == "E96" {
        declared.crs.vertical_code = Some(Said::new(5773, "head DSI"));
    }
    declared.value.unit = Some(Said::new(VerticalUnit::Metres(1.0), "the format"));
    declared.value.nodata.push(Said::new("-32767".to_owned(), "the format"));
    Ok(declared)
}

/// Degrees of "DDDMMSSH".
fn degrees(text: &str) -> Option<f64> {
    let (digits, side) = text.split_at_checked(7)?;
    let part = |from: usize, to: usize| digits.get(from..to)?.trim().parse::<u32>().ok().map(f64::from);
    let value = part(0, 3)? + part(3, 5)? / 60.0 + part(5, 7)? / 3600.0;
    match side {
        "N" | "E" if value <= 180.0 => Some(value),
        "S" | "W" if value <= 180.0 => Some(-value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_stand_apart() {
        let of = |word: u16| height(word.to_be_bytes());
        assert_eq!([of(0), of(8848), of(0x8001), of(0x81ae)], [0.0, 8848.0, -1.0, -430.0]);
        assert_eq!([of(0xffff), of(0x7fff), of((-430i16) as u16)], [-32767.0, 32767.0, -430.0]);
    }

    #[test]
    fn places_of_the_head() {
        assert_eq!(degrees("0063000W"), Some(-6.5));
        assert_eq!(degrees("0450036N"), Some(45.01));
        assert_eq!([degrees("0450036"), degrees("x450036N"), degrees("9990000E"), degrees("")], [None; 4]);
    }
}
