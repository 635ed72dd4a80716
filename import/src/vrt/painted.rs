//! One band of a virtual raster: its files laid over each other into one store, and streamed from there.

use super::paint::Painting;
use super::said::{Band, Part, Source};
use super::text::is_virtual;
use crate::beside::Beside;
use crate::cells::{CELL, Cells, each_block_met};
use crate::guard;
use crate::options::OpenOptions;
use crate::reader::{Declared, Reader, Said};
use crate::value::Voids;
use crate::warp::Store;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use terrasoar_layout::dem::{SampleSink, SampleType, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Share of the memory allowed that the grid may take, and that one file may.
const SHARE: u64 = 16;
/// Files that are opened for one virtual raster and all that lie in it.
const MOST_OPENED: u32 = 200_000;
/// Files that were left out and are named.
const MOST_NAMED: usize = 40;
/// Columns and rows that are streamed at a time.
const BLOCK: [u32; 2] = [2048, 32];

/// What opens a file that is no virtual raster.
pub(crate) type Opens = fn(&Path, &OpenOptions) -> Result<Box<dyn Reader>, LayoutError>;

/// What opens a virtual raster that lies in another.
type OpensVirtual = fn(&Path, Within) -> Result<Box<dyn Reader>, LayoutError>;

/// What all virtual rasters share that lie in each other.
#[derive(Clone)]
pub(super) struct Within {
    pub(super) opens: Opens,
    /// What opens a virtual raster within these.
    pub(super) opens_virtual: OpensVirtual,
    pub(super) options: OpenOptions,
    /// From the outermost to this one, as the system knows them.
    pub(super) chain: Vec<PathBuf>,
    pub(super) opened: Arc<AtomicU32>,
}

/// One band, or the mask.
pub(super) struct Painted {
    declared: Declared,
    band: Band,
    path: PathBuf,
    within: Within,
    lost: Mutex<BTreeMap<PathBuf, String>>,
}

impl Painted {
    pub(super) fn new(path: &Path, declared: Declared, band: Band, within: &Within) -> Self {
        let lost = Mutex::new(BTreeMap::new());
        Self { declared, band, path: path.to_owned(), within: within.clone(), lost }
    }

    fn sample_bytes(&self) -> u64 {
        if self.declared.sample_type.fits_f32() { 4 } else { 8 }
    }

    fn in_memory(&self, samples: [u32; 2], sample_bytes: u64) -> bool {
        let allowed = self.within.options.memory_mib.unwrap_or(512) << 20;
        Store::bytes(samples, sample_bytes) <= allowed / SHARE
    }

    fn folder(&self) -> PathBuf {
        self.within.options.scratch.clone().unwrap_or_else(std::env::temp_dir)
    }

    /// Reads a file, or what lies in it: its samples and their type.
    fn read(&self, source: &Source, ours: &AtomicBool) -> Result<(Store, [u32; 2], SampleType), LayoutError> {
        if self.within.opened.fetch_add(1, Ordering::Relaxed) >= MOST_OPENED {
            ours.store(true, Ordering::Relaxed);
            return Err(LayoutError::unsupported(
                &self.path,
                format!(
                    "more than {MOST_OPENED} files would have to be opened for it; name the files themselves"
                ),
            ));
        }
        let (Part::Band(number) | Part::Mask(number)) = source.part;
        let options = OpenOptions {
            band: Some(number.to_string()),
            memory_mib: self.within.options.memory_mib,
            scratch: self.within.options.scratch.clone(),
            strict: self.within.options.strict,
            ..OpenOptions::default()
        };
        let reader = self.reader(&source.file, options.clone())?;
        let file = reader.declared().samples;
        let beside = Beside::of(std::slice::from_ref(&source.file), &*reader);
        let mut declared = reader.declared().clone();
        let mask = beside.complete(&mut declared, &options)?;
        let is_mask = matches!(source.part, Part::Mask(_));
        let said = source.change.as_ref().and_then(|change| change.nodata.clone());
        let is_made = source.resampling != crate::Resampling::Nearest;
        // What is void for the file is no number of it where new ones are made.
        let nodata = match said {
            Some(text) => vec![Said::new(text, "NODATA")],
            None if is_mask || is_made => declared.value.nodata.clone(),
            None => Vec::new(),
        };
        let valid = declared.value.valid.as_ref().map(|valid| valid.value);
        let voids =
            Voids::new(&source.file, &nodata, &[], declared.sample_type)?.within(valid, declared.sample_type);
        let sample_bytes = if declared.sample_type.fits_f32() { 4 } else { 8 };
        let action = Store::new(file, sample_bytes, self.in_memory(file, sample_bytes), &self.folder());
        let store = action.inspect_err(|_| ours.store(true, Ordering::Relaxed))?;
        let sink = Taking {
            store: &store,
            voids: (!nodata.is_empty() || valid.is_some()).then_some(&voids),
            is_mask,
            ours,
        };
        let is_masked = is_mask || source.change.as_ref().is_some_and(|change| change.uses_mask);
        match mask.filter(|_| is_masked) {
            Some(mask) => mask.stream(&*reader, &sink)?,
            None => reader.stream(&sink)?,
        }
        Ok((store, file, declared.sample_type))
    }

    fn reader(&self, file: &Path, options: OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
        let within = Within { options: options.clone(), ..self.within.clone() };
        if is_virtual(file) {
            return (within.opens_virtual)(file, within);
        }
        (self.within.opens)(file, &options).map_err(|error| match &error {
            LayoutError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                self.not_found(file, error)
            }
            _ => error,
        })
    }

    /// A file that is not there, or a name that only GDAL understands.
    fn not_found(&self, file: &Path, error: LayoutError) -> LayoutError {
        let text = file.to_string_lossy();
        let is_virtual = text.contains("/vsi") || text.contains("://");
        let is_part = text.split_once(':').is_some_and(|(word, _)| {
            word.rsplit(['/', '\\']).next().is_some_and(|word| {
                word.len() > 1 && word.chars().all(|c| c.is_ascii_uppercase() || c == '_' || c == '4')
            })
        });
        if !is_virtual && !is_part {
            return error;
        }
        LayoutError::unsupported(
            &self.path,
            format!(
                "\"{}\" is a name for GDAL and no file; fetch the file, or let GDAL read it: gdal_translate {} heights.tif",
                harmless(&text, 120),
                self.path.file_name().unwrap_or_default().to_string_lossy()
            ),
        )
    }

    /// Lays all files into a store; where they lie.
    fn paint(&self, store: &Store) -> Result<Cells, LayoutError> {
        let mut cells = Cells::default();
        let sources = &self.band.sources;
        let mut lost = BTreeMap::new();
        let (mut at, mut painted) = (0, 0);
        while at < sources.len() {
            let first = &sources[at];
            let is_alike = |other: &&Source| {
                let reads = |source: &Source| {
                    let change =
                        source.change.as_ref().map(|change| (change.nodata.clone(), change.uses_mask));
                    (source.file.clone(), source.part, change, source.resampling)
                };
                reads(other) == reads(first)
            };
            let count = sources[at..].iter().take_while(is_alike).count();
            let ours = AtomicBool::new(false);
            match self.read(first, &ours) {
                Ok((samples, file, file_type)) => {
                    painted += count;
                    let painting = Painting {
                        band: &self.band,
                        file,
                        grid: self.declared.samples,
                        file_type,
                        sample_bytes: if file_type.fits_f32() { 4 } else { 8 },
                        samples: &samples,
                    };
                    for source in &sources[at..at + count] {
                        painting.paint(source, store, &mut cells)?;
                    }
                }
                Err(error)
                    if self.within.options.strict
                        || ours.load(Ordering::Relaxed)
                        || guard::is_ours(&error) =>
                {
                    return Err(error);
                }
                Err(error) => {
                    lost.insert(first.file.clone(), error.to_string());
                }
            }
            at += count;
        }
        let why = lost.values().next().cloned();
        *self.lost.lock().unwrap_or_else(PoisonError::into_inner) = lost;
        match why {
            Some(why) if painted == 0 => Err(LayoutError::damaged(
                &self.path,
                "its files",
                format!("none of them can be read; the first: {why}"),
            )),
            _ => Ok(cells),
        }
    }
}

