//! One file of a mosaic: what its header says, kept in a few hundred bytes; and its samples, read whole or not at all.
//!
//! A file is opened twice, to be looked at and to be read, and closed in between, so that no limit of open files is met. Its samples go to a store of their own first. A file that turns out
//! damaged after half of its samples leaves nothing behind.

use crate::beside::Beside;
use crate::crs::{System, Vertical};
use crate::formats;
use crate::guard::is_ours;
use crate::opened::OpenedDem;
use crate::options::OpenOptions;
use crate::warp::Store;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use terrasoar_layout::dem::{DemSource, SampleSink, SampleType, UnitOf, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// What a file of a mosaic says.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    /// Its place among the names that were given.
    pub(super) rank: usize,
    pub(super) samples: [u32; 2],
    pub(super) sample_type: SampleType,
    /// The map of its grid, north-up; west of 180 degrees it may be counted on.
    pub(super) map: [f64; 6],
    /// As the file has it.
    own_map: [f64; 6],
    /// Metres a raw unit, and metres at raw value 0.
    pub(super) metres: [f64; 2],
    pub(super) unit: UnitOf,
    pub(super) unit_is_known: bool,
    /// What heights are measured from, where the file says so.
    pub(super) level: Option<Vertical>,
    /// Where heights were found, in words.
    pub(super) heights_words: String,
    pub(super) format: String,
    pub(super) memory_bytes: u64,
    pub(super) warnings: Vec<Warning>,
}

/// Opens one file, or what else can be read alone.
pub(crate) fn open_one(paths: &[PathBuf], options: &OpenOptions) -> Result<OpenedDem, LayoutError> {
    let reader = formats::open(paths, options)?;
    let path = paths.first().map(PathBuf::as_path).unwrap_or(Path::new(""));
    let beside = Beside::of(paths, &*reader);
    OpenedDem::new(path, reader, beside, options)
}

/// How each file is opened where the mosaic is opened with `options`.
pub(super) fn options_of_each(options: &OpenOptions) -> OpenOptions {
    OpenOptions {
        reproject: None,
        resolution: None,
        as_stored: false,
        memory_mib: Some((options.memory_mib.unwrap_or(512) / 2).max(1)),
        ..options.clone()
    }
}

impl Source {
    /// Looks at the file; its reference system comes apart.
    ///
    /// # Errors
    /// As [`crate::open`]; [`LayoutError::Usage`] for a file that does not say where it lies.
    pub(super) fn look(
        path: &Path,
        rank: usize,
        options: &OpenOptions,
    ) -> Result<(Self, System), LayoutError> {
        let dem = open_one(&[path.to_owned()], options)?;
        let info = dem.info();
        let map = info.georeference.pixel_to_crs.ok_or_else(|| {
            LayoutError::Usage(format!(
                "{}: it does not say where it lies, and of several files each must; put a world file beside it, or build it alone",
                path.display()
            ))
        })?;
        let heights = info.about.origins.iter().find(|(what, _)| what == "heights");
        // How far a map is from the ground is said once, of the whole.
        let is_own = |warning: &&Warning| !matches!(warning.mended_by, Some((Remedy::Reproject, _)));
        let source = Self {
            path: path.to_owned(),
            rank,
            samples: [info.samples_wide, info.samples_high],
            sample_type: info.sample_type,
            map,
            own_map: map,
            metres: [info.height_scale, info.height_offset_m],
            unit: info.about.vertical_unit.clone().unwrap_or_default(),
            unit_is_known: dem.unit_is_known(),
            level: dem.system().vertical.clone(),
            heights_words: heights.map(|(_, words)| words.clone()).unwrap_or_default(),
            format: info.format.clone(),
            memory_bytes: dem.memory_bytes(),
            warnings: dem.declared_warnings().iter().filter(is_own).cloned().collect(),
        };
        Ok((source, dem.system().clone()))
    }

    /// Reads the file into an empty store of its size.
    ///
    /// # Errors
    /// [`Failure::Ours`] where the store or the system failed, [`Failure::File`] where the file did.
    pub(super) fn read(&self, options: &OpenOptions, store: &Store) -> Result<Read, Failure> {
        let watched = Watched { store, failed: AtomicBool::new(false) };
        let read = || {
            let dem = open_one(std::slice::from_ref(&self.path), options)?;
            let info = dem.info();
            let is_same = [info.samples_wide, info.samples_high] == self.samples
                && info.georeference.pixel_to_crs == Some(self.own_map)
                && [info.height_scale, info.height_offset_m] == self.metres;
            if !is_same {
                return Err(LayoutError::damaged(
                    &self.path,
                    "header",
                    "the file changed while it was read; start again",
                ));
            }
            dem.stream(&watched)?;
            Ok(Read { warnings: dem.seen_by_reader(), unmatched: dem.unmatched() })
        };
        read().map_err(|error| {
            if watched.failed.load(Ordering::Relaxed) || is_ours(&error) {
                Failure::Ours(error)
            } else {
                Failure::File(error)
            }
        })
    }
}

/// What was seen while a file was read.
pub(super) struct Read {
    pub(super) warnings: Vec<Warning>,
    /// Values named as "no data" that no sample had.
    pub(super) unmatched: Vec<String>,
}

/// Why a file was not read.
pub(super) enum Failure {
    /// The disk was full, too many files were open: nothing that another file would mend.
    Ours(LayoutError),
    /// The file is missing, damaged, or not what it was taken for.
    File(LayoutError),
}

/// Passes samples on to a store and remembers whether that failed.
struct Watched<'a> {
    store: &'a Store,
    failed: AtomicBool,
}

impl SampleSink for Watched<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let put = self.store.put(window, samples);
        if matches!(put, Err(LayoutError::Io { .. })) {
            self.failed.store(true, Ordering::Relaxed);
        }
        put
    }

    fn put_void(&self, _window: Window) -> Result<(), LayoutError> {
        Ok(())
    }
}
