//! One suite for every engine: each frame's mesh equals the definition's, covers the data once without cracks, turns one way, and keeps the promised
//! tolerance at every sample in view.

mod common;

use common::checks::{VIEWPORT, check_conforming, check_tolerance, keys, measured, triangles, views};
use common::mirror::{Mirror, check_clusters, corners, drawn};
use common::{frame, noise, rugged_terrain};
use proptest::prelude::*;
use terrasoar::flight::FlightFrame;
use terrasoar::mesh::{Triangle, TriangleKey, twice_area};
use terrasoar::metric::Metric;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::one_in;
use terrasoar_layout::with_records;

/// Flies `views` with all engines, errors being measured in every way, and checks every frame.
fn fly(terrain: &Terrain, views: &[View], check_samples: bool) {
    fly_as_is(terrain, &measured(views, ErrorMetric::Ball), check_samples);
    let by_sight = measured(views, ErrorMetric::Sight);
    fly_culling(terrain, &by_sight, Culling::Vertices, check_samples);
    // Culling knows nothing of metrics: some flights are enough.
    if check_samples {
        fly_culling(terrain, &by_sight, Culling::Clusters, false);
    }
}

fn fly_as_is(terrain: &Terrain, views: &[View], check_samples: bool) {
    fly_culling(terrain, views, Culling::Vertices, check_samples);
    fly_culling(terrain, views, Culling::Clusters, false);
}

fn fly_culling(terrain: &Terrain, views: &[View], culling: Culling, check_samples: bool) {
    with_records!(terrain.records().unwrap(), records => {
        let mut naive = Naive::new(records.clone(), culling);
        let mut soar = Soar::new(records.clone(), culling);
        let mut smart = Smart::new(records.clone(), culling);
        let mut kinetic = Kinetic::new(records.clone(), culling);
        let mut mirror = Mirror::default();
        for (i, view) in views.iter().enumerate() {
            naive.update(view, &mut Unobserved);
            soar.update(view, &mut Unobserved);
            smart.update(view, &mut Unobserved);
            kinetic.update(view, &mut Unobserved);
            let expected = triangles(&naive);
            check_conforming(&records, &expected);
            if check_samples {
                check_tolerance(&records, view, &expected);
            }
            let expected_keys = keys(&expected);
            let engines = [("soar", triangles(&soar)), ("smart", triangles(&smart)), ("kinetic", triangles(&kinetic))];
            for (name, got) in engines {
                assert_eq!(got.len(), expected.len(), "{name}, frame {i}");
                assert!(got.iter().all(|t| twice_area(*t) > 0), "{name}, frame {i}: winding");
                assert!(keys(&got) == expected_keys, "{name} draws another mesh than naive in frame {i}");
            }
            mirror.apply(kinetic.patch());
            check_mirror(&records, &kinetic, &soar, &mirror, &expected, (culling, view, i));
            assert_eq!(kinetic.work().late, 0, "nothing is late without a budget");
        }
    });
}

/// What the patches made, all of them, and the strip on demand, against the full mesh.
fn check_mirror<C: RecordCodec>(
    records: &Records<'_, C>,
    kinetic: &Kinetic<Records<'_, C>>,
    soar: &Soar<Records<'_, C>>,
    mirror: &Mirror,
    expected: &[Triangle],
    (culling, view, i): (Culling, &View, usize),
) {
    let whole = kinetic.whole_patch();
    let mut anew = Mirror::default();
    anew.apply(&whole);
    let (mirrored, full) = (mirror.triangles(), drawn(records, expected));
    assert!(mirrored == anew.triangles(), "frame {i}: the patches so far and the whole one differ");
    mirror.check_vertices(records);
    anew.check_vertices(records);
    match culling {
        Culling::Vertices => assert!(mirrored == full, "the patches make another mesh in frame {i}"),
        // Whole clusters may be left out, but no triangle that shows.
        Culling::Clusters => {
            assert!(mirrored.iter().all(|t| full.binary_search(t).is_ok()));
            let metric = Metric::new(view);
            for t in full.iter().filter(|t| mirrored.binary_search(t).is_err()) {
                let outside = |plane: usize| {
                    corners(*t).into_iter().all(|p| {
                        let sighting = metric.sight(records.grid().position_m(p), &records.vertex_at(p));
                        metric.height_over_plane(plane, &sighting) > -1e-3
                    })
                };
                assert!((0..4).any(outside), "frame {i}: {t:?} may show and is left out");
            }
        }
    }
    if i % 8 == 0 {
        let all: Vec<TriangleKey> = expected.iter().map(|t| TriangleKey::of(*t)).collect();
        if culling == Culling::Clusters {
            check_clusters(kinetic, &whole, &all);
        }
        let mut strip = Vec::new();
        kinetic.strip(&mut strip);
        assert!(strip == soar.strip(), "frame {i}: the strip is not SOAR's");
    }
}

