//! `terrasoar build`: a DEM in, a terrain file out.

use super::built::Built;
use super::output::{complain, print, print_json};
use super::outputs::{Force, Kind};
use super::progress::Meter;
use super::tiles::Tiles;
use super::{WrongUsage, parse, remedy, terrain};
use anyhow::{Context, Result};
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::time::Instant;
use terrasoar_import::{Direction, OpenOptions, Priority, Resampling};
use terrasoar_layout::build::{BuildOptions, MAX_FILL, build};
use terrasoar_layout::file::header::{ErrorKind, Header, SpacingOrigin};
use terrasoar_layout::grid::record::RecordKind;

/// Make a terrain file (.iqt) from elevation data.
///
/// Reads GeoTIFF, GDAL's virtual rasters (.vrt), PNG (grey, or heights packed into colours), PGM, OpenEXR, .hgt (packed ones too), Esri ASCII grids, XYZ
/// grids, .flt and .bil with their .hdr, ENVI, netCDF, GRIB 2, DTED, USGS DEM, VTP BT, pyramids of map tiles (folders, MBTiles, PMTiles) and headerless heightmaps, of any size and any rectangle; and several
/// of them, folders and patterns as one mosaic. The output appears when it is complete; a build that fails or is killed leaves nothing, and the next one starts from the
/// beginning. The same input gives the same bytes whatever --threads and --memory.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar build alps.tif -o alps.iqt
  terrasoar build N46E007.hgt N46E008.hgt -o valais.iqt
  terrasoar build srtm-folder -o all.iqt
  terrasoar build region.tif detail.tif city.vrt -o all.iqt
  terrasoar build 'tiles/*.tif' --priority last --feather 200 -o all.iqt
  terrasoar build island.raw --raw 1025x1025:u16le --spacing 10 -o island.iqt
  terrasoar build puget.png --spacing 160 --z-scale 0.1 -o puget.iqt
  terrasoar build huge.tif --memory 2048 -o huge.iqt
  terrasoar build huge.tif --packed -o huge-packed.iqt
  terrasoar build terrain.pmtiles --bounds 7,46,8,47 --reproject utm -o valais.iqt
  terrasoar build world.tif --reproject utm --resolution 30 -o metric.iqt
  terrasoar build srtm-folder --fill-voids 20 -o whole.iqt
  terrasoar build lidar.tif --height-step 0.01 -o lidar.iqt

Room on the output's disk: some 4 bytes a sample for the file (8 or 16 with exact records), and while building another 4 (8 where single
precision does not hold the samples), unless --memory holds them. Voids take none. With --packed the terrain file is made beside the packed one, and takes that room until it is packed.

A DEM in degrees gets the spacing in metres that degrees have at its centre; `terrasoar info` says so. PNG says nothing about spacing:
state it, or it is taken to be 1 m. What else the data does not say can be stated: its reference system, its unit of heights, which numbers mean \"no data\".
What looks wrong is said aloud, with the flag to type.

Several files become one terrain: in the reference system that most samples are in, with the shortest steps of the files in it (--reproject, --resolution
for others). Files that lie on that grid are copied, others resampled. Where files overlap, --priority says which counts; void samples never do. By finest, the
default, and highest the order of names changes nothing. A file that is missing or damaged is named and left out, whole; with --strict it is an error.

Voids, samples without data, are counted and left as they are. --fill-voids N fills regions of voids that border each other east, west, north or south and whose box is
at most N samples wide and high: each sample becomes the mean of its neighbours, as in a soap film over the rim, rounded to the steps of the data. How many is said,
and kept in the file (terrasoar info).

Heights of floating point are kept exactly unless something else is asked for. --height-step M rounds them, and whole numbers too, to the nearest multiple of M metres: no sample moves
by more than half of it. The build says which step would fit, where records are exact. A step that is too fine for the range of heights is refused, with the smallest that fits.

