//! How a grid lies: which way its rows and columns run on the ground, and the samples turned so that rows run from north to south and columns from west to east.
//!
//! A grid along the axes is turned exactly, window by window: mirrored, flipped, or with rows for columns. Any other is resampled. "Along" means that no sample leaves its
//! row or column by more than a hundredth of a step over the whole grid. Cost: a copy of each window that is turned.

use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::atan2;

/// Largest departure from the axes, in steps over the whole grid.
const ALONG_STEPS: f64 = 0.01;

/// How a grid along the axes is turned: first rows for columns, then from the other side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Turn {
    pub(crate) transpose: bool,
    /// Columns run from east to west.
    pub(crate) mirror: bool,
    /// Rows run from south to north.
    pub(crate) flip: bool,
}

/// How a grid lies on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Lie {
    /// Along the axes.
    Along(Turn),
    /// Turned or sheared.
    Across,
}

impl Lie {
    /// The lie of a grid of `samples` (columns, rows) with the affine `map` of its file; `signs` are those of the system's axes.
    pub(crate) fn of(map: &[f64; 6], signs: [f64; 2], samples: [u32; 2]) -> Self {
        let [columns, rows] = samples.map(|count| f64::from(count.max(2) - 1));
        let column = [signs[0] * map[1], signs[1] * map[4]];
        let row = [signs[0] * map[2], signs[1] * map[5]];
        let along = |column: [f64; 2], row: [f64; 2]| {
            (column[1] * columns).abs() <= ALONG_STEPS * row[1].abs()
                && (row[0] * rows).abs() <= ALONG_STEPS * column[0].abs()
                && column[0] != 0.0
                && row[1] != 0.0
        };
        if along(column, row) {
            return Self::Along(Turn { transpose: false, mirror: column[0] < 0.0, flip: row[1] > 0.0 });
        }
        let stands = (column[0] * columns).abs() <= ALONG_STEPS * row[0].abs()
            && (row[1] * rows).abs() <= ALONG_STEPS * column[1].abs()
            && column[1] != 0.0
            && row[0] != 0.0;
        if stands {
            return Self::Along(Turn { transpose: true, mirror: row[0] < 0.0, flip: column[1] > 0.0 });
        }
        Self::Across
    }
}

impl Turn {
    /// Whether nothing is turned.
    pub(crate) fn is_none(self) -> bool {
        self == Self::default()
    }

    /// What is done, in words; empty for nothing.
    pub(crate) fn words(self) -> &'static str {
        match (self.transpose, self.mirror, self.flip) {
            (false, false, false) => "",
            (false, false, true) => "its rows run from south to north and were turned",
            (false, true, false) => "its columns run from east to west and were turned",
            (false, true, true) => "it lies upside down and was turned",
            (true, ..) => "its rows and columns were exchanged, for rows run along the meridian",
        }
    }

    /// Columns and rows once turned.
    pub(crate) fn samples(self, [columns, rows]: [u32; 2]) -> [u32; 2] {
        if self.transpose { [rows, columns] } else { [columns, rows] }
    }

    /// The map of the turned grid, exactly along the axes.
    pub(crate) fn map(self, map: [f64; 6], samples: [u32; 2]) -> [f64; 6] {
        let [x, a, b, y, d, e] = map;
        let mut map = if self.transpose { [x, b, a, y, e, d] } else { [x, a, b, y, d, e] };
        let [columns, rows] = self.samples(samples).map(|count| f64::from(count - 1));
        if self.mirror {
            map = [map[0] + map[1] * columns, -map[1], map[2], map[3] + map[4] * columns, -map[4], map[5]];
        }
        if self.flip {
            map = [map[0] + map[2] * rows, map[1], -map[2], map[3] + map[5] * rows, map[4], -map[5]];
        }
        map
    }

    /// The window of the turned grid that `window` of the file becomes.
    fn window(self, window: Window, samples: [u32; 2]) -> Window {
        let [columns, rows] = self.samples(samples);
        let mut turned = match self.transpose {
            false => window,
            true => Window { col: window.row, row: window.col, width: window.height, height: window.width },
        };
        if self.mirror {
            turned.col = columns - turned.col - turned.width;
        }
        if self.flip {
            turned.row = rows - turned.row - turned.height;
        }
        turned
    }

    /// The samples of a window of the file, in the order of the turned grid.
    fn samples_of(self, window: Window, samples: &[f64], turned: &mut Vec<f64>) {
        let (width, height) = (window.width as usize, window.height as usize);
        let (wide, high) = if self.transpose { (height, width) } else { (width, height) };
        turned.clear();
        turned.reserve(samples.len());
        for row in 0..high {
            let row = if self.flip { high - 1 - row } else { row };
            if !self.transpose {
                let from = &samples[row * width..(row + 1) * width];
                match self.mirror {
                    false => turned.extend_from_slice(from),
                    true => turned.extend(from.iter().rev()),
                }
                continue;
            }
            for column in 0..wide {
                let column = if self.mirror { wide - 1 - column } else { column };
                turned.push(samples[column * width + row]);
            }
        }
    }
}

/// Passes windows on, turned.
pub(crate) struct Turning<'a> {
    pub(crate) turn: Turn,
    /// Columns and rows of the file.
    pub(crate) samples: [u32; 2],
    pub(crate) sink: &'a dyn SampleSink,
}