fn terrains() -> Vec<Terrain> {
    let all = [([129, 129], 3, false), ([100, 129], 4, false), ([120, 90], 5, true)];
    one_in(2, all).map(|(samples, seed, holes)| rugged_terrain(samples, seed, holes)).collect()
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
fn spinning_and_rolling() {
    for terrain in terrains() {
        let spin = (0..60).map(|i| frame(&terrain, [0.5, 0.5], 1200.0, 4.0 * f64::from(i), -20.0));
        let roll = (0..40).map(|i| FlightFrame {
            roll_deg: 5.0 * f64::from(i),
            ..frame(&terrain, [0.5, 0.5], 1200.0, 240.0 + 2.0 * f64::from(i), -20.0 - 0.5 * f64::from(i))
        });
        fly(&terrain, &views(spin.chain(roll), 3.0), false);
    }
}

#[test]
fn orbit_and_terrain_following() {
    for terrain in terrains() {
        let [width_m, height_m] = terrain.grid().extent_m();
        let orbit = (0..50).map(|i| {
            let angle = f64::from(i) * 0.06;
            let at = [0.5 + 0.4 * angle.cos(), 0.5 + 0.4 * angle.sin()];
            frame(&terrain, at, 1300.0, 270.0 - angle.to_degrees(), -25.0)
        });
        let low = (0..50).map(|i| {
            let at = [0.2 + 0.01 * f64::from(i), 0.3 + 0.008 * f64::from(i)];
            let ground_m = terrain.height_m(at[0] * width_m, at[1] * height_m).unwrap().unwrap_or(800.0);
            frame(&terrain, at, ground_m + 25.0, 50.0, -8.0)
        });
        fly(&terrain, &views(orbit.chain(low), 3.0), false);
    }
}

#[test]
fn vertical_exaggeration() {
    for terrain in terrains() {
        let flown: Vec<View> = (0..50)
            .map(|i| {
                let at = frame(
                    &terrain,
                    [0.3 + 0.004 * f64::from(i), 0.3],
                    2200.0,
                    20.0 + f64::from(i % 7),
                    -25.0,
                );
                let factor = if i < 10 { 1.0 } else { 0.4 + 0.05 * f64::from(i) };
                View { vertical_exaggeration: factor, ..at.view(VIEWPORT, 2.0) }
            })
            .collect();
        fly(&terrain, &flown, false);
    }
}

/// Every few frames errors are measured in another way.
#[test]
fn metrics_by_turns() {
    for terrain in terrains() {
        let flown: Vec<View> = (0..40u32)
            .map(|i| {
                let step = f64::from(i);
                let at = frame(&terrain, [0.3 + 0.005 * step, 0.4], 1200.0 + 20.0 * step, 2.0 * step, -60.0);
                at.view(VIEWPORT, 2.0).metric(ErrorMetric::ALL[(i / 3 % 2) as usize])
            })
            .collect();
        fly_as_is(&terrain, &flown, false);
    }
}

/// From heights just above the ground to far away, looking ahead, down, and straight down: by line of sight no sample in view is farther from its place on the picture than the
/// tolerance. The freedom is used: from the side errors would be larger than that, and there are fewer triangles.
#[test]
fn no_sample_is_off_along_the_line_of_sight() {
    let (mut largest, mut sums) = ([0.0f64; 2], [0usize; 2]);
    for terrain in terrains() {
        let [width_m, height_m] = terrain.grid().extent_m();
        with_records!(terrain.records().unwrap(), records => {
            for (i, above_m) in [3.0, 30.0, 150.0, 600.0, 3000.0].into_iter().enumerate() {
                for (j, pitch_deg) in [-90.0, -75.0, -50.0, -20.0, 0.0].into_iter().enumerate() {
                    for tolerance_px in [0.5, 2.0, 8.0] {
                        let at = [0.31 + 0.07 * i as f64, 0.29 + 0.09 * j as f64];
                        let ground_m = terrain.height_m(at[0] * width_m, at[1] * height_m).unwrap().unwrap_or(800.0);
                        let eye = frame(&terrain, at, ground_m + above_m, 70.0 * i as f64, pitch_deg);
                        for (sum, metric) in sums.iter_mut().zip(ErrorMetric::ALL) {
                            let view = eye.view(VIEWPORT, tolerance_px).metric(metric);
                            let mut soar = Soar::new(records.clone(), Culling::Vertices);
                            soar.update(&view, &mut Unobserved);
                            let mesh = triangles(&soar);
                            let errors_px = check_tolerance(&records, &view, &mesh);
                            *sum += mesh.len();
                            if metric == ErrorMetric::Sight {
                                largest = [0, 1].map(|i| largest[i].max(errors_px[i] / tolerance_px));
                            }
                        }
                    }
                }
            }
        });
    }
    assert!(largest[0] > 0.8 && largest[1] > 2.0, "{largest:?} of the tolerance");
    assert!(sums[1] * 5 < sums[0] * 4, "{sums:?} triangles by ball and by line of sight");
}

/// Round and round until every clock has run out of ticks many times over.
#[test]
fn longer_than_the_clocks() {
    let terrain = rugged_terrain([65, 65], 2, false);
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut soar = Soar::new(records.clone(), culling);
            let mut kinetic = Kinetic::new(records.clone(), culling);
            // A tick is 10 m / 256 and a clock has 2^22 of them: 164 km, of which each frame takes some.
            for i in 0..1500 {
                let angle = f64::from(i) * 0.4;
                let wide = 1.0 + 0.9 * (f64::from(i) * 0.013).sin();
                let at = [0.5 + 3.0 * wide * angle.cos(), 0.5 + 3.0 * wide * angle.sin()];
                let view = frame(&terrain, at, 2000.0, 90.0 - angle.to_degrees() + f64::from(i % 11), -20.0).view(VIEWPORT, 0.4);
                let view = view.metric(ErrorMetric::ALL[i as usize / 750]);
                soar.update(&view, &mut Unobserved);
                kinetic.update(&view, &mut Unobserved);
                assert!(keys(&triangles(&soar)) == keys(&triangles(&kinetic)), "{culling:?}, frame {i}");
            }
        }
    });
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
        let mut soar = Soar::new(records.clone(), Culling::Vertices);
        let mut smart = Smart::new(records.clone(), Culling::Vertices);
        let path = (0..60).map(|i| frame(&terrain, [0.5, 0.2 + 0.0005 * f64::from(i)], 1400.0, 0.0, -20.0));
        let flown = views(path, 1.0);
        for metric in ErrorMetric::ALL {
            let tests: Vec<[u64; 2]> = measured(&flown, metric)
                .iter()
                .map(|v| [soar.update(v, &mut Unobserved), smart.update(v, &mut Unobserved)])
                .collect();
            assert_eq!(tests[0][0], tests[0][1], "the first frame tests all");
            let sums = tests[1..].iter().fold([0; 2], |s, t| [s[0] + t[0], s[1] + t[1]]);
            assert!(sums[1] * 5 < sums[0], "{metric:?}: {sums:?}");
        }
    });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn random_walks(
        wide in 2u32..90, high in 2u32..90, seed in 0u64..100, holes: bool, tolerance_px in 0.3f64..6.0,
        steps in prop::collection::vec((-0.1f64..0.1, -0.1f64..0.1, -80.0f64..80.0, -30.0f64..30.0, any::<bool>(), 0u8..8), 3..25),
    ) {
        let terrain = rugged_terrain([wide, high], seed, holes);
        let (mut x, mut y, mut up, mut yaw) = (0.5, 0.5, 1200.0, 0.0);
        let (mut tolerance_px, mut exaggeration, mut fov, mut roll) = (tolerance_px, 1.0, 45.0, 0.0);
        let flown: Vec<View> = steps.iter().map(|(dx, dy, dz, turn, turning, other)| {
            (x, y, up) = (x + dx, y + dy, up + dz);
            if *turning { yaw += turn; }
            match other {
                0 => tolerance_px = (tolerance_px * (1.0 + dx)).max(0.2),
                1 => exaggeration *= 1.0 + dy,
                2 => fov *= 1.0 + dx,
                3 => roll += turn,
                _ => {}
            }
            let at = FlightFrame { vertical_fov_deg: fov, roll_deg: roll, ..frame(&terrain, [x, y], up, yaw, -25.0) };
            View { vertical_exaggeration: exaggeration, ..at.view(VIEWPORT, tolerance_px) }
        }).collect();
        let plain = flown.iter().all(|view| view.vertical_exaggeration == 1.0);
        fly(&terrain, &flown, plain);
    }
}
