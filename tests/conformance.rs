//! One suite for every engine: each frame's mesh equals the definition's, covers the data once without cracks, turns one way, and keeps the promised
//! tolerance at every sample in view.

mod common;

use common::{frame, noise, rugged_terrain};
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};
use terrasoar::flight::FlightFrame;
use terrasoar::mesh::{Triangle, TriangleKey, has_area, is_drawn, twice_area, with_apex_first};
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Engine, Unobserved};
use terrasoar::view::{View, Viewport};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::terrain::{Records, Terrain};
use terrasoar_layout::with_records;

const VIEWPORT: Viewport = Viewport { width_px: 320, height_px: 240 };

fn triangles(engine: &impl Engine) -> Vec<Triangle> {
    let mut all = Vec::new();
    engine.for_each_triangle(&mut |t| all.push(t));
    all
}

fn keys(triangles: &[Triangle]) -> HashSet<TriangleKey> {
    triangles.iter().map(|t| TriangleKey::of(*t)).collect()
}

/// Every triangle once, all counter-clockwise, exactly covering the square, no vertex inside another triangle's edge.
fn check_conforming<C: RecordCodec>(records: &Records<'_, C>, triangles: &[Triangle]) {
    let grid = records.grid();
    let n = i64::from(grid.side_steps());
    assert_eq!(keys(triangles).len(), triangles.len(), "a triangle twice");
    let mut area = 0;
    let mut edges: HashMap<(u64, u64), i32> = HashMap::new();
    for t in triangles {
        let twice = twice_area(*t);
        assert!(twice > 0, "{t:?} is clockwise or empty");
        area += twice;
        for i in 0..3 {
            let (p, q) = (t[i].packed(), t[(i + 1) % 3].packed());
            // A conforming mesh uses each inner edge once in each direction.
            *edges.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
        }
    }
    assert_eq!(area, 2 * n * n, "the square is covered exactly");
    for ((p, q), uses) in edges {
        let point = |v: u64| GridPoint::new(v as u32, (v >> 32) as u32);
        let (p, q) = (point(p), point(q));
        let on_border = (p.x() == q.x() && (p.x() == 0 || i64::from(p.x()) == n))
            || (p.y() == q.y() && (p.y() == 0 || i64::from(p.y()) == n));
        assert!(uses == 0 || on_border, "a crack along {p:?} {q:?}");
    }
    check_drawn_cover(records, triangles);
}

/// What is drawn covers the data, and leaves out only triangles that touch a void.
fn check_drawn_cover<C: RecordCodec>(records: &Records<'_, C>, triangles: &[Triangle]) {
    let grid = records.grid();
    let [wide, high] = grid.samples();
    let twice_data = 2 * i64::from(wide - 1) * i64::from(high - 1);
    let folded = |t: &Triangle| t.map(|p| grid.fold(p));
    let twice_all: i64 = triangles.iter().map(|t| twice_area(folded(t))).sum();
    assert!(triangles.iter().all(|t| twice_area(folded(t)) >= 0), "a folded triangle turns over");
    assert_eq!(twice_all, twice_data, "the data is covered exactly once");
    for t in triangles.iter().filter(|t| has_area(grid, **t)) {
        let drawn = is_drawn(records, *t);
        if drawn {
            assert!(t.iter().all(|p| !records.vertex_at(*p).class.is_void()), "{t:?} has a void corner");
        } else {
            assert!(records.has_voids(), "{t:?} is left out without reason");
        }
    }
}

