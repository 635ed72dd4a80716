//! From a DEM to a terrain file, out of core. The samples are copied to a spool and surveyed. Then the build works north in bands: it computes error, radius and
//! saturation from the bottom up and writes pages as they fill.
//!
//! The order of work: a row of tiles is scanned for own errors (`scan`); then every level, finest first, makes the records of the rows whose
//! children and own errors are complete (`saturate`); then pages whose rows are complete are written (`writer`). Each level is a little
//! behind the level below it, so a few rows of each level are all that is held. Cost: one pass over the samples to spool them, one to survey, one to build.
//!
//! Invariant: neither threads nor the memory budget change a byte of the file.

mod band;
mod codes;
mod fill;
mod gather;
mod land;
mod levels;
mod memory;
mod options;
mod plan;
mod rebuild;
mod room;
mod saturate;
mod scan;
mod spacing;
mod spool;
mod step;
mod survey;
mod writer;

use crate::bound::{FIRST_SCANNED, Rules};
use crate::dem::DemSource;
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::disk::{Disk, SystemDisk};
use crate::file::header::{ErrorKind, Header, SpacingOrigin};
use crate::grid::Grid;
use crate::grid::order::corners;
use crate::grid::record::{
    Compact, Exact8, Exact16, RadiusCodes, RecordCodec, RecordKind, RecordScale, VertexClass,
};
use crate::packing::{Check, publish_packed};
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::remedy::Remedy;
use crate::words::{harmless, number};
use band::{Band, Fills};
use codes::{Row, RowReader};
pub use fill::MAX_FILL;
use land::Land;
use levels::{LevelRow, LevelShape, Levels};
use memory::MemoryPlan;
pub use options::BuildOptions;
use rayon::prelude::*;
pub(crate) use rebuild::rebuild_into;
pub use rebuild::{HeightRoom, rebuild};
use saturate::{Around, Saturator};
use scan::{OwnErrors, scan_tile_row};
use spool::Spool;
use std::path::Path;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::SyncSender;
pub use step::compact_step_m;
use survey::HeightCode;
use writer::{PageWriter, PlacedPages, page_queue, write_pages};

/// Longest text in a header; it has room for 254 bytes.
const MAX_TEXT_CHARS: usize = 254;

/// Largest `k` of which the memory for heights everywhere is asked for before samples are read: 65,537 a side.
const LARGEST_FULL_K: u32 = 16;

/// Longest warning that is kept.
const MAX_WARNING_CHARS: usize = 500;

/// Builds the terrain file `out` from `dem`, on the current rayon pool, and returns its header. `out` appears only when it is
/// complete; whatever had the name is replaced then.
///
/// # Errors
/// Damage in the DEM; I/O; [`LayoutError::Usage`] for options or sizes that cannot be met, saying which.
pub fn build(
    dem: &dyn DemSource,
    out: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    build_on(&SystemDisk, dem, out, options, progress)
}

