//! What flying must keep to: the same way at any frame rate, clear of the ground, round the pivot.

use super::*;
use crate::window::pick::tests::Hills;

fn fly(rig: &mut Rig, steps: u32, span_s: f64, controls: Controls) {
    for _ in 0..steps {
        rig.advance(span_s / f64::from(steps), &controls, &Hills, 2.0);
    }
}

/// Level, north, high above the ground.
pub(crate) fn high() -> Rig {
    let eye_m = DVec3::new(5000.0, 1000.0, 9000.0);
    let camera = Camera { eye_m, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0, vertical_fov_deg: 45.0 };
    Rig::new(camera, &Hills)
}

#[test]
fn the_way_does_not_depend_on_the_frame_rate() {
    let controls = Controls { thrust: [0.5, 1.0, 0.25], fast: true, ..Default::default() };
    let after = |steps: u32| {
        let mut rig = high();
        fly(&mut rig, steps, 0.7, controls);
        fly(&mut rig, steps, 0.4, Controls::default());
        rig.camera.eye_m
    };
    let (few, many) = (after(2), after(301));
    assert!(few.distance(many) < 1e-6 * few.distance(high().camera.eye_m), "{few} {many}");
    assert!(few.y > 1500.0 && few.z > 9000.0 && few.x > 5000.0);
}

#[test]
fn a_released_key_lets_it_come_to_rest() {
    let mut rig = high();
    fly(&mut rig, 10, 1.0, Controls { thrust: [0.0, 1.0, 0.0], ..Default::default() });
    assert!(rig.is_moving());
    fly(&mut rig, 10, 1.5, Controls::default());
    assert!(!rig.is_moving());
}

#[test]
fn the_ground_is_never_passed_through() {
    for steps in [3, 50] {
        let mut rig = high();
        rig.camera.pitch_deg = -70.0;
        for _ in 0..steps {
            fly(&mut rig, 1, 0.3, Controls { thrust: [0.0, 1.0, -1.0], fast: true, ..Default::default() });
            let eye = rig.camera.eye_m;
            if let Some(below) = ground_below_m(&Hills, eye, 2.0) {
                assert!(eye.z >= below + CLEARANCE_M - 1e-9, "{eye}");
            }
        }
    }
}

#[test]
fn a_followed_height_is_kept_over_hill_and_valley() {
    let mut rig = high();
    rig.speed_m_s = 100.0;
    rig.toggle_follow(&Hills, 2.0);
    let height = rig.follow_m.unwrap();
    for _ in 0..200 {
        fly(&mut rig, 2, 0.1, Controls { thrust: [0.0, 1.0, 0.0], ..Default::default() });
        let below = ground_below_m(&Hills, rig.camera.eye_m, 2.0).unwrap();
        assert!((rig.camera.eye_m.z - below - height).abs() < 60.0, "{:?}", rig.camera);
    }
    fly(&mut rig, 20, 1.0, Controls { thrust: [0.0, 0.0, -1.0], ..Default::default() });
    assert!(rig.follow_m.unwrap() < 0.3 * height, "down changes the height that is kept");
    rig.toggle_follow(&Hills, 2.0);
    assert_eq!(rig.follow_m, None);
}

#[test]
fn the_pivot_keeps_its_place_in_the_picture() {
    let mut rig = high();
    rig.camera.pitch_deg = -20.0;
    let pivot = DVec3::new(6000.0, 4000.0, 700.0);
    let seen = |rig: &Rig| {
        let to = pivot - rig.camera.eye_m;
        rig.camera.axes().map(|axis| axis.dot(to))
    };
    let before = seen(&rig);
    rig.pivot = Some(pivot);
    for by in [[30.0, 0.0], [0.0, -15.0], [-50.0, 8.0]] {
        rig.advance(0.01, &Controls { orbit_deg: by, ..Default::default() }, &Hills, 0.1);
    }
    let after = seen(&rig);
    for (a, b) in before.into_iter().zip(after) {
        assert!((a - b).abs() < 1e-6, "{before:?} {after:?}");
    }
    rig.advance(0.01, &Controls { orbit_deg: [0.0, -500.0], ..Default::default() }, &Hills, 0.1);
    assert!(rig.camera.pitch_deg >= -STEEPEST_DEG);
}

#[test]
fn it_goes_where_it_is_sent_and_looks_there() {
    let after = |steps| {
        let mut rig = high();
        let at = DVec3::new(7000.0, 7000.0, 500.0);
        rig.go_to(at, 2000.0);
        fly(&mut rig, steps, 0.5, Controls::default());
        assert!(rig.is_moving());
        let halfway = rig.camera.eye_m;
        fly(&mut rig, steps, 4.0, Controls::default());
        assert!(!rig.is_moving());
        let to = at - rig.camera.eye_m;
        assert!((to.length() - 2000.0).abs() < 1e-6);
        assert!(rig.camera.axes()[2].dot(to) > 2000.0 - 1e-6);
        halfway
    };
    assert!(after(5).distance(after(77)) < 1e-6);
    let mut rig = high();
    rig.go_to(DVec3::ZERO, 10.0);
    rig.advance(0.1, &Controls { look_deg: [1.0, 0.0], ..Default::default() }, &Hills, 1.0);
    assert!(!rig.is_moving(), "a hand on the controls ends it");
}

#[test]
fn the_eye_goes_along_with_the_exaggeration() {
    let mut rig = high();
    let above = |rig: &Rig, e| rig.camera.eye_m.z - ground_below_m(&Hills, rig.camera.eye_m, e).unwrap();
    let before = above(&rig, 2.0);
    rig.exaggerate(&Hills, 2.0, 5.0);
    assert!((above(&rig, 5.0) - before).abs() < 1e-9);
}
