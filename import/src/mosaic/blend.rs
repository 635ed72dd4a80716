//! Seams blended over some metres: a file counts the less the nearer its edge is.
//!
//! A sample's weight grows from its file's edge, or from the voids in it, to 1 at so many metres. What lies above takes its weight, and what lies below the rest; the sum is brought to 1, so that
//! where only one file has ground that ground is untouched, and no step is left at the end of either file. Distances are exact (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions,
//! section 2), within a window around each part. Cost: two passes over that window.

use crate::warp::Store;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::number;

/// Samples over which a seam is blended, at most.
const MOST_STEPS: f64 = 256.0;

/// How wide seams are blended.
#[derive(Debug)]
pub(super) struct Blend {
    metres: f64,
    /// Metres between the samples of each file or sheet.
    steps_m: Vec<[f64; 2]>,
}

impl Blend {
    /// Seams of so many metres between grids of these steps.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a width that is none, or of more samples than are looked at.
    pub(super) fn new(metres: f64, steps_m: Vec<[f64; 2]>) -> Result<Self, LayoutError> {
        if !(metres.is_finite() && metres > 0.0) {
            return Err(LayoutError::Usage(
                "the width of blended seams is a number of metres above 0".into(),
            ));
        }
        let finest = steps_m.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        if metres / finest > MOST_STEPS {
            return Err(LayoutError::Usage(format!(
                "seams of {} m are wider than {MOST_STEPS} samples of {} m, the widest that are blended; state at most {} m",
                number(metres),
                number((finest * 1e4).round() / 1e4),
                number((MOST_STEPS * finest).floor())
            )));
        }
        Ok(Self { metres, steps_m })
    }

    /// Memory in bytes that weights of a window of this size take.
    pub(super) fn bytes(&self, size: [u32; 2]) -> u64 {
        let finest = self.steps_m.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        // At most MOST_STEPS.
        let margin = 2 * (self.metres / finest).ceil() as u64 + 2;
        24 * (u64::from(size[0]) + margin) * (u64::from(size[1]) + margin)
    }

    /// The edges of a grid: by its number among `steps_m`.
    pub(super) fn edges(&self, number: usize) -> Edges {
        Edges { metres: self.metres, step_m: self.steps_m[number] }
    }
}

/// Distances from the edges of one grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edges {
    metres: f64,
    step_m: [f64; 2],
}

impl Edges {
    /// The weights of a window of a store: 0 for voids, else above 0 and at most 1.
    pub(super) fn weights(
        &self,
        store: &Store,
        first: [i64; 2],
        size: [usize; 2],
    ) -> Result<Vec<f64>, LayoutError> {
        let margin = self.step_m.map(|step| (self.metres / step).ceil() as usize + 1);
        let from = [first[0] - margin[0] as i64, first[1] - margin[1] as i64];
        let around = [size[0] + 2 * margin[0], size[1] + 2 * margin[1]];
        let block = store.window(from, around, false)?.into_values();
        let far = self.metres * self.metres;
        let mut squares: Vec<f64> =
            block.iter().map(|value| if value.is_nan() { 0.0 } else { far }).collect();
        let mut line = Vec::new();
        for row in squares.chunks_exact_mut(around[0]) {
            nearest(row, self.step_m[0], &mut line);
        }
        let mut column = vec![0.0; around[1]];
        for x in margin[0]..margin[0] + size[0] {
            for (y, value) in column.iter_mut().enumerate() {
                *value = squares[y * around[0] + x];
            }
            nearest(&mut column, self.step_m[1], &mut line);
            for (y, value) in column.iter().enumerate() {
                squares[y * around[0] + x] = *value;
            }
        }
        let mut weights = Vec::with_capacity(size[0] * size[1]);
        for y in margin[1]..margin[1] + size[1] {
            let row = &squares[y * around[0] + margin[0]..][..size[0]];
            weights.extend(row.iter().map(|square| (square.sqrt() / self.metres).min(1.0)));
        }
        Ok(weights)
    }
}

