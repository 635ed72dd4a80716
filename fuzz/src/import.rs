//! Elevation data of every format, told by content.

use crate::seeds::{self, Inputs};
use crate::words::{refused, told};
use std::path::Path;
use std::sync::Mutex;
use std::sync::PoisonError;
use terrasoar_import::OpenOptions;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, Window};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

/// Samples that are looked at one by one, and built.
const MOST_SAMPLES: u64 = 1 << 16;

pub(crate) fn seeds() -> Inputs {
    let mut seeds = seeds::folder("import/tests/fixtures", &["tif"]);
    seeds.extend(seeds::elevation());
    seeds
}

pub(crate) fn body(data: &[u8]) {
    let is_hgt = !(data.starts_with(b"\x89PNG")
        || data.starts_with(b"binterr")
        || data.starts_with(b"II")
        || data.starts_with(b"MM"));
    // These tiles alone are told by their name.
    let name = if is_hgt { "N10E010.hgt" } else { "dem" };
    read(&[(name, &seeds::with_png_sums(data))], &OpenOptions::default());
}

/// Opens the first of some files that lie in one folder, streams it and builds it.
pub(crate) fn read(files: &[(&str, &[u8])], options: &OpenOptions) {
    read_named(files, files.iter().take(1).map(|(name, _)| *name), options);
}

/// Opens files that lie in one folder as one, streams it and builds it.
pub(crate) fn read_several(files: &[(&str, &[u8])], options: &OpenOptions) {
    read_named(files, files.iter().map(|(name, _)| *name), options);
}

fn read_named<'n>(files: &[(&str, &[u8])], names: impl Iterator<Item = &'n str>, options: &OpenOptions) {
    let folder = crate::scratch::folder();
    files.iter().for_each(|(name, bytes)| seeds::write(&folder.path().join(name), bytes));
    let paths: Vec<_> = names.map(|name| folder.path().join(name)).collect();
    let Some(dem) = told(terrasoar_import::open_with(&paths, options)) else { return };
    streams(&*dem);
    let info = dem.info();
    if u64::from(info.samples_wide) * u64::from(info.samples_high) <= MOST_SAMPLES {
        builds(&*dem, folder.path(), files.len());
    }
}

/// Streams elevation data; what ends well has given every sample.
pub(crate) fn streams(dem: &dyn DemSource) {
    let info = dem.info();
    assert!(info.samples_wide >= 2 && info.samples_high >= 2, "{info:?}");
    let sink = Sink::new(info);
    let streamed = dem.stream(&sink);
    if told(streamed).is_some() {
        sink.check_whole();
    }
}

/// What is built opens and is sound; what is not built leaves nothing.
fn builds(dem: &dyn DemSource, folder: &Path, files: usize) {
    let out = folder.join("out.iqt");
    let options = BuildOptions::default().memory_mib(48);
    match build(dem, &out, &options, &Silent) {
        Ok(header) => {
            let terrain =
                Terrain::open(&out).unwrap_or_else(|error| panic!("built and does not open: {error}"));
            assert!(terrain.header().to_page() == header.to_page(), "what was built is not what was told");
            let report = verify(&terrain, &|_| {})
                .unwrap_or_else(|error| panic!("built and cannot be verified: {error}"));
            assert!(report.is_sound(), "built and not sound: {:?}", report.problems);
        }
        Err(error) => {
            refused(&error);
            assert!(!out.exists(), "refused, and something was published: {error}");
        }
    }
    let names: Vec<_> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
    assert!(names.len() <= files + 1, "{names:?}");
}

/// Looks at what arrives, and has enough after a while.
struct Sink {
    samples: [u32; 2],
    is_small: bool,
    arrived: Mutex<(Vec<u8>, u64)>,
}

impl Sink {
    fn new(info: &DemInfo) -> Self {
        let count = u64::from(info.samples_wide) * u64::from(info.samples_high);
        let is_small = count <= MOST_SAMPLES;
        let times = if is_small { vec![0; count as usize] } else { Vec::new() };
        Self { samples: [info.samples_wide, info.samples_high], is_small, arrived: Mutex::new((times, 0)) }
    }

    fn check_whole(&self) {
        let arrived = self.arrived.lock().unwrap_or_else(PoisonError::into_inner);
        assert!(arrived.0.iter().all(|times| *times == 1), "a sample did not arrive exactly once");
    }
}

impl SampleSink for Sink {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let Window { col, row, width, height } = window;
        let [wide, high] = self.samples.map(u64::from);
        assert_eq!(samples.len() as u64, u64::from(width) * u64::from(height), "{window:?}");
        assert!(width > 0 && height > 0, "{window:?}");
        assert!(
            u64::from(col) + u64::from(width) <= wide && u64::from(row) + u64::from(height) <= high,
            "{window:?}"
        );
        let mut arrived = self.arrived.lock().unwrap_or_else(PoisonError::into_inner);
        arrived.1 += samples.len() as u64;
        if self.is_small {
            for line in 0..height as usize {
                let at = (row as usize + line) * wide as usize + col as usize;
                arrived.0[at..at + width as usize]
                    .iter_mut()
                    .for_each(|times| *times = times.saturating_add(1));
            }
        } else if arrived.1 > 4 * MOST_SAMPLES {
            return Err(LayoutError::Usage("that is enough for a try".into()));
        }
        Ok(())
    }
}
