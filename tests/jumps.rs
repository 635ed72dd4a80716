//! The first mesh, and the mesh after a jump of the eye: made at once it is what splits one by one make, whatever the number of threads; with a budget it is coarse at once and comes to be the
//! same; what it does not need is given back.

mod common;

use common::checks::{VIEWPORT, check_conforming, keys, triangles};
use common::mirror::{Mirror, check_clusters, drawn};
use common::{frame, rugged_terrain};
use std::sync::Arc;
use terrasoar::mesh::TriangleKey;
use terrasoar::refine::kinetic::{Budget, Kinetic, Patch};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved, Work};
use terrasoar::stream::{ModelDisk, Prefetch, Streamed};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Places far from one another, and a step after each jump.
fn leaps(terrain: &Terrain, tolerance_px: f64) -> Vec<View> {
    let places = [([0.1, 0.1], 1200.0, 40.0), ([0.9, 0.8], 1400.0, 200.0), ([0.5, 0.1], 1000.0, 0.0)];
    let mut views = Vec::new();
    for (at, up_m, yaw_deg) in places.into_iter().chain(places) {
        for step in 0..3 {
            let at = [at[0] + 0.003 * f64::from(step), at[1]];
            views.push(frame(terrain, at, up_m, yaw_deg, -25.0).view(VIEWPORT, tolerance_px));
        }
    }
    views
}

/// What splits do one after another: a budget that is never used up.
fn endless() -> Budget {
    Budget::default().tests(u64::MAX)
}

#[test]
fn a_mesh_made_at_once_is_the_one_that_splits_make() {
    for (samples, holes) in
        [([257, 257], false), ([150, 210], true), ([5, 5], false), ([3, 3], false), ([2, 2], false)]
    {
        let terrain = rugged_terrain(samples, 5, holes);
        for (metric, tolerance_px) in
            ErrorMetric::ALL.into_iter().flat_map(|metric| [(metric, 0.5), (metric, 1.0)])
        {
            with_records!(terrain.records().unwrap(), records => {
                for view in leaps(&terrain, tolerance_px).iter().map(|view| view.metric(metric)) {
                    let mut made = Kinetic::new(records.clone(), Culling::Vertices);
                    let mut split = Kinetic::new(records.clone(), Culling::Vertices);
                    split.set_budget(endless());
                    made.update(&view, &mut Unobserved);
                    split.update(&view, &mut Unobserved);
                    assert!(made.whole_patch() == split.whole_patch(), "{samples:?}");
                    let known = |work: Work| Work { slots_written: 0, patch_bytes: 0, ..work };
                    assert_eq!(known(made.work()), known(split.work()));
                    assert_eq!(made.node_count(), split.node_count());
                    // The same words in the same order: they are over in the same frames, and change the mesh alike.
                    split.set_budget(Budget::default());
                    for step in 1..20 {
                        let mut on = view;
                        on.eye_m.x += 4.0 * f64::from(step);
                        on.yaw_rad += 0.01 * f64::from(step);
                        made.update(&on, &mut Unobserved);
                        split.update(&on, &mut Unobserved);
                        assert!(made.patch() == split.patch(), "{samples:?}, step {step}");
                        assert_eq!(made.work(), split.work());
                    }
                }
            });
        }
    }
}

