//! What `kinetic` promises beyond drawing the right mesh: it conforms whatever a budget leaves undone and catches up, does not depend on the number of
//! threads, allocates nothing once warm, and gives memory back.

mod common;

use common::checks::{VIEWPORT, check_conforming, keys, measured, triangles, views};
use common::mirror::{Mirror, drawn};
use common::{frame, rugged_terrain};
use proptest::prelude::*;
use std::time::Duration;
use terrasoar::flight::FlightFrame;
use terrasoar::refine::kinetic::{Budget, Kinetic, Patch};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// A straight flight with a turn at its end.
fn path(terrain: &Terrain, frames: u32) -> Vec<FlightFrame> {
    (0..frames)
        .map(|i| {
            let turn = f64::from(i.saturating_sub(frames / 2));
            frame(
                terrain,
                [0.4, 0.1 + 0.5 * f64::from(i) / f64::from(frames)],
                1250.0,
                15.0 + 2.0 * turn,
                -20.0,
            )
        })
        .collect()
}

/// Flies with a budget, then stands still until nothing is late.
fn fly_with(budget: Budget, terrain: &Terrain, flown: &[View], culling: Culling) {
    with_records!(terrain.records().unwrap(), records => {
        let mut kinetic = Kinetic::new(records.clone(), culling);
        kinetic.set_budget(budget);
        let mut mirror = Mirror::default();
        let mut was_late = false;
        for view in flown {
            let tests = kinetic.update(view, &mut Unobserved);
            let work = kinetic.work();
            assert_eq!(tests, work.tests);
            // The first frame has to look at the four roots, and each split at its children, whatever the budget.
            assert!(budget.tests.is_none_or(|most| tests <= most + 8), "{tests} of {budget:?}");
            let mesh = triangles(&kinetic);
            check_conforming(&records, &mesh);
            mirror.apply(kinetic.patch());
            if culling == Culling::Vertices {
                assert!(mirror.triangles() == drawn(&records, &mesh));
            }
            was_late |= work.late > 0;
            assert!(work.late_error_px == 0.0 || work.late_error_px >= view.tolerance_px);
            assert!(work.late > 0 || work.late_error_px == 0.0);
        }
        assert!(budget.tests.is_none() || was_late, "a budget that bounds nothing tests nothing");
        let last = flown.last().unwrap();
        let mut frames = 0;
        while kinetic.work().late > 0 {
            kinetic.update(last, &mut Unobserved);
            frames += 1;
            assert!(frames < 20_000, "{} vertices stay late", kinetic.work().late);
        }
        let mut soar = Soar::new(records.clone(), culling);
        soar.update(last, &mut Unobserved);
        assert!(keys(&triangles(&kinetic)) == keys(&triangles(&soar)), "what was late has not caught up");
    });
}

#[test]
fn a_budget_of_tests_keeps_the_mesh_conforming() {
    for (samples, holes) in [([129, 129], false), ([120, 90], true)] {
        let terrain = rugged_terrain(samples, 6, holes);
        for tests in [16, 100, 700] {
            for culling in Culling::ALL {
                let budget = Budget::default().tests(tests);
                for metric in ErrorMetric::ALL {
                    fly_with(budget, &terrain, &measured(&views(path(&terrain, 40), 1.0), metric), culling);
                }
            }
        }
    }
}

