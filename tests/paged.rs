//! Replays over pages that are read as frames need them: every engine has the meshes and the counts of mapped terrain, however small the memory; what was read repeats; what cannot be read is an error.

mod common;

use common::{frame, noise, rugged};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar::flight::FlightFrame;
use terrasoar::flyover::{
    EngineKind, Quality, ReplayError, TimedBatch, frame_mesh, mean_incoherence_percent, replay, replay_edited,
};
use terrasoar::ground::{Ground, PictureEngine};
use terrasoar::refine::Culling;
use terrasoar::simplify::{SimplifyOptions, simplify, simplify_with_reads};
use terrasoar::stats::FrameStats;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::file::source::{FailingSource, MemorySource};
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::one_in;

/// Memory for a few of the pages that a frame needs, and for most.
const CACHES: [u64; 2] = [256 << 10, 1 << 20];

fn crater(at: f64) -> Edit {
    Edit::Crater(Crater { centre_m: [at, 0.8 * at], direction_deg: 40.0, radius_m: 150.0, depth_m: 60.0 })
}

/// Rugged ground with a lake of voids and scattered ones, or without, as a file and packed.
fn files(folder: &Path, samples: [u32; 2], holes: bool, record: Option<RecordKind>) -> [PathBuf; 2] {
    let sample_type = if record == Some(RecordKind::Exact8) { SampleType::F32 } else { SampleType::I16 };
    let dem = MemoryDem::from_fn(samples, sample_type, |x, y| {
        let is_hole = x + y > 0 && (noise(5, y / 9, x / 7) < 0.05 || noise(6, y, x) < 0.001);
        if holes && is_hole { f64::NAN } else { rugged(6, x, y) }
    });
    let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.join(name));
    build(&dem, &plain, &BuildOptions::default().spacing_m([10.0, 12.0]).record(record), &Silent).unwrap();
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    [plain, packed]
}

fn path(terrain: &Terrain) -> Vec<FlightFrame> {
    let frame =
        |i| frame(terrain, [0.4, 0.1 + 0.1 * f64::from(i)], 1300.0, 15.0 + 15.0 * f64::from(i), -25.0);
    (0..6).map(frame).collect()
}

/// What repeats in any replay of the same flight: all but times, and what was read.
fn counts(frames: &[FrameStats]) -> Vec<FrameStats> {
    let counts = |f: &FrameStats| FrameStats {
        pages_read: None,
        tiles_unpacked: None,
        tile_bytes_read: None,
        ..reads(f)
    };
    frames.iter().map(counts).collect()
}

/// The same, and what was read.
fn reads(f: &FrameStats) -> FrameStats {
    let [scan_us, test_us, apply_us, read_ms, unpack_ms] = [None; 5];
    FrameStats { update_ms: 0.0, edit_ms: 0.0, scan_us, test_us, apply_us, read_ms, unpack_ms, ..*f }
}

#[test]
fn every_engine_flies_pages_as_it_flies_the_whole() {
    for (samples, holes, record) in [
        ([257, 257], false, None),
        ([240, 190], true, None),
        ([129, 120], true, Some(RecordKind::Fine)),
        ([150, 110], true, Some(RecordKind::Exact8)),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path(), samples, holes, record);
        let overlays = files.each_ref().map(|path| path.with_extension("iqo"));
        for (path, overlay) in files.iter().zip(&overlays) {
            let mut session = EditSession::open(path).unwrap();
            for at in [700.0, 1000.0, 1300.0] {
                session.apply(&[crater(at)]).unwrap();
                session.commit("crater").unwrap();
            }
            session.undo().unwrap().unwrap();
            if holes {
                drop(session);
                session = EditSession::open_overlay(path, overlay).unwrap();
                session.apply(&[crater(1100.0)]).unwrap();
                session.commit("crater").unwrap();
            }
        }
        let mapped = match holes {
            true => Terrain::open_with_overlay(&files[0], &overlays[0]),
            false => Terrain::open(&files[0]),
        };
        let mapped = Arc::new(mapped.unwrap());
        let flight = path(&mapped);
        let batches = [1, 4].map(|frame| TimedBatch { frame, edits: vec![crater(900.0), crater(1500.0)] });
        let opened = [0, 1].map(|i| match holes {
            true => Terrain::open_with_overlay_unmapped(&files[i], &overlays[i]),
            false => Terrain::open_unmapped(&files[i]),
        });
        let opened = opened.map(|terrain| Arc::new(terrain.unwrap()));
        let cullings = if holes { &Culling::ALL[..1] } else { &Culling::ALL };
        let flown = EngineKind::ALL.into_iter().flat_map(|kind| cullings.iter().map(move |c| (kind, *c)));
        for (kind, culling) in flown {
            let quality = Quality::default().culling(culling);
            let fly = |terrain, quality| replay(terrain, &flight, quality, kind, &mut |_| {}).unwrap();
            let edited = |terrain, quality| {
                replay_edited(terrain, &flight, quality, kind, &batches, &mut |_| {}).unwrap()
            };
            let expected = [fly(&mapped, quality), edited(&mapped, quality)].map(|frames| counts(&frames));
            assert!(expected[0][3].triangles > 20 && expected[0] != expected[1]);
            let mesh = frame_mesh(&mapped, &flight, 5, quality, kind, &batches).unwrap();
            for (terrain, is_packed) in opened.iter().zip([false, true]) {
                // Where time is short, each memory for one of both files: most for the plain one, a few pages for the packed one, or the other way round.
                let first = usize::from(is_packed != (kind == EngineKind::Kinetic));
                for cache_bytes in one_in(2, [CACHES[first], CACHES[1 - first]]) {
                    let quality = quality.cache_bytes(cache_bytes);
                    let flown = [fly(terrain, quality), edited(terrain, quality)];
                    assert_eq!(flown.each_ref().map(|frames| counts(frames)), expected);
                    if kind == EngineKind::Kinetic {
                        let again = [fly(terrain, quality), edited(terrain, quality)];
                        let all = |frames: &Vec<FrameStats>| frames.iter().map(reads).collect::<Vec<_>>();
                        assert_eq!(
                            flown.each_ref().map(all),
                            again.each_ref().map(all),
                            "what is read repeats"
                        );
                    }
                    // The naive engine goes through all records in their order: a page once a frame, however few there is room for.
                    if kind == EngineKind::Naive {
                        assert!(
                            flown[0].iter().all(|f| f.pages_read <= Some(f.pages_touched)),
                            "{cache_bytes}"
                        );
                    }
                    let first = &flown[0][0];
                    assert!(first.pages_read.unwrap() >= first.pages_touched.min(2));
                    assert_eq!(first.tiles_unpacked.is_some_and(|tiles| tiles > 0), is_packed);
                    assert!(first.read_ms.unwrap() > 0.0 && first.unpack_ms.is_some() == is_packed);
                    let found = frame_mesh(terrain, &flight, 5, quality, kind, &batches).unwrap();
                    assert!(found.positions == mesh.positions && found.triangles == mesh.triangles);
                }
            }
        }
    }
}

