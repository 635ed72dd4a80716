//! Ground that changes under a flight: every engine draws, in the frame of the edit, what a full refinement of the edited ground draws.

mod common;

use common::checks::{VIEWPORT, check_conforming, keys, triangles};
use common::mirror::{Mirror, check_clusters, drawn};
use common::{frame, install, noise, roomy_terrain, rugged, terrain_of};
use proptest::prelude::*;
use std::collections::HashSet;
use std::sync::Arc;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::{EngineKind, Quality, TimedBatch, frame_mesh, replay_edited};
use terrasoar::mesh::TriangleKey;
use terrasoar::refine::change::GroundChange;
use terrasoar::refine::kinetic::{Budget, Kinetic};
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Area, Changes, Crater, Edit, Editor, SampleRect};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

fn terrain(samples: [u32; 2], seed: u64, holes: bool) -> Arc<Terrain> {
    Arc::new(roomy_terrain(samples, seed, holes))
}

/// Ground without room, of records that need none.
fn exact_terrain(samples: [u32; 2], seed: u64) -> Arc<Terrain> {
    let dem = MemoryDem::from_fn(samples, SampleType::F32, |x, y| rugged(seed, x, y) / 7.0);
    let options = BuildOptions::default().spacing_m([10.0, 12.0]).record(RecordKind::Exact8);
    Arc::new(terrain_of(&dem, &options))
}

fn terrains() -> [Arc<Terrain>; 4] {
    [
        terrain([129, 129], 3, false),
        terrain([100, 129], 4, false),
        terrain([120, 90], 5, true),
        exact_terrain([97, 101], 6),
    ]
}

/// Tells an engine what changed.
fn tell<S: CompleteStore>(
    engine: &mut impl Engine<Store = EditedRecords<S>>,
    editor: &Editor,
    changes: &Changes,
) {
    let height_range_m = editor.header().height_range_m;
    install(engine.store_mut(), editor, changes);
    let page = |logical| editor.edited_page(logical);
    engine.ground_changed(&GroundChange { areas: &changes.samples, height_range_m, page: &page });
}

/// Flies over ground that is edited before some frames, with all engines, and checks every frame.
fn fly(terrain: &Arc<Terrain>, views: &[View], edits: &[(usize, Vec<Edit>)], culling: Culling) {
    let mut editor = Editor::new(Arc::clone(terrain));
    with_records!(terrain.records().unwrap(), records => {
        let store = || EditedRecords::new(records.clone());
        let mut naive = Naive::new(store(), culling);
        let mut soar = Soar::new(store(), culling);
        let mut smart = Smart::new(store(), culling);
        let mut kinetic = Kinetic::new(store(), culling);
        let mut hasty = Kinetic::new(store(), culling);
        hasty.set_budget(Budget::default().tests(60));
        let (mut mirror, mut hasty_mirror) = (Mirror::default(), Mirror::default());
        for (i, view) in views.iter().enumerate() {
            for (_, edits) in edits.iter().filter(|(frame, _)| *frame == i) {
                let changes = match editor.apply(edits) {
                    Ok(changes) => changes,
                    // Compact records hold what they were made for; others grow with the heights.
                    Err(LayoutError::OutOfRange { .. }) => continue,
                    Err(error) => panic!("{error}"),
                };
                tell(&mut naive, &editor, &changes);
                tell(&mut soar, &editor, &changes);
                tell(&mut smart, &editor, &changes);
                tell(&mut kinetic, &editor, &changes);
                tell(&mut hasty, &editor, &changes);
            }
            naive.update(view, &mut Unobserved);
            soar.update(view, &mut Unobserved);
            smart.update(view, &mut Unobserved);
            kinetic.update(view, &mut Unobserved);
            hasty.update(view, &mut Unobserved);
            let expected = triangles(&naive);
            let edited = soar.store_mut().clone();
            check_conforming(&edited, &expected);
            let late = triangles(&hasty);
            check_conforming(&edited, &late);
            hasty_mirror.apply(hasty.patch());
            hasty_mirror.check_vertices(&edited);
            let mut hasty_anew = Mirror::default();
            hasty_anew.apply(&hasty.whole_patch());
            hasty_mirror.check_same(&hasty_anew);
            if culling == Culling::Vertices {
                assert!(hasty_mirror.triangles() == drawn(&edited, &late), "late in frame {i}");
            }
            for (name, got) in [("soar", triangles(&soar)), ("smart", triangles(&smart)), ("kinetic", triangles(&kinetic))] {
                assert!(keys(&got) == keys(&expected), "{name} draws another mesh than naive in frame {i}");
            }
            mirror.apply(kinetic.patch());
            let whole = kinetic.whole_patch();
            let mut anew = Mirror::default();
            anew.apply(&whole);
            mirror.check_same(&anew);
            mirror.check_vertices(&edited);
            assert!(mirror.triangles() == anew.triangles());
            if culling == Culling::Vertices {
                assert!(mirror.triangles() == drawn(&edited, &expected));
            } else {
                let all: Vec<TriangleKey> = expected.iter().map(|t| TriangleKey::of(*t)).collect();
                check_clusters(&kinetic, &whole, &all);
            }
            let mut strip = Vec::new();
            kinetic.strip(&mut strip);
            assert!(strip == soar.strip(), "frame {i}: the strip is not SOAR's");
            let smart_strip: Vec<_> = smart.strip().iter().map(|v| smart.vertices()[*v as usize]).collect();
            assert!(smart_strip == soar.strip(), "frame {i}: smart's strip is not SOAR's");
        }
        // Time enough, and the eye at rest.
        hasty.set_budget(Budget::default());
        let last = &views[views.len() - 1];
        hasty.update(last, &mut Unobserved);
        assert!(keys(&triangles(&hasty)) == keys(&triangles(&naive)));
    });
}

