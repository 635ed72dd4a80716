//! Files whose checksums are right and whose contents are nonsense, flown over by every engine: no panic, no waiting, no more triangles than records.

#[path = "../../../tests/common/mod.rs"]
mod common;
mod exercise;

use common::frame;
use exercise::fly;
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::refine::{Culling, Unobserved};
use terrasoar::stream::{Prefetch, Streamed, ThreadFetch};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::mix::Random;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::loader::Loader;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::{Counts, reseal, seeds};

/// Longest that all uses of one small file may take.
const PATIENCE: Duration = Duration::from_secs(20);

#[test]
fn whatever_a_sealed_file_says_it_is_flown_over() {
    let rounds = std::env::var("TERRASOAR_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(8);
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let mut opened = 0;
    for (i, seed) in seeds().into_iter().enumerate() {
        let mut random = Random::new(100 + i as u64);
        for _ in 0..rounds {
            let count = 1 + random.index(4);
            let mut recipe = vec![0];
            (0..count).for_each(|_| recipe.extend(random.bits().to_le_bytes()));
            // Records, most of all, and fields of the header.
            for how in recipe[1..].iter_mut().step_by(8) {
                *how = [0, 2, 8, 8, 11, 11, 13, 14][usize::from(*how) % 8];
            }
            let mut files = seed.files.clone();
            files.mutate(&recipe);
            let (path, overlay) = files.write(folder.path()).unwrap();
            let begun = Instant::now();
            let flown = std::panic::catch_unwind(|| fly(&path, overlay.as_deref()));
            opened += usize::from(flown.unwrap_or_else(|_| panic!("{} with {recipe:?}", seed.name)));
            assert!(begun.elapsed() < PATIENCE, "{} with {recipe:?}", seed.name);
        }
    }
    assert!(opened > 4 * rounds, "{opened}");
}

/// A terrain each of whose vertices is wanted always or never, whatever its parents are.
fn without_nesting() -> Vec<u8> {
    let terrain = common::rugged_terrain([129, 100], 3, false);
    let mut bytes = vec![0; terrain.source().byte_count() as usize];
    terrain.source().read_at(0, &mut bytes).unwrap();
    let mut random = Random::new(7);
    for (_, entry) in terrain.present_pages().unwrap() {
        let page = &mut bytes[entry.page as usize * PAGE_BYTES..][..PAGE_BYTES];
        for record in page.chunks_exact_mut(4) {
            // An endless error, or none.
            record[2..].copy_from_slice(if random.below(2) == 0 { &[251, 0] } else { &[0, 0] });
        }
    }
    reseal(&mut bytes, Counts::Keep);
    bytes
}

#[test]
fn filling_a_pool_ends_where_wanted_vertices_have_parents_that_are_not() {
    let source = MemorySource::new("unnested", without_nesting());
    let terrain = Arc::new(Terrain::from_source(Box::new(source)).unwrap());
    let frame = frame(&terrain, [0.5, 0.4], 1200.0, 40.0, -30.0);
    let view = frame.view(terrasoar::view::Viewport::default(), 1.0);
    for prefetch in Prefetch::ALL {
        let ByKind::Compact(pool) = terrain.pool(1 << 24).unwrap() else { panic!("compact records") };
        let loader = ThreadFetch::from(Loader::start(Arc::clone(&terrain), 2).unwrap());
        let mut streamed = Streamed::new(pool, loader, Culling::Vertices, prefetch);
        let begun = Instant::now();
        streamed.fill(&view, Duration::from_secs(60), &mut Unobserved);
        assert!(begun.elapsed() < PATIENCE, "{prefetch:?}: {:?}", begun.elapsed());
        let work = streamed.update(&view, &mut Unobserved).work;
        assert!(work.late > 0 && work.unread == 0, "the file is not what it is to be: {work:?}");
    }
}

#[test]
fn filling_a_pool_ends_where_pages_for_later_have_no_room_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let seed = seeds().into_iter().find(|seed| seed.name == "islands").unwrap();
    let mut files = seed.files;
    // Found at random: records that are not nested, and a view whose extension wants more pages than the pool holds.
    files.mutate(&[0, 11, 140, 230, 7, 246, 115, 208, 194]);
    let (path, overlay) = files.write(folder.path()).unwrap();
    assert!(overlay.is_none());
    let terrain = Arc::new(Terrain::open(&path).unwrap());
    let ByKind::Compact(pool) = terrain.pool(1 << 17).unwrap() else { panic!("compact records") };
    let loader = ThreadFetch::from(Loader::start(Arc::clone(&terrain), 2).unwrap());
    let mut streamed = Streamed::new(pool, loader, Culling::Vertices, Prefetch::Frustum);
    let begun = Instant::now();
    let mut pages_come = 0;
    // Whether a page comes between filling and the update is for the threads that read to decide: in some round one does.
    for _ in 0..200 {
        for frame in exercise::frames(&terrain) {
            let view = frame.view(terrasoar::view::Viewport { width_px: 160, height_px: 120 }, 1.0);
            streamed.fill(&view, Duration::from_secs(60), &mut Unobserved);
            assert!(begun.elapsed() < PATIENCE, "{:?}", begun.elapsed());
            let frame = streamed.update(&view, &mut Unobserved);
            pages_come += frame.pages_come;
            assert!(frame.work.late > 0, "the file is not what it is to be: {frame:?}");
        }
        if pages_come > 0 {
            break;
        }
    }
    assert!(pages_come > 0, "the pool is not too small");
}

