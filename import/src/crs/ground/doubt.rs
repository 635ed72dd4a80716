//! How far places may be off where they are brought from one datum to another: nothing is known of the shift, it differs from region to region, or the place lies outside of the regions for which there is one.

use super::Ground;
use terrasoar_layout::portable::{hypot, sin_cos};

/// Shifts below this are none.
const NEAR_M: f64 = 3.0;
const METRES_A_RADIAN: f64 = 6.37e6;

/// What is not known of the shift between two datums.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// Nothing is known, or a grid is not here, so that the shift was left out.
    Unknown,
    /// It differs from region to region, or is an old one, by so many metres.
    OffM(f64),
    /// Places lie outside of the regions for which there is a shift, so that one was taken further. It is so many metres.
    BeyondM(f64),
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unknown => f.write_str("is not known here, or a grid that is not here, and was left out, so places may be off by up to some hundred metres"),
            Self::OffM(off_m) => write!(f, "differs from region to region or is known roughly, so places may be off by up to {off_m:.0} m"),
            Self::BeyondM(off_m) => write!(f, "is stated for other regions and was taken further, so places may be off by up to {off_m:.0} m"),
        }
    }
}

impl Ground {
    /// How far `places` of this system may be off in the other one, for the shift between both datums is not known well; `None` where it is.
    pub(crate) fn doubt(&self, other: &Self, places: &[[f64; 2]]) -> Option<Doubt> {
        if self.is_same_datum(other) {
            return None;
        }
        if (&self.lost, &self.untied) != (&other.lost, &other.untied) {
            return Some(Doubt::Unknown);
        }
        let off_m = self.off_m.unwrap_or(0.0) + other.off_m.unwrap_or(0.0);
        let beyond_m = |place: &[f64; 2]| {
            let there = self.across_to(other, *place);
            self.beyond_m(*place) + there.map_or(0.0, |there| other.beyond_m(there))
        };
        let beyond_m = places.iter().map(beyond_m).fold(0.0, f64::max);
        match beyond_m > off_m {
            true => Some(Doubt::BeyondM(beyond_m.ceil())),
            false => (off_m > 0.0).then_some(Doubt::OffM(off_m)),
        }
    }

    /// By how many metres a place is shifted to WGS 84 although nobody states a shift there.
    fn beyond_m(&self, place: [f64; 2]) -> f64 {
        let Some((world, own)) = self.world(place).zip(self.own(place)) else { return 0.0 };
        // Nobody says on which of both datums the regions' sides are.
        let is_in = |[west, south, east, north]: &[f64; 4]| {
            [world, own].map(|at| at.map(f64::to_degrees)).iter().all(|[lon, lat]| {
                (*south..=*north).contains(lat)
                    && (lon - west).rem_euclid(360.0) <= (east - west).rem_euclid(360.0)
            })
        };
        if self.reach_deg.is_empty() || self.reach_deg.iter().any(is_in) {
            return 0.0;
        }
        let turn = std::f64::consts::TAU;
        let across = (world[0] - own[0] + turn / 2.0).rem_euclid(turn) - turn / 2.0;
        let metres = METRES_A_RADIAN * hypot(across * sin_cos(world[1]).1, world[1] - own[1]);
        if metres > NEAR_M { metres } else { 0.0 }
    }

    /// Whether both are of one datum, so that nothing is shifted between them.
    pub(super) fn is_same_datum(&self, other: &Self) -> bool {
        let [a, b] = [self, other].map(|ground| ground.unshifted.as_ref().map(|(_, datum)| datum));
        a.is_some() && a == b && !self.shape_differs(other)
    }
}

/// Places all over a grid of `samples`: 25 of them, its corners among them.
pub(crate) fn all_over(map: &[f64; 6], samples: [u32; 2]) -> Vec<[f64; 2]> {
    let part = |quarters: u32, of: u32| f64::from(quarters) / 4.0 * f64::from(of.saturating_sub(1));
    let places = (0..25).map(|at| {
        let [x, y] = [part(at % 5, samples[0]), part(at / 5, samples[1])];
        [map[0] + map[1] * x + map[2] * y, map[3] + map[4] * x + map[5] * y]
    });
    places.collect()
}
