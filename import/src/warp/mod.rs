//! Samples on another grid: north-up where the file's is turned or sheared, or in another reference system.
//!
//! The old samples are kept while they stream ([`store`]); then the new grid is made block by block, on all threads: places among the old samples ([`mapping`]), a window of these,
//! and a kernel ([`kernel`]). Blocks that no old sample reaches are passed over. Memory: a share of what is allowed, whatever the size of either grid. Cost: two passes over the samples that are not void, and a
//! microsecond a new one.

mod kernel;
mod mapping;
mod store;
mod target;
mod touch;

use crate::cells::{CELL, Cells, each_block_met};
use crate::crs::{Doubt, Ground, HorizontalSize, Kind, System, all_over, is_earth};
use crate::options::{OpenOptions, Resampling};
use crate::parallel::each_task;
use kernel::Kernel;
pub(crate) use mapping::{Mapping, Projections, apply};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
pub(crate) use store::Store;
use target::Grid;
pub(crate) use target::system as target_system;
pub(crate) use target::{mesh, three_digits};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;

/// Share of the memory allowed that old samples may take.
const STORE_SHARE: u64 = 4;
/// Old samples of one block, at most.
const MOST_OLD: usize = 1 << 20;
/// New samples on the sides of a block.
const BLOCK: [u32; 2] = [256, 128];

/// A plan to make new samples of old ones.
pub(crate) struct Warp {
    system: Option<System>,
    grid: Grid,
    resampler: Resampler,
    sample_type: SampleType,
    in_memory: bool,
    folder: PathBuf,
    words: String,
    doubt: Option<Doubt>,
}

impl Warp {
    /// The plan for a grid of `samples` with `map` in `system`: none where it lies along the axes and stays in its system.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a system that is not known, or a grid that would be too large.
    pub(crate) fn plan(
        path: &Path,
        system: &System,
        map: Option<[f64; 6]>,
        samples: [u32; 2],
        sample_type: SampleType,
        across: bool,
        options: &OpenOptions,
    ) -> Result<Option<Self>, LayoutError> {
        let wanted = options.reproject.as_deref();
        if wanted.is_none() && !across {
            return Ok(None);
        }
        let Some(map) = map else {
            return Err(LayoutError::Usage(format!(
                "{}: the elevation model does not say where it lies, so it cannot be brought into another system",
                path.display()
            )));
        };
        let resampling = options.resampling.unwrap_or_default();
        let (target, grid, mapping) = match wanted {
            None => {
                let grid = north_up(path, system, &map, samples)?;
                let mapping = Mapping::new(grid.map, map, samples[0], None);
                (None, grid, mapping)
            }
            Some(text) => reprojected(path, text, system, &map, samples, options)?,
        };
        let kernel = Kernel {
            resampling,
            scale: scale(grid.samples.map(f64::from), samples),
            samples,
            wraps: wraps(system, &map, samples),
        };
        let sample_type = match (resampling, sample_type) {
            (Resampling::Nearest, kept) => kept,
            (_, kept) if kept.fits_f32() => SampleType::F32,
            _ => SampleType::F64,
        };
        let sample_bytes = if sample_type.fits_f32() { 4 } else { 8 };
        let allowed = (options.memory_mib.unwrap_or(512) << 20) / STORE_SHARE;
        let words = format!(
            "{} from {} x {} samples to {} x {}, {}",
            match &target {
                None => "turned north-up".to_owned(),
                Some(target) =>
                    format!("brought into {}", terrasoar_layout::words::harmless(&target.name, 80)),
            },
            samples[0],
            samples[1],
            grid.samples[0],
            grid.samples[1],
            resampling.name()
        );
        let doubt = |target| Ground::new(system)?.doubt(&Ground::new(target)?, &all_over(&map, samples));
        let doubt = target.as_ref().and_then(doubt);
        Ok(Some(Self {
            doubt,
            system: target,
            resampler: Resampler { mapping, kernel, sample_bytes },
            sample_type,
            in_memory: Store::bytes(samples, sample_bytes) <= allowed,
            folder: options.scratch.clone().unwrap_or_else(std::env::temp_dir),
            words,
            grid,
        }))
    }

