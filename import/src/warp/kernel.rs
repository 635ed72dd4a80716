//! New samples out of old ones, as GDAL's warper makes them (alg/gdalwarpkernel.cpp of 3.6).
//!
//! Coordinates count sample centres: 0 is the first one. A place is void outside of the outermost samples' areas. Bilinear and Lanczos weight the samples that are there and
//! divide by the sum of their weights; cubic falls back on bilinear where one of its 16 is not; the mean weighs samples by how much of them lies under the new one.
//! Where new samples are farther apart than old ones, kernels are widened by as much, so that nothing is skipped. All stand where they belong; GDAL 3.6 puts widened Lanczos kernels at
//! the centre of an old sample, up to one step off, which later versions do not. Cost: the samples under the kernel.

use crate::options::Resampling;
use std::f64::consts::PI;
use terrasoar_layout::portable::sin_cos;

/// Old samples at hand: NaN for voids and outside.
pub(super) trait Samples {
    /// The sample, NaN if there is none.
    fn at(&self, col: i64, row: i64) -> f64;
}

/// A kernel with its width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kernel {
    pub(super) resampling: Resampling,
    /// New samples an old one, at most 1, by columns and rows.
    pub(super) scale: [f64; 2],
    /// Columns and rows of the old samples.
    pub(super) samples: [u32; 2],
    /// Whether the last column borders the first.
    pub(super) wraps: bool,
}

/// The least sum of weights that counts.
const LEAST_WEIGHT: f64 = 1e-6;

impl Kernel {
    /// Samples on either side of a place that are looked at.
    pub(super) fn reach(&self) -> [f64; 2] {
        let radius = match self.resampling {
            Resampling::Nearest => 1.0,
            Resampling::Bilinear => 1.0,
            Resampling::Cubic => 2.0,
            Resampling::Lanczos => 3.0,
            Resampling::Average => 1.0,
        };
        self.scale.map(|scale| (radius / scale).ceil() + 1.0)
    }

    /// Whether a place lies in the area of a sample.
    fn is_inside(&self, [x, y]: [f64; 2]) -> bool {
        let [columns, rows] = self.samples.map(f64::from);
        (self.wraps || (-0.5..columns - 0.5).contains(&x)) && (-0.5..rows - 0.5).contains(&y)
    }

    /// The new sample at a place; `area` are two opposite corners of its own area, for the mean.
    pub(super) fn sample(&self, from: &impl Samples, place: [f64; 2], area: [[f64; 2]; 2]) -> f64 {
        if !place[0].is_finite() {
            return f64::NAN;
        }
        // A mean is of whatever lies under the new sample, wherever its own centre is.
        if self.resampling == Resampling::Average {
            return self.mean(from, area);
        }
        if !self.is_inside(place) {
            return f64::NAN;
        }
        let nearest =
            || from.at((place[0] + 0.5 + 1e-10).floor() as i64, (place[1] + 0.5 + 1e-10).floor() as i64);
        let is_wide = self.scale.iter().any(|scale| *scale < 1.0);
        match self.resampling {
            Resampling::Nearest | Resampling::Average => nearest(),
            // A void stays one: edges of voids are where they were, to a sample.
            _ if nearest().is_nan() => f64::NAN,
            Resampling::Bilinear if !is_wide => bilinear(from, place),
            Resampling::Cubic if !is_wide => cubic(from, place),
            Resampling::Bilinear => self.weighed(from, place, 1.0, triangle),
            Resampling::Cubic => self.weighed(from, place, 2.0, convolution),
            Resampling::Lanczos => self.weighed(from, place, 3.0, lanczos),
        }
    }

    /// The samples within `radius` of a place, weighed by a function of the distance by columns and by rows.
    fn weighed(&self, from: &impl Samples, [x, y]: [f64; 2], radius: f64, weight: fn(f64) -> f64) -> f64 {
        let [across, down] = self.scale;
        let range =
            |at: f64, scale: f64| ((at - radius / scale).ceil() as i64, (at + radius / scale).floor() as i64);
        let ((west, east), (north, south)) = (range(x, across), range(y, down));
        let (mut sum, mut weights) = (0.0, 0.0);
        for row in north..=south {
            let by_row = weight((row as f64 - y) * down);
            for col in west..=east {
                let sample = from.at(col, row);
                if !sample.is_nan() {
                    let both = by_row * weight((col as f64 - x) * across);
                    sum += both * sample;
                    weights += both;
                }
            }
        }
        if weights < LEAST_WEIGHT { f64::NAN } else { sum / weights }
    }

    /// The mean of what lies between two corners.
    fn mean(&self, from: &impl Samples, [a, b]: [[f64; 2]; 2]) -> f64 {
        let [columns, rows] = self.samples.map(f64::from);
        let range = |a: f64, b: f64, most: f64, wraps: bool| {
            let (low, high) = (a.min(b) + 0.5, a.max(b) + 0.5);
            if wraps { (low, high) } else { (low.clamp(0.0, most), high.clamp(0.0, most)) }
        };
        let (west, east) = range(a[0], b[0], columns, self.wraps);
        let (north, south) = range(a[1], b[1], rows, false);
        // NaN as well.
        if !(west < east && north < south) {
            return f64::NAN;
        }
        let cover = |at: i64, low: f64, high: f64| ((at + 1) as f64).min(high) - (at as f64).max(low);
        let ends = |low: f64, high: f64| {
            let (first, last) = ((low + 1e-10).floor() as i64, (high - 1e-10).ceil() as i64);
            (first, last.max(first + 1))
        };
        let ((first_col, last_col), (first_row, last_row)) = (ends(west, east), ends(north, south));
        let (mut sum, mut weights) = (0.0, 0.0);
        for row in first_row..last_row {
            let by_row = cover(row, north, south).max(1e-9);
            for col in first_col..last_col {
                let sample = from.at(col, row);
                if !sample.is_nan() {
                    let both = by_row * cover(col, west, east).max(1e-9);
                    sum += both * sample;
                    weights += both;
                }
            }
        }
        if weights > 0.0 { sum / weights } else { f64::NAN }
    }
}

