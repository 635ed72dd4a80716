//! A terrain built anew from its own heights: in its own scale, which must give the same records, or in one with room for other heights.
//!
//! The samples are read back from the records, so nothing that the file held is lost. Voids keep the heights they are filled with. Cost and memory are those of a build.

use super::land::{BLOCK, Land};
use super::room::{self, LARGEST_CODE};
use super::spool::Spool;
use super::survey::HeightCode;
use super::{BuildOptions, MemoryPlan, Work};
use crate::dem::{About, DemInfo, DemSource, Georeference, SampleSink, SampleType, Window};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::disk::Disk;
use crate::file::header::Header;
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::{RecordCodec, RecordKind, RecordScale};
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::records::Records;
use crate::read::terrain::Terrain;
use crate::with_records;
use rayon::prelude::*;
use std::path::Path;

/// Heights that a file is to have room for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeightRoom {
    /// Lowest height in metres.
    pub lowest_m: f64,
    /// Highest height in metres.
    pub highest_m: f64,
}

/// Heights of a terrain as a DEM whose raw samples are the records' height values.
struct OwnHeights<'t, C: RecordCodec> {
    info: DemInfo,
    records: Records<'t, C>,
    /// Windows that may have heights, and windows of voids: each sample lies in one.
    land: Vec<Window>,
    sea: Vec<Window>,
}

impl<'t, C: RecordCodec> OwnHeights<'t, C> {
    fn new(info: DemInfo, records: Records<'t, C>) -> Self {
        let [land, sea] = cells(&records);
        Self { info, records, land, sea }
    }
}

/// Windows that may have heights, and windows of voids alone. The centre of a cell is inert where nothing that is refined inside the cell is there, so oceans cost as little as in the file.
fn cells<C: RecordCodec>(records: &Records<'_, C>) -> [Vec<Window>; 2] {
    let grid = records.grid();
    let (k, n, [wide, high]) = (grid.k(), grid.side_steps(), grid.samples());
    let is_void =
        |x: u32, y: u32| records.vertex_at(GridPoint::new(x.min(wide - 1), y.min(high - 1))).class.is_void();
    let (mut land, mut sea) = (Vec::new(), Vec::new());
    let mut waiting = vec![(0, 0, n)];
    while let Some((west, south, side)) = waiting.pop() {
        if west >= wide || south >= high {
            continue;
        }
        let (east, north) = (west + side, south + side);
        let centre = GridPoint::new(west + side / 2, south + side / 2);
        // All of a cell but its corners is below its centre.
        let is_sea = records.raw(slot_of(k, centre)) == C::INERT
            && [(west, south), (east, south), (west, north), (east, north)]
                .into_iter()
                .all(|(x, y)| is_void(x, y));
        if !is_sea && side > BLOCK {
            let half = side / 2;
            waiting
                .extend([0, half].into_iter().flat_map(|y| [0, half].map(|x| (west + x, south + y, half))));
            continue;
        }
        // The last cells have the far border, too.
        let end = |to: u32, count: u32| if to == n { count } else { to.min(count) };
        let (width, height) = (end(east, wide) - west, end(north, high) - south);
        let window = Window { col: west, row: high - south - height, width, height };
        if is_sea { &mut sea } else { &mut land }.push(window);
    }
    [land, sea]
}

impl<C: RecordCodec> DemSource for OwnHeights<'_, C> {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let (high, k) = (self.info.samples_high, self.records.grid().k());
        self.sea.iter().try_for_each(|window| sink.put_void(*window))?;
        self.land.par_iter().try_for_each_init(Vec::new, |samples, window| {
            samples.clear();
            for row in window.row..window.row + window.height {
                let y = high - 1 - row;
                samples.extend((window.col..window.col + window.width).map(|x| {
                    let raw = self.records.raw(slot_of(k, GridPoint::new(x, y)));
                    let is_void = self.records.decode(raw, 0).class.is_void();
                    if is_void { f64::NAN } else { C::height_value(raw) }
                }));
            }
            sink.put(*window, samples)
        })
    }
}

/// Builds `out` from the heights of `terrain`, on the current rayon pool: with the same records if `room` is `None`, else in a scale that has room for these
/// heights beside the terrain's own. `out` appears when it is complete; it has no imagery and no history.
///
/// # Errors
/// As [`build()`](super::build()); [`LayoutError::Usage`] for a terrain whose source does not lend its bytes, and for heights beyond a million kilometres.
pub fn rebuild(
    disk: &dyn Disk,
    terrain: &Terrain,
    out: &Path,
    room: Option<HeightRoom>,
    memory_mib: u64,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    let file = AtomicFile::create(out)?;
    rebuild_into(disk, terrain, &file, room, memory_mib, progress)?;
    progress.stage("syncing", 0);
    publish_terrain(disk, file, None)
}

/// As [`rebuild`], into a file that is published by the caller.
pub(crate) fn rebuild_into(
    disk: &dyn Disk,
    terrain: &Terrain,
    file: &AtomicFile,
    room: Option<HeightRoom>,
    memory_mib: u64,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    if !terrain.lends_records() {
        return Err(LayoutError::Usage(format!(
            "{}: building it anew needs a mapped or in-memory terrain",
            terrain.path().display()
        )));
    }
    let records = terrain.records()?;
    with_records!(records, records => rebuild_kind(disk, terrain, records, file, room, memory_mib, progress))
}