fn edit() -> impl Strategy<Value = Edit> {
    let crater = ([0.0f64..1300.0, 0.0f64..1500.0], 15.0f64..250.0, 0.1f64..0.8, 0.0f64..360.0).prop_map(
        |(centre_m, radius_m, depth, direction_deg)| {
            Edit::Crater(Crater { centre_m, direction_deg, radius_m, depth_m: radius_m * depth })
        },
    );
    let set = (2u32..85, 2u32..85, 1u32..40, 1u32..40, -1900.0f64..3900.0).prop_map(
        |(west, south, w, h, height_m)| {
            let rect = SampleRect { west, south, east: west + w, north: south + h };
            Edit::Set { area: Area::Rect(rect), height_m }
        },
    );
    prop_oneof![4 => crater, 1 => set]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn engines_draw_the_edited_ground(
        which in 0usize..4, clusters in any::<bool>(), along_sight in any::<bool>(), seed in any::<u64>(), exaggerate in any::<bool>(),
        edits in prop::collection::vec((0usize..24, prop::collection::vec(edit(), 1..4)), 1..8),
    ) {
        let terrain = &terrains()[which];
        let culling = if clusters { Culling::Clusters } else { Culling::Vertices };
        let random = |i: u32, what| noise(seed, i, what);
        let views: Vec<View> = (0..24u32).map(|i| {
            // Rest, steady flight, turns, zoom and leaps.
            let phase = i / 6;
            let step = f64::from(if phase == 0 { 0 } else { i });
            let at = if phase == 3 { [random(i, 1), random(i, 2)] } else { [0.3 + 0.01 * step, 0.2 + 0.02 * step] };
            let turn = if phase == 2 { 17.0 * step } else { 20.0 };
            let frame = FlightFrame {
                vertical_fov_deg: if phase == 2 { 20.0 + 2.0 * step } else { 45.0 },
                ..frame(terrain, at, 1500.0 - 10.0 * step, turn, -35.0)
            };
            // Every third frame another one, in the midst of whatever else goes on.
            let vertical_exaggeration = if exaggerate { 0.5 + random(i / 3, 3) } else { 1.0 };
            let metric = if along_sight { ErrorMetric::Sight } else { ErrorMetric::Ball };
            View { vertical_exaggeration, metric, ..frame.view(VIEWPORT, 2.0) }
        }).collect();
        fly(terrain, &views, &edits, culling);
    }
}

