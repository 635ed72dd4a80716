//! The terrain-following flight: a smooth closed path over the ground at a clearance.
//!
//! The path is an oval with three bulges, tabulated by length. Over each entry the height is the highest ground
//! for a way ahead and behind, then averaged over the same way. Each of the averaged maxima includes the entry, so their
//! average is never below it: the profile is smooth and keeps the clearance. Over a void the last height before it counts.

use super::{FlightPlan, Ground, Pose, Stage};
use terrasoar_layout::portable::{atan2, hypot, sin_cos};

/// Entries of the table; on 160 km of terrain they stand 25 m apart.
const ENTRIES: usize = 16_384;
/// Half widths of the oval and the depth of its bulges, as parts of extent and radius: at most 0.42 of the extent
/// from the middle.
const OVAL: f64 = 0.35;
const BULGE: f64 = 0.2;
/// Clearance as a part of the longer extent, and its least in metres.
const CLEARANCE: f64 = 0.002;
const LEAST_CLEARANCE_M: f64 = 2.0;
/// Way ahead and behind over which the profile is smoothed, in clearances.
const SMOOTHED: f64 = 8.0;

pub(super) fn path(stage: &Stage, plan: &FlightPlan, ground: &dyn Ground) -> impl Fn(u64) -> Pose {
    let clearance = (CLEARANCE * stage.longer_m()).max(LEAST_CLEARANCE_M);
    let track = Track::new(stage, ground, clearance);
    let speed = plan.speed_m_per_frame;
    move |i| {
        let way = speed * i as f64;
        let [east, north, profile] = track.at(way);
        // Never below a quarter of the clearance, however sharp a peak stands between two entries.
        let least = known_height(ground, east, north).unwrap_or(profile) + 0.25 * clearance;
        let reach = clearance.clamp(track.spacing_m, 0.01 * track.length_m.max(100.0 * track.spacing_m));
        let [behind, ahead] = [track.at(way - reach), track.at(way + reach)];
        let [de, dn, du] = [0, 1, 2].map(|axis| ahead[axis] - behind[axis]);
        Pose {
            eye_m: [east, north, (profile + clearance).max(least)],
            yaw_deg: atan2(de, dn).to_degrees(),
            pitch_deg: atan2(du, hypot(de, dn)).to_degrees(),
        }
    }
}

/// The closed path: places and smoothed heights at equal steps along its length.
struct Track {
    points_m: Vec<[f64; 3]>,
    spacing_m: f64,
    length_m: f64,
}

