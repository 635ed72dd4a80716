//! What Terrasoar does with hostile input: one body for each way in, for the fuzzer (`scripts/fuzz`) and for tests that replay seeds and findings.
//!
//! A body takes bytes and does with them what the program would. **It panics where a promise is broken**: a panic of the libraries, memory out of proportion to the input,
//! a message that cannot be shown, a file that was called sound or complete and is not. What is refused with words is well. No body leaves a file behind.

mod beside;
mod edits;
mod flight;
mod fly;
mod gridded;
mod grids;
mod image;
mod import;
mod land;
mod memory;
pub mod mutation;
mod overlay_sealed;
mod packed;
mod scratch;
mod seeds;
mod take_out;
mod terrain_sealed;
mod use_files;
mod vrt;
mod web_tiles;
mod words;
mod world_file;

use beside::{aux_xml, reference_system};
use gridded::{dted, grib, netcdf, openexr, usgs_dem};
use grids::{ascii_grid, labelled, netpbm, packed_png, raw, surfer, tiles, xyz};
pub use seeds::Inputs;
use web_tiles::{map_tile, mbtiles, pmtiles};

use std::panic::{PanicHookInfo, resume_unwind};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// A way in for hostile input.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Its name: that of the program in `fuzz_targets` and of the folder in `regressions`.
    pub name: &'static str,
    /// Inputs to begin with, each with a name.
    pub seeds: fn() -> Inputs,
    /// Whether its input is text.
    pub is_text: bool,
    body: fn(&[u8]),
    /// Memory beside the input, in MiB.
    fixed_mib: usize,
    /// Bytes of memory a byte of input.
    per_byte: usize,
}

impl Target {
    /// Every finding so far.
    pub fn regressions(&self) -> Inputs {
        seeds::regressions(self.name)
    }

    /// Runs the body over one input.
    ///
    /// # Panics
    /// Where a promise is broken.
    pub fn run(&self, data: &[u8]) {
        land::make_all();
        let allowed = (self.fixed_mib << 20) + self.per_byte * data.len();
        memory::within(allowed, || (self.body)(data));
    }
}

macro_rules! targets {
    ($($(#[$doc:meta])* $name:ident { is_text: $is_text:expr, fixed_mib: $fixed:expr, per_byte: $per_byte:expr })*) => {
        /// All targets.
        pub const TARGETS: &[Target] = &[$(Target {
            name: stringify!($name),
            seeds: $name::seeds,
            is_text: $is_text,
            body: $name::body,
            fixed_mib: $fixed,
            per_byte: $per_byte,
        }),*];
        $(
            $(#[$doc])*
            ///
            /// # Panics
            /// Where a promise is broken.
            pub fn $name(data: &[u8]) {
                run(stringify!($name), data);
            }
        )*
    };
}

targets! {
    /// Elevation data: opened, streamed, built with little memory, the file that comes of it opened and verified.
    import { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// An Esri ASCII grid.
    ascii_grid { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// A Surfer grid.
    surfer { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// An OpenEXR picture as heights.
    openexr { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// An XYZ grid.
    xyz { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// Plain numbers with a label of ESRI's or ENVI's beside them.
    labelled { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A Netpbm picture.
    netpbm { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A heightmap without a header, and what a person says of its shape.
    raw { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// An `.hgt` tile, packed or in an archive.
    tiles { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A pyramid of map tiles in PMTiles: as heights, as a picture by itself and on a terrain.
    pmtiles { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// The same in MBTiles.
    mbtiles { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A tile in a folder of map tiles.
    map_tile { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A PNG whose colours are heights, or in seven passes.
    packed_png { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// NetCDF, classic and over HDF5.
    netcdf { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// GRIB of edition 2.
    grib { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A DTED cell.
    dted { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A sheet of the USGS.
    usgs_dem { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// A reference system as text: named by a person, and beside a DEM, which is brought out of it.
    reference_system { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// What GDAL keeps beside a DEM.
    aux_xml { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// A virtual raster over files beside it, alone and as one of several files.
    vrt { is_text: true, fixed_mib: 160, per_byte: 256 }
    /// A picture: opened, read, draped, its tiles read.
    image { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// A world file beside a picture: draped where it says.
    world_file { is_text: true, fixed_mib: 160, per_byte: 64 }
    /// A flight: read, written again, flown by all engines.
    flight { is_text: true, fixed_mib: 96, per_byte: 256 }
    /// A script of edits: read, written again, done on the disk, undone, done again, replayed.
    edits { is_text: true, fixed_mib: 96, per_byte: 256 }
    /// A terrain file changed and sealed again, or as it is: opened, verified, flown over, edited, undone, redone, compacted, draped.
    terrain_sealed { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// The same of an overlay over a sound terrain.
    overlay_sealed { is_text: false, fixed_mib: 160, per_byte: 64 }
    /// The same of a packed file, whose pages take little of it.
    packed { is_text: false, fixed_mib: 160, per_byte: 1024 }
}

fn run(name: &str, data: &[u8]) {
    if let Some(target) = TARGETS.iter().find(|target| target.name == name)
        && let Err(panic) = std::panic::catch_unwind(|| target.run(data))
    {
        eprintln!("{}", LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        resume_unwind(panic);
    }
}

/// What the last panic said.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// To be called once in a fuzzing program. Panics inside decoders are caught by whoever called them and become damage in the file; only one that leaves the
/// body is a finding, so none may end the process before. Work is done on the fuzzer's own thread, so that a run repeats. Where the environment names a folder in
/// `TERRASOAR_SEEDS`, the seeds of the target are written there and the program ends.
pub fn prepare(name: &str) {
    if let Some(folder) = std::env::var_os("TERRASOAR_SEEDS") {
        std::process::exit(i32::from(write_seeds(name, folder.as_ref()).is_err()));
    }
    std::panic::set_hook(Box::new(|panic: &PanicHookInfo<'_>| {
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
    // Fails only where the pool exists already, which is as well.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
}

fn write_seeds(name: &str, folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let seeds = TARGETS.iter().filter(|target| target.name == name).flat_map(|target| (target.seeds)());
    for (i, (_, bytes)) in seeds.enumerate() {
        std::fs::write(folder.join(format!("seed-{i}")), bytes)?;
    }
    Ok(())
}
