//! What the counts of a flight's reads promise: they repeat, agree with replay under every culling, order the layouts as they are meant to, and preloading helps.

#[path = "../../tests/common/mod.rs"]
mod common;

use common::terrain_of;
use std::sync::LazyLock;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::{EngineKind, Quality, replay};
use terrasoar::refine::Culling;
use terrasoar::view::View;
use terrasoar_lab::iobench::{CountOptions, IoRun, LayoutKind, Prefetch, Reader, Run, count};
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::read::terrain::Terrain;

const ENGINES: [EngineKind; 3] = [EngineKind::Soar, EngineKind::Smart, EngineKind::Kinetic];

/// Fractal-like ground of 2^k + 1 samples a side, 20 m apart: waves whose height falls with their length.
fn ground(k: u32) -> Terrain {
    let side = (1 << k) + 1;
    let dem = MemoryDem::from_fn([side; 2], SampleType::I16, |x, y| {
        let mut height = 1000.0;
        for octave in 0..8u32 {
            let (length, turn) = (1400.0 / f64::from(1 << octave), f64::from(octave) * 1.1);
            let along = f64::from(x) * turn.cos() + f64::from(y) * turn.sin();
            let across = f64::from(y) * turn.cos() - f64::from(x) * turn.sin();
            height += 0.35 * length * (along / length * 6.3).sin() * (across / length * 5.1 + turn).cos();
        }
        height + 4.0 * common::noise(7, x, y)
    });
    terrain_of(&dem, &BuildOptions::default().spacing_m([20.0; 2]))
}

/// 2,049 x 2,049 samples.
static LARGE: LazyLock<Terrain> = LazyLock::new(|| ground(11));

/// Straight ahead over the middle, `step_m` a frame.
fn flight(terrain: &Terrain, frames: u32, step_m: f64) -> Vec<FlightFrame> {
    let [_, high_m] = terrain.grid().extent_m();
    (0..frames)
        .map(|i| common::frame(terrain, [0.45, 0.15 + f64::from(i) * step_m / high_m], 1900.0, 8.0, -12.0))
        .collect()
}

fn views(frames: &[FlightFrame], quality: Quality) -> Vec<View> {
    frames.iter().map(|f| f.view(quality.viewport, quality.tolerance_px)).collect()
}

fn options() -> CountOptions {
    CountOptions::default()
        .layouts(LayoutKind::ALL.to_vec())
        .preloads(vec![Prefetch::None, Prefetch::Frustum])
        .cache_pages(1 << 15)
        .disk_pages(128)
        .block_m(1000.0)
        .trace(false)
}

fn fly(terrain: &Terrain, frames: &[FlightFrame], reader: Reader, options: &CountOptions) -> Vec<Run> {
    let quality = Quality::default();
    let mut done = 0;
    let runs =
        count(terrain, &views(frames, quality), quality.culling, reader, options, &mut |n| done = n).unwrap();
    assert_eq!(done, frames.len() as u64);
    assert_eq!(runs.len(), options.layouts.len() * options.preloads.len());
    runs
}

fn find(runs: &[Run], layout: LayoutKind, preload: Prefetch) -> IoRun {
    IoRun::of(runs.iter().find(|r| r.layout == layout && r.preload == preload).unwrap())
}

#[test]
fn counts_repeat_and_agree_with_replay() {
    let terrain = ground(8);
    let frames = flight(&terrain, 20, 25.0);
    for culling in Culling::ALL {
        for engine in ENGINES {
            let quality = Quality::default().culling(culling);
            let (views, reader) = (views(&frames, quality), Reader::Engine(engine));
            let run = || count(&terrain, &views, culling, reader, &options(), &mut |_| {}).unwrap();
            let runs = run();
            assert_eq!(runs, run(), "{engine:?}");
            let replayed = replay(&terrain, &frames, quality, engine, &mut |_| {}).unwrap();
            for run in runs.iter().filter(|r| r.layout == LayoutKind::Ours) {
                for (counted, replayed) in run.frames.iter().zip(&replayed) {
                    assert_eq!(counted.pages, replayed.pages_touched);
                    assert_eq!(counted.record_bytes, replayed.record_bytes_touched);
                }
            }
        }
    }
}