/// Levels of more split vertices than are made together, with padding and voids, whose corners are looked at: all of them have to be there by then.
#[test]
fn a_mesh_of_many_pieces_is_what_is_drawn() {
    for (samples, holes) in [([600, 500], true), ([500, 600], false), ([513, 513], true)] {
        let terrain = rugged_terrain(samples, 7, holes);
        let view = frame(&terrain, [0.5, 0.5], 9000.0, 20.0, -80.0).view(VIEWPORT, 0.05);
        with_records!(terrain.records().unwrap(), records => {
            for culling in Culling::ALL {
                let mut soar = Soar::new(records.clone(), culling);
                let mut kinetic = Kinetic::new(records.clone(), culling);
                let [mut mirror, mut whole] = [Mirror::default(), Mirror::default()];
                soar.update(&view, &mut Unobserved);
                kinetic.update(&view, &mut Unobserved);
                assert!(kinetic.node_count() > 150_000, "{}", kinetic.node_count());
                let mesh = triangles(&kinetic);
                assert!(keys(&mesh) == keys(&triangles(&soar)), "{samples:?}");
                mirror.apply(kinetic.patch());
                mirror.check_vertices(&records);
                whole.apply(&kinetic.whole_patch());
                mirror.check_same(&whole);
                assert!(mirror.triangles() == whole.triangles());
                if culling == Culling::Vertices {
                    assert!(mirror.triangles() == drawn(&records, &mesh));
                }
            }
        });
    }
}

/// Jumps about; tells all patches.
fn patches(terrain: &Terrain, culling: Culling, threads: usize) -> Vec<Patch> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        with_records!(terrain.records().unwrap(), records => {
            let mut kinetic = Kinetic::new(records, culling);
            let mut patch_of = |view: &View| {
                kinetic.update(view, &mut Unobserved);
                kinetic.patch().clone()
            };
            leaps(terrain, 0.1).iter().map(&mut patch_of).collect()
        })
    })
}

#[test]
fn patches_of_jumps_do_not_depend_on_the_number_of_threads() {
    let terrain = rugged_terrain([513, 513], 2, true);
    for culling in Culling::ALL {
        let alone = patches(&terrain, culling, 1);
        assert!(alone[3].triangles.len() > 50_000, "{} are too few to be shared", alone[3].triangles.len());
        assert!([2, 3, 4, 7].into_iter().all(|threads| patches(&terrain, culling, threads) == alone));
    }
}

/// A copy that hears of patches alone shows the mesh in every frame, jumps to smaller and to larger meshes among them.
#[test]
fn copies_follow_jumps() {
    for (samples, holes) in [([257, 257], false), ([200, 230], true)] {
        let terrain = rugged_terrain(samples, 8, holes);
        with_records!(terrain.records().unwrap(), records => {
            for (culling, budget) in Culling::ALL.into_iter().flat_map(|c| [(c, Budget::default()), (c, Budget::default().tests(700))]) {
                let mut kinetic = Kinetic::new(records.clone(), culling);
                kinetic.set_budget(budget);
                let mut mirror = Mirror::default();
                let mut jumps = 0;
                for (i, tolerance_px) in [0.3, 3.0, 0.1, 1.0].into_iter().cycle().take(12).enumerate() {
                    for view in leaps(&terrain, tolerance_px).iter().skip(3 * (i % 5)).take(3 + i % 4) {
                        let before = kinetic.triangle_count();
                        kinetic.update(view, &mut Unobserved);
                        jumps += usize::from(before > 3000 && kinetic.work().merges == 0 && kinetic.work().splits > 300);
                        mirror.apply(kinetic.patch());
                        let mesh = triangles(&kinetic);
                        check_conforming(&records, &mesh);
                        mirror.check_vertices(&records);
                        let mut whole = Mirror::default();
                        whole.apply(&kinetic.whole_patch());
                        mirror.check_same(&whole);
                        if culling == Culling::Vertices {
                            assert!(mirror.triangles() == drawn(&records, &mesh));
                        } else {
                            check_clusters(&kinetic, &kinetic.whole_patch(), &mesh.iter().map(|t| TriangleKey::of(*t)).collect::<Vec<_>>());
                            assert!(mirror.triangles() == whole.triangles());
                        }
                    }
                }
                assert!(jumps > 3 || budget != Budget::default(), "{jumps}");
            }
        });
    }
}

