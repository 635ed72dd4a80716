//! A surface over a hole that is as smooth as its rim allows: every sample the mean of its neighbours, as a soap film has it (Laplace's equation).
//!
//! **No sample is above the rim's highest or below its lowest.** Solved by successive over-relaxation in one fixed order, so the same hole gives the same bits everywhere.
//! Cost: O(samples x side) operations, some 24 bytes a sample.

use crate::portable;

/// Of the rim's range, a change in a round that ends the work.
const STILL: f64 = 1e-9;

/// A hole in a window of samples.
pub(super) struct Hole {
    /// Samples from west to east and from south to north.
    pub(super) size: [usize; 2],
    /// The samples, row by row; what lies in the hole is not looked at.
    pub(super) samples: Vec<f64>,
    /// Which lie in the hole. Their neighbours that do not are no voids.
    pub(super) is_inside: Vec<bool>,
}

impl Hole {
    /// Fills the hole. A hole without a rim is left as it is.
    pub(super) fn fill(&mut self) {
        let [wide, high] = self.size;
        let inside: Vec<usize> = (0..wide * high).filter(|i| self.is_inside[*i]).collect();
        let around = |i: usize| {
            let (x, y) = (i % wide, i / wide);
            let places = [
                (x > 0, i.wrapping_sub(1)),
                (x + 1 < wide, i + 1),
                (y > 0, i.wrapping_sub(wide)),
                (y + 1 < high, i + wide),
            ];
            places.into_iter().filter(|(is_there, _)| *is_there).map(|(_, i)| i)
        };
        let (mut low, mut high_m, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0_u32);
        for i in inside.iter().flat_map(|i| around(*i)).filter(|i| !self.is_inside[*i]) {
            let sample = self.samples[i];
            (low, high_m) = (low.min(sample), high_m.max(sample));
            (sum, count) = (sum + sample, count + 1);
        }
        if count == 0 {
            return;
        }
        let mean = sum / f64::from(count);
        inside.iter().for_each(|i| self.samples[*i] = mean);
        let side = wide.max(high);
        // The best factor for a square; rounds in proportion to its side are enough.
        let factor = 2.0 / (1.0 + portable::sin_cos(std::f64::consts::PI / side as f64).0);
        for _ in 0..60 * side + 100 {
            let mut largest = 0.0_f64;
            for &i in &inside {
                let (mut sum, mut count) = (0.0, 0.0);
                for neighbour in around(i) {
                    sum += self.samples[neighbour];
                    count += 1.0;
                }
                let change = factor * (sum / count - self.samples[i]);
                self.samples[i] += change;
                largest = largest.max(change.abs());
            }
            if largest <= STILL * (high_m - low) {
                break;
            }
        }
        inside.iter().for_each(|i| self.samples[*i] = self.samples[*i].clamp(low, high_m));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The same equations by elimination.
    fn eliminated(hole: &Hole) -> Vec<(usize, f64)> {
        let [wide, high] = hole.size;
        let inside: Vec<usize> = (0..wide * high).filter(|i| hole.is_inside[*i]).collect();
        let n = inside.len();
        let mut rows: Vec<Vec<f64>> = vec![vec![0.0; n + 1]; n];
        for (row, &i) in inside.iter().enumerate() {
            let (x, y) = ((i % wide) as i64, (i / wide) as i64);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let (x, y) = (x + dx, y + dy);
                if x < 0 || y < 0 || x >= wide as i64 || y >= high as i64 {
                    continue;
                }
                let other = (y as usize) * wide + x as usize;
                rows[row][row] += 1.0;
                match inside.iter().position(|i| *i == other) {
                    Some(column) => rows[row][column] -= 1.0,
                    None => rows[row][n] += hole.samples[other],
                }
            }
        }
        for pivot in 0..n {
            let best =
                (pivot..n).max_by(|a, b| rows[*a][pivot].abs().total_cmp(&rows[*b][pivot].abs())).unwrap();
            rows.swap(pivot, best);
            let chosen = rows[pivot].clone();
            for (r, row) in rows.iter_mut().enumerate() {
                let factor = row[pivot] / chosen[pivot];
                if r != pivot {
                    row.iter_mut().zip(&chosen).for_each(|(a, b)| *a -= factor * b);
                }
            }
        }
        inside.into_iter().enumerate().map(|(i, at)| (at, rows[i][n] / rows[i][i])).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn it_is_the_solution_of_laplaces_equation(
            size in prop::array::uniform2(2..9usize),
            bits in any::<u64>(),
            heights in prop::collection::vec(-500.0..4000.0f64, 64),
        ) {
            let count = size[0] * size[1];
            // One sample at least is rim; every part of the hole must reach it, so holes grow from rows.
            let is_inside: Vec<bool> = (0..count).map(|i| i > 0 && bits >> (i % 64) & 1 == 1).collect();
            let samples: Vec<f64> = heights[..count].to_vec();
            let mut hole = Hole { size, samples, is_inside };
            let expected = eliminated(&hole);
            hole.fill();
            for (at, height) in expected {
                prop_assert!((hole.samples[at] - height).abs() < 1e-4, "{at}: {} {height}", hole.samples[at]);
            }
        }
    }

    #[test]
    fn a_slope_goes_on_and_a_hole_without_a_rim_stays() {
        let size = [40, 40];
        let plane = |i: usize| 3.0 * (i % 40) as f64 - 2.0 * (i / 40) as f64;
        let is_inside = |i: usize| (1..39).contains(&(i % 40)) && (1..39).contains(&(i / 40));
        let mut hole = Hole {
            size,
            samples: (0..1600).map(|i| if is_inside(i) { f64::NAN } else { plane(i) }).collect(),
            is_inside: (0..1600).map(is_inside).collect(),
        };
        hole.fill();
        assert!((0..1600).all(|i| (hole.samples[i] - plane(i)).abs() < 1e-4));
        let mut all = Hole { size: [2, 2], samples: vec![7.0; 4], is_inside: vec![true; 4] };
        all.fill();
        assert_eq!(all.samples, [7.0; 4]);
    }
}
