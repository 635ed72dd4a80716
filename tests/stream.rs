//! Flying over a terrain of which only some pages are in memory: the mesh conforms whatever is late, becomes the whole engine's once all has come, and live ranges
//! foresee what a steady flight needs. Every test runs on a model disk, so that two runs are the same.

mod common;

use common::checks::{check_conforming, keys, measured, triangles, views};
use common::mirror::{Mirror, drawn};
use common::{frame, rugged, rugged_terrain, terrain_of};
use std::sync::Arc;
use std::time::Duration;
use terrasoar::flight::FlightFrame;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{ModelDisk, Prefetch, StreamFrame, Streamed, height_at};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// A terrain of some 1,700 pages.
fn large_terrain() -> Arc<Terrain> {
    let dem = MemoryDem::from_fn([1025; 2], SampleType::I16, |x, y| rugged(9, x, y));
    Arc::new(terrain_of(&dem, &BuildOptions::default().spacing_m([10.0, 10.0])))
}

/// Straight ahead, and a turn at the end.
fn path(terrain: &Terrain, frames: u32, turning: bool) -> Vec<FlightFrame> {
    (0..frames)
        .map(|i| {
            let turn = if turning { f64::from(i.saturating_sub(frames / 2)) } else { 0.0 };
            frame(
                terrain,
                [0.4, 0.1 + 0.6 * f64::from(i) / f64::from(frames)],
                1400.0,
                15.0 + 2.0 * turn,
                -20.0,
            )
        })
        .collect()
}

/// How a flight is streamed.
#[derive(Debug, Clone, Copy)]
struct How {
    culling: Culling,
    prefetch: Prefetch,
    cache_pages: u64,
    reads_a_frame: usize,
    latency_frames: u64,
    /// Frames from one check of the mesh to the next.
    check_every: usize,
}

/// Flies `flown`, checks every frame, and at the end that what was late has come.
fn fly(terrain: &Arc<Terrain>, flown: &[View], how: How) -> Vec<StreamFrame> {
    let mut frames = Vec::new();
    let disk = ModelDisk::new(Arc::clone(terrain), how.reads_a_frame, how.latency_frames);
    let pool = terrain.pool(how.cache_pages * PAGE_BYTES as u64).unwrap();
    macro_rules! flight {
        ($pool:expr, $records:expr) => {{
            let records = $records;
            let mut streamed = Streamed::new($pool, disk, how.culling, how.prefetch);
            let mut mirror = Mirror::default();
            let mut follow = |streamed: &Streamed<_, _>, i: usize| {
                mirror.apply(streamed.engine().patch());
                let mesh = triangles(streamed.engine());
                if !i.is_multiple_of(how.check_every) {
                    return mesh;
                }
                check_conforming(&records, &mesh);
                // What waits for its record is drawn until void is known of.
                if how.culling == Culling::Vertices
                    && (!records.has_voids() || streamed.engine().work().unread == 0)
                {
                    assert!(mirror.triangles() == drawn(&records, &mesh), "frame {i}");
                }
                mesh
            };
            for (i, view) in flown.iter().enumerate() {
                let frame = streamed.update(view, &mut Unobserved);
                assert_eq!(frame.failures, 0);
                let held = streamed.engine().store().pages_held() as u64;
                assert!(held <= how.cache_pages, "{held} pages in room for {}", how.cache_pages);
                assert!(frame.work.late_error_px == 0.0 || frame.work.late > 0);
                follow(&streamed, i);
                frames.push(frame);
            }
            let last = flown.last().unwrap();
            let mut soar = Soar::new(records.clone(), how.culling);
            soar.update(last, &mut Unobserved);
            for i in 0.. {
                assert!(i < 5000, "{} stay late", streamed.engine().work().late);
                let frame = streamed.update(last, &mut Unobserved);
                let mesh = follow(&streamed, flown.len() + i);
                if frame.work.late == 0 {
                    assert!(keys(&mesh) == keys(&triangles(&soar)), "what was late has not caught up");
                    break;
                }
            }
        }};
    }
    match (pool, terrain.records().unwrap()) {
        (
            terrasoar_layout::read::kinds::ByKind::Compact(pool),
            terrasoar_layout::read::kinds::ByKind::Compact(records),
        ) => flight!(pool, records),
        (
            terrasoar_layout::read::kinds::ByKind::Exact8(pool),
            terrasoar_layout::read::kinds::ByKind::Exact8(records),
        ) => {
            flight!(pool, records)
        }
        (
            terrasoar_layout::read::kinds::ByKind::Exact16(pool),
            terrasoar_layout::read::kinds::ByKind::Exact16(records),
        ) => flight!(pool, records),
        _ => unreachable!("pool and records are of one kind"),
    }
    frames
}

