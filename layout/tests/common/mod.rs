//! Elevation data held in memory, and terrain files made of it.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, Silent, build};
pub mod drape;

pub use terrasoar_layout::dem::MemoryDem;
use terrasoar_layout::terrain::Terrain;

/// Builds a file from `dem` and returns its bytes.
pub fn build_bytes(dem: &MemoryDem, options: &BuildOptions) -> Result<Vec<u8>, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    build(dem, &path, options, &Silent)?;
    Ok(std::fs::read(path).unwrap())
}

/// Opens a terrain over bytes in memory.
pub fn open_bytes(bytes: Vec<u8>) -> Result<Terrain, LayoutError> {
    Terrain::from_source(Box::new(terrasoar_layout::source::MemorySource::new("memory", bytes)))
}
