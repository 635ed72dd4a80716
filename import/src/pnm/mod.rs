//! Grey Netpbm pictures as heights: PGM as text (`P2`) and as bytes (`P5`, 8 or 16 bits, high byte first), and PFM (`Pf`, reals, from the south row on).
//!
//! A header of words says the size and the largest value. Rows run from north to south, except in PFM. Nothing says where the picture lies. The first picture of a file is
//! read; colour and black-and-white ones have no heights. Cost: as for any grid of plain numbers ([`crate::plain`]) or of text ([`crate::text`]).

mod header;

pub(crate) use header::is_pnm;
use header::{Class, Header};

use crate::input;
use crate::plain::{Kind, Plain};
use crate::reader::{Declared, Reader};
use crate::text::{Cut, Sequence, each_block, number, shown, words};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;

/// A grey Netpbm picture.
#[derive(Debug)]
pub(crate) struct PnmDem {
    path: PathBuf,
    declared: Declared,
    body: Body,
}

#[derive(Debug)]
enum Body {
    Bytes(Plain),
    Text { at: u64, largest: f64 },
}

impl PnmDem {
    /// Reads the header.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let failed = |source| LayoutError::io(path, "cannot read the picture", source);
        let file = input::open(path, "cannot open the picture")?;
        let length = file.metadata().map_err(failed)?.len();
        let mut head = Vec::new();
        file.take(header::MOST_BYTES as u64).read_to_end(&mut head).map_err(failed)?;
        let Header { class, samples, largest, data_at } = Header::parse(path, &head)?;
        let at = data_at as u64;
        let [wide, high] = samples;
        let is_wide = largest > 255.0;
        let sample_type = match class {
            Class::Real { .. } => SampleType::F32,
            _ if is_wide => SampleType::U16,
            _ => SampleType::U8,
        };
        let format = match class {
            Class::Real { .. } => "PFM",
            Class::Text => "PGM as text",
            Class::Bytes => "PGM",
        };
        let declared = Declared::new(samples, sample_type, format);
        let body = match class {
            Class::Text => {
                // A digit and a blank each, but for the last one's blank.
                if (length - at).saturating_add(1) / 2 < u64::from(wide) * u64::from(high) {
                    let problem = format!(
                        "{wide} x {high} samples do not fit into the {} bytes that follow the header; fetch the file again",
                        length - at
                    );
                    return Err(LayoutError::damaged(path, "samples", problem));
                }
                Body::Text { at, largest }
            }
            Class::Bytes | Class::Real { .. } => {
                let kind = Kind { sample_type, is_big: !matches!(class, Class::Real { is_big: false }) };
                Body::Bytes(Plain::checked(
                    path,
                    samples,
                    kind,
                    at,
                    [kind.bytes(), kind.bytes() * u64::from(wide)],
                )?)
            }
        };
        Ok(Self { path: path.to_owned(), declared, body })
    }

    fn stream_text(&self, sink: &dyn SampleSink, at: u64, largest: f64) -> Result<(), LayoutError> {
        let mut file = input::open(&self.path, "cannot open the picture")?;
        file.seek(SeekFrom::Start(at))
            .map_err(|source| LayoutError::io(&self.path, "cannot read the picture", source))?;
        let mut sequence = Sequence::new(sink, self.declared.samples);
        let parse = |block: &[u8]| {
            let mut samples = Vec::with_capacity(block.len() / 3);
            for word in words(block) {
                match number(word).filter(|value| value.fract() == 0.0 && (0.0..=largest).contains(value)) {
                    Some(sample) => samples.push(sample),
                    None => return (samples, Some(shown(word))),
                }
            }
            (samples, None)
        };
        each_block(&self.path, &mut file, Cut::Words, parse, |(samples, wrong)| {
            // Something else may follow a picture.
            let most = usize::try_from(sequence.missing()).unwrap_or(usize::MAX).min(samples.len());
            sequence.put(&samples[..most])?;
            match wrong {
                Some(word) if sequence.missing() > 0 => {
                    let [row, column] = sequence.place(0);
                    let problem =
                        format!("{word} is no whole number from 0 to {largest}; fetch the file again");
                    Err(LayoutError::damaged(&self.path, format!("row {row}, column {column}"), problem))
                }
                _ => Ok(()),
            }
        })?;
        if sequence.missing() > 0 {
            let [row, column] = sequence.place(0);
            let problem = "the file ends before its samples do: it is cut short; fetch it again";
            return Err(LayoutError::damaged(&self.path, format!("row {row}, column {column}"), problem));
        }
        Ok(())
    }
}

impl Reader for PnmDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        match &self.body {
            Body::Bytes(plain) if self.declared.sample_type == SampleType::F32 => {
                plain.stream(&FromSouth { sink, high: self.declared.samples[1] })
            }
            Body::Bytes(plain) => plain.stream(sink),
            Body::Text { at, largest } => self.stream_text(sink, *at, *largest),
        }
    }
}

/// Turns windows of rows that run from south to north.
struct FromSouth<'a> {
    sink: &'a dyn SampleSink,
    high: u32,
}

impl SampleSink for FromSouth<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let rows = samples.chunks_exact(window.width as usize).rev();
        let turned: Vec<f64> = rows.flatten().copied().collect();
        self.sink.put(Window { row: self.high - window.row - window.height, ..window }, &turned)
    }
}
