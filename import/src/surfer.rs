//! Surfer grids (Golden Software): as text (`DSAA`), binary of Surfer 6 (`DSBB`) and of Surfer 7 (`DSRB`).
//!
//! ```text
//! DSAA  words: columns rows  west east  south north  lowest highest, then the samples
//! DSBB  i16 columns, rows; f64 west, east, south, north, lowest, highest; then f32 samples
//! DSRB  sections of a name, a length and content: GRID is i32 rows, columns; f64 west, south, step east, step north, lowest, highest, turn, blank;
//!       DATA behind it holds f64 samples; others (faults) are passed over
//! ```
//!
//! All of it is little-endian; the sides are those of the samples themselves, and rows run from the south. A sample of 1.70141e38, or of the value that `DSRB` states, is void. Cost: as
//! for any grid of plain numbers ([`crate::plain`]) or of text ([`crate::text`]).

use crate::ascii_grid::single;
use crate::input;
use crate::plain::{Kind, Plain};
use crate::reader::{Corrects, Declared, Reader, Said};
use crate::text::{Cut, Sequence, each_block, number, shown, words};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;

/// What stands for no sample.
const BLANK: f64 = 1.70141e38;
/// Longest head of a text grid: nine words.
const MOST_HEAD_BYTES: u64 = 4096;
/// Words of the head, the signature among them.
const HEAD_WORDS: usize = 9;
/// Sections looked at, at most.
const MOST_SECTIONS: usize = 1024;

/// Whether a file of these first bytes is a Surfer grid.
pub(crate) fn is_surfer(head: &[u8]) -> bool {
    [b"DSAA", b"DSBB", b"DSRB"].iter().any(|magic| head.starts_with(*magic))
}

/// A Surfer grid.
#[derive(Debug)]
pub(crate) struct SurferDem {
    path: PathBuf,
    declared: Declared,
    blank: f64,
    body: Body,
}

#[derive(Debug)]
enum Body {
    Numbers(Plain),
    Text { at: u64 },
}

/// What a head says.
#[derive(Debug, Clone, Copy)]
struct Head {
    samples: [u32; 2],
    /// West and south sample, and the steps.
    corner: [f64; 2],
    steps: [f64; 2],
    blank: f64,
}

impl Head {
    /// Of so many columns and rows between these sides.
    fn between(
        path: &Path,
        [columns, rows]: [i64; 2],
        [west, east, south, north]: [f64; 4],
    ) -> Result<Self, LayoutError> {
        let samples = counts(path, [columns, rows])?;
        let step = |low: f64, high: f64, count: u32| (high - low) / f64::from(count - 1);
        let steps = [step(west, east, samples[0]), step(south, north, samples[1])];
        Ok(Self { samples, corner: [west, south], steps, blank: BLANK })
    }

    fn declared(&self, path: &Path, kind: SampleType, format: &str) -> Result<Declared, LayoutError> {
        if self.steps.iter().any(|step| !step.is_finite() || *step <= 0.0)
            || self.corner.iter().any(|at| !at.is_finite())
        {
            return Err(damaged(
                path,
                "its sides make no grid: west must lie before east, and south before north",
            ));
        }
        let mut declared = Declared::new(self.samples, kind, format);
        let map = [self.corner[0], self.steps[0], 0.0, self.corner[1], 0.0, self.steps[1]];
        declared.place = Some(Said::new(map, "the grid's head"));
        declared.rows_from_south = true;
        declared.corrects = Corrects { place: true, nodata: true, ..Corrects::default() };
        Ok(declared)
    }
}

fn counts(path: &Path, [columns, rows]: [i64; 2]) -> Result<[u32; 2], LayoutError> {
    match [columns, rows].map(|side| i32::try_from(side).ok().filter(|side| *side >= 2)) {
        [Some(columns), Some(rows)] => Ok([columns as u32, rows as u32]),
        _ => Err(damaged(
            path,
            &format!("{columns} columns and {rows} rows are no grid; at least 2 x 2 are needed"),
        )),
    }
}

fn damaged(path: &Path, problem: &str) -> LayoutError {
    LayoutError::damaged(path, "header", format!("{problem}; fetch or write the file again"))
}