/// The lower envelope of parabolas over a line: each value becomes the least of all values plus the square of their distance.
fn nearest(values: &mut [f64], step: f64, parabolas: &mut Vec<(usize, f64)>) {
    parabolas.clear();
    let at = |i: usize| i as f64 * step;
    for (i, value) in values.iter().enumerate() {
        loop {
            let Some((last, begin)) = parabolas.last().copied() else {
                parabolas.push((i, f64::NEG_INFINITY));
                break;
            };
            let (here, there) = (at(i), at(last));
            let meet = (value + here * here - values[last] - there * there) / (2.0 * (here - there));
            if meet > begin {
                parabolas.push((i, meet));
                break;
            }
            parabolas.pop();
        }
    }
    let lowest: Vec<(f64, f64, f64)> =
        parabolas.iter().map(|(i, begin)| (at(*i), *begin, values[*i])).collect();
    let mut which = 0;
    for (i, value) in values.iter_mut().enumerate() {
        let here = at(i);
        while which + 1 < lowest.len() && lowest[which + 1].1 < here {
            which += 1;
        }
        let (there, _, low) = lowest[which];
        *value = low + (here - there) * (here - there);
    }
}

/// Puts a sample of a weight over one below it, and adds the weights.
pub(super) fn over(value: &mut f64, weight: &mut f64, new: f64, fresh: f64) {
    if new.is_nan() {
        return;
    }
    if value.is_nan() || fresh >= 1.0 {
        (*value, *weight) = (new, fresh);
        return;
    }
    let below = (1.0 - fresh) * *weight;
    let both = fresh + below;
    // Two samples at the very edges of their files.
    if both > 0.0 {
        *value = (fresh * new + below * *value) / both;
        *weight = both;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::dem::{SampleSink, Window};

    /// Against every void looked at one by one.
    #[test]
    fn distances_are_exact() {
        let [wide, high] = [23u32, 17u32];
        let store = Store::new([wide, high], 8, true, std::path::Path::new(".")).unwrap();
        let is_void = |x: i64, y: i64| {
            x < 0 || y < 0 || x >= i64::from(wide) || y >= i64::from(high) || (x * 7 + y * 5) % 61 == 3
        };
        let samples: Vec<f64> = (0..i64::from(wide * high))
            .map(|i| if is_void(i % i64::from(wide), i / i64::from(wide)) { f64::NAN } else { 1.0 })
            .collect();
        store.put(Window { col: 0, row: 0, width: wide, height: high }, &samples).unwrap();
        let (metres, step) = (40.0, [10.0, 7.0]);
        let blend = Blend::new(metres, vec![step]).unwrap();
        let weights = blend.edges(0).weights(&store, [4, 3], [15, 12]).unwrap();
        for y in 0..12i64 {
            for x in 0..15i64 {
                let mut least = metres;
                for v in -8..30 {
                    for u in -8..40 {
                        if is_void(u, v) {
                            let [dx, dy] = [(u - x - 4) as f64 * step[0], (v - y - 3) as f64 * step[1]];
                            least = least.min(dx.hypot(dy));
                        }
                    }
                }
                let found = weights[(y * 15 + x) as usize];
                assert!((found - least / metres).abs() < 1e-12, "{x} {y}: {found} {least}");
            }
        }
        assert!(Blend::new(6000.0, vec![step]).unwrap_err().to_string().contains("at most 1792 m"));
        assert!(Blend::new(f64::NAN, vec![step]).is_err());
    }

    #[test]
    fn weights_add_up_and_lone_ground_is_untouched() {
        let (mut value, mut weight) = (f64::NAN, 0.0);
        over(&mut value, &mut weight, 100.0, 0.25);
        assert_eq!((value, weight), (100.0, 0.25));
        over(&mut value, &mut weight, f64::NAN, 0.5);
        assert_eq!((value, weight), (100.0, 0.25));
        // At its own edge a file changes nothing, far from it it is all.
        let before = value;
        over(&mut value, &mut weight, 900.0, 0.0);
        assert_eq!(value, before);
        over(&mut value, &mut weight, 200.0, 0.5);
        assert!((value - (0.5 * 200.0 + 0.5 * 0.25 * 100.0) / 0.625).abs() < 1e-12);
        over(&mut value, &mut weight, 7.0, 1.0);
        assert_eq!(value, 7.0);
    }
}
