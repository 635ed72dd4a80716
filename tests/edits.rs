//! Ground that changes under a flight: every engine draws, in the frame of the edit, what a full refinement of the edited ground draws.

mod common;

use common::checks::{VIEWPORT, check_conforming, keys, triangles};
use common::mirror::{Mirror, check_clusters, drawn};
use common::{frame, noise, rugged, terrain_of};
use proptest::prelude::*;
use std::sync::Arc;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::{EngineKind, Quality, TimedBatch, frame_mesh, replay_edited};
use terrasoar::mesh::TriangleKey;
use terrasoar::refine::ground::GroundChange;
use terrasoar::refine::kinetic::{Budget, Kinetic};
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::view::View;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Area, Changes, Crater, Edit, Editor, SampleRect};
use terrasoar_layout::edited::EditedRecords;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::record::{RecordCodec, RecordKind};
use terrasoar_layout::terrain::Terrain;
use terrasoar_layout::with_records;

/// Ground with room for edits below and above: two corner samples lie far off.
fn terrain(samples: [u32; 2], seed: u64, holes: bool) -> Arc<Terrain> {
    let dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| match (x, y) {
        (0, 0) => -2000.0,
        (1, 0) => 4000.0,
        _ if holes && (x.abs_diff(40).pow(2) + y.abs_diff(50).pow(2) < 80 || noise(seed, y, x) < 0.002) => {
            f64::NAN
        }
        _ => rugged(seed, x, y),
    });
    let options = BuildOptions { spacing_m: Some([10.0, 12.0]), ..Default::default() };
    Arc::new(terrain_of(&dem, &options))
}

/// Ground without room, of records that need none.
fn exact_terrain(samples: [u32; 2], seed: u64) -> Arc<Terrain> {
    let dem = MemoryDem::from_fn(samples, SampleType::F32, |x, y| rugged(seed, x, y) / 7.0);
    let options = BuildOptions {
        spacing_m: Some([10.0, 12.0]),
        record: Some(RecordKind::Exact8),
        ..Default::default()
    };
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
fn tell<'r, C: RecordCodec>(
    engine: &mut impl Engine<Store = EditedRecords<'r, C>>,
    editor: &Editor,
    changes: &Changes,
) {
    let height_range_m = editor.header().height_range_m;
    engine.store_mut().set_height_range_m(height_range_m);
    for page in &changes.pages {
        engine.store_mut().install(*page, editor.edited_page(*page).unwrap()).unwrap();
    }
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
        hasty.set_budget(Budget { tests: Some(60), time: None });
        let mut mirror = Mirror::default();
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
            check_conforming(&edited, &triangles(&hasty));
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
        which in 0usize..4, clusters in any::<bool>(), seed in any::<u64>(),
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
            frame.view(VIEWPORT, 2.0)
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
    let quality = Quality { viewport: VIEWPORT, tolerance_px: 2.0, ..Quality::default() };
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