/// Reads from a place on.
fn array<const N: usize>(path: &Path, file: &mut File, at: u64) -> Result<[u8; N], LayoutError> {
    let mut bytes = [0; N];
    let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut bytes));
    read.map_err(|source| match source.kind() {
        std::io::ErrorKind::UnexpectedEof => damaged(path, "it is cut short"),
        _ => LayoutError::io(path, "cannot read the Surfer grid", source),
    })?;
    Ok(bytes)
}

fn real(bytes: &[u8], at: usize) -> f64 {
    bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).map_or(f64::NAN, f64::from_le_bytes)
}

fn whole(bytes: &[u8], at: usize) -> i64 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, |b| i32::from_le_bytes(b).into())
}

impl SurferDem {
    /// Reads the head.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let mut file = input::open(path, "cannot open the Surfer grid")?;
        let (head, kind, format, body) = match &array::<4>(path, &mut file, 0)? {
            b"DSAA" => text(path, &mut file)?,
            b"DSBB" => binary_6(path, &mut file)?,
            _ => binary_7(path, &mut file)?,
        };
        let declared = head.declared(path, kind, format)?;
        Ok(Self { path: path.to_owned(), declared, blank: head.blank, body })
    }

    fn stream_text(&self, sink: &dyn SampleSink, at: u64) -> Result<(), LayoutError> {
        let mut file = input::open(&self.path, "cannot open the Surfer grid")?;
        file.seek(SeekFrom::Start(at))
            .map_err(|source| LayoutError::io(&self.path, "cannot read the Surfer grid", source))?;
        let [wide, high] = self.declared.samples;
        let mut sequence = Sequence::new(sink, [wide, high]);
        let parse = |block: &[u8]| {
            let mut samples = Vec::with_capacity(block.len() / 4);
            for word in words(block) {
                match number(word).and_then(|value| single(value, Some(BLANK))) {
                    Some(sample) => samples.push(sample),
                    None => return Err((samples.len(), shown(word))),
                }
            }
            Ok(samples)
        };
        let wrong = |[row, column]: [u64; 2], problem: String| {
            LayoutError::damaged(&self.path, format!("row {row}, column {column}, from the south"), problem)
        };
        each_block(&self.path, &mut file, Cut::Words, parse, |samples| {
            let samples = samples.map_err(|(ahead, word)| {
                wrong(sequence.place(ahead), format!("{word} is no height; mend it, or fetch the file again"))
            })?;
            if samples.len() as u64 > sequence.missing() {
                return Err(wrong(
                    [u64::from(high), 0],
                    format!(
                        "more numbers follow than the {wide} x {high} of the head; mend the head, or fetch the file again"
                    ),
                ));
            }
            sequence.put(&samples)
        })?;
        if sequence.missing() > 0 {
            return Err(wrong(
                sequence.place(0),
                format!(
                    "the file ends after {} of {wide} x {high} numbers: it is cut short; fetch it again",
                    sequence.count()
                ),
            ));
        }
        Ok(())
    }
}