#[test]
fn the_mesh_conforms_whatever_is_late_and_catches_up() {
    for (samples, holes) in [([257, 257], false), ([240, 180], true)] {
        let terrain = Arc::new(rugged_terrain(samples, 6, holes));
        let flown = views(path(&terrain, 40, true), 1.0);
        let ways =
            Culling::ALL.into_iter().flat_map(|culling| ErrorMetric::ALL.map(|metric| (culling, metric)));
        for (culling, metric) in ways {
            let flown = measured(&flown, metric);
            for prefetch in Prefetch::ALL {
                let how = How {
                    culling,
                    prefetch,
                    cache_pages: 4000,
                    reads_a_frame: 1,
                    latency_frames: 3,
                    check_every: 1,
                };
                let frames = fly(&terrain, &flown, how);
                assert!(frames[0].work.unread > 0 && frames[0].late_pages > 0, "{how:?}");
                assert!(frames.iter().any(|f| f.work.late_error_px > 1.0), "{how:?}: what is late shows");
            }
        }
    }
}

#[test]
fn two_flights_over_a_model_disk_are_the_same() {
    let terrain = Arc::new(rugged_terrain([257, 257], 6, false));
    let flown = views(path(&terrain, 30, true), 1.0);
    for prefetch in Prefetch::ALL {
        let how = How {
            culling: Culling::Vertices,
            prefetch,
            cache_pages: 30,
            reads_a_frame: 2,
            latency_frames: 2,
            check_every: 1,
        };
        assert_eq!(fly(&terrain, &flown, how), fly(&terrain, &flown, how));
    }
}

#[test]
fn deadlines_foresee_what_a_steady_flight_needs() {
    let terrain = large_terrain();
    let flown = views(path(&terrain, 400, false), 2.0);
    let shares = Prefetch::ALL.map(|prefetch| {
        let how = How {
            culling: Culling::Vertices,
            prefetch,
            cache_pages: 600,
            reads_a_frame: 20,
            latency_frames: 2,
            check_every: 40,
        };
        let frames = fly(&terrain, &flown, how);
        // The first second is for starting from nothing.
        let later = &frames[60..];
        let sum = |f: fn(&StreamFrame) -> u64| later.iter().map(f).sum::<u64>();
        let (late, come) = (sum(|f| f.late_pages), sum(|f| f.pages_come));
        println!(
            "{}: {late} late pages of {come} that came, {} read, {} asked",
            prefetch.name(),
            sum(|f| f.pages_read),
            sum(|f| f.pages_asked)
        );
        (late, come)
    });
    let [(none, _), (_, _), (deadline, come)] = shares;
    assert!(none > 100, "a flight that needs nothing shows nothing: {shares:?}");
    assert!(deadline * 100 <= none, "{shares:?}");
    assert!(come < 4 * none, "what is foreseen is far more than what is needed: {shares:?}");
}

#[test]
fn soundings_are_the_terrains_own_where_it_is_at_hand() {
    let terrain = Arc::new(rugged_terrain([240, 180], 6, true));
    let view = views(path(&terrain, 2, false), 1.0)[0];
    let [wide_m, high_m] = terrain.grid().extent_m();
    let spots: Vec<[f64; 2]> = (0..400)
        .map(|i| [0.618 * f64::from(i) % 1.0 * wide_m, 0.414 * f64::from(i) % 1.0 * high_m])
        .chain([[0.0, 0.0], [wide_m, high_m], [wide_m, 0.0], [-1.0, 5.0], [5.0, high_m + 1.0]])
        .collect();
    with_records!(terrain.pool(1 << 30).unwrap(), pool => {
        let mut streamed = Streamed::new(pool, ModelDisk::new(Arc::clone(&terrain), 8, 1), Culling::Vertices, Prefetch::None);
        let [mut coarse, mut largest_m] = [0.0f64; 2];
        for [east_m, north_m] in spots.iter().copied() {
            let sounding = height_at(streamed.engine().store(), east_m, north_m);
            if let (false, Some(height_m), Some(own_m)) = (sounding.is_exact, sounding.height_m, terrain.height_m(east_m, north_m).unwrap()) {
                coarse += 1.0;
                largest_m = largest_m.max((height_m - own_m).abs());
            }
            streamed.want_height(east_m, north_m);
        }
        let [low, high] = terrain.header().height_range_m;
        assert!(coarse > 100.0 && largest_m > 0.0 && largest_m < high - low, "{coarse} {largest_m}");
        streamed.fill(&view, Duration::from_secs(60), &mut Unobserved);
        for _ in 0..200 {
            streamed.update(&view, &mut Unobserved);
        }
        for [east_m, north_m] in spots {
            let sounding = height_at(streamed.engine().store(), east_m, north_m);
            let own_m = terrain.height_m(east_m, north_m).unwrap();
            assert!(sounding.is_exact);
            let off_m = sounding.height_m.zip(own_m).map(|(a, b)| (a - b).abs());
            assert!(sounding.height_m.is_some() == own_m.is_some() && off_m.is_none_or(|off| off < 1e-6), "{sounding:?} {own_m:?} at {east_m} {north_m}");
        }
    });
}
