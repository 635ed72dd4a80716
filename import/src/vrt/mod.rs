//! GDAL's virtual rasters (`.vrt`): a grid whose samples are pieces of other files, as gdalbuildvrt and gdal_translate write them.
//!
//! Files are laid one over the other into one store, in the order of the text, and streamed from there. Each is read whole into a store of its own first, so that one that fails leaves nothing: it is named, and
//! what lies below it shows. **What no file covers is void**, where GDAL gives a number. Files are opened when samples are asked for, one at a time. Memory: a share of what is allowed. Cost: two passes over
//! the samples of the files.

mod change;
mod paint;
mod parse;
mod said;
mod text;

use crate::beside::Beside;
use crate::guard;
use crate::options::OpenOptions;
use crate::reader::{CrsSaid, Declared, Reader, Said, ValueSaid, VerticalUnit};
use crate::value::Voids;
use crate::warp::{Store, each_block};
use paint::Painting;
use said::{Band, Part, Source, Vrt};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use terrasoar_layout::dem::{SampleSink, SampleType, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;
pub(crate) use text::is_vrt;

/// Share of the memory allowed that the grid may take, and that one file may.
const SHARE: u64 = 16;
/// Virtual rasters within virtual rasters.
const DEEPEST: usize = 8;
/// Files that are opened for one virtual raster and all that lie in it.
const MOST_OPENED: u32 = 200_000;
/// Files that were left out and are named.
const MOST_NAMED: usize = 40;
/// Columns and rows that are streamed at a time.
const BLOCK: [u32; 2] = [2048, 32];

/// What opens a file that is no virtual raster.
pub(crate) type Opens = fn(&Path, &OpenOptions) -> Result<Box<dyn Reader>, LayoutError>;

/// What all virtual rasters share that lie in each other.
#[derive(Clone)]
struct Within {
    opens: Opens,
    options: OpenOptions,
    /// From the outermost to this one, as the system knows them.
    chain: Vec<PathBuf>,
    opened: Arc<AtomicU32>,
}

/// A virtual raster.
pub(crate) struct VrtDem {
    band: Painted,
    mask: Option<Painted>,
}

/// One band, or the mask.
struct Painted {
    declared: Declared,
    band: Band,
    path: PathBuf,
    within: Within,
    lost: Mutex<BTreeMap<PathBuf, String>>,
}

impl VrtDem {
    /// Reads the text; its files are opened later, by `opens`.
    ///
    /// # Errors
    /// As [`crate::open`].
    pub(crate) fn open(path: &Path, options: &OpenOptions, opens: Opens) -> Result<Self, LayoutError> {
        let options = OpenOptions { strict: options.strict, ..options.clone() };
        let within = Within { opens, options, chain: Vec::new(), opened: Arc::new(AtomicU32::new(0)) };
        Self::within(path, within)
    }

    fn within(path: &Path, mut within: Within) -> Result<Self, LayoutError> {
        let options = &within.options;
        if options.decode.is_some() {
            return Err(LayoutError::Usage(format!(
                "{}: heights packed into colours are unpacked from the files themselves; name these instead of the virtual raster",
                path.display()
            )));
        }
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if within.chain.contains(&whole) {
            return Err(LayoutError::damaged(
                path,
                "SourceFilename",
                "the virtual raster is made of itself; write it again with gdalbuildvrt",
            ));
        }
        if within.chain.len() >= DEEPEST {
            return Err(LayoutError::unsupported(
                path,
                format!("more than {DEEPEST} virtual rasters lie in each other; name the innermost ones"),
            ));
        }
        within.chain.push(whole);
        let text = text::read(path, options)?;
        let vrt = parse::vrt(path, &text::tree(path, &text)?, options)?;
        let declared = declared(&vrt);
        let mask = vrt.mask.map(|band| {
            let declared = Declared::new(vrt.samples, band.sample_type, "mask of a virtual raster");
            Painted::new(path, declared, band, &within)
        });
        Ok(Self { band: Painted::new(path, declared, vrt.band, &within), mask })
    }
}

/// What a virtual raster says, as every file does.
fn declared(vrt: &Vrt) -> Declared {
    let band = &vrt.band;
    let mut files: Vec<&Path> = band.sources.iter().map(|source| source.file.as_path()).collect();
    files.sort_unstable();
    files.dedup();
    let format = match files.len() {
        1 => "virtual raster of a file".to_owned(),
        count => format!("virtual raster of {count} files"),
    };
    let mut declared = Declared::new(vrt.samples, band.sample_type, format.clone());
    declared.band_number = band.number;
    if let Some([x, a, b, y, d, e]) = vrt.corners {
        let centres = [x + 0.5 * (a + b), a, b, y + 0.5 * (d + e), d, e];
        declared.place = Some(Said::new(centres, "GeoTransform"));
    }
    declared.crs =
        CrsSaid { text: vrt.system.clone().map(|text| Said::new(text, "SRS")), ..CrsSaid::default() };
    declared.value = ValueSaid {
        scale: band.scale.map(|scale| Said::new(scale, "Scale")),
        offset: band.offset.map(|offset| Said::new(offset, "Offset")),
        unit: band.unit.clone().map(|unit| Said::new(VerticalUnit::Name(unit), "UnitType")),
        direction: None,
        nodata: band.nodata.clone().map(|text| Said::new(text, "NoDataValue")).into_iter().collect(),
    };
    declared.notes.push(format);
    if vrt.by_points {
        declared.warnings.push(Warning::new(
            "the virtual raster is placed by ground control points alone, which are not read; bring it onto a grid first: gdalwarp IN.vrt heights.tif",
        ));
    }
    declared
}

impl Painted {
    fn new(path: &Path, declared: Declared, band: Band, within: &Within) -> Self {
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
        let voids = Voids::new(&source.file, &nodata, &[], declared.sample_type)?;
        let sample_bytes = if declared.sample_type.fits_f32() { 4 } else { 8 };
        let action = Store::new(file, sample_bytes, self.in_memory(file, sample_bytes), &self.folder());
        let store = action.inspect_err(|_| ours.store(true, Ordering::Relaxed))?;
        let sink = Taking { store: &store, voids: (!nodata.is_empty()).then_some(&voids), is_mask, ours };
        let is_masked = is_mask || source.change.as_ref().is_some_and(|change| change.uses_mask);
        match mask.filter(|_| is_masked) {
            Some(mask) => mask.stream(&*reader, &sink)?,
            None => reader.stream(&sink)?,
        }
        Ok((store, file, declared.sample_type))
    }

    fn reader(&self, file: &Path, options: OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
        let within = Within { options: options.clone(), ..self.within.clone() };
        let is_virtual = |path: &Path| {
            use std::io::Read;
            let mut head = Vec::new();
            let opened = crate::input::open(path, "cannot open the file");
            opened.is_ok_and(|file| file.take(4096).read_to_end(&mut head).is_ok()) && is_vrt(&head)
        };
        if is_virtual(file) {
            return Ok(Box::new(VrtDem::within(file, within)?));
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

    /// Lays all files into a store.
    fn paint(&self, store: &Store) -> Result<(), LayoutError> {
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
                    sources[at..at + count].iter().try_for_each(|source| painting.paint(source, store))?;
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
            _ => Ok(()),
        }
    }
}

impl Reader for Painted {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn warnings(&self) -> Vec<Warning> {
        let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        let mut warnings: Vec<Warning> = lost
            .values()
            .take(MOST_NAMED)
            .map(|why| {
                Warning::new(format!(
                    "{}; the file was left out: its ground is that of other files, or void",
                    harmless(why, 360)
                ))
            })
            .collect();
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
        self.paint(&store)?;
        each_block(samples, BLOCK, |window| {
            let first = [i64::from(window.col), i64::from(window.row)];
            let values =
                store.window(first, [window.width as usize, window.height as usize], false)?.into_values();
            if values.iter().all(|value| value.is_nan()) {
                sink.put_void(window)
            } else {
                sink.put(window, &values)
            }
        })
    }
}

impl Reader for VrtDem {
    fn declared(&self) -> &Declared {
        self.band.declared()
    }

    fn mask(&self) -> Option<&dyn Reader> {
        self.mask.as_ref().map(|mask| mask as &dyn Reader)
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.band.warnings();
        for warning in self.mask.iter().flat_map(|mask| mask.warnings()) {
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        warnings
    }

    fn memory_bytes(&self) -> u64 {
        // The mask is read before the band.
        self.band.memory_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.band.stream(sink)
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