/// A bombardment replayed: all engines hash to the same meshes, and what is told of the edits is true.
#[test]
fn replays_bomb_alike() {
    let terrain = terrain([129, 129], 7, false);
    let frames: Vec<FlightFrame> =
        (0..20).map(|i| frame(&terrain, [0.2 + 0.02 * f64::from(i), 0.2], 1600.0, 30.0, -40.0)).collect();
    let crater = |i: usize| {
        let centre_m = [300.0 + 31.0 * i as f64, 500.0];
        Edit::Crater(Crater { centre_m, direction_deg: 90.0, radius_m: 60.0, depth_m: 30.0 })
    };
    let batches: Vec<TimedBatch> =
        (3..18).map(|frame| TimedBatch { frame, edits: vec![crater(frame), crater(frame + 1)] }).collect();
    let quality = Quality::default().viewport(VIEWPORT).tolerance_px(2.0);
    let replay = |kind, batches: &[TimedBatch]| {
        replay_edited(&terrain, &frames, quality, kind, batches, &mut |_| {}).unwrap()
    };
    let reference = replay(EngineKind::Soar, &batches);
    assert!(reference.iter().enumerate().all(|(i, f)| (f.edited_records > 0) == (3..18).contains(&i)));
    let still = replay(EngineKind::Soar, &[]);
    assert_ne!(still[17].mesh_hash, reference[17].mesh_hash);
    assert!(still.iter().all(|f| (f.edited_records, f.edit_ms) == (0, 0.0)));
    for kind in EngineKind::ALL {
        for (i, (ours, theirs)) in replay(kind, &batches).iter().zip(&reference).enumerate() {
            assert_eq!(ours.mesh_hash, theirs.mesh_hash, "{} in frame {i}", kind.name());
            assert_eq!(ours.edited_records, theirs.edited_records);
        }
    }
    let mesh = |kind| frame_mesh(&terrain, &frames, 17, quality, kind, &batches).unwrap();
    let sorted = |mut positions: Vec<[f64; 3]>| {
        positions.sort_by(|a, b| a.partial_cmp(b).unwrap());
        positions
    };
    assert_eq!(sorted(mesh(EngineKind::Kinetic).positions), sorted(mesh(EngineKind::Soar).positions));
}

/// A small crater, somewhere.
fn small_crater(i: u32) -> Edit {
    let centre_m = [200.0 + 800.0 * noise(1, i, 0), 200.0 + 1000.0 * noise(1, i, 1)];
    Edit::Crater(Crater { centre_m, direction_deg: 0.0, radius_m: 40.0, depth_m: 2.0 })
}

/// However many edits come between two frames, each vertex that they move is sent once, and no triangle unless the mesh changes.
#[test]
fn each_vertex_that_moves_is_sent_once() {
    let terrain = terrain([129, 129], 8, false);
    let mut editor = Editor::new(Arc::clone(&terrain));
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut kinetic = Kinetic::new(EditedRecords::new(records.clone()), culling);
            let view = frame(&terrain, [0.5, 0.1], 2500.0, 0.0, -60.0).view(VIEWPORT, 4.0);
            let (mut still, mut once) = (0, HashSet::new());
            for i in 0..60 {
                kinetic.update(&view, &mut Unobserved);
                // On top of each other, and two apart.
                for edit in [small_crater(i), small_crater(i), small_crater(i + 100)] {
                    let changes = editor.apply(&[edit]).unwrap();
                    tell(&mut kinetic, &editor, &changes);
                }
                kinetic.update(&view, &mut Unobserved);
                let work = kinetic.work();
                once.clear();
                let twice = kinetic.patch().vertices.iter().filter(|(slot, _)| !once.insert(*slot)).count();
                if (work.splits, work.merges) == (0, 0) {
                    still += usize::from(!once.is_empty());
                    assert_eq!(twice, 0, "{culling:?}, edit {i}");
                    assert_eq!(kinetic.patch().triangles, []);
                }
                let sent = kinetic.patch().clone();
                kinetic.update(&view, &mut Unobserved);
                assert!(kinetic.patch().vertices.is_empty(), "{} again", sent.vertices.len());
            }
            assert!(still > 5, "{still} edits changed nothing but heights");
        }
    });
}

