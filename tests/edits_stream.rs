//! Ground that changes under a flight over a pool: heights are right in every frame whatever has come, and once all has come the mesh is SOAR's over the edited ground.

mod common;

use common::checks::{check_conforming, keys, triangles, views};
use common::mirror::{Mirror, drawn};
use common::{frame, install, noise, roomy_terrain};
use std::sync::Arc;
use std::time::Duration;
use terrasoar::flight::FlightFrame;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{ModelDisk, Prefetch, Streamed};
use terrasoar::view::View;
use terrasoar_layout::edit::{Crater, Edit, Editor, SampleRect};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::grid::record::Compact;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::pool::PagePool;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;

/// Frames flown.
const FRAMES: u32 = 60;

/// Straight ahead, and a turn at the end.
fn path(terrain: &Terrain) -> Vec<View> {
    let frames = (0..FRAMES).map(|i| {
        let turn = f64::from(i.saturating_sub(FRAMES / 2));
        let north = 0.1 + 0.5 * f64::from(i) / f64::from(FRAMES);
        frame(terrain, [0.4, north], 1400.0, 15.0 + 2.0 * turn, -20.0)
    });
    views(frames.collect::<Vec<FlightFrame>>(), 1.0)
}

/// Craters before the eye, some where another has just been.
fn craters(view: &View, i: u32) -> Vec<Edit> {
    let forward = view.axes()[2];
    let crater = |j: u32| {
        let ahead_m = 200.0 + 1800.0 * noise(5, i / 2, j);
        let aside_m = ahead_m * (noise(6, i, j) - 0.5);
        let centre_m = [
            view.eye_m.x + forward.x * ahead_m + forward.y * aside_m,
            view.eye_m.y + forward.y * ahead_m - forward.x * aside_m,
        ];
        let radius_m = 30.0 + 100.0 * noise(7, i, j);
        Edit::Crater(Crater { centre_m, direction_deg: 40.0, radius_m, depth_m: radius_m / 5.0 })
    };
    (0..1 + i % 4).map(crater).collect()
}

fn compact(terrain: &Terrain, cache_pages: u64) -> (PagePool<Compact>, Records<'_, Compact>) {
    match (terrain.pool(cache_pages * PAGE_BYTES as u64).unwrap(), terrain.records().unwrap()) {
        (ByKind::Compact(pool), ByKind::Compact(records)) => (pool, records),
        _ => unreachable!("whole metres make compact records"),
    }
}

/// Flies, bombs, and checks every frame; tells how many pages came too late once the flight was under way.
fn fly(terrain: &Arc<Terrain>, cache_pages: u64, culling: Culling, prefetch: Prefetch) -> u64 {
    let (pool, records) = compact(terrain, cache_pages);
    let disk = ModelDisk::new(Arc::clone(terrain), 12, 2);
    let mut streamed = Streamed::new(pool, disk, culling, prefetch);
    let mut editor = Editor::new(Arc::clone(terrain));
    let mut ground = EditedRecords::new(records);
    let mut mirror = Mirror::default();
    let flown = path(terrain);
    let last = flown[flown.len() - 1];
    let (mut unread, mut edited, mut late_pages) = (0, 0, 0);
    for (i, view) in (0..).zip(flown.into_iter().chain(std::iter::repeat(last))) {
        // After the flight too, while what is late comes.
        let is_bombed = i < FRAMES + 10 && i % 3 != 2;
        if is_bombed {
            // Told one by one, and now and then all at once.
            let craters = craters(&view, i);
            for batch in craters.chunks(if i % 2 == 0 { 1 } else { 4 }) {
                let changes = editor.apply(batch).unwrap();
                streamed.ground_changed(&changes, &editor).unwrap();
                install(&mut ground, &editor, &changes);
                edited += changes.vertices.len();
            }
        }
        let told = streamed.update(&view, &mut Unobserved);
        assert_eq!(told.failures, 0);
        unread += told.work.unread;
        late_pages += if (20..FRAMES).contains(&i) { told.late_pages } else { 0 };
        assert!(streamed.engine().store().pages_held() as u64 <= cache_pages);
        mirror.apply(streamed.engine().patch());
        mirror.check_vertices(&ground);
        if i % 10 == 0 {
            let mesh = triangles(streamed.engine());
            check_conforming(&ground, &mesh);
            if culling == Culling::Vertices {
                assert!(mirror.triangles() == drawn(&ground, &mesh), "frame {i}");
            }
        }
        if i > FRAMES + 10 && told.work.late == 0 {
            break;
        }
        assert!(i < 5000, "{} stay late", told.work.late);
    }
    assert!(unread > 0 && edited > 10_000, "{unread} {edited}");
    let mut soar = Soar::new(ground.clone(), culling);
    soar.update(&last, &mut Unobserved);
    let mesh = triangles(streamed.engine());
    assert!(keys(&mesh) == keys(&triangles(&soar)), "not the mesh of the edited ground");
    let mut anew = Mirror::default();
    anew.apply(&streamed.engine().whole_patch());
    mirror.check_same(&anew);
    anew.check_vertices(&ground);
    late_pages
}

/// Flies over some 1,700 pages.
fn bomb(cache_pages: u64) {
    let terrain = Arc::new(roomy_terrain([1025; 2], 9, false));
    let late = Prefetch::ALL.map(|prefetch| fly(&terrain, cache_pages, Culling::Vertices, prefetch));
    println!("pages too late in a pool of {cache_pages}: {late:?}");
    fly(&terrain, cache_pages, Culling::Clusters, Prefetch::Deadline);
}

#[test]
fn craters_fall_while_pages_come() {
    bomb(4000);
}

#[test]
fn craters_fall_while_pages_come_and_go() {
    bomb(250);
}

/// What is lacking is edited pages alone, which no disk brings: the first frame waits for them too.
#[test]
fn filling_brings_edited_pages() {
    let terrain = Arc::new(roomy_terrain([257; 2], 4, false));
    let (pool, records) = compact(&terrain, 4000);
    let disk = ModelDisk::new(Arc::clone(&terrain), 4, 1);
    let mut streamed = Streamed::new(pool, disk, Culling::Vertices, Prefetch::None);
    let mut editor = Editor::new(Arc::clone(&terrain));
    let mut ground = EditedRecords::new(records);
    let everything = SampleRect { west: 0, south: 0, east: 256, north: 256 };
    let crater = |i: u32| {
        let centre_m = [2560.0 * noise(1, i, 0), 3072.0 * noise(2, i, 0)];
        Edit::Crater(Crater { centre_m, direction_deg: 0.0, radius_m: 60.0, depth_m: 25.0 })
    };
    let edits: Vec<Edit> = [Edit::set(everything, 900.0)].into_iter().chain((0..400).map(crater)).collect();
    let changes = editor.apply(&edits).unwrap();
    streamed.ground_changed(&changes, &editor).unwrap();
    install(&mut ground, &editor, &changes);
    let view = frame(&terrain, [0.4, 0.1], 1300.0, 15.0, -20.0).view(common::checks::VIEWPORT, 1.0);
    let first = streamed.update(&view, &mut Unobserved);
    assert!(first.pages_asked == 0 && first.outstanding == 0 && first.work.unread > 0, "{first:?}");
    assert!(streamed.fill(&view, Duration::from_secs(60), &mut Unobserved) > 1);
    assert_eq!(streamed.engine().work().late, 0);
    let mut soar = Soar::new(ground, Culling::Vertices);
    soar.update(&view, &mut Unobserved);
    let expected = triangles(&soar);
    assert!(expected.len() > 1000);
    assert!(keys(&triangles(streamed.engine())) == keys(&expected));
}
