//! The second pass over an XYZ file: every point to its sample.
//!
//! Points are read by all threads and placed in order by one. A sample has a point if it is not NaN. So a point whose height is NaN counts as no point.

use super::XyzDem;
use super::line::is_passed_over;
use super::survey::Order;
use crate::WINDOW_SAMPLES;
use crate::text::{Cut, each_block};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Samples that are held while points come in any order, and while columns are gathered.
const STRIP_SAMPLES: u64 = 8 << 20;
const COLUMN_SAMPLES: u64 = 1 << 20;

/// A point at its sample: column, row from the north, height.
type Placed = (u32, u32, f64);

/// Memory of the pass.
pub(super) fn memory_bytes(dem: &XyzDem) -> u64 {
    let [wide, high] = dem.declared.samples.map(u64::from);
    let samples = match dem.survey.order {
        Order::Rows => wide,
        Order::Columns => COLUMN_SAMPLES.max(high),
        Order::Any => STRIP_SAMPLES.max(wide).min(wide * high),
    };
    8 * samples
}

impl XyzDem {
    /// Takes every point of the file, in order.
    fn each_point(
        &self,
        mut take: impl FnMut(Placed) -> Result<(), LayoutError> + Send,
    ) -> Result<(), LayoutError> {
        let changed =
            || LayoutError::damaged(&self.path, "points", "the file changed while it was read; start again");
        let place = |line: &[u8]| {
            let [x, y, z] = self.format.point(line)?;
            let [across, up] = self.survey.axes;
            let row = up.count - 1 - up.place(y)?;
            Some((across.place(x)?, row, f64::from(z as f32)))
        };
        let work = |block: &[u8]| {
            let lines = block.split(|byte| *byte == b'\n' || *byte == b'\r');
            lines.filter(|line| !is_passed_over(line)).map(place).collect::<Option<Vec<Placed>>>()
        };
        each_block(&self.path, &mut self.points()?, Cut::Lines, work, |points| {
            points.ok_or_else(changed)?.into_iter().try_for_each(&mut take)
        })
    }

    /// Puts a height where none or the same is.
    fn set(&self, sample: &mut f64, (column, row, height): Placed) -> Result<(), LayoutError> {
        if !sample.is_nan() && !height.is_nan() && *sample != height {
            let [x, y] = self.survey.axes;
            let (east, north) =
                (x.first + f64::from(column) * x.step, y.first + f64::from(y.count - 1 - row) * y.step);
            return Err(LayoutError::damaged(
                &self.path,
                format!("the point at {east}, {north}"),
                format!(
                    "it has two heights, {sample} and {height}: the points are scattered, or two files were joined; leave one point for each place"
                ),
            ));
        }
        if sample.is_nan() {
            *sample = height;
        }
        Ok(())
    }
}

/// Points that come row by row, from whatever side.
pub(super) fn rows(dem: &XyzDem, sink: &dyn SampleSink) -> Result<(), LayoutError> {
    let [width, high] = dem.declared.samples;
    let mut heights = vec![f64::NAN; width as usize];
    let mut is_done = vec![false; high as usize];
    let mut current = None;
    let window = |row| Window { col: 0, row, width, height: 1 };
    dem.each_point(|point| {
        let row = point.1;
        if current != Some(row) {
            if let Some(last) = current {
                sink.put(window(last), &heights)?;
                heights.fill(f64::NAN);
            }
            if std::mem::replace(&mut is_done[row as usize], true) {
                return Err(LayoutError::damaged(
                    &dem.path,
                    "points",
                    "the file changed while it was read; start again",
                ));
            }
            current = Some(row);
        }
        dem.set(&mut heights[point.0 as usize], point)
    })?;
    if let Some(last) = current {
        sink.put(window(last), &heights)?;
    }
    let gaps = (0..high).filter(|row| !is_done[*row as usize]);
    gaps.into_iter().try_for_each(|row| sink.put_void(window(row)))
}

