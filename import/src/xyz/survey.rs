//! A first pass over an XYZ file: the grid that its points make, and the order that they come in.
//!
//! Of every block of lines the distinct coordinates are found by the thread that reads it, and joined in order. Memory: the distinct coordinates, at most two times
//! [`MOST_SAMPLES`]. A file is refused as scattered as soon as it has more.

use super::lattice::{Axis, Distinct, MOST_SAMPLES, NoAxis};
use super::line::{Format, is_passed_over};
use crate::text::{Cut, each_block, shown};
use std::io::Read;
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Samples of the grid for each point that there is, at most: beyond that the points lie scattered.
const MOST_SAMPLES_A_POINT: u64 = 64;

/// How points follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// All points of a row come together.
    Rows,
    /// All points of a column come together.
    Columns,
    /// Any.
    Any,
}

/// What the first pass finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Survey {
    /// From west to east, and from south to north.
    pub(super) axes: [Axis; 2],
    pub(super) order: Order,
}

/// What is found in a block of lines.
#[derive(Default)]
struct Found {
    points: u64,
    distinct: [Distinct; 2],
    /// How often a coordinate is another than that of the point before.
    changes: [u64; 2],
    ends: Option<[[f64; 2]; 2]>,
    wrong: Option<String>,
}

impl Found {
    fn in_block(format: Format, block: &[u8]) -> Self {
        let mut found = Self::default();
        for line in block.split(|byte| *byte == b'\n' || *byte == b'\r') {
            if is_passed_over(line) {
                continue;
            }
            let Some([x, y, z]) = format.point(line) else {
                found.wrong = Some(shown(line));
                break;
            };
            if !f64::from(z as f32).is_infinite() {
                found.add([x, y]);
            } else {
                found.wrong = Some(shown(line));
                break;
            }
        }
        found
    }

    fn add(&mut self, point: [f64; 2]) {
        self.points += 1;
        let last = self.ends.map(|[_, last]| last);
        for (axis, coordinate) in point.into_iter().enumerate() {
            if last.is_none_or(|last| last[axis] != coordinate) {
                // Minus zero is zero.
                self.distinct[axis].insert((coordinate + 0.0).to_bits());
                self.changes[axis] += u64::from(last.is_some());
            }
        }
        self.ends = Some([self.ends.map_or(point, |[first, _]| first), point]);
    }

    fn join(&mut self, next: Self) {
        let Some([first, last]) = next.ends else { return };
        for axis in 0..2 {
            let is_new = self.ends.is_some_and(|[_, before]| before[axis] != first[axis]);
            self.changes[axis] += next.changes[axis] + u64::from(is_new);
            self.distinct[axis].extend(&next.distinct[axis]);
        }
        self.points += next.points;
        self.ends = Some([self.ends.map_or(first, |[first, _]| first), last]);
    }
}

impl Survey {
    /// Reads the lines of `file`, the rest of the file at `path`.
    pub(super) fn of(
        path: &Path,
        file: &mut (impl Read + Send),
        format: Format,
    ) -> Result<Self, LayoutError> {
        let mut all = Found::default();
        each_block(
            path,
            file,
            Cut::Lines,
            |block| Found::in_block(format, block),
            |mut found| {
                let wrong = found.wrong.take();
                all.join(found);
                if let Some(line) = wrong {
                    let place = format!("point {}", all.points + 1);
                    let problem = format!(
                        "\"{line}\" has no three numbers (east, north, height); mend the line, or take it out"
                    );
                    return Err(LayoutError::damaged(path, place, problem));
                }
                if all.distinct.iter().any(|distinct| distinct.len() > MOST_SAMPLES) {
                    return Err(scattered(path));
                }
                Ok(())
            },
        )?;
        let axes = [Axis::of(&all.distinct[0]), Axis::of(&all.distinct[1])];
        let axes = match axes {
            [Ok(x), Ok(y)] => [x, y],
            [Err(NoAxis::Line), _] | [_, Err(NoAxis::Line)] => {
                let problem = format!(
                    "its {} points lie in a line or in one place; a terrain needs at least 2 x 2",
                    all.points
                );
                return Err(LayoutError::unsupported(path, problem));
            }
            _ => return Err(scattered(path)),
        };
        if u64::from(axes[0].count) * u64::from(axes[1].count)
            > MOST_SAMPLES_A_POINT.saturating_mul(all.points)
        {
            return Err(scattered(path));
        }
        // Each row is one run exactly if there are as many runs as rows. A row whose coordinate is printed in two ways has two runs, or more.
        let runs = |axis: usize| all.changes[axis] + 1 == u64::from(axes[axis].occupied);
        let order = match (runs(1), runs(0)) {
            (true, _) => Order::Rows,
            (_, true) => Order::Columns,
            _ => Order::Any,
        };
        Ok(Self { axes, order })
    }
}

fn scattered(path: &Path) -> LayoutError {
    LayoutError::unsupported(
        path,
        "its points lie on no grid that runs east and north: they are scattered, or the grid is turned; make a grid of them first, for example with gdal_grid, \
         GMT's surface or PDAL's writers.gdal",
    )
}
