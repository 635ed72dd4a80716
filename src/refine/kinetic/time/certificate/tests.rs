//! Certificates against what the camera then does.

use super::super::course::{Pose, RATE, STEADY_RATES};
use super::*;
use crate::view::{ErrorMetric, View, Viewport};
use glam::DVec3;
use proptest::prelude::*;
use terrasoar_layout::grid::record::{Vertex, VertexClass};

fn view(eye_m: DVec3, yaw: f64, pitch: f64, fov: f64, exaggeration: f64) -> View {
    View {
        eye_m,
        yaw_rad: yaw,
        pitch_rad: pitch,
        roll_rad: 0.1 * yaw,
        vertical_fov_rad: fov,
        viewport: Viewport::default(),
        tolerance_px: 1.0,
        vertical_exaggeration: exaggeration,
        metric: ErrorMetric::Ball,
    }
}

fn direction() -> impl Strategy<Value = DVec3> {
    (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0)
        .prop_map(|(x, y, z)| (DVec3::new(x, y, z) + DVec3::X * 1e-3).normalize())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    /// Whatever the camera does, a word that is alive has the status that a new test gives.
    #[test]
    fn a_live_word_is_a_true_word(
        course in direction(), speed in 0.01f64..80.0,
        away in direction(), distance in (0.0f64..10.0).prop_map(f64::exp), edge in prop::option::weighted(0.7, (-1.3f64..1.3, -1.3f64..1.3)),
        closeness in prop_oneof![0.2f64..2.0, 2.0f64..20.0], radius in 0.0f64..300.0,
        steps in prop::collection::vec((direction(), 0.0f64..0.5, -0.01f64..0.01, 0.98f64..1.02, 0.99f64..1.01), 1..80),
        kind in prop_oneof![Just(ErrorMetric::Ball), Just(ErrorMetric::Sight)], is_below in prop::bool::weighted(0.1), is_plain in prop::bool::weighted(0.9), others in 0u8..60,
        turning: bool, zooming: bool, stretching: bool, culls: bool, start_course: bool, rate in prop_oneof![Just(RATE), Just(STEADY_RATES[0].0), Just(STEADY_RATES[1].0), 0.001f64..0.5], axis in prop_oneof![Just(DVec3::ZERO), Just(DVec3::NEG_Z), Just(DVec3::Z), direction()], spin in prop_oneof![-0.01f64..0.02, 0.0f64..0.06],
        // Who keeps to a course tests what is promised along it.
        unrest in prop_oneof![Just(0.0), Just(1e-4), Just(0.01), Just(1.0)],
        curves in prop::option::of((prop_oneof![Just(DVec3::NEG_Z), Just(DVec3::Z), direction()], 0.0f64..0.04, prop::bool::weighted(0.3))),
    ) {
        let mut clocks = Clocks::new(10.0, 3000.0);
        let mut now = view(DVec3::new(100.0, 200.0, 1000.0), 0.3, -0.2, 0.8, 1.0).metric(kind);
        // The way turns, by itself or as the view does, and by less a metre where frames are far apart.
        let curve = curves.map_or(DVec3::ZERO, |(about, rad, is_alike)| if is_alike { axis * spin.abs() } else { about * rad } / speed);
        let (per_m, mut course) = (curve.length(), course);
        if start_course {
            let (direction, curve) = if speed > 1.0 { (course, curve) } else { (DVec3::ZERO, DVec3::ZERO) };
            let turn_per_m = if speed > 1.0 && axis != DVec3::ZERO { spin.abs() / speed + 1e-9 } else { 0.0 };
            clocks.take_course(2, Course { direction, curve, axis, turn_per_m, rate });
        }
        let mut metric = Metric::new(&now);
        clocks.move_to(Pose::of(&now, &metric));
        // Where vertices enter and leave the view, or anywhere.
        let away = edge.map_or(away, |(x, y)| {
            let [right, up, forward] = now.axes();
            (forward + 0.42 * (4.0 / 3.0 * x * right + y * up)).normalize()
        });
        let away = if is_below { (DVec3::NEG_Z + 0.02 * away).normalize() } else { away };
        let at = now.eye_m + away * distance;
        // An error that puts the vertex near the boundary of selection.
        let radius = radius.min(0.5 * distance);
        let seen_m = match kind {
            ErrorMetric::Ball => distance * closeness - radius,
            ErrorMetric::Sight => closeness * (distance * distance - radius * radius) / (distance * away.truncate().length() + radius + 1e-9),
        };
        let error_m = (seen_m / metric.nu()).max(0.0);
        let class = if is_plain { VertexClass::Plain } else { VertexClass::Fringe };
        let vertex = Vertex { height_m: at.z.clamp(-3000.0, 3000.0), error_m, radius_m: radius, class };
        let sight = |metric: &Metric| metric.sight([at.x, at.y], &vertex);
        let word = Judge::new(metric, &clocks, culls).word(&sight(&metric));
        for (i, (side, off, turn, zoom, stretch)) in (0u8..).zip(steps) {
            if i == others { now.metric = if kind == ErrorMetric::Ball { ErrorMetric::Sight } else { ErrorMetric::Ball }; }
            now.eye_m += Course { direction: course, curve, ..Default::default() }.path(speed) + speed * off * unrest * side;
            if per_m > 0.0 { course = (glam::DQuat::from_axis_angle(curve / per_m, per_m * speed) * course).normalize(); }
            if turning { now.yaw_rad += spin + 0.1 * turn * unrest; now.pitch_rad += 0.1 * turn * unrest; }
            if zooming { now.vertical_fov_rad = (now.vertical_fov_rad * zoom).clamp(0.05, 2.0); }
            if stretching { now.vertical_exaggeration = (now.vertical_exaggeration * stretch).clamp(0.2, 5.0); }
            metric = Metric::new(&now);
            clocks.move_to(Pose::of(&now, &metric));
            if clocks.now(clock_of(word)) >= u64::from(expiry_of(word)) {
                break;
            }
            let s = sight(&metric);
            let active = s.is_selected() && (!culls || metric.cull(&s, crate::metric::ALL_PLANES).is_some());
            prop_assert_eq!(word & ACTIVE != 0, active);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]
    /// Who flies a circle, climbing or not, and turns as it does, or a little otherwise, or turns on the spot.
    #[test]
    fn a_live_word_is_true_all_the_way_round(
        heading in 0.0f64..6.3, climb in prop_oneof![Just(0.0), -0.2f64..0.2], radius_m in prop_oneof![Just(0.0), (3.0f64..9.0).prop_map(f64::exp)],
        turn_rad in 0.002f64..0.1, other in prop_oneof![Just(0.0), -0.01f64..0.01, -0.3f64..0.3], rate in prop_oneof![Just(RATE), 0.001f64..0.3],
        distance in (0.0f64..10.0).prop_map(f64::exp), edge in (-1.3f64..1.3, -1.3f64..1.3), closeness in prop_oneof![0.9f64..1.5, 1.5f64..20.0], radius in 0.0f64..300.0, pitch in -0.5f64..0.2,
    ) {
        let moves = radius_m > 0.0;
        let mut course = DVec3::new(heading.sin(), heading.cos(), climb).normalize();
        let curve = DVec3::NEG_Z * if moves { 1.0 / radius_m } else { 0.0 };
        let step_m = radius_m * turn_rad;
        let spin = turn_rad * (1.0 + other);
        let mut now = View { roll_rad: 0.0, ..view(DVec3::new(100.0, 200.0, 1000.0), 0.3, pitch, 0.8, 1.0) };
        let mut clocks = Clocks::new(10.0, 3000.0);
        let (direction, turn_per_m) = if moves { (course, spin / step_m) } else { (DVec3::ZERO, 0.0) };
        clocks.take_course(1, Course { direction, curve, axis: DVec3::NEG_Z, turn_per_m, rate });
        let mut metric = Metric::new(&now);
        clocks.move_to(Pose::of(&now, &metric));
        let [right, up, forward] = now.axes();
        let away = (forward + 0.42 * (4.0 / 3.0 * edge.0 * right + edge.1 * up)).normalize();
        let at = now.eye_m + away * distance;
        let radius_m = radius.min(0.5 * distance);
        let error_m = ((distance * closeness - radius_m) / metric.nu()).max(0.0);
        let vertex = Vertex { height_m: at.z, error_m, radius_m, class: VertexClass::Plain };
        let sight = |metric: &Metric| metric.sight([at.x, at.y], &vertex);
        let word = Judge::new(metric, &clocks, true).word(&sight(&metric));
        for _ in 0..200 {
            now.eye_m += Course { direction: course, curve, ..Default::default() }.path(step_m);
            if moves { course = (glam::DQuat::from_rotation_z(-turn_rad) * course).normalize(); }
            now.yaw_rad += spin;
            metric = Metric::new(&now);
            clocks.move_to(Pose::of(&now, &metric));
            if clocks.now(clock_of(word)) >= u64::from(expiry_of(word)) {
                break;
            }
            let s = sight(&metric);
            let active = s.is_selected() && metric.cull(&s, crate::metric::ALL_PLANES).is_some();
            prop_assert_eq!(word & ACTIVE != 0, active);
        }
    }
}

/// On course, a word lasts until its vertex changes if its margin falls at all fast, not a fraction of the way.
#[test]
fn on_course_words_last_until_the_change() {
    let mut clocks = Clocks::new(10.0, 0.0);
    let start = view(DVec3::ZERO, 0.0, 0.0, 0.8, 1.0);
    clocks.take_course(1, Course { direction: DVec3::Y, ..Default::default() });
    let metric = Metric::new(&start);
    clocks.move_to(Pose::of(&start, &metric));
    // Not selected, 30 degrees off the course; SMART would look again after 400 m, then 330 m more, ...
    let vertex =
        Vertex { height_m: 0.0, error_m: 600.0 / metric.nu(), radius_m: 0.0, class: VertexClass::Plain };
    let at = [500.0, 866.0];
    let word = Judge::new(metric, &clocks, false).word(&metric.sight(at, &vertex));
    let mut way = 0.0;
    while clocks.now(clock_of(word)) < u64::from(expiry_of(word)) {
        way += 1.0;
        let moved = View { eye_m: DVec3::Y * way, ..start };
        clocks.move_to(Pose::of(&moved, &Metric::new(&moved)));
    }
    let crossing = 866.0 - (600.0f64.powi(2) - 500.0f64.powi(2)).sqrt();
    assert!(way > crossing - 3.0 && way <= crossing + 1.0, "{way} {crossing}");
}

/// By line of sight, on a course past a vertex, a few words are enough from afar until it is far behind.
#[test]
fn few_words_are_made_along_the_line_of_sight() {
    for (side_m, below_m) in [(0.0, 300.0), (500.0, 300.0), (100.0, 700.0), (500.0, 0.0), (2000.0, 900.0)] {
        let mut clocks = Clocks::new(10.0, 0.0);
        let start = view(DVec3::ZERO, 0.0, 0.0, 0.8, 1.0).metric(ErrorMetric::Sight);
        clocks.take_course(1, Course { direction: DVec3::Y, ..Default::default() });
        let nu = Metric::new(&start).nu();
        let vertex =
            Vertex { height_m: -below_m, error_m: 1500.0 / nu, radius_m: 20.0, class: VertexClass::Plain };
        let (mut word, mut words, mut changes) = (None, 0, 0);
        for way in 0..8000 {
            let moved = View { eye_m: DVec3::Y * f64::from(way), ..start };
            let metric = Metric::new(&moved);
            clocks.move_to(Pose::of(&moved, &metric));
            let is_over = |word: u32| clocks.now(clock_of(word)) >= u64::from(expiry_of(word));
            if word.is_none_or(is_over) {
                let next = Judge::new(metric, &clocks, false).word(&metric.sight([side_m, 4000.0], &vertex));
                words += 1;
                changes += usize::from(word.is_some_and(|word| (word ^ next) & ACTIVE != 0));
                word = Some(next);
            }
        }
        assert!(changes > 0 || side_m > 1500.0, "{side_m} {below_m}");
        assert!(
            words <= 4 + 8 * changes,
            "{words} words for {changes} changes at {side_m} m, {below_m} m below"
        );
    }
}
