//! Batches with the heights of their stamps. Elevation data that several stamps name is read once and shared.

use super::place::Place;
use super::{Batch, Moment, Script, ScriptError, StampFile, Step};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use terrasoar_layout::LayoutError;
use terrasoar_layout::dem::{DemSource, Georeference, SampleSink, Window};
use terrasoar_layout::edit::{Edit, MAX_EDIT_SAMPLES, Stamp};
use terrasoar_layout::file::header::Header;

/// Opens a stamp's elevation data. The program says which formats there are.
pub type OpenDem = fn(&Path) -> Result<Box<dyn DemSource>, LayoutError>;

/// Heights of stamps that were read already, by file.
#[derive(Debug)]
pub struct Loader {
    /// The script, which errors name.
    script: PathBuf,
    open: OpenDem,
    /// The terrain that is edited, for stamps that lie where they say themselves.
    place: Option<Place>,
    stamps: HashMap<PathBuf, ReadStamp>,
}

/// Elevation data in memory.
#[derive(Debug)]
struct ReadStamp {
    samples: [u32; 2],
    heights_m: Arc<[f64]>,
    georeference: Georeference,
}

/// A batch ready to be applied.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedBatch {
    /// What it is called in a file's history.
    pub label: String,
    /// When it is done in a replay.
    pub moment: Option<Moment>,
    /// What is done.
    pub edits: Vec<Edit>,
}

impl Loader {
    /// For the batches of the script at `path`, in whose folder relative names of stamps start; `open` opens them.
    pub fn new(path: &Path, open: OpenDem) -> Self {
        Self { script: path.to_owned(), open, place: None, stamps: HashMap::new() }
    }

    /// For a terrain with this header, on which stamps without a sample come where their own georeference says.
    #[must_use]
    pub fn over(mut self, terrain: &Header) -> Self {
        self.place = Some(Place::of(terrain));
        self
    }

    /// All batches of a script.
    ///
    /// # Errors
    /// As [`Loader::batch`].
    pub fn script(&mut self, script: &Script) -> Result<Vec<LoadedBatch>, ScriptError> {
        script.batches.iter().map(|batch| self.batch(batch)).collect()
    }

    /// A batch with all heights in memory. Each file is read once.
    ///
    /// # Errors
    /// [`ScriptError::Stamp`] if a stamp's file cannot be read, is no elevation data or is too large; if it has no place of its own, or its samples do not lie on the terrain's.
    pub fn batch(&mut self, batch: &Batch) -> Result<LoadedBatch, ScriptError> {
        let edits =
            batch.steps.iter().map(|step| match step {
                Step::Edit(edit) => Ok(edit.clone()),
                Step::Stamp(stamp) => self.stamp(stamp).map(Edit::Stamp).map_err(|source| {
                    ScriptError::Stamp { path: self.script.clone(), line: batch.line, source }
                }),
            });
        Ok(LoadedBatch {
            label: batch.label(),
            moment: batch.moment,
            edits: edits.collect::<Result<_, _>>()?,
        })
    }

    fn stamp(&mut self, stamp: &StampFile) -> Result<Stamp, LayoutError> {
        let path = self.script.parent().unwrap_or(Path::new("")).join(&stamp.file);
        if !self.stamps.contains_key(&path) {
            let source = (self.open)(&path)?;
            let (samples, heights_m) = heights_of(source.as_ref(), &path)?;
            let georeference = source.info().georeference.clone();
            self.stamps.insert(path.clone(), ReadStamp { samples, heights_m, georeference });
        }
        let read = &self.stamps[&path];
        let at = match (stamp.at, &self.place) {
            (Some(at), _) => at,
            (None, Some(place)) => place.of_stamp(&path, &read.georeference, read.samples)?,
            (None, None) => {
                return Err(LayoutError::Usage(format!(
                    "{}: without `sample` a stamp needs a terrain to lie on; write `sample COLUMN,ROW`",
                    path.display()
                )));
            }
        };
        Stamp::new(at, read.samples, Arc::clone(&read.heights_m), stamp.mode)
    }
}

/// All heights of elevation data in metres, rows from the south.
fn heights_of(source: &dyn DemSource, path: &Path) -> Result<([u32; 2], Arc<[f64]>), LayoutError> {
    let info = source.info();
    let samples = [info.samples_wide, info.samples_high];
    let count = u64::from(samples[0]) * u64::from(samples[1]);
    if count > MAX_EDIT_SAMPLES as u64 {
        return Err(LayoutError::Usage(format!(
            "{}: {} x {} samples are more than the {MAX_EDIT_SAMPLES} that one edit may change; cut it into smaller ones",
            path.display(),
            samples[0],
            samples[1]
        )));
    }
    let gathered = Gathered { samples, heights_m: Mutex::new(vec![f64::NAN; count as usize]) };
    source.stream(&gathered)?;
    let mut heights_m = gathered.heights_m.into_inner().unwrap_or_else(PoisonError::into_inner);
    for height in &mut heights_m {
        *height = *height * info.height_scale + info.height_offset_m;
    }
    Ok((samples, heights_m.into()))
}

/// Takes windows of elevation data into one array.
struct Gathered {
    samples: [u32; 2],
    heights_m: Mutex<Vec<f64>>,
}

impl SampleSink for Gathered {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let [wide, high] = self.samples.map(|side| side as usize);
        let mut heights = self.heights_m.lock().unwrap_or_else(PoisonError::into_inner);
        for (row, line) in (window.row as usize..).zip(samples.chunks_exact(window.width as usize)) {
            // Windows count rows from the north.
            let first = (high - 1 - row) * wide + window.col as usize;
            heights[first..first + line.len()].copy_from_slice(line);
        }
        Ok(())
    }
}