#[test]
fn meshes_without_a_flight_speeds_and_pictures_need_no_map() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), [330, 190], true, None);
    let mapped = Terrain::open(&files[0]).unwrap();
    let flight = path(&mapped);
    let pairs: Vec<_> = flight.windows(2).map(|pair| (pair[0], pair[1])).collect();
    let quality = Quality::default();
    let options = SimplifyOptions::default().max_error_m(2.0);
    let (mesh, read) = simplify_with_reads(&mapped, &options).unwrap();
    assert_eq!(read, None, "nothing is read of what is mapped");
    let percent = mean_incoherence_percent(&mapped, &pairs, quality).unwrap();
    for path in &files {
        let terrain = Terrain::open_unmapped(path).unwrap();
        for cache_bytes in [None, Some(1)] {
            let (found, read) =
                simplify_with_reads(&terrain, &options.clone().cache_bytes(cache_bytes)).unwrap();
            assert!(found.positions == mesh.positions && found.triangles == mesh.triangles);
            let read = read.unwrap();
            assert!(read.pages > 20 && !read.time.is_zero());
            assert_eq!(read.unpacked.map(|unpacked| unpacked.tiles > 0), (path == &files[1]).then_some(true));
            let found = mean_incoherence_percent(&terrain, &pairs, quality.cache_bytes(cache_bytes)).unwrap();
            assert_eq!(found, percent);
        }
        for (engine, cache_bytes) in
            [PictureEngine::Kinetic, PictureEngine::Soar].into_iter().flat_map(|e| [(e, None), (e, Some(1))])
        {
            let mut ground = Ground::reading(&terrain, engine, Culling::Vertices, cache_bytes).unwrap();
            let mut expected = Ground::mapped(&mapped, engine, Culling::Vertices).unwrap();
            for frame in &flight {
                let view: View = quality.view(frame);
                ground.update(&view);
                expected.update(&view);
                let triangles = |ground: &Ground<'_>| {
                    let mut all = Vec::new();
                    ground.for_each_triangle(&mut |t| all.push(t.map(|p| p.to_array().map(f64::to_bits))));
                    all.sort_unstable();
                    all
                };
                assert!(triangles(&ground) == triangles(&expected) && !ground.lacks_pages());
            }
            assert!(ground.take_error().is_none());
        }
    }
}

/// Several threads make the first mesh, over memory in which pages come and go all the time.
#[test]
fn threads_read_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), [1025, 1025], true, None);
    let mapped = Arc::new(Terrain::open(&files[0]).unwrap());
    let flight = [frame(&mapped, [0.1, 0.1], 1500.0, 45.0, -20.0)];
    let quality = Quality::default().tolerance_px(0.3);
    let mesh = |terrain: &Arc<Terrain>, quality| {
        frame_mesh(terrain, &flight, 0, quality, EngineKind::Kinetic, &[]).unwrap()
    };
    let expected = mesh(&mapped, quality);
    assert!(expected.triangles.len() > 100_000, "{}", expected.triangles.len());
    for path in &files {
        let terrain = Arc::new(Terrain::open_unmapped(path).unwrap());
        for cache_bytes in one_in(3, [1 << 18, 1, 64 << 20]) {
            let found = mesh(&terrain, quality.cache_bytes(cache_bytes));
            assert!(found.positions == expected.positions && found.triangles == expected.triangles);
        }
    }
}