fn bilinear(from: &impl Samples, [x, y]: [f64; 2]) -> f64 {
    let (col, row) = (x.floor(), y.floor());
    let (right, below) = (x - col, y - row);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (dx, dy, weight) in [
        (0, 0, (1.0 - right) * (1.0 - below)),
        (1, 0, right * (1.0 - below)),
        (0, 1, (1.0 - right) * below),
        (1, 1, right * below),
    ] {
        let sample = from.at(col as i64 + dx, row as i64 + dy);
        if !sample.is_nan() {
            sum += weight * sample;
            weights += weight;
        }
    }
    if weights < LEAST_WEIGHT { f64::NAN } else { sum / weights }
}

fn cubic(from: &impl Samples, [x, y]: [f64; 2]) -> f64 {
    let (col, row) = (x.floor(), y.floor());
    let along = |t: f64, [a, b, c, d]: [f64; 4]| {
        b + 0.5
            * (t * (c - a) + t * t * (2.0 * a - 5.0 * b + 4.0 * c - d) + t * t * t * (3.0 * (b - c) + d - a))
    };
    let mut rows = [0.0; 4];
    for (i, value) in rows.iter_mut().enumerate() {
        let row = row as i64 - 1 + i as i64;
        let samples = std::array::from_fn(|j| from.at(col as i64 - 1 + j as i64, row));
        *value = along(x - col, samples);
    }
    let value = along(y - row, rows);
    if value.is_nan() { bilinear(from, [x, y]) } else { value }
}

fn triangle(x: f64) -> f64 {
    (1.0 - x.abs()).max(0.0)
}

/// Keys' cubic convolution with a = -1/2.
fn convolution(x: f64) -> f64 {
    let x = x.abs();
    if x <= 1.0 {
        1.0 + x * x * (1.5 * x - 2.5)
    } else if x <= 2.0 {
        2.0 + x * (-4.0 + x * (2.5 - 0.5 * x))
    } else {
        0.0
    }
}

fn lanczos(x: f64) -> f64 {
    if x.abs() >= 3.0 {
        return 0.0;
    }
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { sin_cos(PI * x).0 / (PI * x) };
    sinc(x) * sinc(x / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Plane;

    impl Samples for Plane {
        fn at(&self, col: i64, row: i64) -> f64 {
            let inside = (0..50).contains(&col) && (0..50).contains(&row);
            if inside && (col, row) != (30, 30) {
                100.0 + 3.0 * col as f64 - 7.0 * row as f64
            } else {
                f64::NAN
            }
        }
    }

    /// Every kernel brings a plane back where all its samples are there.
    #[test]
    fn planes_stay_planes_and_voids_stay_voids() {
        for resampling in Resampling::ALL {
            let kernel = Kernel { resampling, scale: [1.0; 2], samples: [50; 2], wraps: false };
            let at = |x: f64, y: f64| kernel.sample(&Plane, [x, y], [[x - 0.5, y - 0.5], [x + 0.5, y + 0.5]]);
            let (x, y) = (12.3, 17.8);
            let off = if resampling == Resampling::Nearest { 10.0 } else { 0.35 };
            let wanted = 100.0 + 3.0 * x - 7.0 * y;
            assert!((at(x, y) - wanted).abs() <= off, "{resampling:?}: {} {wanted}", at(x, y));
            assert_eq!(at(12.0, 17.0), 100.0 + 36.0 - 119.0, "{resampling:?}");
            assert!(at(30.0, 30.0).is_nan(), "{resampling:?}");
            // A mean is of what lies under it, whether its centre does or not.
            let far = if resampling == Resampling::Average { 0.5 } else { 0.1 };
            assert!(at(-0.5 - far, 5.0).is_nan() && at(5.0, 49.5 + far).is_nan(), "{resampling:?}");
            assert!(at(f64::NAN, 1.0).is_nan());
            assert!(!at(-0.4, 5.0).is_nan() && !at(49.4, 49.4).is_nan(), "{resampling:?}");
            assert!(!at(30.6, 30.0).is_nan(), "{resampling:?}");
            let wide = Kernel { scale: [0.5; 2], ..kernel };
            // Between samples, and not half-way either, lest what is off to one side is made good on the other.
            for x in [20.0, 20.3, 20.5, 20.9] {
                let far = wide.sample(&Plane, [x, 17.4], [[x - 1.0, 16.4], [x + 1.0, 18.4]]);
                let off = far - (100.0 + 3.0 * x - 7.0 * 17.4);
                let least = if resampling == Resampling::Lanczos { 0.3 } else { 1e-9 };
                assert!(
                    resampling == Resampling::Nearest || off.abs() <= least,
                    "{resampling:?} at {x}: {off}"
                );
            }
            let far = wide.sample(&Plane, [12.5, 17.5], [[11.5, 16.5], [13.5, 18.5]]);
            assert!(
                (far - (100.0 + 37.5 - 122.5)).abs()
                    <= match resampling {
                        Resampling::Nearest => 10.0,
                        Resampling::Lanczos => 0.1,
                        _ => 1e-9,
                    },
                "{resampling:?}: {far}"
            );
        }
    }
}