/// As [`build()`], with all writing and reading back done by `disk`.
///
/// # Errors
/// As [`build()`].
pub fn build_on(
    disk: &dyn Disk,
    dem: &dyn DemSource,
    out: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    let info = dem.info();
    if !(options.z_scale.is_finite() && options.z_scale != 0.0) {
        return Err(LayoutError::Usage(format!(
            "the factor on heights is a number other than 0, not {}",
            number(options.z_scale)
        ))
        .mended_by(Remedy::HeightFactor));
    }
    step::check(options.height_step_m, options.record)?;
    if options.fill_voids > MAX_FILL {
        return Err(LayoutError::Usage(format!(
            "holes up to {} samples across are too large to be filled; the largest is {MAX_FILL}",
            options.fill_voids
        )));
    }
    let (spacing_m, spacing_origin) = spacing::resolve(info, options.spacing_m)?;
    let grid = Grid::new([info.samples_wide, info.samples_high], spacing_m)?;
    let samples = u64::from(info.samples_wide) * u64::from(info.samples_high);
    let mut header = first_header(dem, grid, spacing_origin, options);
    // What is wrong already need not be waited for.
    header.check_numbers()?;
    let threads = rayon::current_num_threads() as u64;
    let plan =
        |land: &Land| MemoryPlan::new(&grid, land, info.sample_type, options, threads, dem.memory_bytes());
    // Squares that large have heights everywhere in no file, so what they take is not known before they were read.
    let is_known = grid.k() <= LARGEST_FULL_K;
    let land = if is_known { Land::in_windows(grid.samples(), None) } else { Land::none(grid.samples()) };
    let memory = plan(&land)?;
    // What will have the name comes first: it knows what has the name now.
    let packed = options.packed.then(|| AtomicFile::create(out)).transpose()?;
    let file = AtomicFile::create(out)?;
    let advance = |n| progress.advance(n);

    progress.stage("reading", samples);
    let spool = Spool::new(disk, info, options.nodata, out, memory.spool_bytes, &advance)?;
    dem.stream(&spool)?;
    header
        .about
        .warnings
        .extend(dem.warnings().into_iter().map(|warning| harmless(&warning.words, MAX_WARNING_CHARS)));
    if spool.stats().voids == samples {
        return Err(LayoutError::Usage("the elevation model has no heights: every sample is void".into()));
    }
    if options.fill_voids > 0 && spool.stats().voids > 0 {
        progress.stage("filling voids", samples);
        let filled = fill::fill_holes(&spool, grid.samples(), options.fill_voids, &advance)?;
        header.about.origins.push((
            "voids".into(),
            format!(
                "{} of {} void samples were filled, {} holes of up to {most} x {most} samples, smoothly from their rims",
                filled.samples,
                spool.stats().voids + filled.samples,
                filled.holes,
                most = options.fill_voids
            ),
        ));
    }
    let stats = spool.stats();

    progress.stage("surveying", samples);
    let code = match options.height_step_m {
        Some(step_m) => step::in_steps(info, options.z_scale, &stats, step_m, options.head_room)?,
        None => HeightCode::choose(info, options.z_scale, &stats, options.record, options.head_room),
    };
    let code = code.of_kind(options.record);
    let height_range_m = survey::check_heights(info, &code, &stats)?;
    let steepest_m = survey::steepest_steps_m(&spool, &grid, &code, &advance)?;
    header.record_kind = code.kind;
    header.scale = survey::record_scale(&grid, &code, height_range_m, steepest_m);
    header.has_voids = stats.voids > 0;
    header.heights_rounded = code.rounds;
    header.height_range_m = height_range_m;
    header.nodata_samples = stats.voids;

    progress.stage("building", samples);
    // Now that it is known where heights are, larger tiles may fit, or smaller ones alone. They change no byte.
    let tile = plan(spool.land())?.tile;
    let work = Work { spool: &spool, code, fills: None, tile, file: &file, disk, advance: &advance };
    work.run_kind(&mut header)?;
    drop(spool);
    if let Some(packed) = packed {
        return Ok(publish_packed(disk, file, packed, None, Check::Tiles, progress)?.0);
    }
    progress.stage("syncing", 0);
    publish_terrain(disk, file, None)
}

/// What a header says before a sample is read. Of heights it says what is known: that those of whole numbers go in steps of at least the DEM's scale.
fn first_header(
    dem: &dyn DemSource,
    grid: Grid,
    spacing_origin: SpacingOrigin,
    options: &BuildOptions,
) -> Header {
    let info = dem.info();
    let is_whole = info.sample_type.is_integer();
    let height_step_m = if is_whole { (info.height_scale * options.z_scale).abs() } else { 1.0 };
    Header {
        grid,
        record_kind: RecordKind::Compact,
        scale: RecordScale {
            height_base_m: 0.0,
            height_step_m,
            error_top_m: 1.0,
            radius_codes: RadiusCodes::Octaves(64),
        },
        error_kind: options.error,
        has_voids: false,
        heights_rounded: false,
        generation: 1,
        height_range_m: [0.0; 2],
        nodata_samples: 0,
        stored_pages: 0,
        root_page: 0,
        root_checksum: 0,
        file_bytes: 0,
        imagery: None,
        history: None,
        sample_to_crs: spacing::sample_to_crs(info),
        epsg: info.georeference.epsg,
        crs_unit: info.georeference.unit,
        spacing_origin,
        body_radius_m: info.georeference.body_radius_m.filter(|radius| *radius != 0.0),
        crs_name: harmless(&info.georeference.crs_name, MAX_TEXT_CHARS),
        source: harmless(&info.format, MAX_TEXT_CHARS),
        about: info.about.clone(),
    }
}

/// What the work on one file needs to know.
struct Work<'a> {
    spool: &'a Spool<'a>,
    code: HeightCode,
    /// Heights to fill voids with, other than those that the samples around them suggest.
    fills: Option<&'a Fills<'a>>,
    tile: u32,
    file: &'a AtomicFile,
    disk: &'a dyn Disk,
    advance: &'a (dyn Fn(u64) + Sync),
}