Fields of --json: file, samples, spacing_m, height_range_m, record, record_bytes, height_step_m (null for exact records), heights_rounded, compact_step_m and compact_bytes
(what compact records would round to and take; null unless exact ones were chosen for the data), nodata_samples, bytes, bytes_per_sample, seconds.")]
pub(super) struct Args {
    /// Elevation data: a file, several, folders, or patterns such as 'tiles/*.tif'
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Terrain file to write
    #[arg(short, long, value_name = "OUT.iqt")]
    output: PathBuf,
    /// Write packed terrain, in a third to a tenth of the bytes
    #[arg(long)]
    packed: bool,
    #[command(flatten)]
    force: Force,
    /// Metres between samples, one number or east,north, instead of what the DEM says
    #[arg(long, value_name = "M|MX,MY", value_parser = parse::spacing_m)]
    spacing: Option<[f64; 2]>,
    /// Factor on all heights, such as 0.1 where a raw unit is a decimetre, or -1 where depths are counted
    #[arg(long, value_name = "S", default_value = "1", value_parser = parse::not_zero, allow_negative_numbers = true)]
    z_scale: f64,
    /// Memory to use at most, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 512, value_parser = clap::value_parser!(u64).range(48..=1 << 24))]
    memory: u64,
    /// Kind of record; without it the smallest that keeps every height exactly. Compact rounds heights to 65,536 steps where it must
    #[arg(long, value_name = "KIND")]
    record: Option<RecordWord>,
    /// Round heights to whole multiples of M metres, in compact records
    #[arg(long, value_name = "M", value_parser = parse::positive)]
    height_step: Option<f64>,
    /// Error to store: bounded keeps the promise on the screen, step is the measure of the SOAR papers
    #[arg(long, value_name = "KIND", default_value = "bounded")]
    error: ErrorWord,
    /// Threads to use; all cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Raw value that means "no data", beside what the DEM declares; several with commas between, or the flag several times
    #[arg(long, value_name = "VALUE", value_parser = parse::raw_value, allow_hyphen_values = true, value_delimiter = ',')]
    nodata: Vec<String>,
    /// Fill holes of up to N samples across, either way, smoothly from their rims; larger ones stay void
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=i64::from(MAX_FILL)), hide_default_value = true)]
    fill_voids: u32,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    several: Several,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    tiles: Tiles,
}

