//! `terrasoar drape`: images in, the imagery of a terrain file out.

use super::output::{complain, decimal, grouped, print};
use super::parse;
use super::progress::{Meter, short};
use super::tiles::Tiles;
use anyhow::{Context, Result};
use clap::ValueEnum;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::time::Instant;
use terrasoar_import::{PictureOptions, Stretch, open_images};
use terrasoar_layout::imagery::{DrapeOptions, Draped, Extent, PlaceOrigin, TileFormat, drape};
use terrasoar_layout::read::terrain::Terrain;

/// Drape an image over a terrain file.
///
/// Reads PNG, JPEG, WebP, JPEG 2000 and GeoTIFF (progressive JPEG, WebP and JPEG 2000 of one tile only as far as memory allows), grey, RGB, CMYK or palette, with or without
/// alpha, masks and "no data"; with --stretch GeoTIFF of any numbers; and pyramids of map tiles. Pictures in another reference system, turned, mirrored or of other texels than the first are brought onto the terrain by bilinear interpolation. Appends a pyramid of
/// compressed tiles to the file; until it is complete the file reads as before, whatever happens, and programs that have it open are not
/// disturbed. Draping again puts other imagery in the place of the first, whose space is not used again.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar drape alps.iqt --image alps-photo.tif
  terrasoar drape alps.iqt --image west.tif east.tif
  terrasoar drape alps.iqt --image world.mbtiles
  terrasoar drape alps.iqt --image scene.tif --bands 4,3,2 --stretch 2,98
  terrasoar drape alps.iqt --image photo.png --extent 0,0,20480,15360
  terrasoar drape alps.iqt --image photo.jpg --extent-crs 600000,180000,620480,195360

Where an image lies is taken from --extent, else from its georeference (GeoTIFF tags, or a world file, .prj or .aux.xml beside it) if the
terrain has one too; else it is laid over the whole terrain, upright as its EXIF tag says. Later images of a mosaic lie above earlier ones.")]
pub(super) struct Args {
    /// Terrain file (.iqt)
    file: PathBuf,
    /// Image: one, or several that make a mosaic; or pyramids of map tiles: a folder, MBTiles, PMTiles
    #[arg(long = "image", required = true, num_args = 1.., value_name = "IMG")]
    images: Vec<PathBuf>,
    /// Where the image lies: west, south, east, north in metres from the terrain's south-west sample
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true, conflicts_with = "extent_crs")]
    extent: Option<Sides>,
    /// Where the image lies: west, south, east, north in units of the terrain's reference system
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true)]
    extent_crs: Option<Sides>,
    /// Which numbers are black and white: 2,98 is the darkest and the brightest 2 percent of each band, of all images together; 200..3000 is these numbers
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::stretch, allow_hyphen_values = true)]
    stretch: Option<Stretch>,
    /// Bands for red, green and blue, or one for grey, counted from 1
    #[arg(long, value_name = "R,G,B", value_parser = parse::bands)]
    bands: Option<Bands>,
    /// How texels are stored
    #[arg(long, value_name = "FORMAT", default_value = "bc1")]
    format: FormatWord,
    /// Memory to use at most, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 512, value_parser = clap::value_parser!(u64).range(48..=1 << 24))]
    memory: u64,
    /// Threads to use; all cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    tiles: Tiles,
}

/// West, south, east, north.
type Sides = [f64; 4];
/// Numbers of bands; a name of its own, for a list would be a flag of several values.
type Bands = Vec<NonZero<u32>>;

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FormatWord {
    /// Half a byte a texel, alpha 0 or 1
    Bc1,
    /// A byte a texel, alpha in steps; finer, slower
    Bc7,
    /// Four bytes a texel, nothing lost
    Raw,
}

impl Args {
    fn picture(&self) -> PictureOptions {
        PictureOptions {
            bands: self.bands.clone().unwrap_or_default(),
            stretch: self.stretch,
            memory_mib: Some(self.memory),
            tiles: self.tiles.options(),
        }
    }

    fn options(&self) -> DrapeOptions {
        DrapeOptions::default()
            .format(match self.format {
                FormatWord::Bc1 => TileFormat::Bc1,
                FormatWord::Bc7 => TileFormat::Bc7,
                FormatWord::Raw => TileFormat::Rgba8,
            })
            .extent(self.extent.map(Extent::Metres).or(self.extent_crs.map(Extent::Crs)))
            .memory_mib(self.memory)
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    super::overlays::tell_of_growing(&args.file);
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().context("cannot start the threads; give fewer with --threads")?;
    let start = Instant::now();
    let draped = pool.install(|| -> Result<Draped> {
        let is_placed = args.extent.is_some() || args.extent_crs.is_some();
        let terrain = if is_placed { None } else { Some(Terrain::open(&args.file)?) };
        let header = terrain.as_ref().map(Terrain::header);
        let images = open_images(&args.images, header, &args.picture())?;
        for image in &images {
            for note in &image.info().notes {
                complain(&format!("note: {}: {note}", image.path().display()));
            }
        }
        Ok(drape(&args.file, &images, &args.options(), &Meter::new("texels"))?)
    })?;
    let seconds = start.elapsed().as_secs_f64();
    if draped.place == PlaceOrigin::Assumed {
        complain(
            "note: neither --extent nor a georeference that the terrain shares says where the image lies; it was laid over the \
             whole terrain",
        );
    }
    print(&summary(&args.file, &draped, seconds))
}

fn summary(file: &Path, draped: &Draped, seconds: f64) -> String {
    let shape = draped.shape;
    let [wide, high] = shape.texels.map(u64::from);
    let raw = (wide * high * 3) as f64;
    let bytes = draped.header.imagery.map_or(0, |place| place.bytes);
    format!(
        "{}: {} x {} texels of {} x {} m in {seconds:.1} s ({}B of RGB/s)\n\
         {} tiles of {} levels as {}, {} bytes ({:.4} of raw RGB)",
        file.display(),
        grouped(wide),
        grouped(high),
        decimal(shape.texel_m[0], 4),
        decimal(shape.texel_m[1], 4),
        short(raw / seconds.max(1e-9)),
        grouped(draped.stored_tiles),
        shape.levels,
        shape.format.name(),
        grouped(bytes),
        bytes as f64 / raw
    )
}
