//! Texels of a picture by place: kept while they stream, in memory where they are few, else in a nameless temporary file.
//!
//! Cost: each texel written once, and read once for each window that it lies in.

use crate::kept::Kept;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::RowReader;

/// Most bytes kept in memory.
const MOST_HELD: u64 = 64 << 20;
/// Rows read at once.
const ROWS: usize = 64;

/// All texels of a picture.
pub(super) struct Texels {
    wide: u32,
    high: u32,
    kept: Kept,
}

impl Texels {
    /// Memory that so many texels take.
    pub(super) fn memory_bytes([wide, high]: [u32; 2]) -> u64 {
        let all = u64::from(wide) * u64::from(high) * 4;
        let band = u64::from(wide) * 4 * ROWS as u64;
        if all <= MOST_HELD { all + band } else { band }
    }

    /// Reads all rows.
    pub(super) fn keep(rows: &mut dyn RowReader, [wide, high]: [u32; 2]) -> Result<Self, LayoutError> {
        let row_bytes = wide as usize * 4;
        let all = row_bytes as u64 * u64::from(high);
        let kept = Kept::new(
            all,
            all <= MOST_HELD,
            &std::env::temp_dir(),
            "cannot keep the picture in a temporary file in",
        )?;
        let mut band = vec![0; row_bytes * ROWS];
        for first in (0..high as usize).step_by(ROWS) {
            let band = &mut band[..row_bytes * ROWS.min(high as usize - first)];
            rows.read(band)?;
            kept.write((first * row_bytes) as u64, band)?;
        }
        Ok(Self { wide, high, kept })
    }

    /// Columns `first[0]` on and rows `first[1]` on, `size` of them; columns are counted around the picture if it `wraps`, and what is outside is transparent.
    pub(super) fn window(
        &self,
        first: [i64; 2],
        size: [usize; 2],
        wraps: bool,
    ) -> Result<Window, LayoutError> {
        let (wide, high) = (i64::from(self.wide), i64::from(self.high));
        let mut texels = vec![[0; 4]; size[0] * size[1]];
        let mut buffer = Vec::new();
        for (line, row) in texels.chunks_exact_mut(size[0].max(1)).zip(first[1]..) {
            if !(0..high).contains(&row) {
                continue;
            }
            let at = row as u64 * u64::from(self.wide) * 4;
            self.kept.read(at, self.wide as usize * 4, &mut buffer, |stored| {
                let (stored, _) = stored.as_chunks::<4>();
                for (to, col) in line.iter_mut().zip(first[0]..) {
                    let col = if wraps { col.rem_euclid(wide) } else { col };
                    if (0..wide).contains(&col) {
                        *to = stored[col as usize];
                    }
                }
            })?;
        }
        Ok(Window { first, size, texels })
    }
}

/// Texels around a place.
pub(super) struct Window {
    first: [i64; 2],
    size: [usize; 2],
    texels: Vec<[u8; 4]>,
}

impl Window {
    fn at(&self, col: i64, row: i64) -> [u8; 4] {
        let (col, row) = (col - self.first[0], row - self.first[1]);
        let is_in = (0..self.size[0] as i64).contains(&col) && (0..self.size[1] as i64).contains(&row);
        if is_in { self.texels[row as usize * self.size[0] + col as usize] } else { [0; 4] }
    }

    /// The colour at a place between texel centres: bilinear, colours weighed by their alpha, so that nothing of what is hidden shows.
    pub(super) fn mixed(&self, [x, y]: [f64; 2]) -> [u8; 4] {
        let (col, row) = (x.floor(), y.floor());
        let (right, below) = (x - col, y - row);
        let (mut sum, mut alphas) = ([0.0; 3], 0.0);
        for (dx, dy, weight) in [
            (0, 0, (1.0 - right) * (1.0 - below)),
            (1, 0, right * (1.0 - below)),
            (0, 1, (1.0 - right) * below),
            (1, 1, right * below),
        ] {
            let [r, g, b, a] = self.at(col as i64 + dx, row as i64 + dy).map(f64::from);
            for (sum, colour) in sum.iter_mut().zip([r, g, b]) {
                *sum += weight * a * colour;
            }
            alphas += weight * a;
        }
        // Half of the weight at least is on the picture, or the nearest texel is not.
        if alphas < 1e-6 {
            return [0; 4];
        }
        let [r, g, b] = sum.map(|sum| (sum / alphas).round() as u8);
        [r, g, b, alphas.round() as u8]
    }

    /// The texel nearest to a place.
    pub(super) fn nearest(&self, [x, y]: [f64; 2]) -> [u8; 4] {
        self.at((x + 0.5).floor() as i64, (y + 0.5).floor() as i64)
    }
}
