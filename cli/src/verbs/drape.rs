//! `terrasoar drape`: images in, the imagery of a terrain file out.

use super::guess::is_degrees;
use super::output::{complain, decimal, grouped, print};
use super::parse;
use super::progress::{Meter, short};
use super::siting::{reach, system_name};
use super::tiles::Tiles;
use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::time::Instant;
use terrasoar_import::places::{Crs, Frame};
use terrasoar_import::{PictureOptions, Stretch, open_image, open_images};
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::{DrapeOptions, Draped, Extent, PlaceOrigin, TileFormat, drape};
use terrasoar_layout::read::terrain::Terrain;

/// Drape an image over a terrain file.
///
/// Reads PNG, JPEG, JPEG XL, WebP, JPEG 2000 and GeoTIFF (progressive JPEG, JPEG XL, WebP and JPEG 2000 of one tile only as far as memory allows), grey, RGB, CMYK or palette, with or without
/// alpha, masks and "no data"; with --stretch GeoTIFF of any numbers and JPEG 2000 of signed ones or of more than 16 bits, and lossless JPEG XL of reals; and pyramids of map tiles. Pictures in another reference system, turned, mirrored or of larger texels than the finest of them are brought onto the terrain by bilinear interpolation. Appends a pyramid of
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
    extent: Option<Extents>,
    /// Where the image lies: west, south, east, north in units of the terrain's reference system
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true)]
    extent_crs: Option<Extents>,
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