/// Every sample in view is drawn within the tolerance, or hidden by a void within it.
fn check_tolerance<C: RecordCodec>(records: &Records<'_, C>, view: &View, triangles: &[Triangle]) {
    let grid = records.grid();
    let [right, up, forward] = view.axes();
    let tan_y = (view.vertical_fov_rad / 2.0).tan();
    let tan_x = tan_y * f64::from(view.viewport.width_px) / f64::from(view.viewport.height_px);
    for t in triangles.iter().filter(|t| has_area(grid, **t)) {
        let folded = t.map(|p| grid.fold(p));
        let corners = t.map(|p| {
            let [x, y] = grid.position_m(p);
            [x, y, records.vertex_at(p).height_m]
        });
        let drawn = is_drawn(records, *t);
        let (x0, x1) =
            (folded.iter().map(|p| p.x()).min().unwrap(), folded.iter().map(|p| p.x()).max().unwrap());
        let (y0, y1) =
            (folded.iter().map(|p| p.y()).min().unwrap(), folded.iter().map(|p| p.y()).max().unwrap());
        let whole = twice_area(folded) as f64;
        for y in y0..=y1 {
            for x in x0..=x1 {
                let p = GridPoint::new(x, y);
                let [a, b, c] = folded;
                let w = [twice_area([p, b, c]), twice_area([a, p, c]), twice_area([a, b, p])];
                if w.iter().any(|w| *w < 0) {
                    continue;
                }
                let sample = records.vertex_at(p);
                let [px, py] = grid.position_m(p);
                let to = glam::DVec3::new(px, py, sample.height_m) - view.eye_m;
                let depth = to.dot(forward);
                let in_view =
                    depth > 0.0 && to.dot(right).abs() <= depth * tan_x && to.dot(up).abs() <= depth * tan_y;
                if !in_view {
                    continue;
                }
                let pixels_a_metre = view.pixels_per_radian() / to.length();
                if drawn {
                    let height = (0..3).map(|i| w[i] as f64 / whole * corners[i][2]).sum::<f64>();
                    let error_px = (sample.height_m - height).abs() * pixels_a_metre;
                    assert!(error_px <= view.tolerance_px * (1.0 + 1e-9), "{error_px} px at {p:?} in {t:?}");
                } else if !sample.class.is_void() && w.iter().all(|w| *w > 0) {
                    // Left out for a void: the hole is too large by less than the triangle's longest edge.
                    let [_, b, d] = with_apex_first(*t).map(|p| grid.position_m(p));
                    let edge_m = (b[0] - d[0]).hypot(b[1] - d[1]);
                    assert!(
                        edge_m * pixels_a_metre <= view.tolerance_px * 1.5,
                        "{t:?}: a hole of {edge_m} m"
                    );
                }
            }
        }
    }
}

/// Flies `views` with all engines and checks every frame.
fn fly(terrain: &Terrain, views: &[View], check_samples: bool) {
    with_records!(terrain.records().unwrap(), records => {
        let mut naive = Naive::new(records.clone());
        let mut soar = Soar::new(records.clone());
        let mut smart = Smart::new(records.clone());
        for (i, view) in views.iter().enumerate() {
            naive.update(view, &mut Unobserved);
            soar.update(view, &mut Unobserved);
            smart.update(view, &mut Unobserved);
            let expected = triangles(&naive);
            check_conforming(&records, &expected);
            if check_samples {
                check_tolerance(&records, view, &expected);
            }
            for (name, got) in [("soar", triangles(&soar)), ("smart", triangles(&smart))] {
                assert_eq!(got.len(), expected.len(), "{name}, frame {i}");
                assert!(got.iter().all(|t| twice_area(*t) > 0), "{name}, frame {i}: winding");
                assert!(keys(&got) == keys(&expected), "{name} draws another mesh than naive in frame {i}");
            }
        }
    });
}

fn views(frames: impl IntoIterator<Item = FlightFrame>, tolerance_px: f64) -> Vec<View> {
    frames.into_iter().map(|f| f.view(VIEWPORT, tolerance_px)).collect()
}

fn terrains() -> Vec<Terrain> {
    vec![
        rugged_terrain([129, 129], 3, false),
        rugged_terrain([100, 129], 4, false),
        rugged_terrain([120, 90], 5, true),
    ]
}

#[test]
fn translation() {
    for terrain in terrains() {
        let path = (0..40).map(|i| {
            frame(&terrain, [0.4, 0.1 + 0.02 * f64::from(i)], 1300.0 - 10.0 * f64::from(i), 20.0, -20.0)
        });
        fly(&terrain, &views(path, 2.0), true);
    }
}

#[test]
fn rotation() {
    for terrain in terrains() {
        let path = (0..50).map(|i| FlightFrame {
            roll_deg: f64::from(i % 7) * 9.0,
            ..frame(&terrain, [0.5, 0.5], 1100.0, 3.0 * f64::from(i * i % 53), -30.0 + f64::from(i % 5) * 7.0)
        });
        fly(&terrain, &views(path, 3.0), false);
    }
}

