//! Terrain of the largest sizes there are, nearly all of it void: slots past 2^32, absent pages by the million, and builds whose cost is that
//! of what is not void.
//!
//! The DEM is a handful of islands, computed as it is streamed; every answer is compared with that computation.

mod common;

use common::{Island, Islands};
use std::path::Path;
use std::time::Instant;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::edit::{Edit, EditSession, SampleRect};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{ROOTS, child_slots, point_of, slot_count, slot_of};
use terrasoar_layout::grid::record::{RecordKind, VertexClass};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::store::RecordStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

/// Islands in the corners, in the middle, and across the last line at which the quadtree is cut in four.
fn islands(side: u32) -> Islands {
    let (last, middle) = (side - 1, side / 2);
    Islands::new(
        side,
        vec![
            Island { west: 0, south: 0, wide: 90, high: 130 },
            Island { west: last - 200, south: 0, wide: 201, high: 65 },
            Island { west: last - 99, south: last - 149, wide: 100, high: 150 },
            Island { west: 0, south: last - 40, wide: 300, high: 41 },
            Island { west: middle - 150, south: middle - 77, wide: 311, high: 200 },
        ],
    )
}

/// Descends from a root to the smallest triangle around (`east`, `north`), in steps, by slots alone; gives the slots of all split vertices.
fn walk(terrain: &Terrain, east: f64, north: f64) -> Vec<u64> {
    let k = terrain.grid().k();
    let corners = terrasoar_layout::grid::order::corners(k);
    let at = |p: GridPoint| [f64::from(p.x()), f64::from(p.y())];
    let side = |a: GridPoint, b: GridPoint| {
        let ([ax, ay], [bx, by]) = (at(a), at(b));
        (bx - ax) * (north - ay) - (by - ay) * (east - ax)
    };
    let contains = |t: [GridPoint; 3]| {
        let s = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
        s.iter().all(|s| *s >= 0.0) || s.iter().all(|s| *s <= 0.0)
    };
    let centre = point_of(k, 4).unwrap();
    let roots = ROOTS.map(|(split, [b, d])| ([centre, corners[b], corners[d]], split));
    let (mut triangle, mut split) = roots.into_iter().find(|(t, _)| contains(*t)).unwrap();
    let mut apex = 4;
    let mut slots = Vec::new();
    for level in (0..2 * k - 1).rev() {
        let [a, b, d] = triangle;
        let v = b.midpoint(d);
        assert_eq!(point_of(k, split), Some(v), "level {level}");
        assert_eq!(slot_of(k, v), split);
        slots.push(split);
        let next = child_slots(apex, split);
        let halves = [[v, b, a], [v, a, d]];
        let side = usize::from(!contains(halves[0]));
        (triangle, apex, split) = (halves[side], split, next[side]);
    }
    slots
}

/// Builds, opens, verifies and samples a square of `side` samples with islands in it.
fn check(side: u32, path: &Path) -> Terrain {
    check_built(&islands(side), path)
}

fn check_built(dem: &Islands, path: &Path) -> Terrain {
    let side = dem.info.samples_wide;
    let start = Instant::now();
    let options = BuildOptions::default().spacing_m([30.0, 20.0]);
    let header = build(dem, path, &options, &Silent).unwrap();
    let built = start.elapsed();
    let data = dem.samples();
    assert_eq!(header.nodata_samples, u64::from(side) * u64::from(side) - data);
    // A page holds a thousand records; pages of coarse levels and along outlines hold few that matter.
    let bound = 40 * data + (16 << 20);
    assert!(header.file_bytes < bound, "{} bytes for {data} samples", header.file_bytes);

    let start = Instant::now();
    let terrain = Terrain::open(path).unwrap();
    let opened = start.elapsed();
    let start = Instant::now();
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    let verified = start.elapsed();
    assert_eq!(report.pages_checked, header.stored_pages);
    println!(
        "{side} a side, {data} samples not void: built in {built:.1?}, opened in {opened:.1?}, verified in {verified:.1?}; \
         {} of {} pages, {} bytes",
        header.stored_pages,
        header.record_pages(),
        header.file_bytes
    );
    compare(dem, &terrain);
    terrain
}

/// Heights and classes of all islands, of what surrounds them and of places far from any, against the source.
fn compare(dem: &Islands, terrain: &Terrain) {
    let last = dem.info.samples_wide - 1;
    let far = (0..4000u32).map(|i| {
        [
            i.wrapping_mul(2_654_435_761) % dem.info.samples_wide,
            i.wrapping_mul(40_503).wrapping_mul(65_537) % dem.info.samples_wide,
        ]
    });
    let near = dem.islands.iter().flat_map(|island| {
        let (x0, y0) = (island.west.saturating_sub(3), island.south.saturating_sub(3));
        let (x1, y1) =
            ((island.west + island.wide + 2).min(last), (island.south + island.high + 2).min(last));
        (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| [x, y]))
    });
    let (mut seas, mut lands) = (0, 0);
    with_records!(terrain.records().unwrap(), records => {
        for [x, y] in near.chain(far) {
            let v = records.vertex_at(GridPoint::new(x, y));
            let height = dem.height(x, y);
            assert_eq!(Some(v.height_m).filter(|_| !v.class.is_void()), height, "({x}, {y}) {v:?}");
            *if height.is_some() { &mut lands } else { &mut seas } += 1;
        }
    });
    assert!(lands >= dem.samples() && seas > 5000, "{lands} {seas}");
    let [dx, dy] = terrain.grid().spacing_m();
    for island in &dem.islands {
        let (x, y) = (island.west + 1, island.south + island.high - 2);
        let [height, beside] = [x, x + 1].map(|x| dem.height(x, y).unwrap());
        let read = terrain.height_m((f64::from(x) + 0.25) * dx, f64::from(y) * dy).unwrap().unwrap();
        assert!((read - (0.75 * height + 0.25 * beside)).abs() < 1e-9, "{read}");
    }
    assert_eq!(terrain.height_m(f64::from(last / 3) * dx, f64::from(last / 5) * dy).unwrap(), None);
}

