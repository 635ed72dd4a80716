//! A few frames over a terrain with every engine, over the map, over pages that are read there and then, and over pages that come late.
//!
//! Over a sound file all engines draw the mesh of the definition. Over any other they return, whatever they draw.

use std::collections::HashSet;
use std::sync::Arc;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::EngineKind;
use terrasoar::mesh::TriangleKey;
use terrasoar::refine::kinetic::{Budget, Kinetic};
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{ModelDisk, Prefetch, Streamed};
use terrasoar::view::{View, Viewport};
use terrasoar_lab::iobench::{CountOptions, LayoutKind, Reader, count};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Largest terrain that brute force flies over: 2^7 + 1 samples a side.
const MOST_K: u32 = 7;
/// Frames of a replay in all.
const MOST_FRAMES: usize = 4;
const VIEWPORT: Viewport = Viewport { width_px: 64, height_px: 48 };

/// From above, from near, from within the ground.
pub(crate) fn frames_over(terrain: &Terrain) -> Vec<FlightFrame> {
    let [east, north] = terrain.grid().extent_m();
    let [low, high] = terrain.header().height_range_m;
    let places = [
        (0.5, 0.1, high + 0.7 * north, -60.0),
        (0.45, 0.15, high + 0.02 * north, -10.0),
        (0.4, 0.2, 0.5 * (low + high), 5.0),
    ];
    let frame = |(i, (x, y, up, pitch)): (usize, (f64, f64, f64, f64))| FlightFrame {
        time_s: i as f64 / 30.0,
        eye_m: [x * east, y * north, up],
        yaw_deg: 20.0 * i as f64,
        pitch_deg: pitch,
        roll_deg: 0.0,
        vertical_fov_deg: 50.0,
    };
    places.into_iter().enumerate().map(frame).collect()
}

/// Flies the first frames over `terrain` with every engine.
pub(crate) fn flies(terrain: &Arc<Terrain>, frames: &[FlightFrame], is_sound: bool) {
    let views: Vec<View> = frames.iter().take(MOST_FRAMES).map(|frame| frame.view(VIEWPORT, 4.0)).collect();
    for culling in Culling::ALL {
        refines(terrain, &views, culling, is_sound);
    }
    streams(terrain, &views);
    if terrain.grid().k() <= MOST_K {
        counts(terrain, &views);
    }
}

fn keys(engine: &impl Engine) -> HashSet<TriangleKey> {
    let mut keys = HashSet::new();
    engine.for_each_triangle(&mut |triangle| _ = keys.insert(TriangleKey::of(triangle)));
    keys
}

fn refines(terrain: &Terrain, views: &[View], culling: Culling, is_sound: bool) {
    let is_small = terrain.grid().k() <= MOST_K;
    // Packed terrain whose pages cannot all be unpacked lends none, nor does one with a damaged directory.
    match terrain.records() {
        Ok(records) => with_records!(records, records => over(&records, views, culling, is_sound, is_small)),
        Err(_) => assert!(!is_sound, "a sound terrain does not lend its bytes"),
    }
    // Brute force reads all of it in each frame, over little memory again and again.
    let paged = terrain.paged(64 * PAGE_BYTES as u64);
    with_records!(paged, records => over(&records, views, culling, is_sound, false));
}

/// All engines over records that all have an answer, until one cannot be read.
fn over<S: CompleteStore + Clone>(
    records: &S,
    views: &[View],
    culling: Culling,
    is_sound: bool,
    is_small: bool,
) {
    let mut soar = Soar::new(records.clone(), culling);
    let mut smart = Smart::new(records.clone(), culling);
    let mut kinetic = Kinetic::new(records.clone(), culling);
    let mut hurried = Kinetic::new(records.clone(), culling);
    hurried.set_budget(Budget::default().tests(20));
    let mut naive = is_small.then(|| Naive::new(records.clone(), culling));
    for view in views {
        soar.update(view, &mut Unobserved);
        smart.update(view, &mut Unobserved);
        kinetic.update(view, &mut Unobserved);
        hurried.update(view, &mut Unobserved);
        let _ = (kinetic.patch(), kinetic.whole_patch(), soar.strip());
        if let Some(naive) = &mut naive {
            naive.update(view, &mut Unobserved);
        }
        if let Some(error) = records.take_error() {
            assert!(!is_sound, "a sound terrain cannot be read: {error}");
            return crate::words::refused(&error);
        }
        if is_sound {
            let wanted = naive.as_ref().map_or_else(|| keys(&soar), keys);
            assert!(keys(&soar) == wanted, "soar draws another mesh over a file that was called sound");
            assert!(keys(&smart) == wanted, "smart draws another mesh over a file that was called sound");
            assert!(keys(&kinetic) == wanted, "kinetic draws another mesh over a file that was called sound");
        }
    }
}

/// Over few pages of memory that come a frame late.
fn streams(terrain: &Arc<Terrain>, views: &[View]) {
    let Some(pool) = crate::words::told(terrain.pool(12 * PAGE_BYTES as u64)) else { return };
    with_records!(pool, pool => {
        let disk = ModelDisk::new(Arc::clone(terrain), 3, 1);
        let mut streamed = Streamed::new(pool, disk, Culling::Clusters, Prefetch::Deadline);
        for view in views.iter().flat_map(|view| [view, view, view]) {
            streamed.update(view, &mut Unobserved);
            while let Some(error) = streamed.take_error() {
                crate::words::refused(&error);
            }
        }
    });
}

/// What the reads of a flight touch.
fn counts(terrain: &Terrain, views: &[View]) {
    let options = CountOptions::default()
        .layouts(LayoutKind::ALL.to_vec())
        .preloads(vec![Prefetch::None, Prefetch::Frustum])
        .cache_pages(3)
        .disk_pages(2)
        .block_m(50.0)
        .trace(true);
    for reader in [Reader::Engine(EngineKind::Kinetic), Reader::Mesh] {
        crate::words::told(count(terrain, views, Culling::Clusters, reader, &options, &mut |_| {}));
    }
}