/// Turns and flies by turns, so that words made in one orientation are asked in another.
#[test]
fn rotation_and_translation_by_turns() {
    for terrain in terrains() {
        let path = (0..120).map(|i| {
            let step = f64::from(i);
            frame(&terrain, [0.3 + 0.003 * step, 0.4], 1200.0, 40.0 + 4.0 * f64::from(i / 5), -25.0)
        });
        fly(&terrain, &views(path, 3.0), false);
    }
}

#[test]
fn zoom_and_tolerance() {
    for terrain in terrains() {
        let frames: Vec<FlightFrame> = (0..30)
            .map(|i| FlightFrame {
                vertical_fov_deg: 60.0 - 1.7 * f64::from(i),
                ..frame(&terrain, [0.5, 0.2], 1200.0, 0.0, -15.0)
            })
            .collect();
        fly(&terrain, &views(frames.iter().copied(), 2.0), true);
        let ramp: Vec<View> = (0..30).map(|i| frames[i / 3].view(VIEWPORT, 0.5 + 0.4 * i as f64)).collect();
        fly(&terrain, &ramp, false);
    }
}

#[test]
fn slower_than_a_tick() {
    let terrain = rugged_terrain([129, 129], 8, false);
    // A tick is spacing / 64, some 0.16 m; each frame moves a hundredth of that.
    let path = (0..3000)
        .filter(|i| i % 20 == 0 || *i > 2900)
        .map(|i| frame(&terrain, [0.5, 0.3 + f64::from(i) * 1e-6], 1150.0, 10.0, -20.0));
    fly(&terrain, &views(path, 2.0), false);
}

#[test]
fn teleports() {
    for terrain in terrains() {
        let path = (0..40).map(|i| {
            let far = if i % 7 == 3 { 1e7 } else { 1.0 };
            frame(
                &terrain,
                [noise(1, i, 0) * far, noise(2, i, 0)],
                900.0 + 2000.0 * noise(3, i, 0),
                360.0 * noise(4, i, 0),
                -60.0 * noise(5, i, 0),
            )
        });
        fly(&terrain, &views(path, 2.0), false);
    }
}

#[test]
fn tolerance_holds_at_every_sample() {
    for terrain in terrains() {
        for tolerance_px in [0.5, 1.0, 4.0] {
            let path = (0..6).map(|i| {
                frame(
                    &terrain,
                    [0.2 + 0.1 * f64::from(i), 0.1],
                    1000.0 + 150.0 * f64::from(i),
                    15.0 * f64::from(i) - 40.0,
                    -18.0,
                )
            });
            fly(&terrain, &views(path, tolerance_px), true);
        }
    }
}

#[test]
fn smart_tests_little_of_what_soar_tests() {
    let terrain = rugged_terrain([257, 257], 3, false);
    with_records!(terrain.records().unwrap(), records => {
        let mut soar = Soar::new(records.clone());
        let mut smart = Smart::new(records.clone());
        let path = (0..60).map(|i| frame(&terrain, [0.5, 0.2 + 0.0005 * f64::from(i)], 1400.0, 0.0, -20.0));
        let tests: Vec<[u64; 2]> =
            views(path, 1.0).iter().map(|v| [soar.update(v, &mut Unobserved), smart.update(v, &mut Unobserved)]).collect();
        assert_eq!(tests[0][0], tests[0][1], "the first frame tests all");
        let sums = tests[1..].iter().fold([0; 2], |s, t| [s[0] + t[0], s[1] + t[1]]);
        assert!(sums[1] * 5 < sums[0], "{sums:?}");
    });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn random_walks(
        wide in 2u32..90, high in 2u32..90, seed in 0u64..100, holes: bool, tolerance_px in 0.3f64..6.0,
        steps in prop::collection::vec((-0.1f64..0.1, -0.1f64..0.1, -80.0f64..80.0, -30.0f64..30.0, any::<bool>()), 3..25),
    ) {
        let terrain = rugged_terrain([wide, high], seed, holes);
        let (mut x, mut y, mut up, mut yaw) = (0.5, 0.5, 1200.0, 0.0);
        let path: Vec<FlightFrame> = steps.iter().map(|(dx, dy, dz, turn, turning)| {
            (x, y, up) = (x + dx, y + dy, up + dz);
            if *turning { yaw += turn; }
            frame(&terrain, [x, y], up, yaw, -25.0)
        }).collect();
        fly(&terrain, &views(path, tolerance_px), true);
    }
}
