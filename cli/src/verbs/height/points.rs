//! Heights at the places of a table, in the order of its rows. Places are looked up in batches.
//!
//! A batch is a million rows or 64 MiB of their text, so that a page is read once for all places on it. Cost a row: reading and writing it, a projection where the system is
//! another, and `heights_m`.

use super::is_inside;
use super::table::Table;
use crate::verbs::guess;
use crate::verbs::output::{complain, decimal, grouped, print_rows};
use crate::verbs::siting::{frame, reach};
use anyhow::{Context, Result, anyhow};
use csv::{ByteRecord, Terminator, Writer, WriterBuilder};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use terrasoar::sink::FileSink;
use terrasoar_import::places::Frame;
use terrasoar_layout::read::heights::heights_m;
use terrasoar_layout::read::terrain::Terrain;

/// Rows of a batch, at most.
const ROWS: usize = 1 << 20;
/// Bytes of their text, at most, but for the last row.
const BYTES: usize = 64 << 20;
/// Memory for pages.
const PAGES_BYTES: u64 = 256 << 20;
/// Name of the column that is added.
const COLUMN: &[u8] = b"height_m";

/// Rows that wait for their heights: their text, where each ends in it, and their places.
struct Batch {
    text: Writer<Vec<u8>>,
    ends: Vec<usize>,
    places: Vec<[f64; 2]>,
}

impl Batch {
    fn new(separator: u8) -> Self {
        let mut builder = WriterBuilder::new();
        builder.delimiter(separator).flexible(true).terminator(Terminator::Any(b'\n'));
        Self { text: builder.from_writer(Vec::new()), ends: Vec::new(), places: Vec::new() }
    }

    fn push(&mut self, row: &ByteRecord, place: [f64; 2]) -> Result<()> {
        let written = self.text.write_byte_record(row).map_err(|_| anyhow!("a row cannot be written"));
        written?;
        self.text.flush()?;
        self.ends.push(self.text.get_ref().len() - 1);
        self.places.push(place);
        Ok(())
    }

    fn is_full(&self) -> bool {
        self.places.len() >= ROWS || self.text.get_ref().len() >= BYTES
    }
}

/// Places without a height, and the first of those inside and outside as they were given.
#[derive(Default)]
struct Missed {
    rows: u64,
    outside: u64,
    void: u64,
    inside_at: Vec<[f64; 2]>,
    outside_at: Vec<[f64; 2]>,
    /// Least and greatest coordinates of those outside.
    outside_reach: Option<[f64; 4]>,
}

impl Missed {
    fn is_outside(&mut self, at: [f64; 2]) {
        self.outside += 1;
        remember(&mut self.outside_at, at);
        let [x0, y0, x1, y1] = self.outside_reach.unwrap_or([at[0], at[1], at[0], at[1]]);
        self.outside_reach = Some([x0.min(at[0]), y0.min(at[1]), x1.max(at[0]), y1.max(at[1])]);
    }
}

fn remember(places: &mut Vec<[f64; 2]>, at: [f64; 2]) {
    if places.len() < guess::PLACES {
        places.push(at);
    }
}

/// Where rows go.
enum Out {
    Standard,
    File(Box<FileSink>),
}

impl Out {
    fn rows(&mut self, rows: &[u8]) -> Result<()> {
        match self {
            Self::Standard => print_rows(rows),
            Self::File(file) => file.write_all(rows).context("cannot write the table; check the free space"),
        }
    }
}

pub(super) fn run(terrain: &Terrain, path: &Path, crs: Option<&str>, output: Option<&Path>) -> Result<()> {
    let from: Box<dyn Read> = if path == Path::new("-") {
        Box::new(io::stdin().lock())
    } else {
        let file = File::open(path)
            .with_context(|| format!("{}: cannot open the table of places", path.display()))?;
        Box::new(BufReader::new(file))
    };
    let header = terrain.header();
    let mut seen = frame(header, crs)?;
    let wants_degrees = crs.map(|_| guess::is_degrees(seen.as_ref()));
    let mut table = Table::new(path, from, wants_degrees)?;
    if crs.is_none() && table.is_lon_lat {
        seen = frame(header, Some("EPSG:4326"))
            .context("the columns lon and lat are taken for degrees of WGS 84; another system is --crs's")?;
    }
    let separator = table.separator;
    let mut out = match output {
        Some(path) => Out::File(Box::new(FileSink::create(path)?)),
        None => Out::Standard,
    };
    if let Some(names) = &mut table.header {
        names.push_field(COLUMN);
        let mut line = Batch::new(separator);
        line.push(names, [0.0; 2])?;
        out.rows(line.text.get_ref())?;
    }
    let (mut missed, mut row) = (Missed::default(), ByteRecord::new());
    loop {
        let mut batch = Batch::new(separator);
        let end = loop {
            match table.next(&mut row) {
                Ok(Some(place)) => batch.push(&row, place)?,
                Ok(None) => break Some(Ok(())),
                Err(error) => break Some(Err(error)),
            }
            if batch.is_full() {
                break None;
            }
        };
        // What comes before a wrong row is right.
        answer(terrain, seen.as_ref(), separator, batch, &mut missed, &mut out)?;
        let Some(end) = end else { continue };
        tell(terrain, seen.as_ref(), &missed);
        return match (end, out) {
            (Ok(()), Out::File(file)) => Ok(file.publish()?),
            (Err(error), Out::File(_)) => Err(error.context("no table was written")),
            (end, Out::Standard) => end,
        };
    }
}