/// Hills that are taken away leave no cluster higher than its triangles for long.
#[test]
fn bounds_follow_ground_that_falls() {
    let terrain = exact_terrain([129, 129], 9);
    let mut editor = Editor::new(Arc::clone(&terrain));
    with_records!(terrain.records().unwrap(), records => {
        let mut kinetic = Kinetic::new(EditedRecords::new(records), Culling::Clusters);
        let view = frame(&terrain, [0.5, 0.1], 2500.0, 0.0, -60.0).view(VIEWPORT, 0.2);
        let highest_m = |kinetic: &Kinetic<_>| {
            kinetic.clusters().map(|(bounds, _)| bounds.largest[2]).fold(f32::MIN, f32::max)
        };
        kinetic.update(&view, &mut Unobserved);
        let before_m = highest_m(&kinetic);
        let rect = SampleRect { west: 30, south: 30, east: 90, north: 90 };
        for height_m in [2000.0, 100.0] {
            let changes = editor.apply(&[Edit::set(rect, height_m)]).unwrap();
            tell(&mut kinetic, &editor, &changes);
            kinetic.update(&view, &mut Unobserved);
            assert_eq!(highest_m(&kinetic), 2000.0);
        }
        // As many frames as there are clusters.
        let clusters = kinetic.clusters().count();
        (0..2 * clusters).for_each(|_| { kinetic.update(&view, &mut Unobserved); });
        assert_eq!(kinetic.work().merges, 0);
        assert!(highest_m(&kinetic) <= before_m, "{clusters} clusters");
    });
}

#[test]
fn a_warm_edit_allocates_nothing() {
    let terrain = terrain([257, 257], 3, false);
    let mut editor = Editor::new(Arc::clone(&terrain));
    with_records!(terrain.records().unwrap(), records => {
        for culling in Culling::ALL {
            let mut kinetic = Kinetic::new(EditedRecords::new(records.clone()), culling);
            let view = frame(&terrain, [0.5, 0.2], 1500.0, 0.0, -30.0).view(VIEWPORT, 2.0);
            kinetic.update(&view, &mut Unobserved);
            let mut sent = 0;
            let mut settled_bytes = 0;
            // The same ground up and down, over and over.
            for round in 0..300 {
                for i in 0..10u32 {
                    let [west, south] = [60 + 10 * i, 90 + 7 * i];
                    let rect = SampleRect { west, south, east: west + 12, north: south + 12 };
                    let edit = Edit::set(rect, if round % 2 == 0 { 900.0 } else { 700.0 });
                    let changes = editor.apply(&[edit]).unwrap();
                    let height_range_m = editor.header().height_range_m;
                    install(kinetic.store_mut(), &editor, &changes);
                    let page = |logical| editor.edited_page(logical);
                    let change = GroundChange { areas: &changes.samples, height_range_m, page: &page };
                    let counted = allocation_counter::measure(|| {
                        kinetic.ground_changed(&change);
                        kinetic.update(&view, &mut Unobserved);
                    });
                    sent += kinetic.patch().vertices.len();
                    if round == 140 {
                        settled_bytes = kinetic.bytes();
                    }
                    assert!(round <= 140 || counted.count_total == 0, "{culling:?} in round {round}: {counted:?}");
                }
            }
            assert!(sent > 1000, "{sent}");
            assert!(kinetic.bytes() <= settled_bytes, "{} bytes after {settled_bytes}", kinetic.bytes());
        }
    });
}