/// Splits all the way down to a sample in each island, and to void: slots agree with points, records with the source.
fn descend(dem: &Islands, terrain: &Terrain) -> u64 {
    let mut largest = 0;
    with_records!(terrain.records().unwrap(), records => {
        for island in &dem.islands {
            let (x, y) = (island.west + island.wide / 2, island.south + island.high / 2);
            let slots = walk(terrain, f64::from(x) + 0.3, f64::from(y) + 0.2);
            let mut radius_m = f64::INFINITY;
            for (slot, level) in slots.iter().zip((0..terrain.grid().levels() - 1).rev()) {
                let v = records.vertex(*slot, level);
                assert_ne!(v.class, VertexClass::Inert, "an ancestor of ground, slot {slot}");
                assert!(v.radius_m <= radius_m, "slot {slot}");
                radius_m = v.radius_m;
                let p = point_of(terrain.grid().k(), *slot).unwrap();
                assert_eq!(Some(v.height_m).filter(|_| !v.class.is_void()), dem.height(p.x(), p.y()));
                largest = largest.max(*slot);
            }
        }
        let (x, y) = (0.31 * f64::from(dem.info.samples_wide), 0.17 * f64::from(dem.info.samples_wide));
        let slots = walk(terrain, x, y);
        assert_eq!(records.vertex(*slots.last().unwrap(), 0).class, VertexClass::Inert);
    });
    largest
}

#[test]
fn void_costs_next_to_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let side = 16_385;
    let terrain = check(side, &folder.path().join("islands.iqt"));
    assert!(descend(&islands(side), &terrain) < u64::from(u32::MAX));
}

#[test]
fn slots_past_32_bits_hold_what_the_source_says() {
    let folder = tempfile::tempdir().unwrap();
    let side = 65_537;
    let terrain = check(side, &folder.path().join("islands.iqt"));
    assert_eq!(terrain.grid().k(), 16);
    let largest = descend(&islands(side), &terrain);
    assert!(largest > u64::from(u32::MAX), "{largest}");
    assert!(slot_count(16) > 1 << 32);
}

#[test]
fn squares_of_17_bits_a_side() {
    let folder = tempfile::tempdir().unwrap();
    let side = 131_073;
    let terrain = check(side, &folder.path().join("islands.iqt"));
    assert_eq!(terrain.grid().k(), 17);
    descend(&islands(side), &terrain);
}

/// In the largest records there are more than 2^32 pages: a pool holds them, an editor changes them, and both find what the source said.
#[test]
fn pages_past_32_bits_hold_what_the_source_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("islands.iqt");
    let dem = islands(1_048_577).precise();
    let terrain = check_built(&dem, &path);
    let far: Vec<u64> =
        terrain.present_pages().unwrap().map(|(page, _)| page).filter(|page| page >> 32 > 0).collect();
    assert!(far.len() > 100 && terrain.header().record_kind == RecordKind::Exact16, "{}", far.len());
    let unmapped = Terrain::open_unmapped(&path).unwrap();
    let ByKind::Exact16(mut pool) = unmapped.pool(64 << 20).unwrap() else { panic!("records of 16 bytes") };
    assert!(!pool.is_resident(far[0]), "its leaf was not read");
    for (page, _) in terrain.present_pages().unwrap() {
        pool.install(page, &unmapped.checked_page(page).unwrap()).unwrap();
    }
    assert!(far.iter().all(|page| pool.is_resident(*page)));
    let places = |island: &Island| {
        let (x, y) = (island.west, island.south);
        [[x, y], [x + 1, y + 2], [x + island.wide - 1, y + island.high - 1]]
    };
    for [x, y] in dem.islands.iter().flat_map(places) {
        let v = pool.vertex_at(GridPoint::new(x, y));
        assert_eq!(Some(v.height_m), dem.height(x, y), "({x}, {y})");
    }
    drop(terrain);
    let mut session = EditSession::open(&path).unwrap();
    for island in &dem.islands {
        let [west, south] = [island.west + 5, island.south + 5];
        let rect = SampleRect { west, south, east: west + 20, north: south + 20 };
        assert!(!session.apply(&[Edit::set(rect, 777.25)]).unwrap().vertices.is_empty());
    }
    session.commit("set").unwrap();
    let edited = Terrain::open(&path).unwrap();
    let report = verify(&edited, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    for island in &dem.islands {
        let place_m = [f64::from(island.west + 9) * 30.0, f64::from(island.south + 9) * 20.0];
        assert_eq!(edited.height_m(place_m[0], place_m[1]).unwrap(), Some(777.25));
    }
    drop(edited);
    session.undo().unwrap().unwrap();
    compare(&dem, &Terrain::open(&path).unwrap());
}

/// Slots past 2^40, and a directory with nodes.
#[test]
fn squares_of_20_bits_a_side() {
    let folder = tempfile::tempdir().unwrap();
    for (side, k) in [(262_145, 18), (1_048_577, 20)] {
        let terrain = check(side, &folder.path().join("islands.iqt"));
        assert_eq!(terrain.grid().k(), k);
        let largest = descend(&islands(side), &terrain);
        assert!(k < 20 || largest > 1 << 40, "{largest}");
    }
}