    /// How far places may be off, where a shift between datums is not known well.
    pub(crate) fn doubt(&self) -> Option<Doubt> {
        self.doubt
    }

    /// The new system, if it is another one.
    pub(crate) fn system(&self) -> Option<&System> {
        self.system.as_ref()
    }

    /// Columns and rows of the new grid.
    pub(crate) fn samples(&self) -> [u32; 2] {
        self.grid.samples
    }

    /// The map of the new grid.
    pub(crate) fn map(&self) -> [f64; 6] {
        self.grid.map
    }

    /// Type of new samples.
    pub(crate) fn sample_type(&self) -> SampleType {
        self.sample_type
    }

    /// The kernel's name.
    pub(crate) fn method(&self) -> &'static str {
        self.resampler.kernel.resampling.name()
    }

    /// What is done, in words.
    pub(crate) fn words(&self) -> String {
        self.words.clone()
    }

    /// Memory that it takes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let Resampler { kernel, sample_bytes, .. } = &self.resampler;
        let kept = if self.in_memory { Store::bytes(kernel.samples, *sample_bytes) } else { 0 };
        kept + blocks_bytes()
    }

    /// Keeps what `old` streams, and streams the new samples into `sink`.
    pub(crate) fn stream(
        &self,
        old: &dyn Fn(&dyn SampleSink) -> Result<(), LayoutError>,
        sink: &dyn SampleSink,
    ) -> Result<(), LayoutError> {
        let Resampler { kernel, sample_bytes, .. } = &self.resampler;
        let store = Store::new(kernel.samples, *sample_bytes, self.in_memory, &self.folder)?;
        let there = Mutex::default();
        old(&Noting { store: &store, there: &there })?;
        let there = there.into_inner().unwrap_or_else(PoisonError::into_inner);
        let is_met = |window| self.resampler.may_touch(window, &there);
        let pass = |window| sink.put_void(window);
        each_block_met(
            self.grid.samples,
            BLOCK,
            CELL,
            is_met,
            pass,
            || (),
            |(), window| {
                // Cells are large: around a pole, where what they hold is in doubt, most of their blocks are not.
                if !is_met(window) {
                    return pass(window);
                }
                self.resampler.block(&store, window, &mut |window, samples| match samples {
                    Some(samples) => sink.put(window, samples),
                    None => pass(window),
                })
            },
        )
    }
}

/// Keeps samples and notes where there are some that are not void.
struct Noting<'a> {
    store: &'a Store,
    there: &'a Mutex<Cells>,
}

impl SampleSink for Noting<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        if samples.iter().all(|value| value.is_nan()) {
            return Ok(());
        }
        // Checks that the window lies in the grid.
        self.store.put(window, samples)?;
        let mut there = self.there.lock().unwrap_or_else(PoisonError::into_inner);
        there.add([window.col, window.row], [window.col + window.width, window.row + window.height]);
        Ok(())
    }

    fn put_void(&self, _window: Window) -> Result<(), LayoutError> {
        Ok(())
    }
}

/// Memory that making blocks takes, on all threads.
pub(crate) fn blocks_bytes() -> u64 {
    rayon::current_num_threads() as u64 * (8 * MOST_OLD as u64 + 32 * u64::from(BLOCK[0] * BLOCK[1]))
}

/// Calls `make` with every block of a grid, of at most `size` columns and rows, on all threads.
pub(crate) fn each_block(
    [wide, high]: [u32; 2],
    size: [u32; 2],
    make: impl Fn(Window) -> Result<(), LayoutError> + Sync,
) -> Result<(), LayoutError> {
    let across = u64::from(wide.div_ceil(size[0]));
    let blocks = across * u64::from(high.div_ceil(size[1]));
    each_task(
        blocks,
        usize::MAX,
        || Ok(()),
        |(), block| {
            // Both products stay below the grid's sides.
            let col = (block % across) as u32 * size[0];
            let row = (block / across) as u32 * size[1];
            make(Window { col, row, width: size[0].min(wide - col), height: size[1].min(high - row) })
        },
    )
}