/// Points on each side of an image whose places are looked at.
const EDGE: u32 = 32;
/// West, south, east, north.
type Extents = [f64; 4];
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
    super::overlays::tell_of_lost_in(&args.file, None);
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().context("cannot start the threads; give fewer with --threads")?;
    let start = Instant::now();
    let is_placed = args.extent.is_some() || args.extent_crs.is_some();
    let header = if is_placed { None } else { Some(Terrain::open_unmapped(&args.file)?.header().clone()) };
    if let Some(header) = &header {
        let looked: Vec<Result<()>> = args.images.iter().map(|path| meets(path, header)).collect();
        // Of a mosaic some may lie elsewhere.
        if looked.iter().all(Result::is_err) {
            looked.into_iter().collect::<Result<()>>()?;
        }
    }
    let draped = pool.install(|| -> Result<Draped> {
        let images = open_images(&args.images, header.as_ref(), &args.picture())?;
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

/// Refuses an image whose georeference lies wholly beside the terrain, in the image's own system; says if it reaches beyond. What cannot be opened or has no
/// place here is for those who drape it.
fn meets(path: &Path, header: &Header) -> Result<()> {
    let Ok(image) = open_image(path) else { return Ok(()) };
    let (info, [wide, high]) = (image.info(), image.info().texels.map(f64::from));
    let Some(map) = info.georeference.pixel_to_crs else { return Ok(()) };
    let Some(crs) = info.georeference.epsg.and_then(|code| Crs::named(&format!("EPSG:{code}")).ok()) else {
        return Ok(());
    };
    let Ok(frame) = Frame::of(header, &crs) else { return Ok(()) };
    let (mut own, mut placed) = (Sides::NONE, Sides::NONE);
    for i in 0..=EDGE {
        let share = f64::from(i) / f64::from(EDGE);
        let (across, down) = (share * wide - 0.5, share * high - 0.5);
        for [x, y] in [[across, -0.5], [across, high - 0.5], [-0.5, down], [wide - 0.5, down]] {
            let point = [map[0] + map[1] * x + map[2] * y, map[3] + map[4] * x + map[5] * y];
            own.take(point);
            let Some(place_m) = frame.place_m(point) else { return Ok(()) };
            placed.take(place_m);
        }
    }
    let [east_m, north_m] = header.grid.extent_m();
    let terrain = Sides([0.0, 0.0, east_m, north_m]);
    if !placed.meets(terrain) {
        let [x0, y0, x1, y1] = own.0.map(|side| decimal(side, if crs.is_geographic() { 7 } else { 3 }));
        bail!(
            "{}: the image lies from {x0},{y0} to {x1},{y1} in {}, and the terrain {}: they do not meet; name an image of this ground, or state with --extent where it lies",
            path.display(),
            crs.name(),
            reach(header, Some(&frame)).unwrap_or_else(|| "elsewhere".into())
        );
    }
    let slack_m = [0, 1].map(|axis| header.grid.spacing_m()[axis]);
    if placed.reaches_beyond(terrain, slack_m) {
        let [west, south, east, north] = placed.0.map(|side| decimal(side, 1));
        complain(&format!(
            "note: {}: the image lies from {west},{south} to {east},{north} metres and the terrain from 0,0 to {},{}; what lies outside is left out",
            path.display(),
            decimal(east_m, 1),
            decimal(north_m, 1)
        ));
    }
    Ok(())
}

/// Sides of imagery in metres.
pub(super) fn sides_m(origin_m: [f64; 2], texel_m: [f64; 2], texels: [u32; 2]) -> [f64; 4] {
    let far = |axis: usize| origin_m[axis] + texel_m[axis] * f64::from(texels[axis]);
    [origin_m[0], origin_m[1], far(0), far(1)]
}

/// Which share of the terrain's ground is under imagery, and from where to where that lies in the terrain's own coordinates, or in metres.
pub(super) fn covered(header: &Header, [west_m, south_m, east_m, north_m]: [f64; 4]) -> String {
    let [wide_m, high_m] = header.grid.extent_m();
    let within = |from: f64, to: f64, most: f64| (to.min(most) - from.max(0.0)).max(0.0) / most;
    let share = within(west_m, east_m, wide_m) * within(south_m, north_m, high_m);
    let frame = Frame::own(header);
    let corners = [[west_m, south_m], [east_m, north_m]];
    let own = frame
        .as_ref()
        .and_then(|frame| Some([frame.coordinates(corners[0])?, frame.coordinates(corners[1])?]));
    let digits = if is_degrees(frame.as_ref()) { 7 } else { 2 };
    let [[x0, y0], [x1, y1]] =
        own.unwrap_or(corners).map(|corner| corner.map(|value| decimal(value, digits)));
    let system = match (&frame, own) {
        (Some(frame), Some(_)) => system_name(frame),
        _ => "metres from the south-west sample".into(),
    };
    format!("{x0},{y0} to {x1},{y1} in {system}, {} % of the terrain", decimal(100.0 * share, 1))
}

/// West, south, east and north around points.
#[derive(Debug, Clone, Copy)]
struct Sides([f64; 4]);

impl Sides {
    const NONE: Self = Self([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]);

    fn take(&mut self, point: [f64; 2]) {
        let [west, south, east, north] = &mut self.0;
        (*west, *east) = (west.min(point[0]), east.max(point[0]));
        (*south, *north) = (south.min(point[1]), north.max(point[1]));
    }

    fn meets(self, other: Self) -> bool {
        (0..2).all(|axis| self.0[axis] < other.0[axis + 2] && other.0[axis] < self.0[axis + 2])
    }

    fn reaches_beyond(self, other: Self, slack: [f64; 2]) -> bool {
        (0..2).any(|axis| {
            self.0[axis] < other.0[axis] - slack[axis] || self.0[axis + 2] > other.0[axis + 2] + slack[axis]
        })
    }
}

fn summary(file: &Path, draped: &Draped, seconds: f64) -> String {
    let shape = draped.shape;
    let [wide, high] = shape.texels.map(u64::from);
    let raw = (wide * high * 3) as f64;
    let bytes = draped.header.imagery.map_or(0, |place| place.bytes);
    format!(
        "{}: {} x {} texels of {} x {} m in {seconds:.1} s ({}B of RGB/s)\n\
         covers {}\n\
         {} tiles of {} levels as {}, {} bytes ({:.4} of raw RGB)",
        file.display(),
        grouped(wide),
        grouped(high),
        decimal(shape.texel_m[0], 4),
        decimal(shape.texel_m[1], 4),
        short(raw / seconds.max(1e-9)),
        covered(&draped.header, sides_m(shape.origin_m, shape.texel_m, shape.texels)),
        grouped(draped.stored_tiles),
        shape.levels,
        shape.format.name(),
        grouped(bytes),
        bytes as f64 / raw
    )
}