#[test]
fn what_is_counted_is_consistent() {
    let terrain = ground(8);
    let frames = flight(&terrain, 12, 25.0);
    for reader in ENGINES.map(Reader::Engine).into_iter().chain([Reader::Mesh]) {
        let options = options().trace(true).cache_pages(40).disk_pages(5);
        for run in fly(&terrain, &frames, reader, &options) {
            assert_eq!(run.trace.is_some(), run.preload == Prefetch::None);
            for (i, f) in run.frames.iter().enumerate() {
                assert_eq!((f.frame, f.record_bytes), (i as u64, f.reads * run.record_bytes));
                assert!(f.units <= f.pages && f.pages <= f.lines && f.lines <= 2 * f.reads);
                assert!(f.realtime_pages <= f.pages);
                assert!(f.preloaded_pages <= if run.preload == Prefetch::None || i == 0 { 0 } else { 5 });
                if let Some(trace) = &run.trace {
                    let mut pages = trace[i].clone();
                    pages.sort_unstable();
                    pages.dedup();
                    assert_eq!((pages.len(), trace[i].len()), (f.pages as usize, f.pages as usize));
                    assert!(pages.last().is_none_or(|page| page * 4096 < run.file_bytes));
                }
            }
            // A cache smaller than a frame's needs misses pages for ever; it never has more than it holds.
            let first = &run.frames[0];
            assert_eq!(first.realtime_pages, first.pages);
        }
    }
}

#[test]
fn the_mesh_needs_what_soar_reads() {
    let terrain = ground(8);
    let frames = flight(&terrain, 10, 25.0);
    let [soar, mesh] =
        [Reader::Engine(EngineKind::Soar), Reader::Mesh].map(|r| fly(&terrain, &frames, r, &options()));
    assert!(soar.iter().zip(&mesh).all(|(a, b)| a.frames == b.frames));
}

/// The order of layouts and engines on a terrain of moderate size; larger ones widen the distance (benches/runs).
#[test]
fn layouts_and_engines_keep_their_distance() {
    let frames = flight(&LARGE, 40, 40.0);
    let soar = fly(&LARGE, &frames, Reader::Engine(EngineKind::Soar), &options());
    let kinetic = fly(&LARGE, &frames, Reader::Engine(EngineKind::Kinetic), &options());
    let pages = |layout| find(&soar, layout, Prefetch::None).distinct_pages_per_frame_mean;
    let [row, tiled, interleaved, ours] = LayoutKind::ALL.map(pages);
    assert!(2.0 * ours <= interleaved, "{ours} {interleaved}");
    // Tiles of full detail are worse than rows where far ground needs few samples of many.
    assert!(10.0 * ours <= row && row < tiled, "{ours} {tiled} {row}");
    let [all, few] = [&soar, &kinetic].map(|runs| find(runs, LayoutKind::Ours, Prefetch::None));
    assert!(few.record_bytes_per_frame_mean <= 0.03 * all.record_bytes_per_frame_mean);
    assert!(3.0 * few.distinct_pages_per_frame_mean <= 2.0 * all.distinct_pages_per_frame_mean);
}

#[test]
fn preloading_by_frustum_leaves_less_to_real_time() {
    let frames = flight(&LARGE, 40, 60.0);
    let layouts = vec![LayoutKind::Row, LayoutKind::Soar, LayoutKind::Ours];
    let options = options().layouts(layouts.clone());
    for reader in [EngineKind::Soar, EngineKind::Kinetic].map(Reader::Engine) {
        let runs = fly(&LARGE, &frames, reader, &options);
        for layout in layouts.clone() {
            let [none, frustum] =
                [Prefetch::None, Prefetch::Frustum].map(|preload| find(&runs, layout, preload));
            assert_eq!(none.needed_mb, frustum.needed_mb);
            assert!(none.late_pages > 0 && frustum.preloaded_mb > 0.0 && none.preloaded_mb == 0.0);
            assert!(5 * frustum.late_pages <= none.late_pages, "{reader:?} {layout:?}");
        }
    }
}

#[test]
fn a_larger_cache_never_misses_more() {
    let terrain = ground(9);
    let frames = flight(&terrain, 30, 40.0);
    let there_and_back: Vec<FlightFrame> = frames.iter().chain(frames.iter().rev()).copied().collect();
    let late = |cache_pages| {
        let options = options().cache_pages(cache_pages).preloads(vec![Prefetch::None]);
        let runs = fly(&terrain, &there_and_back, Reader::Mesh, &options);
        find(&runs, LayoutKind::Soar, Prefetch::None).late_pages
    };
    let lates = [1, 20, 100, 400, 1 << 20].map(late);
    assert!(lates.windows(2).all(|w| w[1] <= w[0]), "{lates:?}");
    assert!(lates[4] < lates[0]);
}

#[test]
fn deadlines_are_refused() {
    let terrain = ground(5);
    let options = options().preloads(vec![Prefetch::Deadline]);
    for engine in ENGINES {
        let error = count(&terrain, &[], Culling::Vertices, Reader::Engine(engine), &options, &mut |_| {})
            .unwrap_err();
        assert!(error.to_string().contains(engine.name()), "{error}");
    }
}
