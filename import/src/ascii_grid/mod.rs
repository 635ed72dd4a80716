//! Esri ASCII grid (`.asc`): a head of words, then the samples as text, row by row from north to south.
//!
//! Samples are words between blanks. Ends of lines have no meaning: a row may take several lines, and a line may hold several rows. The file is read once from front to back,
//! taken apart by all threads ([`crate::text`]). Samples are kept in single precision, as GDAL does.

mod header;

use header::Header;
pub(crate) use header::is_ascii_grid;

use crate::input;
use crate::reader::{Declared, Reader, Said};
use crate::text::{Cut, Sequence, each_block, number, shown, words};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, SampleType};
use terrasoar_layout::error::LayoutError;

/// An Esri ASCII grid.
#[derive(Debug)]
pub(crate) struct AsciiGrid {
    path: PathBuf,
    declared: Declared,
    data_at: u64,
    nodata: Option<f64>,
}

impl AsciiGrid {
    /// Reads the head.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let failed = |source| LayoutError::io(path, "cannot read the ASCII grid", source);
        let file = input::open(path, "cannot open the ASCII grid")?;
        let file_bytes = file.metadata().map_err(failed)?.len();
        let mut head = Vec::new();
        file.take(header::MOST_BYTES as u64).read_to_end(&mut head).map_err(failed)?;
        let header = Header::parse(path, &head)?;
        let [wide, high] = header.samples;
        let data_bytes = file_bytes - header.data_at as u64;
        let count = u64::from(wide) * u64::from(high);
        // A digit and a blank each, but for the last one's blank.
        if data_bytes.saturating_add(1) / 2 < count {
            return Err(LayoutError::damaged(
                path,
                "samples",
                format!(
                    "{wide} x {high} samples do not fit into the {data_bytes} bytes that follow the head: the file is cut short; fetch it again"
                ),
            ));
        }
        let mut declared = Declared::new(header.samples, SampleType::F32, "Esri ASCII grid");
        declared.place = header.place.map(|place| Said::new(place, "the grid's head"));
        let nodata = header.nodata.as_deref().and_then(|text| number(text.as_bytes()));
        declared.value.nodata.extend(header.nodata.map(|text| Said::new(text, "NODATA_value")));
        declared.notes.extend(
            header
                .unknown
                .iter()
                .map(|word| format!("the word {word} in the grid's head is not known and was passed over")),
        );
        Ok(Self { path: path.to_owned(), declared, data_at: header.data_at as u64, nodata })
    }

    /// The samples of a block; or the first word that is none, with its number in the block.
    fn parse(&self, block: &[u8]) -> Result<Vec<f64>, (usize, String)> {
        let mut samples = Vec::with_capacity(block.len() / 4);
        for word in words(block) {
            let sample = number(word).and_then(|value| single(value, self.nodata));
            samples.push(sample.ok_or_else(|| (samples.len(), shown(word)))?);
        }
        Ok(samples)
    }

    fn damaged(&self, place: [u64; 2], problem: String) -> LayoutError {
        LayoutError::damaged(&self.path, format!("row {}, column {}", place[0], place[1]), problem)
    }
}

/// A number in single precision; `None` for one that is beyond it, unless it is the one that means "no data", which becomes a void here.
pub(crate) fn single(value: f64, nodata: Option<f64>) -> Option<f64> {
    let rounded = f64::from(value as f32);
    match (rounded.is_infinite(), nodata) {
        (false, _) => Some(rounded),
        (true, Some(nodata)) if nodata == value => Some(f64::NAN),
        (true, _) => None,
    }
}

impl Reader for AsciiGrid {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let mut file = input::open(&self.path, "cannot open the ASCII grid")?;
        file.seek(SeekFrom::Start(self.data_at))
            .map_err(|source| LayoutError::io(&self.path, "cannot read the ASCII grid", source))?;
        let [wide, high] = self.declared.samples;
        let mut sequence = Sequence::new(sink, [wide, high]);
        each_block(
            &self.path,
            &mut file,
            Cut::Words,
            |block| self.parse(block),
            |samples| {
                let samples = samples.map_err(|(ahead, word)| {
                    self.damaged(
                        sequence.place(ahead),
                        format!("{word} is no height; mend it, or fetch the file again"),
                    )
                })?;
                if samples.len() as u64 > sequence.missing() {
                    return Err(self.damaged(
                        [u64::from(high), 0],
                        format!("more numbers follow than the {wide} x {high} of the head: ncols or nrows is wrong, and the ground would be skewed; mend them"),
                    ));
                }
                sequence.put(&samples)
            },
        )?;
        if sequence.missing() > 0 {
            return Err(self.damaged(
                sequence.place(0),
                format!(
                    "the file ends after {} of {wide} x {high} numbers: it is cut short, or ncols or nrows is wrong; fetch it again or mend them",
                    sequence.count()
                ),
            ));
        }
        Ok(())
    }
}