impl Work<'_> {
    /// Works with the codec of the header's kind of records, after a look at whether the file will open.
    fn run_kind(&self, header: &mut Header) -> Result<(), LayoutError> {
        header.check_numbers()?;
        let (grid, scale) = (header.grid, header.scale);
        match header.record_kind {
            RecordKind::Compact | RecordKind::Fine => self.run(Compact::new(&grid, &scale), header),
            RecordKind::Exact8 => self.run(Exact8::new(&grid, &scale), header),
            RecordKind::Exact16 => self.run(Exact16::new(&grid, &scale), header),
        }
    }

    fn run<C: RecordCodec>(&self, codec: C, header: &mut Header) -> Result<(), LayoutError> {
        let (outgoing, incoming) = page_queue();
        let writer = std::thread::scope(|scope| {
            let writing = scope.spawn(|| write_pages(self.file, self.disk, incoming));
            let made = self.make_pages(codec, header, outgoing);
            let written = writing.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            // What the disk said is the cause of whatever followed.
            written.and(made)
        })?;
        writer.finish(header)
    }

    /// Makes all pages and sends them off; returns what knows their places.
    fn make_pages<C: RecordCodec>(
        &self,
        codec: C,
        header: &Header,
        outgoing: SyncSender<PlacedPages>,
    ) -> Result<PageWriter<'_, C>, LayoutError> {
        let grid = header.grid;
        let [wide, high] = grid.samples();
        let land = self.spool.land();
        let plan = plan::Plan::new(&grid, land, header.records_per_page());
        let ends = self.spool.stats().range.map(|raw| self.code.code(raw));
        let lowest = ends[0].min(ends[1]);
        let mut state = State {
            grid,
            land,
            tile: self.tile,
            saturator: Saturator {
                rules: Rules { grid, codec, scale: header.scale, error_kind: header.error_kind },
                has_voids: header.has_voids,
            },
            shapes: (0..grid.levels()).map(|l| LevelShape::new(&grid, l)).collect(),
            band: Band::new(grid, self.tile, self.fills),
            own: Levels::new(grid),
            records: Levels::new(grid),
            writer: PageWriter::new(self.file, self.disk, grid, plan, header.record_kind, outgoing)?,
            scanned: 0,
        };
        let reader = || RowReader::new(self.spool, self.code, wide, lowest);
        state.band.preload_coarse(reader(), self.spool)?;
        state.make_own_rows(0);
        let tile_rows = (high - 1).div_ceil(self.tile).max(1);
        let last_row = |tile_y: u32| ((tile_y + 1) * self.tile).min(high - 1);
        let mut reader = reader();
        let mut rows = reader.read(last_row(0))?;
        for tile_y in 0..tile_rows {
            let count = rows.len() as u64;
            state.band.push(rows);
            state.make_own_rows((tile_y + 1) * self.tile);
            let is_last = tile_y + 1 == tile_rows;
            state.scanned = if is_last { u32::MAX } else { (tile_y + 1) * self.tile };
            // The next rows are read while these are worked on.
            let (ahead, worked) = rayon::join(
                || if is_last { Ok(Vec::<Row>::new()) } else { reader.read(last_row(tile_y + 1)) },
                || {
                    if header.error_kind == ErrorKind::Bounded {
                        let step_m = header.scale.height_step_m;
                        scan_tile_row(&grid, land, &state.band, &state.own, tile_y, self.tile, step_m);
                    }
                    state.advance()
                },
            );
            worked?;
            rows = ahead?;
            (self.advance)(count * u64::from(wide));
        }
        state.finish()
    }
}

/// The work on one file as far as it has come.
struct State<'a, C: RecordCodec> {
    grid: Grid,
    land: &'a Land,
    tile: u32,
    saturator: Saturator<C>,
    shapes: Vec<LevelShape>,
    band: Band<'a>,
    own: OwnErrors,
    records: Levels<C::Raw>,
    writer: PageWriter<'a, C>,
    /// Own errors of rows below this are complete; `u32::MAX` when all are.
    scanned: u32,
}

impl<'a, C: RecordCodec> State<'a, C> {
    /// Levels whose triangles fit a tile.
    fn tile_levels(&self) -> u32 {
        2 * self.tile.trailing_zeros()
    }

