//! Large squares of a grid, and which of them anything lies in: what lies between is passed over as a whole.
//!
//! Memory: some 12 bytes a cell with something in it. Cost: a look at each block of cells with something in them, and at the larger squares around these.

use crate::parallel::each_task;
use std::collections::HashSet;
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;

/// Binary logarithm of the side of a cell of samples.
const CELL_LOG2: u32 = 11;
/// Side of a cell of samples.
pub(crate) const CELL: u32 = 1 << CELL_LOG2;

/// The cells of a grid that something lies in.
#[derive(Debug)]
pub(crate) struct Cells {
    side_log2: u32,
    met: HashSet<[u32; 2]>,
}

impl Default for Cells {
    /// Cells of samples.
    fn default() -> Self {
        Self::of(CELL_LOG2)
    }
}

impl Cells {
    /// Cells of a side whose binary logarithm is told, below 32.
    pub(crate) fn of(side_log2: u32) -> Self {
        Self { side_log2, met: HashSet::new() }
    }

    /// Side of a cell.
    pub(crate) fn side(&self) -> u32 {
        1 << self.side_log2
    }

    /// Something lies from one column and row to others, which are not included.
    pub(crate) fn add(&mut self, from: [u32; 2], to: [u32; 2]) {
        if (0..2).all(|i| from[i] < to[i]) {
            let span = |i: usize| from[i] >> self.side_log2..=(to[i] - 1) >> self.side_log2;
            self.met.extend(span(1).flat_map(|y| span(0).map(move |x| [x, y])));
        }
    }

    /// Whether a window of the grid, which may lie beyond it in part, touches any.
    pub(crate) fn touch(&self, from: [i64; 2], size: [u32; 2]) -> bool {
        let cell = |v: i64| (v.clamp(0, i64::from(u32::MAX)) >> self.side_log2) as u32;
        let span = [0, 1].map(|i| cell(from[i])..=cell(from[i] + i64::from(size[i]) - 1));
        let count: u64 = span.iter().map(|span| u64::from(span.end() - span.start()) + 1).product();
        if count > self.met.len() as u64 {
            return self.met.iter().any(|cell| (0..2).all(|i| span[i].contains(&cell[i])));
        }
        span[1].clone().any(|y| span[0].clone().any(|x| self.met.contains(&[x, y])))
    }
}

/// The cells of a grid that `is_met` says something may lie in, row by row; `pass` is called with windows that are made of the others. `is_met` is asked of the whole grid first, then of halves.
pub(crate) fn cells_met(
    [wide, high]: [u32; 2],
    cell: u32,
    is_met: impl Fn(Window) -> Result<bool, LayoutError>,
    pass: impl Fn(Window) -> Result<(), LayoutError>,
) -> Result<Vec<Window>, LayoutError> {
    let mut met: Vec<Window> = Vec::new();
    let mut waiting = vec![Window { col: 0, row: 0, width: wide, height: high }];
    while let Some(window) = waiting.pop() {
        let Window { col, row, width, height } = window;
        if !is_met(window)? {
            pass(window)?;
        } else if width.max(height) <= cell {
            met.push(window);
        } else {
            // In halves of whole cells.
            let half = |side: u32| (side.div_ceil(cell) / 2).max(1) * cell;
            if width >= height {
                let left = half(width);
                waiting.push(Window { width: left, ..window });
                waiting.push(Window { col: col + left, width: width - left, ..window });
            } else {
                let upper = half(height);
                waiting.push(Window { height: upper, ..window });
                waiting.push(Window { row: row + upper, height: height - upper, ..window });
            }
        }
    }
    met.sort_unstable_by_key(|cell| (cell.row, cell.col));
    Ok(met)
}

