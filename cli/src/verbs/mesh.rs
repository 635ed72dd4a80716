//! `terrasoar mesh`: triangles as a file that other programs read, of one frame of a flight, or of the ground without an eye.

use super::area::AreaArgs;
use super::output::{complain, grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::pages::{CacheArgs, ReadForIt};
use super::replay::{QualityArgs, batches_of};
use super::siting;
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse};
use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use serde::Serialize;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use terrasoar::flight::Flight;
use terrasoar::flyover::{EngineKind, frame_mesh_with_reads};
use terrasoar::mesh::IndexedMesh;
use terrasoar::simplify::{SimplifyOptions, simplify_with_reads};
use terrasoar_lab::mesh_file::{Format, MeshFile, Placing, Texture};
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::read::store::PagesRead;
use terrasoar_layout::read::terrain::Terrain;

/// Write a terrain as triangles: PLY, OBJ, STL or GLB.
///
/// With --max-error M every sample lies within M metres of the mesh, measured vertically, of the whole terrain or of a window; flat ground takes few triangles. With --flight it is
/// what an engine draws in one frame, after it has flown all frames before it. Voids are left out.
///
/// Coordinates are metres east, north and up of the south-west sample, or with --coordinates dem those of the elevation model, with heights in the same unit (metres where coordinates are degrees). PLY and
/// OBJ hold double precision. STL and GLB hold single precision, in which coordinates of some millions are good to half a metre only: where they are large the file holds them less an origin,
/// which is printed, and which GLB adds again. GLB has the terrain's picture on it, if there is one; its y points up and its z south, as in all of glTF.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar mesh alps.iqt --max-error 2 -o alps.glb
  terrasoar mesh alps.iqt --max-error 0.5 --window 395000,5092000,396000,5093000 --crs dem --coordinates dem -o village.ply
  terrasoar mesh alps.iqt --overlay dam.iqo --max-error 1 --window 0,0,2000,2000 -o print.stl
  terrasoar mesh alps.iqt --flight low.flight --frame 0 -o frame.ply
  terrasoar mesh alps.iqt --flight low.flight --frame 99 --engine soar --tolerance-px 4 -o frame.obj

Fields of --json: output, format, triangles, vertices, texture_px (null without a picture), origin (what coordinates in single precision lack), cache_mib (memory for pages that were read as the mesh needed them; null if records were taken
where they lie, and so are the rest), pages_read (each as often as it was), tiles_unpacked, tile_bytes_read (null too where the terrain is not packed), read_ms (waited for pages, over all threads), unpack_ms (the part of it for unpacking).")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Largest distance of any sample from the mesh, in metres
    #[arg(long, value_name = "M", value_parser = parse::not_negative, required_unless_present = "flight", conflicts_with_all = OF_A_FLIGHT)]
    max_error: Option<f64>,
    #[command(flatten)]
    area: AreaArgs,
    /// Most triangles, beyond which nothing is made; a million take some 50 MiB of memory
    #[arg(long, value_name = "N", default_value_t = 20_000_000, value_parser = clap::value_parser!(u64).range(1..=1 << 31), conflicts_with = "flight")]
    max_triangles: u64,
    /// Flight file
    #[arg(long, value_name = "F", requires = "frame", conflicts_with_all = ["window", "crs"])]
    flight: Option<PathBuf>,
    /// Frame, from 0
    #[arg(long, value_name = "N", requires = "flight")]
    frame: Option<usize>,
    /// Engine
    #[arg(long, value_name = "ENGINE", default_value = EngineKind::default().name(), value_parser = parse::engine())]
    engine: EngineKind,
    #[command(flatten)]
    quality: QualityArgs,
    /// Edit the ground on the way, in memory only, by this script
    #[arg(long, value_name = "E.edits", requires = "flight")]
    edits: Option<PathBuf>,
    /// File to write: PLY, OBJ, STL or GLB by its extension, or what --format says
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Kind of file, whatever its name
    #[arg(long, value_name = "FORMAT")]
    format: Option<FormatWord>,
    #[command(flatten)]
    force: Force,
    /// Write PLY as text
    #[arg(long)]
    ascii: bool,
    /// What coordinates are
    #[arg(long, value_name = "SYSTEM", default_value = "local")]
    coordinates: CoordinatesWord,
    /// Largest side of GLB's picture in texels, 4096 without it; 0 for no picture
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(0..=16_384))]
    texture: Option<u32>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    output: String,
    format: &'static str,
    triangles: u64,
    vertices: u64,
    /// Null without a picture.
    texture_px: Option<[u32; 2]>,
    /// What coordinates in single precision lack.
    origin: [f64; 2],
    #[serde(flatten)]
    read: ReadForIt,
}

