//! `terrasoar info`: what a terrain file says about itself.

use super::drape::{covered, sides_m};
use super::output::{decimal, grouped, print, print_json, table};
use super::siting::{self, Siting};
use super::terrain::{self, TerrainArgs};
use anyhow::Result;
use serde::Serialize;
use terrasoar_layout::edit::history;
use terrasoar_layout::imagery::Imagery;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::unused::unused_bytes;

/// Show what a terrain file says about itself.
///
/// Reads headers and directories only, so it takes no time however large the file.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar info alps.iqt
  terrasoar info alps.iqt --json | jq .spacing_m

Bounds are least x and y and greatest x and y of the samples' own places (not of pixels around them), in the elevation model's coordinates; the row below them says how to get from
samples to coordinates. In --json, sample_to_crs are the six numbers m of it: a sample so many columns east and rows north of the south-west one, both from 0, lies at
x = m0 + m1 column + m2 row, y = m3 + m4 column + m5 row. bounds, bounds_wgs84, sample_to_crs and height_step_m are null where there are none, and unpacked_bytes and appended_bytes
(what edits, their history and imagery have added since it was packed) where the terrain is not packed. unused_bytes are bytes that nothing
leads to; history_bytes those that undo and redo need, or that edits made after an undo left behind.")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Info {
    path: String,
    /// Format of the DEM.
    source: String,
    samples: [u32; 2],
    k: u32,
    spacing_m: [f64; 2],
    spacing_origin: String,
    extent_m: [f64; 2],
    height_range_m: [f64; 2],
    /// Null where heights are kept as the data has them, in no steps.
    height_step_m: Option<f64>,
    heights_rounded: bool,
    nodata_samples: u64,
    crs: Option<String>,
    epsg: Option<u32>,
    /// The system in full: WKT or a PROJ string.
    crs_wkt: Option<String>,
    horizontal_unit: Option<String>,
    /// What heights are measured from.
    vertical_crs: Option<String>,
    vertical_epsg: Option<u32>,
    /// Unit in which the DEM gives heights; those here are metres.
    vertical_unit: Option<String>,
    /// What was found where.
    origins: Vec<[String; 2]>,
    warnings: Vec<String>,
    /// Samples east and north of the south-west one to coordinates: x = m0 + m1 x + m2 y, y = m3 + m4 x + m5 y.
    sample_to_crs: Option<[f64; 6]>,
    /// Where it lies.
    #[serde(flatten)]
    siting: Siting,
    record: &'static str,
    record_bytes: usize,
    error: &'static str,
    /// Record pages stored; pages of nothing but padding and void are left out.
    pages: u64,
    logical_pages: u64,
    generation: u32,
    /// Of the packed file, where the terrain is packed.
    file_bytes: u64,
    /// Of the terrain file that it was made of, where the terrain is packed.
    unpacked_bytes: Option<u64>,
    /// Appended to the packed file since it was packed, where the terrain is packed.
    appended_bytes: Option<u64>,
    bytes_per_sample: f64,
    /// The file with the edits, if they lie apart.
    overlay: Option<String>,
    /// Batches of edits that can be undone or redone.
    commits: u64,
    /// The terrain is in the state after this one; 0: as built.
    commit: u32,
    /// Bytes that nothing leads to: what other imagery replaced. 0 where the file has a history, whose bytes these may be.
    unused_bytes: u64,
    /// Bytes that the terrain as it is does not use and that its history keeps: undone edits, and what edits replaced.
    history_bytes: u64,
    imagery: Option<Pictures>,
}

/// What the imagery says about itself.
#[derive(Debug, Serialize)]
struct Pictures {
    /// Format of the image.
    source: String,
    format: &'static str,
    texels: [u32; 2],
    texel_m: [f64; 2],
    /// South-west corner, in metres from the terrain's south-west sample.
    origin_m: [f64; 2],
    levels: u32,
    /// Tiles stored; transparent ones are left out.
    tiles: u64,
    logical_tiles: u64,
    bytes: u64,
    /// Bytes over those of the texels of level 0 as raw RGB.
    raw_ratio: f64,
    /// Where it lies, in words.
    #[serde(skip)]
    covers: String,
}

