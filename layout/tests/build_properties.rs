//! What a built file promises, checked vertex by vertex against brute force on small grids of every shape: heights, classes,
//! nesting, bounded error, and that tiles, threads and memory do not show.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use proptest::prelude::*;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::record::{RecordKind, Vertex, VertexClass};
use terrasoar_layout::grid::{Grid, GridPoint};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

fn all_points(grid: &Grid) -> impl Iterator<Item = GridPoint> + use<> {
    let n = grid.side_steps();
    (0..=n).flat_map(move |y| (0..=n).map(move |x| GridPoint::new(x, y)))
}

fn vertex(terrain: &Terrain, p: GridPoint) -> Vertex {
    with_records!(terrain.records().unwrap(), records => records.vertex_at(p))
}

fn position(grid: &Grid, p: GridPoint, height_m: f64) -> [f64; 3] {
    let [x, y] = grid.position_m(p);
    [x, y, height_m]
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Height at `q` of the triangle, if it has area and `q` lies in it.
fn height_in(t: [[f64; 3]; 3], q: [f64; 2]) -> Option<f64> {
    let area =
        |a: [f64; 3], b: [f64; 3], c: [f64; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let p = [q[0], q[1], 0.0];
    let whole = area(t[0], t[1], t[2]);
    if whole.abs() < 1e-9 {
        return None;
    }
    let w = [area(p, t[1], t[2]) / whole, area(t[0], p, t[2]) / whole, area(t[0], t[1], p) / whole];
    w.iter().all(|w| *w > -1e-9).then(|| w[0] * t[0][2] + w[1] * t[1][2] + w[2] * t[2][2])
}

/// All that must hold of a file made from `dem`.
fn check(dem: &MemoryDem, terrain: &Terrain, precision_m: f64) {
    let grid = *terrain.grid();
    let [wide, high] = grid.samples();
    let sample = |p: GridPoint| {
        let q = grid.fold(p);
        dem.sample(q.x(), q.y())
    };
    for p in all_points(&grid) {
        let v = vertex(terrain, p);
        let z = sample(p);
        if !grid.is_padding(p) {
            assert_eq!(v.class.is_void(), z.is_nan(), "{p:?} {v:?} {z}");
            if !z.is_nan() {
                assert!((v.height_m - z).abs() <= precision_m, "{p:?} {} {z}", v.height_m);
            }
        }
        if grid.is_corner(p) {
            continue;
        }
        let level = grid.level(p);
        let children: Vec<_> = grid.children(p).map(|c| (c, vertex(terrain, c))).collect();
        let mut fringe =
            level == 0 && grid.edge_ends(p).into_iter().chain(grid.apexes(p)).any(|c| sample(c).is_nan());
        for (c, child) in &children {
            if child.class == VertexClass::Inert {
                fringe |= !grid.is_beyond(*c, level - 1);
                continue;
            }
            fringe |= !child.class.is_plain();
            assert_ne!(v.class, VertexClass::Inert);
            assert!(v.error_m >= child.error_m, "{p:?} {v:?} {c:?} {child:?}");
            let gap = distance(position(&grid, p, v.height_m), position(&grid, *c, child.height_m));
            assert!(
                v.radius_m >= (gap + child.radius_m) * (1.0 + 1.0 / f64::from(1 << 20)),
                "{p:?} {v:?} {c:?} {child:?}"
            );
        }
        if grid.is_beyond(p, level) {
            assert_eq!(v.class, VertexClass::Inert);
            continue;
        }
        if v.class != VertexClass::Inert {
            assert_eq!(!v.class.is_plain(), fringe || z.is_nan(), "{p:?} {v:?}");
        } else {
            assert!(z.is_nan());
        }
        if !v.class.is_plain() {
            assert!(v.class == VertexClass::Inert || v.error_m >= grid.edge_m(level) * 0.999_999);
            continue;
        }
        // The bound over every sample of both triangles, folded as they are drawn.
        let ends = grid.edge_ends(p).map(|e| position(&grid, e, vertex(terrain, e).height_m));
        let mut farthest = 0.0f64;
        for apex in grid.apexes(p) {
            let t = [position(&grid, apex, vertex(terrain, apex).height_m), ends[0], ends[1]];
            for y in 0..high {
                for x in 0..wide {
                    let q = GridPoint::new(x, y);
                    if let Some(h) = height_in(t, grid.position_m(q)) {
                        assert!(!sample(q).is_nan(), "a void in the triangle of a plain vertex");
                        farthest = farthest.max((vertex(terrain, q).height_m - h).abs());
                    }
                }
            }
        }
        match terrain.header().error_kind {
            ErrorKind::Bounded => assert!(v.error_m >= farthest - 1e-9, "{p:?} {v:?} {farthest}"),
            ErrorKind::Step => {
                let step = (v.height_m - 0.5 * (ends[0][2] + ends[1][2])).abs();
                assert!(grid.samples().map(|s| s - 1) != [grid.side_steps(); 2] || v.error_m >= step - 1e-9);
            }
        }
    }
}

/// Ruggedness that repeats for a seed.
fn noise(seed: u64, x: u32, y: u32) -> f64 {
    let mut h = seed ^ (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((h ^ h >> 32) % 1000) as f64 / 1000.0
}

fn rugged(seed: u64, x: u32, y: u32) -> f64 {
    let smooth = 300.0 * (f64::from(x) * 0.11 + seed as f64).sin() * (f64::from(y) * 0.07).cos();
    (500.0 + smooth + 80.0 * noise(seed, x, y)).round()
}

fn terrain_of(dem: &MemoryDem, options: &BuildOptions) -> Terrain {
    open_bytes(build_bytes(dem, options).unwrap()).unwrap()
}

#[test]
fn every_shape_keeps_its_promises() {
    for samples in [[33, 33], [17, 9], [20, 33], [33, 18], [25, 27], [2, 2], [3, 2], [2, 40], [64, 65]] {
        for error in [ErrorKind::Bounded, ErrorKind::Step] {
            let dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| rugged(7, x, y));
            let options = BuildOptions::default().error(error).spacing_m([10.0, 13.5]);
            let terrain = terrain_of(&dem, &options);
            assert_eq!(terrain.header().record_kind, RecordKind::Compact);
            check(&dem, &terrain, 1e-9);
        }
    }
}

#[test]
fn voids_are_masked_and_do_not_spread() {
    for samples in [[33, 33], [30, 21], [65, 50]] {
        let holes = |x: u32, y: u32| {
            let d = |cx: u32, cy: u32| x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2);
            d(20, 12) < 20 || (x, y) == (5, 5) || x + 3 > samples[0] || noise(3, x, y) < 0.004
        };
        for sample_type in [SampleType::I16, SampleType::F32, SampleType::F64] {
            let dem = MemoryDem::from_fn(samples, sample_type, |x, y| {
                if holes(x, y) {
                    f64::NAN
                } else {
                    rugged(5, x, y) + if sample_type == SampleType::I16 { 0.0 } else { noise(9, x, y) }
                }
            });
            let dem = if sample_type == SampleType::F32 {
                MemoryDem::from_fn(samples, sample_type, |x, y| f64::from(dem.sample(x, y) as f32))
            } else {
                dem
            };
            check(&dem, &terrain_of(&dem, &BuildOptions::default().spacing_m([5.0, 5.0])), 1e-9);
        }
    }
}

#[test]
fn exact_records_keep_every_bit() {
    let dem =
        MemoryDem::from_fn([33, 30], SampleType::F32, |x, y| f64::from((rugged(1, x, y) * 1.000_1) as f32));
    let terrain = terrain_of(&dem, &BuildOptions::default());
    assert_eq!(terrain.header().record_kind, RecordKind::Exact8);
    check(&dem, &terrain, 0.0);
    let dem = MemoryDem::from_fn([33, 30], SampleType::F64, |x, y| rugged(1, x, y) * 1.000_1);
    let terrain = terrain_of(&dem, &BuildOptions::default());
    assert_eq!(terrain.header().record_kind, RecordKind::Exact16);
    check(&dem, &terrain, 0.0);
    let dem = MemoryDem::from_fn([33, 30], SampleType::I32, |x, y| rugged(1, x, y) * 1e6 + 1.0);
    let terrain = terrain_of(&dem, &BuildOptions::default());
    assert_eq!(terrain.header().record_kind, RecordKind::Exact16, "beyond 2^24 single precision has gaps");
    check(&dem, &terrain, 0.0);
}

#[test]
fn floats_of_even_steps_stay_compact_and_forced_compact_rounds() {
    let dem =
        MemoryDem::from_fn([33, 30], SampleType::F32, |x, y| f64::from((rugged(1, x, y) / 10.0) as f32));
    let terrain = terrain_of(&dem, &BuildOptions::default());
    assert_eq!(
        (terrain.header().record_kind, terrain.header().heights_rounded),
        (RecordKind::Compact, false)
    );
    assert_eq!(terrain.header().scale.height_step_m, 0.1);
    check(&dem, &terrain, 1e-4);
    let dem = MemoryDem::from_fn([33, 30], SampleType::F64, |x, y| rugged(1, x, y) * 1.000_1);
    let options = BuildOptions::default().record(RecordKind::Compact);
    let terrain = terrain_of(&dem, &options);
    assert!(terrain.header().heights_rounded);
    check(&dem, &terrain, terrain.header().scale.height_step_m * 0.500_001);
}

#[test]
fn heights_in_steps_that_were_asked_for_keep_their_promises() {
    for (step_m, error) in [(0.05, ErrorKind::Bounded), (13.0, ErrorKind::Bounded), (0.7, ErrorKind::Step)] {
        for samples in [[33, 30], [40, 17]] {
            let dem = MemoryDem::from_fn(samples, SampleType::F64, |x, y| {
                if (x, y) == (7, 8) || x + y > 50 { f64::NAN } else { rugged(4, x, y) * 1.000_1 }
            });
            let options = BuildOptions::default().height_step_m(step_m).error(error).spacing_m([3.0, 4.0]);
            let terrain = terrain_of(&dem, &options);
            assert_eq!(terrain.header().record_kind, RecordKind::Compact);
            check(&dem, &terrain, step_m * (0.5 + 1e-9));
        }
    }
}

#[test]
fn cliffs_spikes_and_flats_fit_the_records() {
    let cliff = |x: u32, _| if x > 16 { 60_000.0 } else { 0.0 };
    let spike = |x: u32, y: u32| if (x, y) == (9, 9) { 30_000.0 } else { -20_000.0 };
    let flat = |_, _| 17.0;
    for shape in [&cliff as &dyn Fn(u32, u32) -> f64, &spike, &flat] {
        for spacing in [0.01, 1.0, 1000.0] {
            let dem = MemoryDem::from_fn([33, 33], SampleType::I32, shape);
            let options = BuildOptions::default().spacing_m([spacing, spacing * 3.0]);
            let terrain = terrain_of(&dem, &options);
            assert_eq!(terrain.header().record_kind, RecordKind::Compact);
            check(&dem, &terrain, 1e-9);
        }
    }
}

#[test]
fn tiles_threads_and_memory_do_not_show() {
    for (samples, holes) in [([130, 200], true), ([257, 257], false)] {
        let dem = MemoryDem::from_fn(samples, SampleType::F32, |x, y| {
            if holes && x.abs_diff(70) + y.abs_diff(90) < 12 {
                f64::NAN
            } else {
                f64::from((rugged(2, x, y) * 1.01) as f32)
            }
        });
        let base = build_bytes(&dem, &BuildOptions::default()).unwrap();
        for largest_tile in [2, 4, 16, 64, 128] {
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let options = BuildOptions::default()
                    .largest_tile(largest_tile)
                    .memory_mib(if threads == 1 { 48 } else { 2048 });
                let bytes = pool.install(|| build_bytes(&dem, &options)).unwrap();
                assert!(bytes == base, "tile {largest_tile}, {threads} threads");
            }
        }
    }
}

fn records() -> impl Strategy<Value = Option<RecordKind>> {
    prop_oneof![Just(None), Just(Some(RecordKind::Fine)), Just(Some(RecordKind::Exact8))]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn random_terrains_keep_their_promises(
        wide in 2u32..40, high in 2u32..40, seed in 0u64..1000, void_share in prop_oneof![Just(0.0), 0.0..0.3],
        tile in 1u32..6, spacing in 0.5f64..200.0, record in records(), step: bool,
    ) {
        let dem = MemoryDem::from_fn([wide, high], SampleType::I16, |x, y| {
            if noise(seed + 1, x, y) < void_share && (x, y) != (0, 0) { f64::NAN } else { rugged(seed, x, y) }
        });
        let options = BuildOptions::default().largest_tile(1 << tile).spacing_m([spacing, spacing * 1.3]).record(record).error(if step { ErrorKind::Step } else { ErrorKind::Bounded });
        check(&dem, &terrain_of(&dem, &options), 1e-9);
    }
}