fn rebuild_kind<C: RecordCodec>(
    disk: &dyn Disk,
    terrain: &Terrain,
    records: Records<'_, C>,
    file: &AtomicFile,
    room: Option<HeightRoom>,
    memory_mib: u64,
    progress: &dyn Progress,
) -> Result<Header, LayoutError> {
    let old = terrain.header();
    let (grid, [wide, high]) = (old.grid, old.grid.samples());
    let info = DemInfo {
        samples_wide: wide,
        samples_high: high,
        sample_type: match old.record_kind {
            RecordKind::Compact | RecordKind::Fine => SampleType::U16,
            RecordKind::Exact8 => SampleType::F32,
            RecordKind::Exact16 => SampleType::F64,
        },
        height_scale: old.scale.height_step_m,
        height_offset_m: old.scale.height_base_m,
        georeference: Georeference::default(),
        format: old.source.clone(),
        about: About::default(),
    };
    let samples = u64::from(wide) * u64::from(high);
    let options = BuildOptions { memory_mib, ..BuildOptions::default() };
    let source = OwnHeights::new(info, records);
    let land = Land::in_windows(grid.samples(), Some(&source.land));
    let threads = rayon::current_num_threads() as u64;
    let memory = MemoryPlan::new(&grid, &land, source.info.sample_type, &options, threads, 0)?;
    let advance = |n| progress.advance(n);
    progress.stage("reading", samples);
    let spool = Spool::new(disk, &source.info, None, file.target(), memory.spool_bytes, &advance)?;
    source.stream(&spool)?;

    let (code, scale) = match room {
        None => (same_code(old), old.scale),
        Some(room) => {
            progress.stage("surveying", samples);
            let code = roomy_code(terrain.path(), old, room)?;
            let steepest_m = super::survey::steepest_steps_m(&spool, &grid, &code, &advance)?;
            (code, roomy_scale(old, &code, room, steepest_m))
        }
    };
    let fill_of = |x, y| kept_fill(&source.records, GridPoint::new(x, y)).map(|value| code.code(value));
    let stats = spool.stats();
    let mut header = Header {
        record_kind: code.kind,
        scale,
        generation: 1,
        height_range_m: stats.range.map(|raw| code.metres(code.code(raw))),
        imagery: None,
        history: None,
        ..old.clone()
    };
    progress.stage("building", samples);
    Work { spool: &spool, code, fills: Some(&fill_of), tile: memory.tile, file, disk, advance: &advance }
        .run_kind(&mut header)?;
    Ok(header)
}

/// Height value that a void is filled with: what its record says, or that of a padding vertex with its position; `None` if all are inert.
fn kept_fill<C: RecordCodec>(records: &Records<'_, C>, void: GridPoint) -> Option<f64> {
    let (grid, [wide, high]) = (records.grid(), records.grid().samples());
    // No vertex of a level stands farther from the data, and none on this row or column has a higher level than it allows.
    let padding_to = |v: u32, count: u32, across: u32| {
        if v + 1 < count {
            return v;
        }
        let level = (2 * across.trailing_zeros().min(grid.k()) + 1).min(grid.levels() - 1);
        (v + grid.reach_steps(level)).min(grid.side_steps())
    };
    let (x_to, y_to) = if void.x() + 1 == wide && void.y() + 1 == high {
        (grid.side_steps(), grid.side_steps())
    } else {
        (padding_to(void.x(), wide, void.y()), padding_to(void.y(), high, void.x()))
    };
    let images = (void.y()..=y_to).flat_map(|y| (void.x()..=x_to).map(move |x| GridPoint::new(x, y)));
    let mut raws = images.map(|p| records.raw(slot_of(grid.k(), p)));
    raws.find(|raw| *raw != C::INERT).map(C::height_value)
}

/// Raw samples are the records' own height values.
fn same_code(old: &Header) -> HeightCode {
    let RecordScale { height_base_m, height_step_m, .. } = old.scale;
    HeightCode {
        kind: old.record_kind,
        raw_base: 0.0,
        raw_step: 1.0,
        rounds: old.heights_rounded,
        base_m: height_base_m,
        step_m: height_step_m,
        reach_steps: 0.0,
    }
}

/// Heights of the terrain and those it is to have room for.
fn range_with(old: &Header, room: HeightRoom) -> [f64; 2] {
    let [low, high] = old.height_range_m;
    [low.min(room.lowest_m), high.max(room.highest_m)]
}

/// The smallest kind of records that keeps the terrain's heights exactly and has room for others.
fn roomy_code(path: &Path, old: &Header, room: HeightRoom) -> Result<HeightCode, LayoutError> {
    let [low, high] = range_with(old, room);
    if !(low.abs() <= 1e9 && high.abs() <= 1e9) {
        return Err(LayoutError::Usage(format!(
            "{}: heights from {low} to {high} m are beyond a million kilometres; a terrain does not go there",
            path.display()
        )));
    }
    let same = same_code(old);
    if !old.record_kind.has_height_codes() {
        return Ok(same);
    }
    // Whole steps, so that every height stays what it is. Where the base moves, it moves by what the next edits may need, too.
    let range_steps = (high - low) / same.step_m;
    let below = match ((same.base_m - low) / same.step_m).ceil().max(0.0) {
        0.0 => 0.0,
        needed => needed + room::codes_below(range_steps),
    };
    let above = ((high - same.base_m) / same.step_m).ceil();
    if below + above <= LARGEST_CODE {
        let base_m = same.base_m - below * same.step_m;
        let reach_steps = room::reach_steps(range_steps);
        return Ok(HeightCode { raw_base: -below, base_m, reach_steps, ..same });
    }
    Ok(HeightCode { kind: RecordKind::Exact8, ..same })
}

/// Room for slopes too: as steep as the whole range over one step.
fn roomy_scale(old: &Header, code: &HeightCode, room: HeightRoom, steepest_m: [f64; 3]) -> RecordScale {
    let range_m = range_with(old, room);
    let tall = range_m[1] - range_m[0];
    let steepest_m = steepest_m.map(|s| s.max(tall));
    super::survey::record_scale(&old.grid, code, range_m, steepest_m)
}