/// Takes a window of new samples; none where all are void.
type Put<'a> = &'a mut dyn FnMut(Window, Option<&[f64]>) -> Result<(), LayoutError>;

/// From old samples to new ones: places and a kernel.
pub(crate) struct Resampler {
    mapping: Mapping,
    kernel: Kernel,
    sample_bytes: u64,
}

impl Resampler {
    /// From a grid of `old` samples in a store to another; `new` is how many new samples lie along its sides.
    pub(crate) fn new(
        mapping: Mapping,
        resampling: Resampling,
        old: [u32; 2],
        new: [f64; 2],
        sample_bytes: u64,
    ) -> Self {
        Self {
            mapping,
            kernel: Kernel { resampling, scale: scale(new, old), samples: old, wraps: false },
            sample_bytes,
        }
    }

    /// Where the samples of a window of the new grid lie among the old ones: NaN where there is no such place.
    pub(crate) fn places(&self, window: Window) -> Vec<[f64; 2]> {
        let first = [f64::from(window.col), f64::from(window.row)];
        self.mapping.places(first, [window.width as usize, window.height as usize])
    }

    /// Makes the samples of a window, in halves where it needs too many old ones.
    pub(crate) fn block(&self, store: &Store, window: Window, put: Put<'_>) -> Result<(), LayoutError> {
        let size = [window.width as usize, window.height as usize];
        let first = [f64::from(window.col), f64::from(window.row)];
        let is_mean = self.kernel.resampling == Resampling::Average;
        let places = self.mapping.places(first, size);
        // Corners of the new samples' areas, for the mean.
        let corners = if is_mean {
            self.mapping.places([first[0] - 0.5, first[1] - 0.5], [size[0] + 1, size[1] + 1])
        } else {
            Vec::new()
        };
        let Some(([west, north], [east, south])) = rim(places.iter().chain(&corners)) else {
            return put(window, None);
        };
        let reach = self.kernel.reach();
        let limits = self.kernel.samples.map(f64::from);
        let low = |value: f64, i: usize, wraps: bool| {
            let value = (value - reach[i]).floor();
            if wraps { value } else { value.clamp(-1.0, limits[i]) }
        };
        let high = |value: f64, i: usize, wraps: bool| {
            let value = (value + reach[i]).ceil();
            if wraps { value } else { value.clamp(-1.0, limits[i]) }
        };
        let from = [low(west, 0, self.kernel.wraps) as i64, low(north, 1, false) as i64];
        let to = [high(east, 0, self.kernel.wraps) as i64, high(south, 1, false) as i64];
        let old = [0, 1].map(|i| (to[i] - from[i] + 1).max(1) as usize);
        if old[0].saturating_mul(old[1]) > MOST_OLD && size[0] * size[1] > 1 {
            let halves = if size[0] >= size[1] {
                let left = window.width / 2;
                [
                    Window { width: left, ..window },
                    Window { col: window.col + left, width: window.width - left, ..window },
                ]
            } else {
                let upper = window.height / 2;
                [
                    Window { height: upper, ..window },
                    Window { row: window.row + upper, height: window.height - upper, ..window },
                ]
            };
            return halves.into_iter().try_for_each(|half| self.block(store, half, put));
        }
        let block = store.window(from, old, self.kernel.wraps)?;
        let samples: Vec<f64> = places
            .iter()
            .enumerate()
            .map(|(i, place)| {
                let area = if is_mean {
                    let at = i / size[0] * (size[0] + 1) + i % size[0];
                    [corners[at], corners[at + size[0] + 2]]
                } else {
                    [*place; 2]
                };
                let sample = self.kernel.sample(&block, *place, area);
                if self.sample_bytes == 4 { f64::from(sample as f32) } else { sample }
            })
            .collect();
        put(window, Some(&samples))
    }
}