#[test]
fn a_budget_of_time_keeps_the_mesh_conforming() {
    let terrain = rugged_terrain([129, 129], 7, false);
    for microseconds in [0, 5, 50] {
        let budget = Budget::default().time(Duration::from_micros(microseconds));
        let flown = views(path(&terrain, 30), 1.0);
        if microseconds > 0 {
            fly_with(budget, &terrain, &flown, Culling::Vertices);
        } else {
            // Nothing at all may be done: the mesh stays the four roots.
            with_records!(terrain.records().unwrap(), records => {
                let mut kinetic = Kinetic::new(records.clone(), Culling::Vertices);
                kinetic.set_budget(budget);
                flown.iter().for_each(|view| { kinetic.update(view, &mut Unobserved); });
                assert_eq!(kinetic.triangle_count(), 4);
                assert!(kinetic.work().late_error_px > 1.0);
            });
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]
    #[test]
    fn budgets_on_random_walks(
        tests in 8u64..400, seed in 0u64..50, holes: bool, metric in prop::sample::select(&ErrorMetric::ALL[..]),
        steps in prop::collection::vec((-0.1f64..0.1, -0.1f64..0.1, -80.0f64..80.0, -30.0f64..30.0), 5..30),
    ) {
        let terrain = rugged_terrain([90, 70], seed, holes);
        let (mut x, mut y, mut up, mut yaw) = (0.5, 0.5, 1200.0, 0.0);
        let flown: Vec<FlightFrame> = steps.iter().map(|(dx, dy, dz, turn)| {
            (x, y, up, yaw) = (x + dx, y + dy, up + dz, yaw + turn);
            frame(&terrain, [x, y], up, yaw, -25.0)
        }).collect();
        let flown = measured(&views(flown, 1.0), metric);
        with_records!(terrain.records().unwrap(), records => {
            let mut kinetic = Kinetic::new(records.clone(), Culling::Vertices);
            kinetic.set_budget(Budget::default().tests(tests));
            for view in &flown {
                kinetic.update(view, &mut Unobserved);
                check_conforming(&records, &triangles(&kinetic));
            }
            kinetic.set_budget(Budget::default());
            kinetic.update(&flown[flown.len() - 1], &mut Unobserved);
            let mut soar = Soar::new(records.clone(), Culling::Vertices);
            soar.update(&flown[flown.len() - 1], &mut Unobserved);
            prop_assert!(keys(&triangles(&kinetic)) == keys(&triangles(&soar)));
        });
    }
}

#[test]
fn patches_do_not_depend_on_the_number_of_threads() {
    let terrain = rugged_terrain([513, 513], 1, false);
    let flown: Vec<View> = path(&terrain, 12).iter().map(|f| f.view(VIEWPORT, 0.1)).collect();
    let patches = |threads: usize| -> Vec<Patch> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            with_records!(terrain.records().unwrap(), records => {
                let mut kinetic = Kinetic::new(records, Culling::Vertices);
                let mut largest = 0;
                let patches = flown.iter().map(|view| {
                    largest = largest.max(kinetic.update(view, &mut Unobserved));
                    kinetic.patch().clone()
                }).collect();
                assert!(largest > 20_000, "{largest} tests are too few to be shared");
                patches
            })
        })
    };
    let alone = patches(1);
    assert!([2, 5].into_iter().all(|threads| patches(threads) == alone));
}

#[test]
fn a_warm_frame_allocates_nothing() {
    let terrain = rugged_terrain([257, 257], 3, false);
    with_records!(terrain.records().unwrap(), records => {
        for (culling, metric, climb_m) in [
            (Culling::Vertices, ErrorMetric::Ball, 0.0),
            (Culling::Clusters, ErrorMetric::Ball, 0.0),
            (Culling::Clusters, ErrorMetric::Ball, 0.5),
            (Culling::Vertices, ErrorMetric::Sight, 0.0),
        ] {
            let mut kinetic = Kinetic::new(records.clone(), culling);
            let mut most_tests = 0;
            let mut round = |kinetic: &mut Kinetic<_>| {
                most_tests = 0;
                for i in 0..400u16 {
                    let angle = f64::from(i) / 400.0 * std::f64::consts::TAU;
                    let at = [0.5 + 0.3 * angle.cos(), 0.5 + 0.3 * angle.sin()];
                    let up_m = 1300.0 + climb_m * f64::from((200 - i32::from(i)).abs());
                    let view = frame(&terrain, at, up_m, -angle.to_degrees(), -20.0).view(VIEWPORT, 1.0).metric(metric);
                    kinetic.update(&view, &mut Unobserved);
                    assert!(i == 0 || kinetic.work().tests > 0);
                    most_tests = most_tests.max(kinetic.work().tests);
                }
            };
            (0..8).for_each(|_| round(&mut kinetic));
            let counted = allocation_counter::measure(|| round(&mut kinetic));
            assert_eq!(counted.count_total, 0, "{culling:?}: {counted:?}");
            // Words that were made together do not all end together.
            assert!(3 * most_tests < kinetic.node_count() as u64, "{culling:?}: {most_tests} tests in a frame");
        }
    });
}

#[test]
fn memory_follows_the_mesh() {
    let terrain = rugged_terrain([513, 513], 4, false);
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut kinetic = Kinetic::new(records.clone(), culling);
            let near = frame(&terrain, [0.5, 0.4], 1100.0, 0.0, -25.0).view(VIEWPORT, 0.2);
            kinetic.update(&near, &mut Unobserved);
            let (triangles_near, bytes_near) = (kinetic.triangle_count(), kinetic.bytes());
            assert!(triangles_near > 30_000, "{triangles_near}");
            for i in 0..3000 {
                let up = frame(&terrain, [0.5, 0.4], 1100.0 + 20.0 * f64::from(i), 0.0, -25.0).view(VIEWPORT, 0.2);
                kinetic.update(&up, &mut Unobserved);
            }
            assert!(kinetic.triangle_count() * 8 < triangles_near, "{}", kinetic.triangle_count());
            assert!(kinetic.bytes() * 2 < bytes_near, "{culling:?}: {} of {bytes_near}", kinetic.bytes());
        }
    });
}
