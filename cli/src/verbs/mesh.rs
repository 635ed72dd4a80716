//! `terrasoar mesh`: one frame's triangles as a file that other programs read.

use super::mesh_file::{self, Format};
use super::output::{grouped, print};
use super::outputs::{Force, Kind};
use super::parse;
use super::replay::{QualityArgs, batches_of};
use super::siting;
use super::terrain::TerrainArgs;
use anyhow::Result;
use std::path::{Path, PathBuf};
use terrasoar::flight::Flight;
use terrasoar::flyover::{EngineKind, frame_mesh};

/// Write the triangles of one frame of a flight as PLY or OBJ.
///
/// Coordinates are metres east, north and up of the south-west sample; comments in the file say in which reference system that lies, and how to get from one to the other. The engine flies all frames before it.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar mesh alps.iqt --flight low.flight --frame 0 -o frame.ply
  terrasoar mesh alps.iqt --flight low.flight --frame 99 --engine soar --tolerance-px 4 -o frame.obj")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Frame, from 0
    #[arg(long, value_name = "N")]
    frame: usize,
    /// Engine
    #[arg(long, value_name = "ENGINE", default_value = EngineKind::default().name(), value_parser = parse::engine())]
    engine: EngineKind,
    #[command(flatten)]
    quality: QualityArgs,
    /// Edit the ground on the way, in memory only, by this script
    #[arg(long, value_name = "E.edits")]
    edits: Option<PathBuf>,
    /// File to write: binary PLY or OBJ by its extension
    #[arg(short, long, value_name = "OUT.(ply|obj)", value_parser = parse::with_extension(&["ply", "obj"]))]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Write PLY as text
    #[arg(long)]
    ascii: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let inputs: Vec<&Path> =
        [Some(&args.flight), args.edits.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    args.force.file(&args.output, Kind::Mesh, &args.terrain.inputs(&inputs))?;
    let is_obj = args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let format = match (is_obj, args.ascii) {
        (true, _) => Format::Obj,
        (false, true) => Format::PlyText,
        (false, false) => Format::PlyBinary,
    };
    let terrain = std::sync::Arc::new(args.terrain.open()?);
    let flight = Flight::read(&args.flight)?;
    args.quality.look_at(&terrain, &flight, &args.flight)?;
    let batches = match &args.edits {
        Some(script) => batches_of(script, &flight.frames, &terrain)?,
        None => Vec::new(),
    };
    let mesh =
        frame_mesh(&terrain, &flight.frames, args.frame, args.quality.quality(), args.engine, &batches)?;
    mesh_file::write(&args.output, &mesh, format, &siting::notes(terrain.header()))?;
    print(&format!(
        "{}: {} triangles, {} vertices",
        args.output.display(),
        grouped(mesh.triangles.len() as u64),
        grouped(mesh.positions.len() as u64)
    ))
}
