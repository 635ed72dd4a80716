//! Small sound files to begin with: all kinds of records, padding and voids, several directory leaves, a directory with nodes, edits undone and not, pictures draped and painted, an overlay.

use super::sealed::Sealed;
use crate::build::{BuildOptions, build};
use crate::dem::{MemoryDem, SampleType};
use crate::edit::{Area, Edit, EditSession};
use crate::error::LayoutError;
use crate::file::disk::SystemDisk;
use crate::grid::record::RecordKind;
use crate::imagery::{DrapeOptions, Extent, Fill, MemoryImage, Paint, Region, TileFormat, drape};
use crate::packing::pack;
use crate::progress::Silent;
use std::path::Path;
use std::sync::OnceLock;

/// A sound file.
#[derive(Debug, Clone)]
pub struct Seed {
    /// Its name.
    pub name: &'static str,
    /// It.
    pub files: Sealed,
}

/// All seeds, made once a process in a temporary folder.
///
/// # Panics
/// If the folder cannot be written to.
pub fn seeds() -> Vec<Seed> {
    static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();
    SEEDS.get_or_init(|| make().expect("the temporary folder can be written to")).clone()
}

/// Packed ones: as built, with imagery, and edited, painted and draped since they were packed. Made once a process.
///
/// # Panics
/// If the temporary folder cannot be written to.
pub fn packed_seeds() -> Vec<Seed> {
    static SEEDS: OnceLock<Vec<Seed>> = OnceLock::new();
    SEEDS.get_or_init(|| make_packed().expect("the temporary folder can be written to")).clone()
}

fn make_packed() -> Result<Vec<Seed>, LayoutError> {
    let folder =
        tempfile::tempdir().map_err(|e| LayoutError::io(Path::new("."), "cannot make a folder", e))?;
    let [plain, path] = ["plain.iqt", "t.iqt"].map(|name| folder.path().join(name));
    let mut seeds = Vec::new();
    let names = [
        "packed",
        "packed islands",
        "packed edits",
        "packed, fine",
        "packed, exact 8",
        "packed, exact 16",
        "packed nodes",
        "edited",
        "draped and painted",
    ];
    for name in names {
        match name {
            "packed islands" => islands(&plain)?,
            "packed nodes" => shore(&plain)?,
            "packed, fine" => terrain(&plain, RecordKind::Fine)?,
            "packed, exact 8" => terrain(&plain, RecordKind::Exact8)?,
            "packed, exact 16" => terrain(&plain, RecordKind::Exact16)?,
            _ => terrain(&plain, RecordKind::Compact)?,
        }
        if name == "packed edits" {
            edit(EditSession::open(&plain)?, false)?;
        }
        pack(&SystemDisk, &plain, &path, &Silent)?;
        if name == "draped and painted" {
            picture(&path, TileFormat::Bc1)?;
        }
        if !name.starts_with("packed") {
            edit(EditSession::open(&path)?, name != "edited")?;
        }
        let terrain = std::fs::read(&path).map_err(|e| LayoutError::io(&path, "cannot read", e))?;
        seeds.push(Seed { name, files: Sealed { terrain, overlay: None } });
    }
    Ok(seeds)
}

fn make() -> Result<Vec<Seed>, LayoutError> {
    let folder =
        tempfile::tempdir().map_err(|e| LayoutError::io(Path::new("."), "cannot make a folder", e))?;
    let at = |name: &str| folder.path().join(name);
    let mut seeds = Vec::new();
    let mut keep = |name, overlay: Option<&Path>| {
        let read = |path: &Path| std::fs::read(path).map_err(|e| LayoutError::io(path, "cannot read", e));
        let overlay = overlay.map(read).transpose()?;
        seeds.push(Seed { name, files: Sealed { terrain: read(&at("t.iqt"))?, overlay } });
        Ok::<(), LayoutError>(())
    };
    let path = at("t.iqt");
    for (name, kind) in [
        ("compact", RecordKind::Compact),
        ("fine", RecordKind::Fine),
        ("exact 8", RecordKind::Exact8),
        ("exact 16", RecordKind::Exact16),
    ] {
        terrain(&path, kind)?;
        keep(name, None)?;
    }
    for (name, kind) in [("edited", RecordKind::Compact), ("edited, exact", RecordKind::Exact8)] {
        terrain(&path, kind)?;
        edit(EditSession::open(&path)?, false)?;
        keep(name, None)?;
    }
    for (name, format) in [("draped", TileFormat::Bc1), ("draped, raw", TileFormat::Rgba8)] {
        terrain(&path, RecordKind::Compact)?;
        picture(&path, format)?;
        keep(name, None)?;
    }
    edit(EditSession::open(&path)?, true)?;
    keep("painted", None)?;
    let overlay = at("o.iqo");
    edit(EditSession::open_overlay(&path, &overlay)?, true)?;
    keep("overlay", Some(&overlay))?;
    islands(&path)?;
    keep("islands", None)?;
    shore(&path)?;
    edit(EditSession::open(&path)?, false)?;
    keep("nodes", None)?;
    Ok(seeds)
}

