//! Where a straight line meets the ground, from what is in memory.
//!
//! Between four samples the ground is bilinear ([`HeightAt`]), so along a line it is a parabola, of which three heights tell all. The line is followed from cell to cell, between the lowest and the
//! highest ground only. Cost: two heights a cell on the way; nothing is read and nothing allocated.

use crate::stream::HeightAt;

/// Where a ray meets the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// Metres east and north of the south-west sample, and up.
    pub place_m: [f64; 3],
    /// Metres from where the ray begins.
    pub distance_m: f64,
    /// Whether the ground there is the data's own: no record that bears on it is away.
    pub is_exact: bool,
}

/// A half-line.
pub(super) struct Ray {
    from_m: [f64; 3],
    /// Of length 1.
    direction: [f64; 3],
}

impl Ray {
    /// `None` for numbers that make no ray.
    pub(super) fn new(from_m: [f64; 3], direction: [f64; 3]) -> Option<Self> {
        let longest = direction.into_iter().fold(0.0, |most: f64, part| most.max(part.abs()));
        // Scaled first, for squares of small and of large numbers have no room.
        let scaled = direction.map(|part| part / longest);
        let length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
        let direction = scaled.map(|part| part / length);
        let is_sound = from_m.iter().chain(&direction).all(|part| part.is_finite());
        is_sound.then_some(Self { from_m, direction })
    }

    fn at(&self, t: f64) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.from_m[axis] + t * self.direction[axis])
    }

    /// The part between two numbers of one axis.
    fn between(&self, axis: usize, [low, high]: [f64; 2], [begin, end]: [f64; 2]) -> [f64; 2] {
        let (from, step) = (self.from_m[axis], self.direction[axis]);
        if step == 0.0 {
            return if (low..=high).contains(&from) { [begin, end] } else { [0.0, -1.0] };
        }
        let (a, b) = ((low - from) / step, (high - from) / step);
        [begin.max(a.min(b)), end.min(a.max(b))]
    }

    /// The first place within `longest_m` where the ray meets the ground, from above or from below.
    pub(super) fn hit(
        &self,
        longest_m: f64,
        spacing_m: [f64; 2],
        extent_m: [f64; 2],
        range_m: [f64; 2],
        height: impl Fn(f64, f64) -> HeightAt,
    ) -> Option<RayHit> {
        let mut part = self.between(0, [0.0, extent_m[0]], [0.0, longest_m]);
        part = self.between(1, [0.0, extent_m[1]], part);
        // A little more, for the ground at its lowest and highest is ground.
        let room = 1e-6 * (1.0 + range_m[0].abs().max(range_m[1].abs()));
        let [begin, end] = self.between(2, [range_m[0] - room, range_m[1] + room], part);
        let above = |t: f64| {
            let [x, y, z] = self.at(t);
            // Roundings lead beyond the rim, where there is nothing.
            let found = height(x.clamp(0.0, extent_m[0]), y.clamp(0.0, extent_m[1]));
            (found.height_m.map(|ground| z - ground), found.is_exact)
        };
        let mut from = begin;
        while from <= end {
            let to = self.next_line(from, spacing_m).min(end);
            let [(first, _), (middle, is_exact), (last, _)] = [from, 0.5 * (from + to), to].map(above);
            if let (Some(first), Some(middle), Some(last)) = (first, middle, last)
                && let Some(share) = first_root(first, middle, last)
            {
                let distance_m = from + share * (to - from);
                return Some(RayHit { place_m: self.at(distance_m), distance_m, is_exact });
            }
            if to >= end {
                return None;
            }
            from = to;
        }
        None
    }

    /// Where the ray crosses the next line of samples after `t`.
    fn next_line(&self, t: f64, spacing_m: [f64; 2]) -> f64 {
        let next = |axis: usize| {
            let step = self.direction[axis];
            if step == 0.0 {
                return f64::INFINITY;
            }
            let cells = (self.from_m[axis] + t * step) / spacing_m[axis];
            // Lines that are hit already count as passed.
            let line = if step > 0.0 { (cells + 1e-9).floor() + 1.0 } else { (cells - 1e-9).ceil() - 1.0 };
            (line * spacing_m[axis] - self.from_m[axis]) / step
        };
        // Onward, whatever roundings do.
        next(0).min(next(1)).max(t + 1e-9 * spacing_m[0].min(spacing_m[1]))
    }
}

/// The first place from 0 to 1 where the parabola through three heights over the ground at 0, 1/2 and 1 is 0.
fn first_root(first: f64, middle: f64, last: f64) -> Option<f64> {
    let a = 2.0 * first - 4.0 * middle + 2.0 * last;
    let b = 4.0 * middle - 3.0 * first - last;
    let c = first;
    if c == 0.0 {
        return Some(0.0);
    }
    // The larger of two roots loses no digits this way, and the other follows from it.
    let root = (b * b - 4.0 * a * c).sqrt();
    let q = -0.5 * (b + root.copysign(b));
    [q / a, c / q].into_iter().filter(|s| (0.0..=1.0).contains(s)).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parabolas_are_met_first_where_they_are() {
        assert_eq!(first_root(1.0, 0.0, -1.0), Some(0.5));
        assert_eq!(first_root(1.0, 1.0, 1.0), None);
        assert_eq!(first_root(0.0, 1.0, 1.0), Some(0.0));
        assert_eq!(first_root(1.0, 0.25, 0.0), Some(1.0));
        // (4 s - 1)(4 s - 3) is 3 at 0, -1 at 1/2 and 3 at 1.
        assert!((first_root(3.0, -1.0, 3.0).unwrap() - 0.25).abs() < 1e-15);
        assert_eq!(first_root(f64::NAN, 0.0, 1.0), None);
    }

    #[test]
    fn what_is_no_ray_is_none() {
        for (from, direction) in [
            ([0.0; 3], [0.0; 3]),
            ([f64::NAN, 0.0, 0.0], [0.0, 0.0, -1.0]),
            ([0.0; 3], [f64::INFINITY, 0.0, 0.0]),
        ] {
            assert!(Ray::new(from, direction).is_none());
        }
        for size in [1e-300, 1e300] {
            assert_eq!(Ray::new([0.0; 3], [0.0, 0.0, -size]).unwrap().direction, [0.0, 0.0, -1.0]);
        }
    }
}