/// Points that come column by column, from whatever side: neighbours are gathered and turned.
pub(super) fn columns(dem: &XyzDem, sink: &dyn SampleSink) -> Result<(), LayoutError> {
    let [wide, high] = dem.declared.samples;
    let most = (COLUMN_SAMPLES / u64::from(high)).clamp(1, u64::from(wide)) as usize;
    let mut gathered = Gathered { high: high as usize, columns: Vec::new(), heights: Vec::new() };
    let mut is_done = vec![false; wide as usize];
    dem.each_point(|point| {
        let column = point.0;
        if gathered.columns.last() != Some(&column) {
            let is_next = gathered.columns.last().is_some_and(|last| last.abs_diff(column) == 1);
            let keeps_on = match gathered.columns.as_slice() {
                [.., a, b] => (*b > *a) == (column > *b),
                _ => true,
            };
            if gathered.columns.len() == most || !is_next || !keeps_on {
                gathered.hand_on(sink)?;
            }
            if std::mem::replace(&mut is_done[column as usize], true) {
                return Err(LayoutError::damaged(
                    &dem.path,
                    "points",
                    "the file changed while it was read; start again",
                ));
            }
            gathered.columns.push(column);
            gathered.heights.resize(gathered.columns.len() * gathered.high, f64::NAN);
        }
        let at = (gathered.columns.len() - 1) * gathered.high + point.1 as usize;
        dem.set(&mut gathered.heights[at], point)
    })?;
    gathered.hand_on(sink)?;
    let gaps = (0..wide).filter(|column| !is_done[*column as usize]);
    gaps.into_iter().try_for_each(|col| sink.put_void(Window { col, row: 0, width: 1, height: high }))
}

/// Columns that lie side by side, each from north to south.
struct Gathered {
    high: usize,
    columns: Vec<u32>,
    heights: Vec<f64>,
}

impl Gathered {
    fn hand_on(&mut self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let (Some(first), Some(last)) = (self.columns.first().copied(), self.columns.last().copied()) else {
            return Ok(());
        };
        let (width, high) = (self.columns.len(), self.high);
        let is_eastward = first <= last;
        let rows = (WINDOW_SAMPLES as usize / width).clamp(1, high);
        let mut turned = Vec::new();
        for row in (0..high).step_by(rows) {
            let height = rows.min(high - row);
            turned.clear();
            turned.resize(width * height, 0.0);
            for (i, column) in self.heights.chunks_exact(high).enumerate() {
                let across = if is_eastward { i } else { width - 1 - i };
                let part = &column[row..row + height];
                turned.iter_mut().skip(across).step_by(width).zip(part).for_each(|(to, from)| *to = *from);
            }
            // All are sides of the grid, or parts of them.
            let window =
                Window { col: first.min(last), row: row as u32, width: width as u32, height: height as u32 };
            sink.put(window, &turned)?;
        }
        self.columns.clear();
        self.heights.clear();
        Ok(())
    }
}

/// Points that come in any order: the file is read once for each strip of rows.
pub(super) fn strips(dem: &XyzDem, sink: &dyn SampleSink) -> Result<(), LayoutError> {
    let [width, high] = dem.declared.samples;
    let rows = (STRIP_SAMPLES / u64::from(width)).clamp(1, u64::from(high)) as u32;
    for first in (0..high).step_by(rows as usize) {
        let height = rows.min(high - first);
        let mut heights = vec![f64::NAN; width as usize * height as usize];
        dem.each_point(|point| {
            let Some(row) = point.1.checked_sub(first).filter(|row| *row < height) else { return Ok(()) };
            dem.set(&mut heights[row as usize * width as usize + point.0 as usize], point)
        })?;
        let at_once = (WINDOW_SAMPLES / u64::from(width)).max(1) as usize * width as usize;
        for (i, part) in heights.chunks(at_once).enumerate() {
            // Rows of the strip.
            let (row, height) = ((i * at_once / width as usize) as u32, (part.len() / width as usize) as u32);
            sink.put(Window { col: 0, row: first + row, width, height }, part)?;
        }
    }
    Ok(())
}