/// What means something with `--flight` alone.
const OF_A_FLIGHT: [&str; 9] =
    ["flight", "frame", "edits", "engine", "tolerance_px", "metric", "viewport", "exaggeration", "culling"];

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatWord {
    /// Polygon file, binary unless --ascii
    Ply,
    /// Wavefront OBJ
    Obj,
    /// For printers
    Stl,
    /// glTF in one file, with the picture
    Glb,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CoordinatesWord {
    /// Metres from the terrain's south-west sample
    Local,
    /// Those of the elevation model
    Dem,
}

impl Args {
    fn format(&self) -> Result<Format> {
        let named = self
            .output
            .extension()
            .and_then(|extension| FormatWord::from_str(extension.to_str()?, true).ok());
        let word = self.format.or(named).ok_or_else(|| {
            WrongUsage(format!(
                "{}: the name of a mesh ends in .ply, .obj, .stl or .glb, or --format says which it is",
                self.output.display()
            ))
        })?;
        if self.ascii && word != FormatWord::Ply {
            return Err(WrongUsage("--ascii is for PLY; leave it away, or write PLY".into()).into());
        }
        if self.texture.is_some() && word != FormatWord::Glb {
            return Err(WrongUsage(
                "--texture is for GLB, which alone has a picture; leave it away, or write GLB".into(),
            )
            .into());
        }
        Ok(match (word, self.ascii) {
            (FormatWord::Ply, false) => Format::PlyBinary,
            (FormatWord::Ply, true) => Format::PlyText,
            (FormatWord::Obj, _) => Format::Obj,
            (FormatWord::Stl, _) => Format::Stl,
            (FormatWord::Glb, _) => Format::Glb,
        })
    }

    fn placing(&self, terrain: &Terrain, format: Format) -> Result<Placing> {
        if self.coordinates == CoordinatesWord::Local {
            return Ok(Placing::LOCAL);
        }
        let shown = self.terrain.file.display();
        let Some((placing, is_angle)) = siting::placing(terrain.header()) else {
            bail!(
                "{shown}: the terrain does not know where on the ground it lies, for its elevation model did not say; leave --coordinates away"
            );
        };
        if is_angle && format.is_single() {
            bail!(
                "{shown}: its coordinates are degrees, which make no shape beside heights in metres; write local coordinates, or PLY or OBJ"
            );
        }
        Ok(placing)
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let format = args.format()?;
    let others: Vec<&Path> =
        [&args.flight, &args.edits].into_iter().flatten().map(PathBuf::as_path).collect();
    args.force.file(&args.output, Kind::Mesh, &args.terrain.inputs(&others))?;
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let terrain = std::sync::Arc::new(terrain);
    let placing = args.placing(&terrain, format)?;
    let (mesh, part_m, read) = match (&args.flight, args.max_error) {
        (None, Some(max_error_m)) => simplified(args, &terrain, max_error_m, cache_bytes)?,
        (Some(flight), _) => {
            let path = flight;
            let flight = Flight::read(path)?;
            args.quality.look_at(&terrain, &flight, path)?;
            let batches = match &args.edits {
                Some(script) => batches_of(script, &flight.frames, &terrain)?,
                None => Vec::new(),
            };
            let quality = args.quality.quality().cache_bytes(cache_bytes);
            let frame = args.frame.unwrap_or(0);
            let (mesh, read) =
                frame_mesh_with_reads(&terrain, &flight.frames, frame, quality, args.engine, &batches)?;
            let [east, north] = terrain.grid().extent_m();
            (mesh, [0.0, 0.0, east, north], read)
        }
        (None, None) => return Err(WrongUsage("give --max-error, or --flight and --frame".into()).into()),
    };
    let texture = match format {
        Format::Glb => match args.texture.unwrap_or(4096) {
            0 => None,
            side => Texture::of(&terrain, part_m, side)?,
        },
        _ => None,
    };
    let notes = siting::mesh_notes(terrain.header(), args.coordinates == CoordinatesWord::Dem);
    let file = MeshFile::new(&mesh).placing(placing).notes(&notes).texture(texture.as_ref());
    write(&args.output, &file, format)?;
    let [x, y] = file.origin(format);
    if [x, y] != [0.0; 2] {
        let again = if format == Format::Glb { "; its node adds it again" } else { "" };
        complain(&format!(
            "note: coordinates are large for single precision; the file holds them less {x},{y}{again}"
        ));
    }
    let texture_px = texture.map(|texture| texture.size);
    let [triangles, vertices] = [mesh.triangles.len() as u64, mesh.positions.len() as u64];
    let read = ReadForIt::of(read, cache_bytes);
    if args.json {
        return print_json(&Answer {
            output: args.output.display().to_string(),
            format: word_of(format),
            triangles,
            vertices,
            texture_px,
            origin: [x, y],
            read,
        });
    }
    let picture = texture_px.map(|[wide, high]| format!(", a picture of {wide} x {high} texels"));
    let read = read.words().map(|words| format!("\n{words}"));
    print(&format!(
        "{}: {} triangles, {} vertices{}{}",
        args.output.display(),
        grouped(triangles),
        grouped(vertices),
        picture.unwrap_or_default(),
        read.unwrap_or_default()
    ))
}

/// The word that names a kind of file.
const fn word_of(format: Format) -> &'static str {
    match format {
        Format::PlyBinary | Format::PlyText => "ply",
        Format::Obj => "obj",
        Format::Stl => "stl",
        Format::Glb => "glb",
    }
}

/// A mesh, the sides of its part in metres, and what was read for it.
type Made = (IndexedMesh, [f64; 4], Option<PagesRead>);

/// The mesh of a part within the error.
fn simplified(args: &Args, terrain: &Terrain, max_error_m: f64, cache_bytes: Option<u64>) -> Result<Made> {
    let window = args.area.window(terrain, &args.terrain.file, 1)?;
    let options =
        SimplifyOptions::default().max_error_m(max_error_m).window(window).max_triangles(args.max_triangles);
    let options = options.cache_bytes(cache_bytes);
    let (mesh, read) = simplify_with_reads(terrain, &options)?;
    if mesh.triangles.is_empty() {
        bail!(
            "{}: no three samples beside each other have heights there, so there are no triangles",
            args.terrain.file.display()
        );
    }
    let ([x0, y0], [x1, y1]) = (window.from, window.last());
    let [east, north] = terrain.grid().spacing_m();
    let sides_m = [f64::from(x0) * east, f64::from(y0) * north, f64::from(x1) * east, f64::from(y1) * north];
    Ok((mesh, sides_m, read))
}

/// Writes the file, which appears when it is complete.
fn write(path: &Path, mesh: &MeshFile<'_>, format: Format) -> Result<()> {
    let file = AtomicFile::create(path)?;
    let mut out = BufWriter::with_capacity(1 << 20, file.file());
    mesh.write(format, &mut out)
        .and_then(|()| out.flush())
        .with_context(|| format!("{}: cannot write the mesh; check the free space", path.display()))?;
    drop(out);
    Ok(file.publish()?)
}
