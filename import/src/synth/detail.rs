//! From the lattice of large forms to every sample.
//!
//! The lattice is interpolated by Catmull-Rom splines, and octaves of value noise are added, each on a
//! lattice twice as fine as the one before, until the lattice is the grid itself. Lattices and grid are
//! aligned and their ratio is a power of two, so the spline's weights are a small table and a row costs
//! four multiplications a sample and octave. An octave's amplitude follows its wavelength in metres,
//! `(wavelength)^H`, so the relief at a scale is the same at any spacing; the surface's fractal dimension is
//! `3 - H`. Cost: about 3 ns a sample and octave on one core.

use super::HEIGHT_SCALE;
use super::landscape::{CELLS, Landscape, POINTS};
use super::noise::{hash, signed_unit};
use terrasoar_layout::portable::pow;

/// Hurst exponent: dimension 2.15, as rough mountains are.
const H: f64 = 0.85;
/// Amplitude of the octave of wavelength [`REFERENCE_M`] at roughness 1.
const AMPLITUDE_M: f64 = 60.0;
/// Wavelength of the finest large forms at the extent they are made for.
const REFERENCE_M: f64 = FULL_EXTENT_M / CELLS as f64;
/// Extent whose heights are those of the large forms; narrower ones are lower.
const FULL_EXTENT_M: f64 = 163_840.0;

/// A terrain whose rows can be made in any order.
pub(super) struct Terrain {
    size: u32,
    seed: u32,
    landscape: Landscape,
    height_factor: f32,
    extent_m: f64,
}

/// Buffers of a worker.
#[derive(Default)]
pub(super) struct Scratch {
    heights: Vec<f32>,
    roughness: Vec<f32>,
    octave: Vec<f32>,
    lattice: Vec<f32>,
    column: Vec<f32>,
}

impl Terrain {
    /// The terrain of a checked size and spacing.
    pub(super) fn new(size: u32, seed: u64, spacing_m: f64) -> Self {
        let seed = hash(seed as u32, (seed >> 32) as u32, 0);
        let extent_m = f64::from(size - 1) * spacing_m;
        let height_factor = pow(extent_m / FULL_EXTENT_M, H).min(1.0) as f32;
        Self { size, seed, landscape: Landscape::new(seed), height_factor, extent_m }
    }

    /// Makes the rows from `first` that fit into `out`, in units of 0.1 m.
    pub(super) fn rows(&self, first: u32, out: &mut [u16], scratch: &mut Scratch) {
        let width = self.size as usize;
        let Scratch { heights, roughness, octave, lattice, column } = scratch;
        for buffer in [&mut *heights, &mut *roughness, &mut *octave] {
            buffer.clear();
            buffer.resize(out.len(), 0.0);
        }
        self.large(&self.landscape.heights_m, first, width, heights, column);
        self.large(&self.landscape.roughness, first, width, roughness, column);
        heights.iter_mut().for_each(|height| *height *= self.height_factor);

        let mut cells = CELLS * 2;
        while cells < self.size {
            let wavelength_m = self.extent_m / f64::from(cells);
            let amplitude_m = (AMPLITUDE_M * pow(wavelength_m / REFERENCE_M, H)) as f32;
            self.octave(cells, first, width, octave, lattice, column);
            if cells <= CELLS * 4 {
                // The crests of the large forms go on into the first octaves, and make the next ones stronger.
                for ((height, rough), noise) in
                    heights.iter_mut().zip(roughness.iter_mut()).zip(octave.iter())
                {
                    let crest = 0.5 - 1.4 * noise.abs();
                    *height += amplitude_m * *rough * crest;
                    *rough *= 1.0 + 0.5 * crest;
                }
            } else {
                for ((height, rough), noise) in heights.iter_mut().zip(roughness.iter()).zip(octave.iter()) {
                    *height += amplitude_m * rough * noise;
                }
            }
            cells *= 2;
        }
        let units = (1.0 / HEIGHT_SCALE) as f32;
        for (out, height) in out.iter_mut().zip(heights.iter()) {
            // Saturating: below the sea is 0, and nothing is as high as 6.5 km but over thousands of kilometres, where it is cut off.
            *out = (height * units + 0.5) as u16;
        }
    }