impl Pictures {
    fn of(terrain: &Terrain) -> Result<Option<Self>> {
        let Some(imagery) = Imagery::open(terrain)? else { return Ok(None) };
        let shape = imagery.shape();
        let bytes = terrain.header().imagery.map_or(0, |place| place.bytes);
        let [wide, high] = shape.texels.map(f64::from);
        Ok(Some(Self {
            source: imagery.source().to_owned(),
            format: shape.format.name(),
            texels: shape.texels,
            texel_m: shape.texel_m,
            origin_m: shape.origin_m,
            levels: shape.levels,
            tiles: imagery.stored_tiles(),
            logical_tiles: shape.tiles(),
            bytes,
            raw_ratio: bytes as f64 / (3.0 * wide * high),
            covers: covered(terrain.header(), sides_m(shape.origin_m, shape.texel_m, shape.texels)),
        }))
    }
}

impl Info {
    fn of(terrain: &Terrain, args: &TerrainArgs) -> Result<Self> {
        let header = terrain.header();
        let packed_bytes = terrain.source().packed_bytes();
        let commits = history(terrain)?;
        let beside = unused_bytes(terrain)?;
        // In a packed file they take less than the pages that they are.
        let beside = terrain.appended_bytes().map_or(beside, |appended| beside.min(appended));
        let [unused_bytes, history_bytes] = if commits.is_empty() { [beside, 0] } else { [0, beside] };
        Ok(Self {
            path: args.file.display().to_string(),
            source: header.source.clone(),
            samples: header.grid.samples(),
            k: header.grid.k(),
            spacing_m: header.grid.spacing_m(),
            spacing_origin: terrain::spacing_origin(header),
            extent_m: header.grid.extent_m(),
            height_range_m: header.height_range_m,
            height_step_m: header.record_kind.has_height_codes().then_some(header.scale.height_step_m),
            heights_rounded: header.heights_rounded,
            nodata_samples: header.nodata_samples,
            crs: terrain::crs(header),
            epsg: header.epsg,
            crs_wkt: siting::crs_text(header),
            horizontal_unit: terrain::horizontal_unit(header),
            vertical_crs: Some(header.about.vertical_name.clone()).filter(|name| !name.is_empty()),
            vertical_epsg: header.about.vertical_epsg,
            vertical_unit: header.about.vertical_unit.as_ref().map(terrain::unit),
            origins: header.about.origins.iter().map(|(what, words)| [what.clone(), words.clone()]).collect(),
            warnings: header.about.warnings.clone(),
            sample_to_crs: header.sample_to_crs,
            siting: Siting::of(header),
            record: header.record_kind.name(),
            record_bytes: header.record_kind.bytes(),
            error: header.error_kind.name(),
            pages: header.stored_pages,
            logical_pages: header.record_pages(),
            generation: header.generation,
            file_bytes: packed_bytes.unwrap_or(header.file_bytes),
            unpacked_bytes: packed_bytes.map(|_| header.file_bytes),
            appended_bytes: terrain.appended_bytes(),
            bytes_per_sample: terrain.bytes_per_sample(),
            overlay: args.overlay.as_ref().map(|overlay| overlay.display().to_string()),
            commits: commits.len() as u64,
            commit: commits.iter().find(|commit| commit.is_current).map_or(0, |commit| commit.sequence),
            unused_bytes,
            history_bytes,
            imagery: Pictures::of(terrain)?,
        })
    }

