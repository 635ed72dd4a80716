//! The samples of a grid, window by window.
//!
//! Samples that are not compressed are read some rows at a time. A chunk of HDF5 is unpacked as a whole even for a part of it. So windows are whole
//! chunks, and each is unpacked once. Of chunks larger than [`LARGEST_WINDOW`] one worker keeps the last one while its rows are passed on.

use super::Shape;
use super::choose::Grid;
use super::file::{self, Purpose};
use crate::parallel::each_task;
use crate::{WINDOW_SAMPLES, guard};
use netcdf_reader::{NcFile, NcSliceInfo, NcSliceInfoElem, NcType};
use std::path::Path;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

/// Largest chunk that is a window by itself, in samples.
const LARGEST_WINDOW: u64 = 1 << 20;
/// Memory that all workers together take, unless one takes more.
const BUDGET_BYTES: u64 = 16 << 20;
/// Memory that the library keeps for each chunk of a file, to know where it lies.
const ENTRY_BYTES: u64 = 160;

/// Where samples come from.
#[derive(Debug)]
pub(super) struct Source {
    place: String,
    /// Number of the layer along each leading dimension.
    leading: Vec<u64>,
    /// Columns and rows as they lie in the variable.
    stored: [u32; 2],
    is_transposed: bool,
    is_flat: bool,
    /// Columns and rows of a chunk, and its bytes with the leading dimensions it reaches over.
    chunk: Option<([u32; 2], u64)>,
    sample_bytes: u64,
    /// What is added to numbers below 0 that are meant without a sign.
    wrap: f64,
}

impl Source {
    pub(super) fn new(
        path: &Path,
        grid: &Grid<'_>,
        layer: u64,
        Shape { samples, is_transposed }: Shape,
        is_unsigned: bool,
    ) -> Result<Self, LayoutError> {
        let shape = grid.variable.shape();
        let sizes = if grid.is_flat { &[] } else { &shape[..shape.len() - 2] };
        let mut rest = layer;
        let mut leading: Vec<u64> = sizes
            .iter()
            .rev()
            .map(|size| {
                let at = rest % size.max(&1);
                rest /= size.max(&1);
                at
            })
            .collect();
        leading.reverse();
        let sample_bytes = match grid.variable.dtype() {
            NcType::Byte | NcType::UByte => 1,
            NcType::Short | NcType::UShort => 2,
            NcType::Int | NcType::UInt | NcType::Float => 4,
            _ => 8,
        };
        let wrap = if is_unsigned { (1u128 << (8 * sample_bytes)) as f64 } else { 0.0 };
        let stored = if is_transposed { [samples[1], samples[0]] } else { samples };
        let chunk = chunk(path, &grid.place, grid.is_flat, stored, sample_bytes)?;
        let place = grid.place.clone();
        Ok(Self { place, leading, stored, is_transposed, is_flat: grid.is_flat, chunk, sample_bytes, wrap })
    }

    /// The windows that are read, as columns and rows of each; the last ones of a row or column are cut.
    fn window(&self) -> [u32; 2] {
        let [columns, rows] = self.stored;
        let fit =
            |width: u32| u32::try_from(WINDOW_SAMPLES / u64::from(width.max(1))).unwrap_or(u32::MAX).max(1);
        match self.chunk {
            None => [columns, fit(columns).min(rows)],
            Some(([wide, high], _)) if u64::from(wide) * u64::from(high) > LARGEST_WINDOW => {
                [wide, fit(wide).min(high)]
            }
            // As many chunks side by side as make a window, and of flat ones as many below each other.
            Some(([wide, high], _)) => {
                let (columns, rows) = (u64::from(columns), u64::from(rows));
                let (wide, high) = (u64::from(wide), u64::from(high));
                let across = (wide * (WINDOW_SAMPLES / (wide * high)).max(1)).min(columns);
                let down = (high * (WINDOW_SAMPLES / (across * high)).max(1)).min(rows);
                // Both are sides of the grid at most.
                [across as u32, down as u32]
            }
        }
    }

    /// Whether a chunk is kept while its rows are handed on.
    fn is_kept(&self) -> bool {
        self.chunk.is_some_and(|([wide, high], _)| u64::from(wide) * u64::from(high) > LARGEST_WINDOW)
    }

    fn worker_bytes(&self) -> u64 {
        let [wide, high] = self.window().map(u64::from);
        // Samples as doubles once more than they are handed over, and as the file has them.
        let window = wide * high * (24 + self.sample_bytes);
        // A chunk packed, and at two stages of unpacking.
        window.saturating_add(self.chunk.map_or(0, |(_, bytes)| bytes.saturating_mul(3)))
    }

    /// Memory beyond a megabyte or two a thread.
    pub(super) fn memory_bytes(&self) -> u64 {
        let entries = self.chunk.map_or(0, |([wide, high], _)| {
            let [columns, rows] = self.stored;
            u64::from(columns.div_ceil(wide)) * u64::from(rows.div_ceil(high)) * ENTRY_BYTES
        });
        let kept = if self.is_kept() { self.chunk.map_or(0, |(_, bytes)| bytes) } else { 0 };
        self.worker_bytes().saturating_add(kept).saturating_sub(BUDGET_BYTES).saturating_add(entries)
    }