impl Reader for Painted {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn warnings(&self) -> Vec<Warning> {
        let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        let mut warnings: Vec<Warning> =
            lost.values().take(MOST_NAMED).map(|why| guard::left_out(why)).collect();
        if lost.len() > MOST_NAMED {
            warnings.push(Warning::new(format!(
                "{} more files of the virtual raster were left out",
                lost.len() - MOST_NAMED
            )));
        }
        warnings
    }

    fn memory_bytes(&self) -> u64 {
        let allowed = self.within.options.memory_mib.unwrap_or(512) << 20;
        let samples = self.declared.samples;
        let own = if self.in_memory(samples, self.sample_bytes()) {
            Store::bytes(samples, self.sample_bytes())
        } else {
            0
        };
        // A file may take as much; what reading it takes is not known before it is opened.
        own + allowed / SHARE + crate::warp::blocks_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let samples = self.declared.samples;
        let in_memory = self.in_memory(samples, self.sample_bytes());
        let store = Store::new(samples, self.sample_bytes(), in_memory, &self.folder())?;
        let cells = self.paint(&store)?;
        let is_met = |w: Window| cells.touch([w.col.into(), w.row.into()], [w.width, w.height]);
        let make = |window: Window| {
            let first = [i64::from(window.col), i64::from(window.row)];
            let values =
                store.window(first, [window.width as usize, window.height as usize], false)?.into_values();
            if values.iter().all(|value| value.is_nan()) {
                sink.put_void(window)
            } else {
                sink.put(window, &values)
            }
        };
        let pass = |window| sink.put_void(window);
        each_block_met(samples, BLOCK, CELL, is_met, pass, || (), |(), window| make(window))
    }
}

/// Takes a file's samples into its store.
struct Taking<'a> {
    store: &'a Store,
    voids: Option<&'a Voids>,
    is_mask: bool,
    ours: &'a AtomicBool,
}

impl SampleSink for Taking<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let mut samples = samples.to_vec();
        if let Some(voids) = self.voids {
            voids.apply(&mut samples);
        }
        if self.is_mask {
            samples.iter_mut().for_each(|value| *value = if value.is_nan() { 0.0 } else { 255.0 });
        }
        self.store.put(window, &samples).inspect_err(|error| {
            if matches!(error, LayoutError::Io { .. }) {
                self.ours.store(true, Ordering::Relaxed);
            }
        })
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        if !self.is_mask {
            return Ok(());
        }
        let row = vec![0.0; window.width as usize];
        (window.row..window.row + window.height)
            .try_for_each(|row_number| self.store.put(Window { row: row_number, height: 1, ..window }, &row))
    }
}