/// Frames with so many tests that threads would share them: the pass that counts pages has one thread read them, so that counts are those of one thread, page by page.
#[test]
fn what_is_counted_does_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), [1025, 1025], false, None);
    let opened = Terrain::open(&files[0]).unwrap();
    let flight: Vec<FlightFrame> = (0..5)
        .map(|i| frame(&opened, [0.3 + 0.02 * f64::from(i), 0.2], 900.0, 30.0 + 9.0 * f64::from(i), -20.0))
        .collect();
    let replay_by = |threads: usize, path: &Path| {
        let terrain = Terrain::open_unmapped(path).unwrap();
        let quality = Quality::default().tolerance_px(0.5).cache_bytes(300 << 10);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let kind = EngineKind::Kinetic;
        let frames = pool.install(|| replay(&terrain, &flight, quality, kind, &mut |_| {}).unwrap());
        frames.iter().map(reads).collect::<Vec<FrameStats>>()
    };
    for path in &files {
        let expected = replay_by(1, path);
        let many = expected[1..].iter().filter(|f| f.vertex_tests > 40_000 && f.pages_read > Some(150));
        assert!(
            many.count() > 2,
            "{:?}",
            expected.iter().map(|f| (f.vertex_tests, f.pages_read)).collect::<Vec<_>>()
        );
        for threads in [2, 5] {
            for _ in one_in(3, 0..3) {
                assert_eq!(replay_by(threads, path), expected, "{threads} threads");
            }
        }
    }
}

/// Whichever read fails, the replay says so; and none shows another ground than there is.
#[test]
fn a_read_that_fails_is_an_error_and_no_ground() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), [400, 300], true, None);
    let mapped = Terrain::open(&files[0]).unwrap();
    let flight = &path(&mapped)[..3];
    for (path, kind) in files.iter().flat_map(|path| EngineKind::ALL.map(|kind| (path, kind))) {
        let expected = counts(&replay(&mapped, flight, Quality::default(), kind, &mut |_| {}).unwrap());
        let bytes = std::fs::read(path).unwrap();
        let mut failed = 0;
        let mut n = 0;
        loop {
            n += 1 + n / 3;
            let source = FailingSource::new(MemorySource::new("memory", bytes.clone()), n);
            let Ok(terrain) = Terrain::from_source(Box::new(source)) else { continue };
            match replay(&terrain, flight, Quality::default().cache_bytes(1 << 20), kind, &mut |_| {}) {
                Ok(frames) => {
                    assert_eq!(counts(&frames), expected);
                    break;
                }
                Err(ReplayError::Terrain(LayoutError::Io { .. })) => failed += 1,
                Err(other) => panic!("{other}"),
            }
        }
        assert!(failed > 3, "{failed} reads failed");
    }
}

/// Wherever a packed file is damaged, the replay says so, or the damage is none of its ground's.
#[test]
fn damage_is_told_with_its_place_and_is_no_ground() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed] = files(folder.path(), [257, 257], false, None);
    let mapped = Terrain::open(&plain).unwrap();
    let flight = path(&mapped);
    let quality = Quality::default();
    let expected =
        EngineKind::ALL.map(|kind| counts(&replay(&mapped, &flight, quality, kind, &mut |_| {}).unwrap()));
    let sound = std::fs::read(packed).unwrap();
    let mut tiles = 0;
    for part in 4..40 {
        let mut bytes = sound.clone();
        bytes[part * sound.len() / 40] ^= 0x55;
        let Ok(terrain) = Terrain::from_source(Box::new(MemorySource::new("memory", bytes))) else {
            continue;
        };
        let terrain = Arc::new(terrain);
        let names_tile = |error: &dyn std::fmt::Display| error.to_string().starts_with("memory: tile ");
        for (kind, expected) in EngineKind::ALL.into_iter().zip(&expected) {
            match replay(&terrain, &flight, quality, kind, &mut |_| {}) {
                Ok(frames) => assert_eq!(&counts(&frames), expected),
                Err(error) if names_tile(&error) => {
                    tiles += 1;
                    let mesh = frame_mesh(&terrain, &flight, 5, quality, kind, &[]);
                    assert!(names_tile(&mesh.map(drop).unwrap_err()));
                }
                Err(error) => {
                    assert!(matches!(error, ReplayError::Terrain(LayoutError::Damaged { .. })), "{error}");
                }
            }
        }
        let simple = simplify(&terrain, &SimplifyOptions::default().max_error_m(1.0)).map(drop);
        let mut ground = Ground::mapped(&terrain, PictureEngine::Kinetic, Culling::Vertices).unwrap();
        for frame in &flight {
            ground.update(&quality.view(frame));
        }
        for error in simple.err().into_iter().chain(ground.take_error()) {
            assert!(matches!(error, LayoutError::Damaged { .. }), "{error}");
        }
    }
    assert!(tiles > 20, "{tiles} flights met a damaged tile");
}