    /// Pushes every sample once.
    pub(super) fn stream(&self, path: &Path, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let chunk_bytes = self.chunk.map_or(0, |(_, bytes)| bytes);
        let kept_bytes = if self.is_kept() { chunk_bytes } else { 0 };
        let file = file::open(path, Purpose::Stream { chunk_bytes, kept_bytes })?;
        let [columns, rows] = self.stored;
        let [wide, high] = self.window();
        // All rows of a chunk before those of the next.
        let tall = match self.chunk {
            Some(([_, tall], _)) if self.is_kept() => tall.min(rows),
            _ => high,
        };
        let bands = u64::from(tall.div_ceil(high));
        let across = u64::from(columns.div_ceil(wide));
        let tasks = across * u64::from(rows.div_ceil(tall)) * bands;
        let workers = if self.is_kept() {
            1
        } else {
            usize::try_from(BUDGET_BYTES / self.worker_bytes().max(1)).unwrap_or(1)
        };
        each_task(
            tasks,
            workers.max(1),
            || Ok(Vec::new()),
            |samples, task| {
                let (chunk, band) = (task / bands, (task % bands) as u32);
                // Both lie in the grid, whose sides are 31-bit.
                let (col, first) = ((chunk % across) as u32 * wide, (chunk / across) as u32 * tall);
                let row = first + band * high;
                let end = (first + tall).min(rows);
                if row >= end {
                    return Ok(());
                }
                let window = Window { col, row, width: wide.min(columns - col), height: high.min(end - row) };
                self.read(path, &file, window, samples)?;
                let handed =
                    Window { col: window.row, row: window.col, width: window.height, height: window.width };
                sink.put(if self.is_transposed { handed } else { window }, samples)
            },
        )
    }

    /// Reads a window as it lies in the variable.
    fn read(
        &self,
        path: &Path,
        file: &NcFile,
        window: Window,
        samples: &mut Vec<f64>,
    ) -> Result<(), LayoutError> {
        let slice = |start: u64, count: u64| NcSliceInfoElem::Slice { start, end: start + count, step: 1 };
        let Window { col, row, width, height } = window;
        let selections = if self.is_flat {
            // Whole rows, for there are no chunks.
            let from = u64::from(row) * u64::from(self.stored[0]) + u64::from(col);
            vec![slice(from, u64::from(width) * u64::from(height))]
        } else {
            let leading = self.leading.iter().map(|at| NcSliceInfoElem::Index(*at));
            leading.chain([slice(row.into(), height.into()), slice(col.into(), width.into())]).collect()
        };
        let name = format!("variable \"{}\", row {row}", harmless(&self.place, 40));
        let selection = NcSliceInfo { selections };
        let read = file::guarded(path, &name, || file.read_variable_slice_as_f64(&self.place, &selection))?;
        let values =
            read.as_slice().filter(|values| values.len() as u64 == u64::from(width) * u64::from(height));
        let Some(values) = values else {
            return Err(LayoutError::damaged(
                path,
                name,
                "its structure is damaged; fetch or write the file again",
            ));
        };
        let meant = |value: f64| if value < 0.0 { value + self.wrap } else { value };
        samples.clear();
        if self.is_transposed {
            let (width, height) = (width as usize, height as usize);
            samples.extend(
                (0..width).flat_map(|col| (0..height).map(move |row| meant(values[row * width + col]))),
            );
        } else {
            samples.extend(values.iter().map(|value| meant(*value)));
        }
        Ok(())
    }
}

/// Columns and rows of the chunks that a variable of HDF5 is packed in, and the bytes of one.
fn chunk(
    path: &Path,
    place: &str,
    is_flat: bool,
    [columns, rows]: [u32; 2],
    sample_bytes: u64,
) -> Result<Option<([u32; 2], u64)>, LayoutError> {
    let storage = file::storage(path, Purpose::Look)?;
    let is_hdf5 = storage.read_range(0, 4).is_ok_and(|head| &head[..] == b"\x89HDF");
    if !is_hdf5 {
        return Ok(None);
    }
    let place_shown = format!("variable \"{}\"", harmless(place, 40));
    let sides = guard(
        path,
        || place_shown.clone(),
        || {
            let options = hdf5_reader::OpenOptions::default().with_chunk_cache_bytes(0);
            let file = hdf5_reader::Hdf5File::from_storage_with_options(storage, options);
            let sides = file.and_then(|file| file.dataset(place)).map(|dataset| dataset.chunks());
            sides.map_err(|error| file::hdf5_in_words(path, &place_shown, error))
        },
    )?;
    let Some(sides) = sides else { return Ok(None) };
    let bytes = sides.iter().fold(sample_bytes, |bytes, side| bytes.saturating_mul(u64::from(*side)));
    let sides = match sides[..] {
        // Of a list of samples whole rows are read, whatever it is packed in.
        _ if is_flat => [columns, 1],
        [.., high, wide] => [wide.clamp(1, columns), high.clamp(1, rows)],
        _ => [columns, 1],
    };
    Ok(Some((sides, bytes)))
}