/// 50 x 37 samples with voids in the middle and in a corner.
fn terrain(path: &Path, kind: RecordKind) -> Result<(), LayoutError> {
    let sample_type = if kind == RecordKind::Exact16 { SampleType::F64 } else { SampleType::I16 };
    let dem = MemoryDem::from_fn([50, 37], sample_type, |x, y| {
        if x.abs_diff(20) + y.abs_diff(11) < 5 || x + y > 83 {
            return f64::NAN;
        }
        let height = 400.0 + 90.0 * (f64::from(x) * 0.3).sin() + f64::from((x * 31 + y * 57) % 23);
        if kind == RecordKind::Exact16 { height / 3.0 } else { height.round() }
    });
    let options =
        BuildOptions { record: Some(kind), spacing_m: Some([20.0, 25.0]), ..BuildOptions::default() };
    build(&dem, path, &options, &Silent).map(|_| ())
}

/// Two islands far apart in a sea of voids: more than one directory leaf, few pages.
fn islands(path: &Path) -> Result<(), LayoutError> {
    let dem = MemoryDem::from_fn([520, 600], SampleType::I16, |x, y| {
        let is_land = (x < 20 && y < 20) || (x > 500 && y > 580);
        if is_land { f64::from(x * 7 % 13 + y * 5 % 11) } else { f64::NAN }
    });
    build(&dem, path, &BuildOptions::default(), &Silent).map(|_| ())
}

/// A shore in the west of a square of 2^18 steps, whose directory has nodes.
fn shore(path: &Path) -> Result<(), LayoutError> {
    let dem = MemoryDem::from_fn([(1 << 17) + 9, 12], SampleType::I16, |x, y| {
        if x < 20 { f64::from(400 + x * 7 % 13 + y * 5 % 11) } else { f64::NAN }
    });
    let options = BuildOptions { spacing_m: Some([20.0, 25.0]), ..BuildOptions::default() };
    build(&dem, path, &options, &Silent).map(|_| ())
}

fn picture(path: &Path, format: TileFormat) -> Result<(), LayoutError> {
    let image = MemoryImage::from_fn([520, 12], |x, y| [x as u8, (y * 20) as u8, 90, 255]);
    let extent = Some(Extent::Metres([0.0, 0.0, 980.0, 900.0]));
    let options = DrapeOptions { format, extent, ..DrapeOptions::default() };
    drape(path, &[Box::new(image)], &options, &Silent).map(|_| ())
}

/// Three batches, the last one undone.
fn edit(mut session: EditSession, paints: bool) -> Result<(), LayoutError> {
    let places = [[200.0, 300.0], [700.0, 500.0], [500.0, 800.0]];
    for (centre_m, height_m) in places.into_iter().zip([410.0, 380.0, 420.0]) {
        session.apply(&[Edit::Set { area: Area::Disc { centre_m, radius_m: 60.0 }, height_m }])?;
        if paints {
            let region = Region::Disc { centre_m, radius_m: 100.0 };
            session.paint(&[Paint::Fill(Fill {
                region,
                colour: [200, 40, 10],
                opacity: 0.8,
                falloff_m: 10.0,
            })])?;
        }
        session.commit("a batch")?;
    }
    session.undo().map(|_| ())
}