/// Large forms that are wanted sooner or later as the eye comes near, and everything below them at once: each vertex is due from each of its parents.
fn due_all_at_once() -> Vec<u8> {
    let terrain = common::rugged_terrain([513, 513], 4, false);
    let mut bytes = vec![0; terrain.source().byte_count() as usize];
    terrain.source().read_at(0, &mut bytes).unwrap();
    let grid = *terrain.grid();
    let mut random = Random::new(9);
    for (x, y) in (0..=512).flat_map(|x| (0..=512).map(move |y| (x, y))) {
        let point = GridPoint::new(x, y);
        if grid.is_corner(point) {
            continue;
        }
        let slot = slot_of(grid.k(), point) as usize;
        let page = terrain.entry((slot * 4 / PAGE_BYTES) as u64).unwrap().page as usize;
        let error = if grid.level(point) > 13 { 1 + random.below(247) as u8 } else { 251 };
        bytes[page * PAGE_BYTES + slot * 4 % PAGE_BYTES + 2] = error;
    }
    reseal(&mut bytes, Counts::Keep);
    bytes
}

#[test]
fn looking_ahead_ends_where_everything_is_due_at_once() {
    let source = MemorySource::new("due", due_all_at_once());
    let terrain = Arc::new(Terrain::from_source(Box::new(source)).unwrap());
    let ByKind::Compact(pool) = terrain.pool(1 << 24).unwrap() else { panic!("compact records") };
    let loader = ThreadFetch::from(Loader::start(Arc::clone(&terrain), 2).unwrap());
    let mut streamed = Streamed::new(pool, loader, Culling::Vertices, Prefetch::Deadline);
    let begun = Instant::now();
    for i in 0..150 {
        let up_m = 4e6 * 0.95_f64.powi(i);
        let frame = frame(&terrain, [0.5, 0.4], up_m, 40.0, -60.0);
        streamed.update(&frame.view(terrasoar::view::Viewport::default(), 1.0), &mut Unobserved);
        assert!(begun.elapsed() < PATIENCE, "frame {i}: {:?}", begun.elapsed());
    }
}

#[test]
fn every_engine_flies_over_records_that_are_not_nested() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    std::fs::write(&path, without_nesting()).unwrap();
    assert!(fly(&path, None));
}
