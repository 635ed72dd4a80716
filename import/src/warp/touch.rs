//! Which windows of the new grid may hold anything, found without a look at each sample.
//!
//! Places are computed on a mesh; between its nodes they lie no farther from the nearest than that from its neighbours. Columns that go around the globe are counted on over its seam, as long as nodes lie
//! near each other; where they do not, as at a pole, a window may hold anything.

use super::Resampler;
use super::rim;
use crate::cells::Cells;
use terrasoar_layout::dem::Window;

/// Nodes a side of a window.
const NODES: usize = 9;
type Nodes = [[[f64; 2]; NODES]; NODES];

impl Resampler {
    /// Whether new samples of a window may be made of old ones in `cells`.
    pub(crate) fn may_touch(&self, window: Window, cells: &Cells) -> bool {
        let first = [f64::from(window.col) - 0.5, f64::from(window.row) - 0.5];
        let step = [window.width, window.height].map(|side| f64::from(side) / (NODES - 1) as f64);
        let mut places: Nodes = std::array::from_fn(|y| {
            std::array::from_fn(|x| {
                self.mapping.place([first[0] + x as f64 * step[0], first[1] + y as f64 * step[1]])
            })
        });
        if places.as_flattened().as_flattened().iter().any(|value| !value.is_finite()) {
            return true;
        }
        let around = self.kernel.wraps.then(|| self.kernel.samples[0]);
        if around.is_some_and(|around| !unrolled(&mut places, around.into())) {
            return true;
        }
        let Some((low, high)) = rim(places.iter().flatten()) else { return true };
        let reach = self.kernel.reach();
        let span: [[f64; 2]; 2] = std::array::from_fn(|i| {
            let apart = |a: [f64; 2], b: [f64; 2]| (a[i] - b[i]).abs();
            let along = places.iter().flat_map(|row| row.windows(2)).map(|two| apart(two[0], two[1]));
            let across =
                places.windows(2).flat_map(|two| two[0].iter().zip(&two[1])).map(|(a, b)| apart(*a, *b));
            let margin = along.chain(across).fold(0.0, f64::max) + reach[i] + 1.0;
            [low[i] - margin, high[i] + margin]
        });
        let clamped = |[from, to]: [f64; 2]| {
            let [from, to] = [from, to].map(|value| value.clamp(-1.0, 4.0e9) as i64);
            (from, (to - from + 1) as u32)
        };
        let (row, high) = clamped(span[1]);
        let touch = |(column, wide): (i64, u32)| cells.touch([column, row], [wide, high]);
        let [west, east] = span[0];
        match around {
            None => touch(clamped(span[0])),
            Some(around) if east - west + 1.0 >= around.into() => touch((0, around)),
            Some(around) => {
                // What reaches over the seam lies at the other end.
                let west = west.floor() as i64;
                let wide = east.ceil() as i64 - west + 1;
                let from = west.rem_euclid(around.into());
                let rest = i64::from(around) - from;
                touch((from, wide.min(rest) as u32)) || wide > rest && touch((0, (wide - rest) as u32))
            }
        }
    }
}

/// Counts columns on from node to node, so that none is more than half of all `around` away from its neighbour; whether all of them are much nearer, and so nothing is in doubt.
fn unrolled(places: &mut Nodes, around: f64) -> bool {
    let mut is_sure = true;
    for y in 0..NODES {
        for x in 0..NODES {
            let before = match (x, y) {
                (0, 0) => continue,
                (0, _) => places[y - 1][0][0],
                _ => places[y][x - 1][0],
            };
            let column = &mut places[y][x][0];
            *column -= around * ((*column - before) / around).round();
            is_sure &= (*column - before).abs() <= around / 8.0;
        }
    }
    // Neighbours across are led to on two ways, which a pole between them would tell apart.
    let across = places.windows(2).flat_map(|two| two[0].iter().zip(&two[1]));
    is_sure && across.into_iter().all(|(a, b)| (a[0] - b[0]).abs() <= around / 8.0)
}