/// The least and the greatest of places that exist.
fn rim<'a>(places: impl Iterator<Item = &'a [f64; 2]>) -> Option<([f64; 2], [f64; 2])> {
    places.filter(|place| place.iter().all(|value| value.is_finite())).fold(None, |rim, place| {
        let (low, high) = rim.unwrap_or((*place, *place));
        Some(([low[0].min(place[0]), low[1].min(place[1])], [high[0].max(place[0]), high[1].max(place[1])]))
    })
}

/// The grid in the same system with its axes north-up, its steps those of the file.
fn north_up(path: &Path, system: &System, map: &[f64; 6], samples: [u32; 2]) -> Result<Grid, LayoutError> {
    // The step along what is nearer to the east, and across it so that as many samples cover the same ground.
    let along = if map[1].abs() >= map[2].abs() { hypot(map[1], map[4]) } else { hypot(map[2], map[5]) };
    let steps = [along, (map[1] * map[5] - map[2] * map[4]).abs() / along];
    target::grid(path, samples, steps, None, system.signs, |at| Some(apply(map, at)))
}

fn reprojected(
    path: &Path,
    text: &str,
    system: &System,
    map: &[f64; 6],
    samples: [u32; 2],
    options: &OpenOptions,
) -> Result<(Option<System>, Grid, Mapping), LayoutError> {
    let Some(old) = Ground::new(system) else {
        return Err(LayoutError::Usage(format!(
            "{}: {} is not tied to the ground in a way that is known here, so it cannot be brought into another system; say which system it is in",
            path.display(),
            if system.name.is_empty() { "the elevation model" } else { system.name.as_str() }
        ))
        .mended_by(Remedy::ReferenceSystem));
    };
    let target = target::system(path, text, system, &old, map, samples)?;
    let new = Ground::new(&target).ok_or_else(|| {
        LayoutError::Usage(format!(
            "data cannot be brought into {} here; name another system, or do it before: gdalwarp -t_srs SYSTEM INPUT output.tif",
            target.name
        ))
        .mended_by(Remedy::Reproject)
    })?;
    let bodies = [system, &target].map(|system| system.radius_m.is_none_or(is_earth));
    if bodies[0] != bodies[1] {
        return Err(LayoutError::Usage(format!(
            "{}: {} and {} are systems of different bodies",
            path.display(),
            system.name,
            target.name
        ))
        .mended_by(Remedy::Reproject));
    }
    let step = target::step(path, &target, &old, map, samples, options)?;
    let over = |at: [f64; 2]| old.across_to(&new, apply(map, at));
    let grid = target::grid(path, samples, [step; 2], new.turn(), target.signs, over)?;
    let mapping =
        Mapping::new(grid.map, *map, samples[0], Some(Projections { old: old.clone(), new: new.clone() }));
    Ok((Some(target), grid, mapping))
}

/// New samples an old one, at most 1: by how many there are of either, for the new grid covers all of the old one. A whole number of old ones where it is nearly that, as GDAL
/// has it.
fn scale(new: [f64; 2], old: [u32; 2]) -> [f64; 2] {
    std::array::from_fn(|i| {
        let old = f64::from(old[i]) / new[i];
        if old <= 1.05 {
            return 1.0;
        }
        let whole = old.round();
        if (old - whole).abs() < 0.05 { 1.0 / whole } else { 1.0 / old }
    })
}

/// Whether the columns go once around the globe.
fn wraps(system: &System, map: &[f64; 6], samples: [u32; 2]) -> bool {
    let Some(HorizontalSize::Radians(size)) = system.unit.as_ref().map(|unit| unit.size) else {
        return false;
    };
    let turn = std::f64::consts::TAU / size;
    system.kind == Kind::Geographic
        && (f64::from(samples[0]) * map[1].abs() - turn).abs() < 0.5 * map[1].abs()
}

#[cfg(test)]
mod tests;
