//! Builds that fail leave nothing, and keep what was there.

mod common;

use common::MemoryDem;
use std::path::Path;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, SampleType, Window};
use terrasoar_layout::progress::Silent;

/// A small terrain with padding and voids.
fn dem() -> MemoryDem {
    MemoryDem::from_fn([50, 37], SampleType::I16, |x, y| {
        if x.abs_diff(20) + y.abs_diff(11) < 5 || x + y > 83 {
            return f64::NAN;
        }
        (400.0 + 90.0 * (f64::from(x) * 0.3).sin() + f64::from((x * 31 + y * 57) % 23)).round()
    })
}

fn options() -> BuildOptions {
    BuildOptions::default().spacing_m([20.0, 25.0])
}

/// Passes on a DEM up to a row, then fails.
struct Failing(MemoryDem, u32);

struct FailingSink<'a>(&'a dyn SampleSink, u32);

fn injected() -> LayoutError {
    LayoutError::io(Path::new("dem"), "cannot read the file", std::io::Error::other("injected failure"))
}

impl SampleSink for FailingSink<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if window.row == self.1 {
            return Err(injected());
        }
        self.0.put(window, samples)
    }
}

impl DemSource for Failing {
    fn info(&self) -> &DemInfo {
        self.0.info()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.0.stream(&FailingSink(sink, self.1))
    }
}

#[test]
fn a_build_that_fails_leaves_nothing_and_keeps_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let names = || {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect::<Vec<_>>()
    };
    let out = folder.path().join("t.iqt");
    for row in [0, 20, 36] {
        let error = build(&Failing(dem(), row), &out, &options(), &Silent).unwrap_err();
        assert!(error.to_string().contains("injected failure"), "{error}");
        assert!(names().is_empty(), "{:?}", names());
    }
    std::fs::write(&out, "what was there").unwrap();
    assert!(build(&Failing(dem(), 30), &out, &options(), &Silent).is_err());
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "what was there");
    assert_eq!(names(), ["t.iqt"]);
    let void = MemoryDem::from_fn([9, 9], SampleType::I16, |_, _| f64::NAN);
    assert!(build(&void, &out, &options(), &Silent).unwrap_err().to_string().contains("void"));
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "what was there");
    assert_eq!(names(), ["t.iqt"]);
}

#[test]
fn outputs_that_cannot_be_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let is_refused = |out: &Path, words: &str| {
        let error = build(&dem(), out, &options(), &Silent).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains(&out.display().to_string()), "{error}");
    };
    is_refused(&folder.path().join("missing/t.iqt"), "cannot create the file");
    is_refused(folder.path(), "is a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "x").unwrap();
    is_refused(&file.join("t.iqt"), "cannot create the file");
    // The kernel's process folder takes no files, whoever asks.
    #[cfg(target_os = "linux")]
    is_refused(Path::new("/proc/t.iqt"), "cannot create the file");
}