/// Prints the rows of a batch with their heights.
fn answer(
    terrain: &Terrain,
    seen: Option<&Frame>,
    separator: u8,
    mut batch: Batch,
    missed: &mut Missed,
    to: &mut Out,
) -> Result<()> {
    let given = batch.places.clone();
    if let Some(frame) = seen {
        // What has no place in the terrain's system lies outside.
        batch.places.par_iter_mut().for_each(|at| *at = frame.place_m(*at).unwrap_or([f64::NAN; 2]));
    }
    let heights = heights_m(terrain, &batch.places, PAGES_BYTES)?;
    let (text, mut out, mut start) = (batch.text.get_ref(), Vec::with_capacity(1 << 17), 0);
    for (((end, height_m), at_m), at) in batch.ends.iter().zip(heights).zip(&batch.places).zip(given) {
        out.extend_from_slice(&text[start..*end]);
        out.push(separator);
        start = end + 1;
        missed.rows += 1;
        match height_m {
            Some(height_m) => {
                remember(&mut missed.inside_at, at);
                write_height(&mut out, height_m)?;
            }
            None if is_inside(terrain, *at_m) => {
                remember(&mut missed.inside_at, at);
                missed.void += 1;
            }
            None => missed.is_outside(at),
        }
        out.push(b'\n');
        if out.len() >= 1 << 16 {
            to.rows(&out)?;
            out.clear();
        }
    }
    to.rows(&out)
}

/// A height with as many decimals as it has, up to six.
fn write_height(out: &mut Vec<u8>, height_m: f64) -> io::Result<()> {
    let start = out.len();
    write!(out, "{height_m:.6}")?;
    let kept = out[start..].iter().rposition(|byte| *byte != b'0').unwrap_or(0);
    let is_point = out[start + kept] == b'.';
    out.truncate(start + kept + usize::from(!is_point));
    if &out[start..] == b"-0" {
        out.remove(start);
    }
    Ok(())
}

fn tell(terrain: &Terrain, seen: Option<&Frame>, missed: &Missed) {
    let header = terrain.header();
    if missed.outside + missed.void > 0 {
        complain(&format!(
            "note: of {} places {} lie outside the terrain and {} where it has no data; their heights are empty",
            grouped(missed.rows),
            grouped(missed.outside),
            grouped(missed.void)
        ));
    }
    if let (Some(sides), Some(reach)) = (missed.outside_reach, reach(header, seen)) {
        let [x0, y0, x1, y1] = sides.map(|side| decimal(side, 7));
        let otherwise = guess::of_outside(header, seen, &missed.outside_at)
            .map(|guess| format!("; {} they would lie inside", guess.words()))
            .unwrap_or_default();
        complain(&format!(
            "note: the terrain extends {reach}, and the places outside go from {x0},{y0} to {x1},{y1}{otherwise}"
        ));
    }
    if seen.is_none()
        && !missed.inside_at.is_empty()
        && let Some((note, _)) = guess::note_of_local(header, &missed.inside_at)
    {
        complain(&note);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_have_no_zeros_at_their_end() {
        for (height_m, text) in [
            (0.0, "0"),
            (-1e-9, "0"),
            (100.0, "100"),
            (-2.5, "-2.5"),
            (1_234.567_891_4, "1234.567891"),
            (1e9, "1000000000"),
        ] {
            let mut out = b"7,".to_vec();
            write_height(&mut out, height_m).unwrap();
            assert_eq!(String::from_utf8(out).unwrap(), format!("7,{text}"));
        }
    }
}