    /// Interpolates a table of the large forms.
    fn large(&self, table: &[f32], first: u32, width: usize, out: &mut [f32], column: &mut Vec<f32>) {
        let cells = self.size - 1;
        let clamped = |index: i64| index.clamp(0, POINTS as i64 - 1) as usize;
        if cells < CELLS {
            let step = (CELLS / cells) as usize;
            for (row, out) in (first as usize..).zip(out.chunks_exact_mut(width)) {
                let from = table[row * step * POINTS..][..POINTS].iter().step_by(step);
                out.iter_mut().zip(from).for_each(|(out, value)| *out = *value);
            }
            return;
        }
        let weights = Weights::new(cells / CELLS);
        for (row, out) in (first..).zip(out.chunks_exact_mut(width)) {
            let (cell, phase) = weights.split(row);
            let rows = [-1, 0, 1, 2].map(|d| &table[clamped(i64::from(cell) + d) * POINTS..][..POINTS]);
            column.clear();
            // One point more on each side, and two on the right for the last sample.
            column.extend((-1..POINTS as i64 + 2).map(|x| {
                let x = clamped(x);
                weights.blend(phase, [rows[0][x], rows[1][x], rows[2][x], rows[3][x]])
            }));
            weights.spread(column, out);
        }
    }

    /// Value noise on a lattice of `cells` cells a side, about -1..1.
    fn octave(
        &self,
        cells: u32,
        first: u32,
        width: usize,
        out: &mut [f32],
        lattice: &mut Vec<f32>,
        column: &mut Vec<f32>,
    ) {
        let weights = Weights::new((self.size - 1) / cells);
        let seed = hash(self.seed, cells, 2);
        // Lattice points -1 to cells + 2, the outermost for the spline's sake.
        let points = cells as usize + 4;
        let rows = (out.len() / width) as u32;
        let top = weights.split(first).0;
        let bottom = weights.split(first + rows - 1).0;
        lattice.clear();
        for y in top..=bottom + 3 {
            lattice.extend((0..points as u32).map(|x| signed_unit(hash(seed, x, y))));
        }
        for (row, out) in (first..).zip(out.chunks_exact_mut(width)) {
            let (cell, phase) = weights.split(row);
            let from = (cell - top) as usize * points;
            let [a, b, c, d] = [0, 1, 2, 3].map(|y| &lattice[from + y * points..][..points]);
            column.clear();
            column.extend((0..points).map(|x| weights.blend(phase, [a[x], b[x], c[x], d[x]])));
            weights.spread(column, out);
        }
    }
}

/// Weights of the Catmull-Rom spline (Edwin Catmull and Raphael Rom, 1974) at the samples of a cell.
struct Weights(Vec<[f32; 4]>);

impl Weights {
    fn new(samples: u32) -> Self {
        let at = |phase: u32| {
            let t = f64::from(phase) / f64::from(samples);
            let (t2, t3) = (t * t, t * t * t);
            [-t3 + 2.0 * t2 - t, 3.0 * t3 - 5.0 * t2 + 2.0, -3.0 * t3 + 4.0 * t2 + t, t3 - t2]
                .map(|w| (0.5 * w) as f32)
        };
        Self((0..samples).map(at).collect())
    }

    /// Cell and phase of a sample.
    fn split(&self, sample: u32) -> (u32, usize) {
        let samples = self.0.len() as u32;
        (sample / samples, (sample % samples) as usize)
    }

    #[inline]
    fn blend(&self, phase: usize, [a, b, c, d]: [f32; 4]) -> f32 {
        let w = &self.0[phase];
        w[0] * a + w[1] * b + w[2] * c + w[3] * d
    }

    /// Interpolates along a row: `out[i]` lies between `points[i / samples + 1]` and the next.
    fn spread(&self, points: &[f32], out: &mut [f32]) {
        if self.0.len() == 1 {
            // Every sample is a lattice point.
            out.copy_from_slice(&points[1..=out.len()]);
            return;
        }
        for (out, points) in out.chunks_mut(self.0.len()).zip(points.windows(4)) {
            for (out, w) in out.iter_mut().zip(&self.0) {
                *out = w[0] * points[0] + w[1] * points[1] + w[2] * points[2] + w[3] * points[3];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of the largest grid is made alone as with others, and neighbours are near each other.
    #[test]
    fn rows_of_the_largest_grid_are_the_same_one_by_one() {
        let size = super::super::MAX_SIZE;
        let terrain = Terrain::new(size, 7, 20.0);
        let (first, width) = (size / 3, size as usize);
        let mut scratch = Scratch::default();
        let mut together = vec![0; 2 * width];
        terrain.rows(first, &mut together, &mut scratch);
        let mut alone = vec![0; width];
        for (row, wanted) in (first..).zip(together.chunks(width)) {
            terrain.rows(row, &mut alone, &mut scratch);
            assert!(alone == wanted, "{row}");
        }
        let is_smooth = |row: &[u16]| row.windows(2).all(|two| two[0].abs_diff(two[1]) < 1000);
        assert!(together.chunks(width).all(is_smooth) && together.iter().any(|height| *height > 0));
    }
}