impl Track {
    fn new(stage: &Stage, ground: &dyn Ground, clearance_m: f64) -> Self {
        let (middle, [width, length]) = (stage.middle_m(), stage.extent_m);
        let oval = |t: f64| {
            let angle = std::f64::consts::TAU * t;
            let radius = OVAL * (1.0 + BULGE * sin_cos(3.0 * angle).1);
            let (sin, cos) = sin_cos(angle);
            [middle[0] + radius * width * sin, middle[1] + radius * length * cos]
        };
        // Lengths along the curve at equal steps of its parameter, four to an entry.
        let fine: Vec<[f64; 2]> = (0..=4 * ENTRIES).map(|i| oval(i as f64 / (4 * ENTRIES) as f64)).collect();
        let mut way_m = Vec::with_capacity(fine.len());
        let mut sum = 0.0;
        way_m.push(sum);
        for pair in fine.windows(2) {
            sum += hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            way_m.push(sum);
        }
        let spacing_m = sum / ENTRIES as f64;
        let places: Vec<[f64; 2]> = (0..ENTRIES)
            .map(|i| {
                let wanted = i as f64 * spacing_m;
                let next = way_m.partition_point(|w| *w <= wanted).clamp(1, fine.len() - 1);
                let (from, to) = (way_m[next - 1], way_m[next]);
                let part = if to > from { ((wanted - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
                [0, 1].map(|axis| fine[next - 1][axis] + part * (fine[next][axis] - fine[next - 1][axis]))
            })
            .collect();
        let reach = ((SMOOTHED * clearance_m / spacing_m) as usize).clamp(2, ENTRIES / 8);
        let heights = smoothed(highest_within(known_heights(&places, ground, stage.lowest_m), reach), reach);
        let points_m = places.into_iter().zip(heights).map(|([e, n], up)| [e, n, up]).collect();
        Self { points_m, spacing_m, length_m: sum }
    }

    /// Place and smoothed height at a way along the path, round it as often as it takes.
    fn at(&self, way_m: f64) -> [f64; 3] {
        let entry = way_m.rem_euclid(self.length_m) / self.spacing_m;
        let part = entry.fract();
        let index = |step: usize| (entry as usize + step) % self.points_m.len();
        let (from, to) = (self.points_m[index(0)], self.points_m[index(1)]);
        [0, 1, 2].map(|axis| from[axis] + part * (to[axis] - from[axis]))
    }
}

/// Height of the ground, if it has one that a flight can be made over.
fn known_height(ground: &dyn Ground, east_m: f64, north_m: f64) -> Option<f64> {
    ground.height_m(east_m, north_m).filter(|height| height.abs() <= 1e8)
}

/// Ground heights; where there is none, the last known one along the path, or `otherwise` if there is none at all.
fn known_heights(places: &[[f64; 2]], ground: &dyn Ground, otherwise: f64) -> Vec<f64> {
    let found: Vec<Option<f64>> = places.iter().map(|[e, n]| known_height(ground, *e, *n)).collect();
    // The path is closed: what stands before its start is its end.
    let mut last = found.iter().rev().flatten().next().copied().unwrap_or(otherwise);
    found
        .into_iter()
        .map(|height| {
            last = height.unwrap_or(last);
            last
        })
        .collect()
}

/// The largest value within `reach` entries either way, on a ring.
fn highest_within(mut values: Vec<f64>, reach: usize) -> Vec<f64> {
    let n = values.len();
    let mut covered = 0;
    while covered < reach {
        let step = (2 * covered + 1).min(reach - covered);
        values =
            (0..n).map(|i| values[i].max(values[(i + step) % n]).max(values[(i + n - step) % n])).collect();
        covered += step;
    }
    values
}

/// Two running means over half of `reach` either way each, on a ring: together they reach no further than it.
fn smoothed(mut values: Vec<f64>, reach: usize) -> Vec<f64> {
    let (n, half) = (values.len(), reach / 2);
    for _ in 0..2 {
        // Sums of what exceeds the least value: equal heights stay exactly equal.
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let mut prefix = Vec::with_capacity(2 * n + 1);
        let mut sum = 0.0;
        prefix.push(sum);
        for i in 0..2 * n {
            sum += values[i % n] - least;
            prefix.push(sum);
        }
        let window = (2 * half + 1) as f64;
        values = (0..n)
            .map(|i| {
                let from = (i + n - half) % n;
                least + (prefix[from + 2 * half + 1] - prefix[from]) / window
            })
            .collect();
    }
    values
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Hills, puget};
    use super::super::{FlightKind, FlightPlan, generate};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_clearance_is_kept_and_the_path_is_smooth() {
        let ground = puget();
        let flight = generate(&ground, &FlightPlan::new(FlightKind::Terrain, 3000, 40.0)).unwrap();
        for pair in flight.frames.windows(2) {
            let [e, n, up] = pair[0].eye_m;
            let clearance = up - ground.height_m(e, n).unwrap();
            assert!((300.0..4000.0).contains(&clearance), "{clearance}");
            let turn = (pair[1].yaw_deg - pair[0].yaw_deg + 180.0).rem_euclid(360.0) - 180.0;
            assert!(turn.abs() < 0.5, "{turn}");
            assert!((pair[1].pitch_deg - pair[0].pitch_deg).abs() < 1.0);
            assert!(pair[0].pitch_deg.abs() < 45.0);
        }
        let bends = |sign: f64| flight.frames.windows(2).any(|w| (w[1].yaw_deg - w[0].yaw_deg) * sign > 1e-6);
        assert!(bends(1.0));
    }

    #[test]
    fn void_ground_has_the_last_known_height() {
        let all_void = Hills { void_from: 0.0, base_m: 70.0, ..puget() };
        let flight = generate(&all_void, &FlightPlan::new(FlightKind::Terrain, 50, 100.0)).unwrap();
        assert!(flight.frames.iter().all(|f| f.eye_m[2] == 70.0 + 0.002 * 163_840.0 && f.pitch_deg == 0.0));
        let half = Hills { void_from: 0.5, ..puget() };
        let flight = generate(&half, &FlightPlan::new(FlightKind::Terrain, 3000, 200.0)).unwrap();
        assert!(flight.frames.iter().all(|f| f.eye_m[2] < 4000.0 + 400.0));
    }

    proptest! {
        #[test]
        fn filters_are_what_they_say(values in prop::collection::vec(-50.0..50.0f64, 40), reach in 2usize..9) {
            let n = values.len();
            let highest = highest_within(values.clone(), reach);
            for i in 0..n {
                let naive = (0..=2 * reach).map(|k| values[(i + n + k - reach) % n]).fold(f64::MIN, f64::max);
                prop_assert_eq!(highest[i], naive);
            }
            for (low, smooth) in values.iter().zip(smoothed(highest, reach)) {
                prop_assert!(smooth >= low - 1e-9);
            }
        }
    }
}