    fn text(&self) -> String {
        let pair = |[a, b]: [f64; 2], digits| format!("{} x {}", decimal(a, digits), decimal(b, digits));
        let precision = if self.record_bytes > 8 { "double" } else { "single" };
        let rounded = if self.heights_rounded { ", heights rounded to it" } else { "" };
        let mut rows = vec![
            ("file", self.path.clone()),
            ("made from", self.source.clone()),
            ("samples", format!("{} x {}", grouped(self.samples[0].into()), grouped(self.samples[1].into()))),
            ("k", format!("{} (a square of 2^{} steps)", self.k, self.k)),
            ("spacing", format!("{} m, {}", pair(self.spacing_m, 4), self.spacing_origin)),
            ("extent", format!("{} m", pair(self.extent_m, 1))),
            (
                "heights",
                format!("{} to {} m", decimal(self.height_range_m[0], 3), decimal(self.height_range_m[1], 3)),
            ),
            (
                "height step",
                match self.height_step_m {
                    Some(step_m) => format!("{} m{rounded}", decimal(step_m, 6)),
                    None => format!("none, heights are kept as the data has them, in {precision} precision"),
                },
            ),
            ("no data", format!("{} samples", grouped(self.nodata_samples))),
            ("reference system", self.crs.clone().unwrap_or_else(|| "unknown".into())),
            ("coordinates in", self.horizontal_unit.clone().unwrap_or_else(|| "unknown units".into())),
            ("heights were in", self.vertical_unit.clone().unwrap_or_else(|| "metres, or so assumed".into())),
            ("records", format!("{}, {} bytes each", self.record, self.record_bytes)),
            ("error", self.error.to_owned()),
            ("pages", format!("{} of {} stored", grouped(self.pages), grouped(self.logical_pages))),
            (
                "file size",
                match self.unpacked_bytes {
                    Some(unpacked) => {
                        format!("{} bytes, packed; {} unpacked", grouped(self.file_bytes), grouped(unpacked))
                    }
                    None => format!("{} bytes", grouped(self.file_bytes)),
                },
            ),
            ("a sample", format!("{:.2} bytes", self.bytes_per_sample)),
        ];
        let at = rows.iter().position(|(name, _)| *name == "records").unwrap_or(rows.len());
        rows.splice(at..at, self.siting.rows());
        if let Some(appended @ 1..) = self.appended_bytes {
            let at = rows.len() - 1;
            let words = format!(
                "{} bytes since it was packed: edits, their history, imagery; terrasoar compact packs the ground as it is",
                grouped(appended)
            );
            rows.insert(at, ("appended", words));
        }
        if let Some(overlay) = &self.overlay {
            rows.insert(1, ("with edits in", overlay.clone()));
        }
        if self.commits > 0 {
            let state = match self.commit {
                0 => "all undone".to_owned(),
                commit => format!("the terrain is as after commit {commit}"),
            };
            rows.push(("edits", format!("{} batches in its history, {state}", grouped(self.commits))));
        }
        if let Some(imagery) = &self.imagery {
            let [wide, high] = imagery.texels.map(|side| grouped(side.into()));
            let [east, north] = imagery.origin_m.map(|m| decimal(m, 2));
            rows.extend([
                ("imagery", format!("{wide} x {high} texels, made from {}", imagery.source)),
                ("texel", format!("{} m", pair(imagery.texel_m, 4))),
                ("imagery from", format!("{east} m east, {north} m north")),
                ("covers", imagery.covers.clone()),
                (
                    "tiles",
                    format!(
                        "{} of {} stored, {} levels, {}",
                        grouped(imagery.tiles),
                        grouped(imagery.logical_tiles),
                        imagery.levels,
                        imagery.format
                    ),
                ),
                (
                    "imagery size",
                    format!("{} bytes, {:.4} of raw RGB", grouped(imagery.bytes), imagery.raw_ratio),
                ),
            ]);
        }
        if let Some(vertical) = &self.vertical_crs {
            let code = self.vertical_epsg.map(|code| format!(" (EPSG:{code})")).unwrap_or_default();
            rows.push(("heights above", format!("{vertical}{code}")));
        }
        rows.extend(self.origins.iter().map(|[what, words]| ("found", format!("{what}: {words}"))));
        rows.extend(self.warnings.iter().map(|words| ("warning", words.clone())));
        if self.unused_bytes > 0 {
            rows.push(("unused", format!("{} bytes that nothing leads to", grouped(self.unused_bytes))));
        }
        if self.history_bytes > 0 && self.unpacked_bytes.is_none() {
            let bytes = grouped(self.history_bytes);
            rows.push((
                "history keeps",
                format!("{bytes} bytes for undo and redo that the terrain as it is does not use; terrasoar compact gives them back"),
            ));
        }
        table(&rows)
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let info = Info::of(&args.terrain.open()?, &args.terrain)?;
    if args.json { print_json(&info) } else { print(&info.text()) }
}