    /// Makes room for the own errors of rows up to `last_y`, and of all rows of levels larger than a tile.
    fn make_own_rows(&mut self, last_y: u32) {
        for shape in &self.shapes[FIRST_SCANNED.min(self.grid.levels()) as usize..] {
            let last = if shape.level() >= self.tile_levels() { u32::MAX } else { last_y };
            let mut row = self.own.next_row(shape.level());
            while row < shape.rows() && shape.row_y(row) <= last {
                let runs = self.land.columns(shape, row).into_iter();
                let runs = runs.map(|run| (run.start, run.map(|_| AtomicU32::new(0)).collect()));
                self.own.push(shape.level(), LevelRow::new(shape.columns(row), runs.collect()));
                row += 1;
            }
        }
    }

    /// All rows of `level` up to this y are done.
    fn done_y(&self, level: u32) -> i64 {
        let (shape, next) = (&self.shapes[level as usize], self.records.next_row(level));
        if next >= shape.rows() { i64::MAX } else { i64::from(shape.row_y(next)) - 1 }
    }

    /// Whether everything that the row at `y` of a level depends on is there.
    fn is_ready(&self, shape: &LevelShape, y: u32) -> bool {
        let all = self.scanned == u32::MAX;
        let (level, step) = (shape.level(), shape.step());
        let own = all || (level < self.tile_levels() && (level < FIRST_SCANNED || y < self.scanned));
        let codes = all || y + step < self.band.rows_read();
        let to_child = if shape.is_white() { step } else { step / 2 };
        let children = level == 0
            || self.done_y(level - 1) >= i64::from(y + to_child).min(i64::from(self.grid.side_steps()));
        own && codes && children
    }

    /// Makes every row that can be made, writes every page that can be written, and drops what is no longer needed.
    fn advance(&mut self) -> Result<(), LayoutError> {
        for level in 0..self.grid.levels() {
            let shape = self.shapes[level as usize];
            let first = self.records.next_row(level);
            let mut end = first;
            while end < shape.rows() && self.is_ready(&shape, shape.row_y(end)) {
                end += 1;
            }
            let made: Vec<LevelRow<C::Raw>> = (first..end)
                .into_par_iter()
                .map(|row| {
                    let around = Around { band: &self.band, own: &self.own, records: &self.records };
                    self.saturator.row(&shape, row, &self.land.columns(&shape, row), around)
                })
                .collect::<Result<_, LayoutError>>()?;
            for row in made {
                self.records.push(level, row);
            }
        }
        for level in 0..self.grid.levels() {
            let waiting = self.writer.advance(level, self.done_y(level), &self.records)?;
            let parent_needs = match self.shapes.get(level as usize + 1) {
                Some(parent) if self.records.next_row(level + 1) < parent.rows() => {
                    i64::from(parent.row_y(self.records.next_row(level + 1))) - i64::from(parent.step())
                }
                _ => i64::MAX,
            };
            let shape = self.shapes[level as usize];
            let keep = first_row_at(&shape, waiting.min(parent_needs).min(self.done_y(level)));
            self.records.drop_below(level, keep);
            self.own.drop_below(level, self.records.next_row(level));
        }
        let needed = (0..self.tile_levels().min(self.grid.levels()))
            .map(|level| {
                let shape = &self.shapes[level as usize];
                (self.done_y(level)).saturating_sub(i64::from(shape.step()))
            })
            .min()
            .unwrap_or(0);
        // The next row of tiles begins with the last row read.
        let last_read = i64::from(self.band.rows_read()) - 1;
        self.band.drop_below(needed.clamp(0, last_read) as u32);
        Ok(())
    }

    fn finish(mut self) -> Result<PageWriter<'a, C>, LayoutError> {
        let records = corners(self.grid.k()).map(|corner| {
            let class = if self.band.is_void(corner) { VertexClass::FringeVoid } else { VertexClass::Plain };
            let code = self.band.code(corner);
            self.saturator.rules.codec.encode(0, code, class, 0.0, 0.0).unwrap_or(C::INERT)
        });
        self.writer.set_corners(records)?;
        self.writer.close_queue();
        Ok(self.writer)
    }
}

/// First row of a level at or north of `y`.
fn first_row_at(shape: &LevelShape, y: i64) -> usize {
    let y = y.clamp(0, i64::from(u32::MAX / 4)) as u32;
    let guess = if shape.is_white() { y / (2 * shape.step()) } else { y / shape.step() };
    (guess as usize).min(shape.rows())
}
