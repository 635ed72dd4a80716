//! Files as terrain: opened, built and looked at.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::Remedy;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

pub(crate) fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/cases").join(name)
}

/// A terrain, and what was said on the way to it.
pub(crate) struct Built {
    pub(crate) terrain: Terrain,
    pub(crate) warnings: Vec<Warning>,
    _folder: tempfile::TempDir,
}

pub(crate) fn built(
    path: &Path,
    options: &OpenOptions,
    spacing_m: Option<[f64; 2]>,
) -> Result<Built, LayoutError> {
    built_with(path, options, spacing_m, 1.0)
}

pub(crate) fn built_with(
    path: &Path,
    options: &OpenOptions,
    spacing_m: Option<[f64; 2]>,
    z_scale: f64,
) -> Result<Built, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("t.iqt");
    let options =
        OpenOptions { spacing_is_stated: spacing_m.is_some(), z_scale: Some(z_scale), ..options.clone() };
    let dem = open_with(&[path.to_owned()], &options)?;
    build(&*dem, &out, &BuildOptions { spacing_m, z_scale, ..BuildOptions::default() }, &Silent)?;
    let warnings = dem.warnings();
    Ok(Built { terrain: Terrain::open(&out)?, warnings, _folder: folder })
}

impl Built {
    pub(crate) fn spacing_m(&self) -> [f64; 2] {
        self.terrain.grid().spacing_m()
    }

    /// The height of a sample counted from the south-west one; `None` for a void.
    pub(crate) fn height_m(&self, [x, y]: [u32; 2]) -> Option<f64> {
        let vertex = self.terrain.checked_vertex(GridPoint::new(x, y)).unwrap();
        (!vertex.class.is_void()).then_some(vertex.height_m)
    }

    /// The height between samples, NaN next to voids.
    pub(crate) fn between(&self, [x, y]: [f64; 2]) -> f64 {
        let at = |dx: u32, dy: u32| self.height_m([x as u32 + dx, y as u32 + dy]).unwrap_or(f64::NAN);
        let (s, t) = (x.fract(), y.fract());
        (1.0 - t) * ((1.0 - s) * at(0, 0) + s * at(1, 0)) + t * ((1.0 - s) * at(0, 1) + s * at(1, 1))
    }

    /// Heights of all samples, rows from the south.
    pub(crate) fn heights_m(&self) -> Vec<Option<f64>> {
        let [wide, high] = self.terrain.grid().samples();
        (0..high).flat_map(|y| (0..wide).map(move |x| [x, y])).map(|at| self.height_m(at)).collect()
    }
}

/// The words and the remedy with which opening or building fails.
pub(crate) fn refused(path: &Path, options: &OpenOptions) -> (String, Option<Remedy>) {
    match built(path, options, None) {
        Ok(_) => panic!("{} was built", path.display()),
        Err(error) => (error.to_string(), error.remedy()),
    }
}