/// With a budget: few triangles in the first frame, no frame beyond it, and the mesh of an engine without one after as many frames as that takes.
#[test]
fn a_budget_makes_jumps_coarse_at_once_and_fine_in_the_end() {
    let terrain = rugged_terrain([513, 513], 4, false);
    let budget = 4000;
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut kinetic = Kinetic::new(records.clone(), culling);
            kinetic.set_budget(Budget::default().tests(budget));
            for view in leaps(&terrain, 1.0).iter().step_by(3) {
                let mut soar = Soar::new(records.clone(), culling);
                soar.update(view, &mut Unobserved);
                let expected = keys(&triangles(&soar));
                let mut frames = 0;
                loop {
                    let tests = kinetic.update(view, &mut Unobserved);
                    assert!(tests <= budget + 8, "{tests} tests in frame {frames}");
                    let work = kinetic.work();
                    assert!(work.splits + work.merges <= budget, "{work:?}");
                    assert!(kinetic.triangle_count() as u64 <= 4 + 2 * budget * (frames + 1));
                    frames += 1;
                    if work.late == 0 {
                        break;
                    }
                    check_conforming(&records, &triangles(&kinetic));
                }
                assert!(frames > 5, "{frames} frames");
                assert!(frames <= 2 + 4 * expected.len() as u64 / budget, "{frames} frames for {}", expected.len());
                assert!(keys(&triangles(&kinetic)) == expected);
            }
        }
    });
}

#[test]
fn a_jump_to_a_small_mesh_gives_memory_back() {
    let terrain = rugged_terrain([513, 513], 4, false);
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut kinetic = Kinetic::new(records.clone(), culling);
            let near = frame(&terrain, [0.5, 0.4], 1100.0, 0.0, -25.0).view(VIEWPORT, 0.1);
            let far = frame(&terrain, [0.5, 0.4], 90_000.0, 0.0, -89.0).view(VIEWPORT, 20.0);
            kinetic.update(&near, &mut Unobserved);
            let (many, held) = (kinetic.triangle_count(), kinetic.bytes());
            (0..3).for_each(|_| _ = kinetic.update(&far, &mut Unobserved));
            assert!(20 * kinetic.triangle_count() < many, "{} of {many}", kinetic.triangle_count());
            assert!(6 * kinetic.bytes() < held, "{culling:?}: {} of {held}", kinetic.bytes());
        }
    });
}

/// Over a pool that lacks pages, and one too small for the mesh: what is there conforms in every frame, and where all pages come the mesh is the whole one.
#[test]
fn jumps_over_a_pool_that_lacks_pages() {
    let terrain = Arc::new(rugged_terrain([257, 257], 6, true));
    let views = leaps(&terrain, 0.4);
    for (cache_bytes, is_large, culling) in
        Culling::ALL.into_iter().flat_map(|c| [(64u64 << 20, true, c), (96 << 10, false, c)])
    {
        with_records!(terrain.pool(cache_bytes).unwrap(), pool => {
            let disk = ModelDisk::new(Arc::clone(&terrain), 2, 8);
            let mut streamed = Streamed::new(pool, disk, culling, Prefetch::Deadline);
            let mut mirror = Mirror::default();
            for view in &views {
                for _ in 0..12 {
                    streamed.update(view, &mut Unobserved);
                    let engine = streamed.engine();
                    mirror.apply(engine.patch());
                    let mut whole = Mirror::default();
                    whole.apply(&engine.whole_patch());
                    assert!(mirror.triangles() == whole.triangles());
                    with_records!(terrain.records().unwrap(), records => check_conforming(&records, &triangles(engine)));
                }
            }
            let last = &views[views.len() - 1];
            let mut frames = 0;
            while is_large && streamed.update(last, &mut Unobserved).work.late > 0 {
                frames += 1;
                assert!(frames < 5000);
            }
            if is_large {
                with_records!(terrain.records().unwrap(), records => {
                    let mut soar = Soar::new(records, culling);
                    soar.update(last, &mut Unobserved);
                    assert!(keys(&triangles(streamed.engine())) == keys(&triangles(&soar)));
                });
            }
        });
    }
}