/// How several files become one.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Several files")]
struct Several {
    /// Which of several files counts where they overlap
    #[arg(long, value_name = "WHICH", default_value = "finest")]
    priority: PriorityWord,
    /// Blend the seams between files over M metres; without it they stay as they are
    #[arg(long, value_name = "M", value_parser = parse::positive)]
    feather: Option<f64>,
    /// Fail where a file is missing or damaged, instead of leaving it out
    #[arg(long)]
    strict: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PriorityWord {
    /// The one with the shortest steps on the ground; of files alike the first by name
    Finest,
    /// The one named first; folders and patterns are sorted by name
    First,
    /// The one named last
    Last,
    /// The highest ground, sample by sample
    Highest,
}

/// What the elevation data does not say, or says wrongly.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "What the elevation data does not say")]
struct Reading {
    /// Reference system instead of the DEM's: EPSG:n, EPSG:n+m with heights, WKT, a PROJ string, or local for a site in metres
    #[arg(long, value_name = "SYSTEM")]
    crs: Option<String>,
    /// Unit of heights instead of the DEM's: m, ft, ftUS, dm, cm, fathom, or its metres, such as 0.1
    #[arg(long, value_name = "UNIT")]
    height_unit: Option<String>,
    /// Whether numbers grow upward, as heights do, or downward, as depths do
    #[arg(long, value_name = "WAY")]
    positive: Option<Way>,
    /// Band or variable with the heights: its number from 1 on, or its name
    #[arg(long, value_name = "BAND")]
    band: Option<String>,
    /// How heights are packed into colours: mapbox (Terrain-RGB), terrarium, or factors R,G,B,BASE
    #[arg(long, alias = "encoding", value_name = "PACKING", allow_hyphen_values = true)]
    decode: Option<String>,
    /// Shape of a file without a header: width x height : type, such as 1025x1025:u16le
    #[arg(long, value_name = "WxH:TYPE")]
    raw: Option<String>,
    /// Bring the data into another system: EPSG:n, utm (the zone of the centre), auto, WKT or a PROJ string
    #[arg(long, value_name = "SYSTEM")]
    reproject: Option<String>,
    /// Metres between the new samples, with --reproject or of several files; without it those of the data
    #[arg(long, value_name = "M", value_parser = parse::positive)]
    resolution: Option<f64>,
    /// How new samples are made of old ones, where they are brought elsewhere or turned north-up
    #[arg(long, value_name = "KERNEL")]
    resampling: Option<KernelWord>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Way {
    /// Heights
    Up,
    /// Depths
    Down,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum KernelWord {
    /// The nearest sample
    Nearest,
    /// The four around
    Bilinear,
    /// The sixteen around, cubic convolution
    Cubic,
    /// The thirty-six around, a windowed sine
    Lanczos,
    /// The mean of what lies under the new sample
    Average,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum RecordWord {
    /// 4 bytes a vertex
    Compact,
    /// 4 bytes a vertex, with finer errors and radii: a few percent fewer triangles
    Fine,
    /// 8 or 16 bytes a vertex
    Exact,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ErrorWord {
    /// Farthest departure of the surface over all samples
    Bounded,
    /// Distance of a vertex from the edge it splits
    Step,
}

impl Args {
    fn options(&self) -> BuildOptions {
        BuildOptions::default()
            .spacing_m(self.spacing)
            .z_scale(self.z_scale)
            .memory_mib(self.memory)
            .fill_voids(self.fill_voids)
            .packed(self.packed)
            .record(self.record.map(|word| match word {
                RecordWord::Compact => RecordKind::Compact,
                RecordWord::Fine => RecordKind::Fine,
                RecordWord::Exact => RecordKind::Exact8,
            }))
            .height_step_m(self.height_step)
            .error(match self.error {
                ErrorWord::Bounded => ErrorKind::Bounded,
                ErrorWord::Step => ErrorKind::Step,
            })
    }

    fn opening(&self) -> OpenOptions {
        let reading = &self.reading;
        let folder = self.output.parent().filter(|folder| !folder.as_os_str().is_empty());
        OpenOptions {
            band: reading.band.clone(),
            decode: reading.decode.clone(),
            nodata: self.nodata.clone(),
            raw: reading.raw.clone(),
            positive: reading.positive.map(|way| match way {
                Way::Up => Direction::Up,
                Way::Down => Direction::Down,
            }),
            crs: reading.crs.clone(),
            height_unit: reading.height_unit.clone(),
            spacing_is_stated: self.spacing.is_some(),
            z_scale: Some(self.z_scale),
            reproject: reading.reproject.clone(),
            resolution: reading.resolution,
            resampling: reading.resampling.map(|word| match word {
                KernelWord::Nearest => Resampling::Nearest,
                KernelWord::Bilinear => Resampling::Bilinear,
                KernelWord::Cubic => Resampling::Cubic,
                KernelWord::Lanczos => Resampling::Lanczos,
                KernelWord::Average => Resampling::Average,
            }),
            priority: match self.several.priority {
                PriorityWord::First => Priority::First,
                PriorityWord::Last => Priority::Last,
                PriorityWord::Highest => Priority::Highest,
                PriorityWord::Finest => Priority::Finest,
            },
            feather_m: self.several.feather,
            strict: self.several.strict,
            memory_mib: Some(self.memory),
            scratch: Some(folder.unwrap_or(Path::new(".")).to_owned()),
            tiles: self.tiles.options(),
            ..OpenOptions::default()
        }
    }
}

impl Args {
    /// Flags that say something of several files alone go with several.
    fn check(&self) -> Result<(), WrongUsage> {
        if !matches!(self.inputs.as_slice(), [one] if one.is_file()) {
            return Ok(());
        }
        if self.reading.resolution.is_some() && self.reading.reproject.is_none() {
            return Err(WrongUsage(
                "--resolution goes with --reproject, or with several files; one file alone keeps its own steps"
                    .into(),
            ));
        }
        if self.several.feather.is_some() {
            return Err(WrongUsage("--feather blends seams between several files, and one was named".into()));
        }
        Ok(())
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    args.check()?;
    let inputs: Vec<&Path> = args.inputs.iter().map(PathBuf::as_path).collect();
    args.force.file(&args.output, Kind::Terrain, &inputs)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().context("cannot start the threads; give fewer with --threads")?;
    let start = Instant::now();
    let (header, warnings) = pool.install(|| {
        let dem = terrasoar_import::open_with(&args.inputs, &args.opening())?;
        let built = build(&*dem, &args.output, &args.options(), &Meter::new("samples"));
        built.map(|header| (header, dem.warnings()))
    })?;
    let seconds = start.elapsed().as_secs_f64();
    warnings.iter().for_each(|warning| complain(&remedy::warned(warning)));
    for (_, words) in header.about.origins.iter().filter(|(what, _)| what == "tiles") {
        complain(&format!("note: {words}"));
    }
    warn_about_spacing(&header);
    let bytes = if args.packed {
        std::fs::metadata(&args.output).map_or(header.file_bytes, |meta| meta.len())
    } else {
        header.file_bytes
    };
    let built = Built::of(&args.output, &header, args.record.is_none(), bytes, seconds);
    if let Some(note) = built.compact_note() {
        complain(&note);
    }
    if args.json { print_json(&built) } else { print(&built.text(&header)) }
}

/// The spacing decides slopes and speeds, so where it came from is printed if it was not stated.
fn warn_about_spacing(header: &Header) {
    match header.spacing_origin {
        SpacingOrigin::Dem | SpacingOrigin::User => {}
        SpacingOrigin::Degrees { .. } => complain(&format!(
            "note: the DEM is in degrees; its spacing of {} was {}; state another with --spacing",
            terrain::spacing(header),
            terrain::spacing_origin(header)
        )),
        SpacingOrigin::Assumed => complain(&format!(
            "warning: the DEM does not say how far apart its samples are; {} was assumed; state it with --spacing",
            terrain::spacing(header)
        )),
    }
}