/// Calls `make` with every block, of at most `size` columns and rows, of those cells of a grid that `is_met` says something may lie in, on all threads, each with a state of its own; and `pass` with windows
/// that are made of the others, as [`cells_met`] finds them. The sides of blocks divide that of a cell.
pub(crate) fn each_block_met<S>(
    [wide, high]: [u32; 2],
    size: [u32; 2],
    cell: u32,
    is_met: impl Fn(Window) -> bool,
    pass: impl Fn(Window) -> Result<(), LayoutError>,
    open: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, Window) -> Result<(), LayoutError> + Sync,
) -> Result<(), LayoutError> {
    debug_assert!(size.iter().all(|side| cell.is_multiple_of(*side)));
    let mut met = cells_met([wide, high], cell, |window| Ok(is_met(window)), pass)?;
    // Cells side by side are one, so that the order of blocks is that of rows.
    met.dedup_by(|cell, last| {
        let is_beside = cell.row == last.row && cell.col == last.col + last.width;
        last.width += if is_beside { cell.width } else { 0 };
        is_beside
    });
    let blocks =
        |cells: &Window| u64::from(cells.width.div_ceil(size[0])) * u64::from(cells.height.div_ceil(size[1]));
    let mut all = 0;
    let firsts: Vec<u64> = met
        .iter()
        .map(|cells| {
            all += blocks(cells);
            all - blocks(cells)
        })
        .collect();
    each_task(
        all,
        usize::MAX,
        || Ok(open()),
        |state, block| {
            let at = firsts.partition_point(|first| *first <= block) - 1;
            let (cells, block) = (&met[at], block - firsts[at]);
            let across = u64::from(cells.width.div_ceil(size[0]));
            // Both products stay below the sides of the cells.
            let (col, row) = ((block % across) as u32 * size[0], (block / across) as u32 * size[1]);
            let block = Window {
                col: cells.col + col,
                row: cells.row + row,
                width: size[0].min(cells.width - col),
                height: size[1].min(cells.height - row),
            };
            make(state, block)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn windows_touch_the_cells_of_files_and_no_others() {
        let cells = Cells { met: [[0, 0], [3, 5]].into(), ..Cells::default() };
        assert!(cells.touch([2047, 2047], [1, 1]) && !cells.touch([2048, 0], [4096, 5000]));
        assert!(cells.touch([6143, 10_239], [2, 2]) && !cells.touch([6143, 10_239], [1, 2]));
        assert!(cells.touch([-500, -500], [501, 501]) && cells.touch([-500, 0], [100_000, 1]));
    }

    /// Every sample is in one window, those of cells that are met in a block and the others passed over.
    #[test]
    fn blocks_and_what_is_passed_over_make_up_the_grid() {
        for grid in [[5000, 4500], [2048, 2048], [1, 7], [6200, 300], [300, 9000]] {
            for met in [vec![], vec![[0, 0]], vec![[0, 0], [1, 0], [2, 1]], vec![[1, 1], [0, 4]]] {
                let mut cells = Cells::default();
                met.iter().for_each(|[x, y]| cells.add([x * CELL, y * CELL], [x * CELL + 1, y * CELL + 9]));
                for size in [[2048, 32], [256, 256]] {
                    let is_met = |w: Window| cells.touch([w.col.into(), w.row.into()], [w.width, w.height]);
                    let seen = Mutex::new(vec![0u8; (grid[0] * grid[1]) as usize]);
                    let note = |window: Window, as_block: bool| {
                        let mut seen = seen.lock().unwrap();
                        for row in window.row..window.row + window.height {
                            let from = (row * grid[0] + window.col) as usize;
                            let places = &mut seen[from..from + window.width as usize];
                            places.iter_mut().for_each(|place| *place += 1 + u8::from(as_block));
                        }
                        Ok(())
                    };
                    let make = |(): &mut (), window: Window| {
                        assert!(window.width <= size[0] && window.height <= size[1]);
                        note(window, true)
                    };
                    each_block_met(grid, size, CELL, is_met, |window| note(window, false), || (), make)
                        .unwrap();
                    for (at, seen) in (0u32..).zip(seen.into_inner().unwrap()) {
                        let cell = [at % grid[0] / CELL, at / grid[0] / CELL];
                        assert_eq!(seen, 1 + u8::from(met.contains(&cell)), "{cell:?} {grid:?}");
                    }
                }
            }
        }
    }
}