/// What a file says, the type of its samples, its name, and where the samples are.
type Opened = (Head, SampleType, &'static str, Body);

fn text(path: &Path, file: &mut File) -> Result<Opened, LayoutError> {
    let failed = |source| LayoutError::io(path, "cannot read the Surfer grid", source);
    let length = file.metadata().map_err(failed)?.len();
    file.seek(SeekFrom::Start(0)).map_err(failed)?;
    let mut head = Vec::new();
    file.take(MOST_HEAD_BYTES).read_to_end(&mut head).map_err(failed)?;
    let found: Vec<&[u8]> = words(&head).take(HEAD_WORDS).collect();
    let [_, columns, rows, west, east, south, north, _, last] = found[..] else {
        return Err(damaged(path, "it ends before its head does"));
    };
    let whole = |word: &[u8]| {
        let value = number(word).filter(|value| value.fract() == 0.0 && value.abs() < 1e10);
        value
            .map(|value| value as i64)
            .ok_or_else(|| damaged(path, &format!("{} is no number of samples", shown(word))))
    };
    let side =
        |word: &[u8]| number(word).ok_or_else(|| damaged(path, &format!("{} is no side", shown(word))));
    let head_of = Head::between(
        path,
        [whole(columns)?, whole(rows)?],
        [side(west)?, side(east)?, side(south)?, side(north)?],
    )?;
    // The last word ends where the samples begin.
    let at = (last.as_ptr() as usize - head.as_ptr() as usize + last.len()) as u64;
    let [wide, high] = head_of.samples.map(u64::from);
    // A digit and a blank each.
    if (length - at) / 2 < wide * high {
        return Err(LayoutError::damaged(
            path,
            "samples",
            format!(
                "{wide} x {high} samples do not fit into the {} bytes that follow the head; fetch the file again",
                length - at
            ),
        ));
    }
    Ok((head_of, SampleType::F32, "Surfer grid as text", Body::Text { at }))
}

fn binary_6(path: &Path, file: &mut File) -> Result<Opened, LayoutError> {
    let bytes: [u8; 56] = array(path, file, 0)?;
    let half = |at: usize| i64::from(i16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let sides = [8, 16, 24, 32].map(|at| real(&bytes, at));
    let head = Head::between(path, [half(4), half(6)], sides)?;
    let kind = Kind { sample_type: SampleType::F32, is_big: false };
    let plain = plain(path, &head, kind, 56)?;
    Ok((head, SampleType::F32, "Surfer 6 grid", Body::Numbers(plain)))
}

fn binary_7(path: &Path, file: &mut File) -> Result<Opened, LayoutError> {
    let mut at = 0u64;
    let mut head = None;
    for _ in 0..MOST_SECTIONS {
        let section: [u8; 8] = array(path, file, at)?;
        // A length below 0 is damage.
        let length =
            u64::try_from(whole(&section, 4)).map_err(|_| damaged(path, "a section of it has no length"))?;
        match (&section[..4], &head) {
            (b"GRID", _) => {
                let bytes: [u8; 72] = array(path, file, at + 8)?;
                let samples = counts(path, [whole(&bytes, 4), whole(&bytes, 0)])?;
                let [west, south, east, north, turn, blank] =
                    [8, 16, 24, 32, 56, 64].map(|at| real(&bytes, at));
                if turn != 0.0 {
                    return Err(LayoutError::unsupported(
                        path,
                        "the grid is turned, of which Surfer's own programs make nothing; write it again without: gdal_translate INPUT output.tif",
                    ));
                }
                head = Some(Head { samples, corner: [west, south], steps: [east, north], blank });
            }
            (b"DATA", Some(head)) => {
                let kind = Kind { sample_type: SampleType::F64, is_big: false };
                let plain = plain(path, head, kind, at + 8)?;
                return Ok((*head, SampleType::F64, "Surfer 7 grid", Body::Numbers(plain)));
            }
            _ => {}
        }
        at += 8 + length;
    }
    Err(damaged(path, "it has more sections than a grid can have"))
}

fn plain(path: &Path, head: &Head, kind: Kind, at: u64) -> Result<Plain, LayoutError> {
    let steps = [kind.bytes(), kind.bytes() * u64::from(head.samples[0])];
    Plain::checked(path, head.samples, kind, at, steps)
}

impl Reader for SurferDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let sink = &Blanks { sink, blank: self.blank };
        match &self.body {
            Body::Numbers(plain) => plain.stream(sink),
            Body::Text { at } => self.stream_text(sink, *at),
        }
    }
}

/// Makes voids of what stands for no sample.
struct Blanks<'a> {
    sink: &'a dyn SampleSink,
    blank: f64,
}

impl SampleSink for Blanks<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        // What is beyond the largest number that Surfer has is blank as well.
        let is_blank = |value: f64| value == self.blank || value >= BLANK;
        if !samples.iter().any(|value| is_blank(*value)) {
            return self.sink.put(window, samples);
        }
        let seen = samples.iter().map(|value| if is_blank(*value) { f64::NAN } else { *value });
        self.sink.put(window, &seen.collect::<Vec<_>>())
    }
}
