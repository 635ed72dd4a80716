//! Everything that engines, flights and measurements do with a terrain, done to one that may hold nonsense: whatever comes out, it comes to an end and in proportion to what the
//! file holds.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use terrasoar::flight::FlightFrame;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::flyover::{
    EngineKind, Quality, TimedBatch, frame_mesh, mean_incoherence_percent, replay, replay_edited,
};
use terrasoar::refine::{Culling, Unobserved};
use terrasoar::simplify::{SimplifyOptions, simplify};
use terrasoar::stream::{Streamed, ThreadFetch, height_at};
use terrasoar::view::{View, Viewport};
use terrasoar_lab::iobench::{CountOptions, LayoutKind, Prefetch, Reader, count};
use terrasoar_lab::mesh_file::{Format, MeshFile, Texture};
use terrasoar_layout::edit::{Crater, Edit, SampleRect};
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Frames near the ground, far above it and turning.
pub fn frames(terrain: &Terrain) -> Vec<FlightFrame> {
    let [east, north] = terrain.grid().extent_m();
    let [low, high] = terrain.header().height_range_m;
    let up_m = (high + 0.05 * east.max(north)).clamp(-1e8, 1e8);
    let frame = |i: u32, at: [f64; 2], up_m: f64, yaw_deg: f64| FlightFrame {
        time_s: f64::from(i),
        eye_m: [at[0] * east, at[1] * north, up_m],
        yaw_deg,
        pitch_deg: -30.0,
        roll_deg: 0.0,
        vertical_fov_deg: 60.0,
    };
    vec![
        frame(0, [0.2, 0.3], up_m, 45.0),
        frame(1, [0.22, 0.33], up_m, 47.0),
        frame(2, [0.5, 0.5], low.clamp(-1e8, 1e8), 200.0),
        frame(3, [0.5, 0.5], 1e9, 0.0),
    ]
}

fn quality(culling: Culling, vertical_exaggeration: f64) -> Quality {
    Quality::default()
        .viewport(Viewport { width_px: 160, height_px: 120 })
        .culling(culling)
        .vertical_exaggeration(vertical_exaggeration)
}

/// Flies over the file at `path`, with the edits in `overlay` if there is one. Returns whether it opened.
pub fn fly(path: &Path, overlay: Option<&Path>) -> bool {
    let opened = match overlay {
        Some(overlay) => Terrain::open_with_overlay(path, overlay),
        None => Terrain::open(path),
    };
    let Ok(terrain) = opened else { return false };
    let terrain = Arc::new(terrain);
    let frames = frames(&terrain);
    if terrain.check_directory().is_err() {
        // What takes all records refuses; what reads page by page reads what there is.
        let quality = quality(Culling::Vertices, 1.0);
        assert!(replay(&terrain, &frames, quality, EngineKind::Soar, &mut |_| {}).is_err());
        let view = |frame: &FlightFrame| frame.view(quality.viewport, quality.tolerance_px);
        stream(&terrain, &frames.iter().map(view).collect::<Vec<View>>());
        return true;
    }
    let edits = [
        Edit::set(SampleRect { west: 1, south: 1, east: 4, north: 3 }, terrain.header().height_range_m[0]),
        Edit::Crater(Crater {
            centre_m: terrain.grid().extent_m().map(|m| 0.4 * m),
            direction_deg: 10.0,
            radius_m: 4.0 * terrain.grid().spacing_m()[0],
            depth_m: 3.0,
        }),
    ];
    let batches = [TimedBatch { frame: 1, edits: edits.to_vec() }];
    // Brute force takes its time on a large square, whatever is in it.
    let is_large = terrain.grid().side_steps() > 64;
    for kind in EngineKind::ALL.into_iter().filter(|kind| !(is_large && *kind == EngineKind::Naive)) {
        for (culling, exaggeration) in [(Culling::Vertices, 1.0), (Culling::Clusters, 100.0)] {
            let quality = quality(culling, exaggeration);
            let flown = replay(&terrain, &frames, quality, kind, &mut |_| {});
            let flown = flown.expect("a small terrain in memory is flown over");
            let triangles = flown.iter().map(|frame| frame.triangles).max().unwrap_or(0);
            // Each stored record can split two triangles.
            let records = terrain.header().stored_pages * terrain.header().records_per_page();
            assert!(triangles <= 4 + 2 * records, "{triangles} triangles of {records} records");
            let _ = replay_edited(&terrain, &frames, quality, kind, &batches, &mut |_| {});
            let _ = frame_mesh(&terrain, &frames, 2, quality, kind, &batches);
        }
    }
    let pairs: Vec<_> = frames.windows(2).map(|pair| (pair[0], pair[1])).collect();
    let _ = mean_incoherence_percent(&terrain, &pairs, quality(Culling::Vertices, 1.0));
    for kind in FlightKind::ALL {
        let _ = generate(&TerrainGround::new(&terrain), &FlightPlan::new(kind, 5, 3.0));
    }
    let quality = quality(Culling::Vertices, 1.0);
    let views: Vec<View> =
        frames.iter().map(|frame| frame.view(quality.viewport, quality.tolerance_px)).collect();
    let options = CountOptions::default()
        .layouts(LayoutKind::ALL.to_vec())
        .preloads(vec![Prefetch::None, Prefetch::Frustum])
        .cache_pages(4)
        .disk_pages(2)
        .block_m(10.0)
        .trace(false);
    count(&terrain, &views, quality.culling, Reader::Engine(EngineKind::Soar), &options, &mut |_| {})
        .expect("a terrain in memory is counted over");
    stream(&terrain, &views);
    mesh(&terrain);
    true
}

/// A mesh without an eye, in every format.
fn mesh(terrain: &Terrain) {
    let [east, north] = terrain.grid().extent_m();
    let texture = Texture::of(terrain, [0.0, 0.0, east, north], 64).ok().flatten();
    for max_error_m in [0.0, 5.0] {
        let options = SimplifyOptions::default().max_error_m(max_error_m).max_triangles(100_000);
        let Ok(mesh) = simplify(terrain, &options) else { continue };
        for format in [Format::PlyText, Format::Stl, Format::Glb] {
            let file = MeshFile::new(&mesh).texture(texture.as_ref());
            file.write(format, &mut std::io::sink()).expect("nothing refuses bytes here");
        }
    }
}

/// Flies over a pool.
fn stream(terrain: &Arc<Terrain>, views: &[View]) {
    for prefetch in Prefetch::ALL {
        let Ok(pool) = terrain.pool(1 << 17) else { continue };
        let loader = ThreadFetch::from(Loader::start(Arc::clone(terrain), 2).expect("a thread is to be had"));
        with_records!(pool, pool => {
            let mut streamed = Streamed::new(pool, loader, Culling::Vertices, prefetch);
            for view in views {
                streamed.fill(view, Duration::from_secs(60), &mut Unobserved);
                streamed.update(view, &mut Unobserved);
            }
            for at in [[0.0, 0.0], [55.5, 33.3], [1e9, -1.0]] {
                let _ = height_at(streamed.engine().store(), at[0], at[1]);
            }
        });
    }
}
