//! Which files lie on one grid: in one reference system, with one step, a whole number of steps apart.
//!
//! Files on one grid are laid together sample by sample, bit for bit. "Whole" means to a thousandth of a step over all the file. Systems are the same if places come out the same, whatever
//! they are called. Cost: some projected points a file.

use crate::crs::{Ground, Kind, System};
use crate::warp::apply;

/// How far samples may lie from those of the grid, in steps.
const OFF_STEPS: f64 = 1e-3;

/// A reference system, and its way to the ground where it has one.
#[derive(Debug, Clone)]
pub(super) struct Tied {
    pub(super) system: System,
    pub(super) ground: Option<Ground>,
}

impl Tied {
    pub(super) fn new(system: System) -> Self {
        let ground = Ground::new(&system);
        Self { system, ground }
    }

    /// Once around the globe in its unit, where that leads to the same place.
    pub(super) fn turn(&self) -> Option<f64> {
        self.ground.as_ref().and_then(Ground::turn)
    }

    /// Whether the grid with this map lies in the same place by either system.
    pub(super) fn is_same(&self, other: &Self, map: &[f64; 6], samples: [u32; 2]) -> bool {
        let (a, b) = (&self.system, &other.system);
        if a.unit.as_ref().map(|unit| unit.size) != b.unit.as_ref().map(|unit| unit.size)
            || a.signs != b.signs
        {
            return false;
        }
        if a.code.is_some() && a.code == b.code {
            return true;
        }
        match (&self.ground, &other.ground) {
            (Some(here), Some(there)) => {
                let [columns, rows] = samples.map(|count| f64::from(count - 1));
                let off = OFF_STEPS * map[1].abs().min(map[5].abs());
                [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].into_iter().all(|[x, y]| {
                    let at = apply(map, [x * columns, y * rows]);
                    there.across_to(here, at).is_some_and(|[x, y]| {
                        let turn = here.turn().unwrap_or(f64::INFINITY);
                        let dx = (x - at[0]).abs() % turn;
                        dx.min(turn - dx) <= off && (y - at[1]).abs() <= off
                    })
                })
            }
            (None, None) => {
                a.kind == b.kind && (a.kind == Kind::Unknown || a.text == b.text && a.name == b.name)
            }
            _ => false,
        }
    }
}

/// A grid without an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    /// Number of its system.
    pub(super) system: usize,
    /// A sample's coordinates.
    pub(super) origin: [f64; 2],
    /// Steps by columns and rows, with their signs.
    pub(super) step: [f64; 2],
}

impl Lattice {
    /// The grid of a north-up map.
    pub(super) fn of(system: usize, map: &[f64; 6]) -> Self {
        Self { system, origin: [map[0], map[3]], step: [map[1], map[5]] }
    }

    /// Column and row of a point.
    pub(super) fn index(&self, point: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| (point[i] - self.origin[i]) / self.step[i])
    }

    /// Column and row of the first sample of a grid of this map in the same system, if it lies on this one.
    pub(super) fn place(&self, map: &[f64; 6], samples: [u32; 2]) -> Option<[i64; 2]> {
        let first = self.index([map[0], map[3]]);
        let last = self.index(apply(map, samples.map(|count| f64::from(count - 1))));
        let mut at = [0; 2];
        for i in 0..2 {
            let whole = first[i].round();
            let off = (first[i] - whole).abs().max((last[i] - whole - f64::from(samples[i] - 1)).abs());
            // NaN and infinities as well.
            if !(off <= OFF_STEPS && whole.abs() < 1e15) {
                return None;
            }
            at[i] = whole as i64;
        }
        Some(at)
    }

    /// The map of the part that begins at a column and row.
    pub(super) fn map(&self, first: [i64; 2]) -> [f64; 6] {
        let at = |i: usize| self.origin[i] + self.step[i] * first[i] as f64;
        [at(0), self.step[0], 0.0, at(1), 0.0, self.step[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::by_text;

    #[test]
    fn grids_are_the_same_to_a_thousandth_of_a_step() {
        let lattice = Lattice::of(0, &[500.0, 10.0, 0.0, 900.0, 0.0, -10.0]);
        let at = |x: f64, step: f64| lattice.place(&[x, step, 0.0, 600.0, 0.0, -10.0], [1000, 100]);
        assert_eq!(at(500.0, 10.0), Some([0, 30]));
        assert_eq!(at(-2500.004, 10.0), Some([-300, 30]));
        assert_eq!(at(505.0, 10.0), None);
        assert_eq!(at(500.0, 10.001), None, "a tenth of a step over a thousand samples");
        assert_eq!(at(500.0, 10.000_001), Some([0, 30]));
        assert_eq!(at(f64::NAN, 10.0), None);
        assert_eq!(lattice.map([3, -2]), [530.0, 10.0, 0.0, 920.0, 0.0, -10.0]);
    }

    #[test]
    fn systems_are_known_by_where_places_come_out() {
        let tied = |text: &str| Tied::new(by_text(text).unwrap());
        let map = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0];
        let utm = tied("EPSG:32632");
        assert!(utm.is_same(&tied("+proj=utm +zone=32 +datum=WGS84 +units=m"), &map, [100; 2]));
        assert!(utm.is_same(
            &tied("+proj=tmerc +lon_0=9 +k=0.9996 +x_0=500000 +datum=WGS84"),
            &map,
            [100; 2]
        ));
        assert!(!utm.is_same(&tied("EPSG:32633"), &map, [100; 2]));
        assert!(
            !utm.is_same(&tied("EPSG:2263"), &map, [100; 2]) && !utm.is_same(&tied("local"), &map, [100; 2])
        );
        assert!(tied("local").is_same(&tied("local"), &map, [100; 2]));
    }
}