impl Turning<'_> {
    /// Whether the window lies in the file.
    fn check(&self, window: Window) -> Result<(), LayoutError> {
        let inside = window.col.checked_add(window.width).is_some_and(|end| end <= self.samples[0])
            && window.row.checked_add(window.height).is_some_and(|end| end <= self.samples[1]);
        if inside {
            return Ok(());
        }
        Err(LayoutError::Usage("a window of samples does not lie in the elevation model".into()))
    }
}

impl SampleSink for Turning<'_> {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.check(window)?;
        let mut turned = Vec::new();
        self.turn.samples_of(window, samples, &mut turned);
        self.sink.put(self.turn.window(window, self.samples), &turned)
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.check(window)?;
        self.sink.put_void(self.turn.window(window, self.samples))
    }
}

/// Degrees by which a grid is turned against north, counterclockwise.
pub(crate) fn turned_by(map: &[f64; 6], signs: [f64; 2]) -> f64 {
    atan2(signs[1] * map[4], signs[0] * map[1]).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    struct Grid(Mutex<Vec<f64>>, u32);

    impl SampleSink for Grid {
        fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
            let mut grid = self.0.lock().unwrap();
            for (row, values) in samples.chunks_exact(window.width as usize).enumerate() {
                let at = (window.row as usize + row) * self.1 as usize + window.col as usize;
                grid[at..at + values.len()].copy_from_slice(values);
            }
            Ok(())
        }
    }

    /// A plane over the ground, laid out in all eight ways in windows of several sizes, comes back the same.
    #[test]
    fn all_eight_ways_come_back() {
        let [wide, high] = [7u32, 5u32];
        let height = |x: f64, y: f64| 100.0 + 3.0 * x / 10.0 + 7.0 * y / 20.0;
        for way in 0..8 {
            let (transpose, mirror, flip) = (way & 4 != 0, way & 1 != 0, way & 2 != 0);
            let samples = if transpose { [high, wide] } else { [wide, high] };
            // Of the ground: x from 500 in tens, y from 900 downward in twenties.
            let [mut x0, mut dx, mut y0, mut dy] = [500.0, 10.0, 900.0, -20.0];
            if mirror {
                (x0, dx) = (x0 + dx * f64::from(wide - 1), -dx);
            }
            if flip {
                (y0, dy) = (y0 + dy * f64::from(high - 1), -dy);
            }
            let map = if transpose { [x0, 0.0, dx, y0, dy, 0.0] } else { [x0, dx, 0.0, y0, 0.0, dy] };
            let Lie::Along(turn) = Lie::of(&map, [1.0; 2], samples) else { panic!("{way}") };
            assert_eq!(turn, Turn { transpose, mirror, flip });
            assert_eq!(turn.samples(samples), [wide, high]);
            let turned = turn.map(map, samples);
            assert_eq!(turned.map(|m| m + 0.0), [500.0, 10.0, 0.0, 900.0, 0.0, -20.0]);
            let grid = Grid(Mutex::new(vec![f64::NAN; 35]), wide);
            let turning = Turning { turn, samples, sink: &grid };
            for col in (0..samples[0]).step_by(3) {
                for row in (0..samples[1]).step_by(2) {
                    let window =
                        Window { col, row, width: 3.min(samples[0] - col), height: 2.min(samples[1] - row) };
                    let values: Vec<f64> = (0..window.height)
                        .flat_map(|r| {
                            (0..window.width).map(move |c| (f64::from(col + c), f64::from(row + r)))
                        })
                        .map(|(c, r)| {
                            height(map[0] + map[1] * c + map[2] * r, map[3] + map[4] * c + map[5] * r)
                        })
                        .collect();
                    turning.put(window, &values).unwrap();
                }
            }
            for (at, value) in grid.0.into_inner().unwrap().into_iter().enumerate() {
                let (c, r) = ((at % 7) as f64, (at / 7) as f64);
                assert!((value - height(500.0 + 10.0 * c, 900.0 - 20.0 * r)).abs() < 1e-9, "{way}: {at}");
            }
        }
    }

    #[test]
    fn what_is_turned_or_sheared_is_across() {
        let (sin, cos) = 30f64.to_radians().sin_cos();
        let turned = [0.0, 10.0 * cos, 10.0 * sin, 0.0, 10.0 * sin, -10.0 * cos];
        assert_eq!(Lie::of(&turned, [1.0; 2], [41, 31]), Lie::Across);
        assert!((turned_by(&turned, [1.0; 2]) - 30.0).abs() < 1e-9);
        assert_eq!(Lie::of(&[0.0, 10.0, 0.01, 0.0, 0.0, -10.0], [1.0; 2], [41, 31]), Lie::Across);
        assert_eq!(
            Lie::of(&[0.0, 10.0, 1e-9, 0.0, 0.0, -10.0], [1.0; 2], [41, 31]),
            Lie::Along(Turn::default())
        );
        // Axes to the west and south: what looks north-up lies upside down.
        let turn = Turn { transpose: false, mirror: true, flip: true };
        assert_eq!(Lie::of(&[0.0, 10.0, 0.0, 0.0, 0.0, -10.0], [-1.0; 2], [41, 31]), Lie::Along(turn));
    }
}
