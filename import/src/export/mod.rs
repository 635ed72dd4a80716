//! Heights of a terrain as a cloud-optimised GeoTIFF, with edits and overlays, for every program that reads GeoTIFF.
//!
//! Written is what the file holds: metres, a sample a pixel, `PixelIsPoint`, for heights are measured at points. Voids are the declared "no data". Overviews are means of four. The
//! directories stand before the data and the coarsest overview comes first, so that a reader over a network needs the file's beginning and the tiles it looks at (`cog`). **Memory does not
//! follow the terrain**: some tiles a thread and 50 bytes a tile (`pyramid`); tiles without a number are not stored; on the output's disk twice the file's room is taken while it is made.
//!
//! Crates that write such files were looked at: `tiff` 0.11.3 writes strips alone, with the directory behind them; `geotiff-writer` 0.10 lays tiles uncompressed into the system's folder for
//! temporary files, which may be memory, and compresses on one thread.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use terrasoar_import::export::{Numbers, export_heights};
//! use terrasoar_import::synth::{SynthOptions, write};
//! use terrasoar_layout::build::{BuildOptions, build};
//! use terrasoar_layout::progress::Silent;
//! use terrasoar_layout::read::terrain::Terrain;
//! use terrasoar_layout::read::window::SampleWindow;
//! # let folder = tempfile::tempdir()?;
//! # let at = |name: &str| folder.path().join(name);
//! write(&SynthOptions::default().size(65), &at("made-up.tif"), &|_| {})?;
//! build(&*terrasoar_import::open_file(&at("made-up.tif"))?, &at("made-up.iqt"), &BuildOptions::default(), &Silent)?;
//! let terrain = Terrain::open(&at("made-up.iqt"))?;
//! let written = export_heights(&terrain, &SampleWindow::of(terrain.grid()), None, &at("out.tif"), &Silent)?;
//! assert_eq!(written.numbers, Numbers::Float32);
//! assert_eq!(terrasoar_import::open_file(&at("out.tif"))?.info().samples_wide, 65);
//! # Ok(())
//! # }
//! ```

mod cog;
mod encode;
mod keys;
mod methods;
mod place;
mod pyramid;

pub use cog::is_exported;
pub use encode::Numbers;
pub use keys::Named;

use crate::raster::{Raster, TerrainSamples};
use place::Place;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::progress::Progress;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// How the numbers are stored.
    pub numbers: Numbers,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Bytes of the file.
    pub bytes: u64,
    /// Pixels without a number.
    pub voids: u64,
    /// How far the file says in which reference system it lies.
    pub named: Named,
}

/// What numbers are, for those who open the file.
pub(crate) struct Meaning {
    /// Of the file.
    pub(crate) file: String,
    /// Of its band.
    pub(crate) band: String,
    /// Whether they are heights above what the terrain's are measured from.
    pub(crate) are_heights: bool,
}

/// The numbers that keep every height of a terrain: 16-bit integers where all heights are whole metres, double precision where the records have it, else single precision.
pub fn numbers_of(header: &Header) -> Numbers {
    let is_whole = |value: f64| value.fract() == 0.0;
    let scale = &header.scale;
    // The lowest integer stands for "no data".
    let fits = header.height_range_m.iter().all(|metres| (-32767.0..=32767.0).contains(metres));
    match header.record_kind {
        RecordKind::Compact | RecordKind::Fine
            if is_whole(scale.height_base_m) && is_whole(scale.height_step_m) && fits =>
        {
            Numbers::Int16
        }
        RecordKind::Exact16 => Numbers::Float64,
        _ => Numbers::Float32,
    }
}

/// Writes the heights of `window` to `out`, as `numbers`, or as those of [`numbers_of`]. The file appears when it is complete. Works on the current rayon pool.
///
/// # Errors
/// [`LayoutError::Usage`] for a window that does not lie in the terrain; damage in the terrain; I/O.
pub fn export_heights(
    terrain: &Terrain,
    window: &SampleWindow,
    numbers: Option<Numbers>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, LayoutError> {
    let header = terrain.header();
    let above = match header.about.vertical_name.as_str() {
        "" => String::new(),
        name => format!(", {name}"),
    };
    let meaning = Meaning {
        file: format!("Terrain heights in metres{above}"),
        band: format!("height{above}"),
        are_heights: true,
    };
    let numbers = numbers.unwrap_or_else(|| numbers_of(header));
    let raster = TerrainSamples::new(terrain, *window)?;
    write_raster(&raster, &meaning, numbers, header, window, out, progress)
}

/// Writes numbers that belong to the samples of `window` of the terrain of `header`.
pub(crate) fn write_raster(
    raster: &dyn Raster,
    meaning: &Meaning,
    numbers: Numbers,
    header: &Header,
    window: &SampleWindow,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Written, LayoutError> {
    let place = Place::of(header, window);
    let keys = keys::of(header, meaning.are_heights);
    let made = pyramid::make(raster, numbers, out, progress)?;
    let bytes = cog::write(&made, numbers, meaning, &place, &keys, out, progress)?;
    Ok(Written { numbers, size: raster.size(), bytes, voids: made.voids, named: keys.named })
}
