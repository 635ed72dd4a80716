//! What to build: plain values.

use crate::file::header::ErrorKind;
use crate::grid::record::RecordKind;

/// Largest tile: beyond this a tile no longer fits a core's cache.
pub(super) const LARGEST_TILE: u32 = 256;

/// What to build.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// Spacing in metres (east, north) instead of what the DEM says.
    pub spacing_m: Option<[f64; 2]>,
    /// Factor on all heights, below 0 where raw numbers are depths; the default is 1.
    pub z_scale: f64,
    /// Memory budget in MiB; at least 48.
    pub memory_mib: u64,
    /// Record kind; `None` chooses the smallest that keeps every height exactly. Either exact kind stands for both.
    pub record: Option<RecordKind>,
    /// Metres between the heights of compact records, more than 0 and finite: every sample is rounded to the nearest whole multiple of it. `None`, the default,
    /// leaves it to `record`. It goes with compact records alone, and [`build()`](super::build()) refuses steps of which the range of heights has more than records count.
    pub height_step_m: Option<f64>,
    /// Kind of error to store.
    pub error: ErrorKind,
    /// Raw value that means "no data", beside what the DEM declares.
    pub nodata: Option<f64>,
    /// Holes up to so many samples across, either way, are filled from their rims; 0, the default, for none, at most 256.
    pub fill_voids: u32,
    /// Whether compact records have room for heights below the lowest and above the highest, so that edits may dig and raise. The default is yes: a range
    /// of 16,384 height steps, or a quarter more than the terrain's. It costs some 0.1 % of triangles, and more where a terrain is that tall: its smallest errors grow
    /// by up to a quarter.
    pub head_room: bool,
    /// Whether the file is packed: the terrain file is built without a name first, and packed from there, so that it takes the room of both. The default is no.
    pub packed: bool,
    /// Largest side of a tile in steps, a power of two from 2 to 256. Smaller tiles save memory and cost time; the file is the same.
    pub largest_tile: u32,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            spacing_m: None,
            z_scale: 1.0,
            memory_mib: 512,
            record: None,
            height_step_m: None,
            error: ErrorKind::Bounded,
            nodata: None,
            fill_voids: 0,
            head_room: true,
            packed: false,
            largest_tile: LARGEST_TILE,
        }
    }
}

impl BuildOptions {
    /// These options with a spacing in metres, east and north, instead of what the DEM says.
    pub fn spacing_m(self, spacing_m: impl Into<Option<[f64; 2]>>) -> Self {
        Self { spacing_m: spacing_m.into(), ..self }
    }

    /// These options with another factor on all heights.
    pub fn z_scale(self, z_scale: f64) -> Self {
        Self { z_scale, ..self }
    }

    /// These options with another memory budget in MiB.
    pub fn memory_mib(self, memory_mib: u64) -> Self {
        Self { memory_mib, ..self }
    }

    /// These options with this kind of records, instead of the smallest that keeps every height exactly.
    pub fn record(self, record: impl Into<Option<RecordKind>>) -> Self {
        Self { record: record.into(), ..self }
    }

    /// These options with heights rounded to whole multiples of so many metres.
    pub fn height_step_m(self, height_step_m: impl Into<Option<f64>>) -> Self {
        Self { height_step_m: height_step_m.into(), ..self }
    }

    /// These options with another kind of error to store.
    pub fn error(self, error: ErrorKind) -> Self {
        Self { error, ..self }
    }

    /// These options with a raw value that means "no data", beside what the DEM declares.
    pub fn nodata(self, nodata: impl Into<Option<f64>>) -> Self {
        Self { nodata: nodata.into(), ..self }
    }

    /// These options with holes up to so many samples across filled from their rims.
    pub fn fill_voids(self, fill_voids: u32) -> Self {
        Self { fill_voids, ..self }
    }

    /// These options with or without room for heights that the terrain does not have yet.
    pub fn head_room(self, head_room: bool) -> Self {
        Self { head_room, ..self }
    }

    /// These options with a file that is packed, or not.
    pub fn packed(self, packed: bool) -> Self {
        Self { packed, ..self }
    }

    /// These options with another largest side of a tile in steps.
    pub fn largest_tile(self, largest_tile: u32) -> Self {
        Self { largest_tile, ..self }
    }
}
