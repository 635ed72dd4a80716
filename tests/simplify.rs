//! Meshes without an eye against brute force: every sample within the bound, all of the part covered once, no crack, voids left out.

mod common;

use common::{noise, rugged, rugged_terrain, terrain_of};
use std::collections::{HashMap, HashSet};
use terrasoar::mesh::IndexedMesh;
use terrasoar::simplify::{SimplifyOptions, simplify};
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;
use terrasoar_layout::with_records;

/// Heights of all samples, rows from the south; NaN for voids.
fn samples(terrain: &Terrain) -> Vec<f64> {
    let [wide, high] = terrain.grid().samples();
    with_records!(terrain.records().unwrap(), records => {
        let points = (0..high).flat_map(|y| (0..wide).map(move |x| GridPoint::new(x, y)));
        let height = |p| {
            let vertex = records.vertex_at(p);
            if vertex.class.is_void() { f64::NAN } else { vertex.height_m }
        };
        points.map(height).collect()
    })
}

/// Twice the area of a triangle in samples.
fn twice_area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

/// Checks a mesh of the samples from `from` to `to`; the largest distance of a sample from it.
fn check(
    terrain: &Terrain,
    heights: &[f64],
    mesh: &IndexedMesh,
    [from, to]: [[u32; 2]; 2],
    max_error_m: f64,
) -> f64 {
    let wide = terrain.grid().samples()[0];
    let spacing = terrain.grid().spacing_m();
    let height = |x: u32, y: u32| heights[(y * wide + x) as usize];
    // In samples.
    let corner = |i: u32| {
        let [x, y, z] = mesh.positions[i as usize];
        [x / spacing[0], y / spacing[1], z]
    };
    let (mut area, mut worst) = (0.0, 0.0f64);
    let mut covered: HashSet<(u32, u32)> = HashSet::new();
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(corner);
        let whole = twice_area(corners);
        assert!(whole > 0.0, "{corners:?} is clockwise or empty");
        area += 0.5 * whole;
        for i in 0..3 {
            let (p, q) = (triangle[i], triangle[(i + 1) % 3]);
            *edges.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
        }
        let range = |axis: usize| {
            let all = corners.map(|corner| corner[axis]);
            let low = all.into_iter().fold(f64::INFINITY, f64::min);
            let high = all.into_iter().fold(f64::NEG_INFINITY, f64::max);
            assert!(low >= f64::from(from[axis]) - 1e-9 && high <= f64::from(to[axis]) + 1e-9, "{corners:?}");
            ((low - 1e-9).ceil() as u32)..=((high + 1e-9).floor() as u32)
        };
        for y in range(1) {
            for x in range(0) {
                let p = [f64::from(x), f64::from(y), 0.0];
                let [a, b, c] = corners;
                let weights = [[p, b, c], [a, p, c], [a, b, p]].map(|part| twice_area(part) / whole);
                if weights.iter().any(|weight| *weight < -1e-9) {
                    continue;
                }
                let sample = height(x, y);
                assert!(!sample.is_nan(), "a triangle lies over the void at {x}, {y}");
                covered.insert((x, y));
                let found: f64 = (0..3).map(|i| weights[i] * corners[i][2]).sum();
                worst = worst.max((found - sample).abs());
            }
        }
    }
    assert!(worst <= max_error_m + 1e-6, "{worst} m, not within {max_error_m} m");
    // What lies at a whole cell is covered.
    let is_whole = |x: u32, y: u32| (0..2).all(|i| (0..2).all(|j| !height(x + i, y + j).is_nan()));
    let mut cells = 0;
    for y in from[1]..to[1] {
        for x in from[0]..to[0] {
            if is_whole(x, y) {
                cells += 1;
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    assert!(
                        covered.contains(&(x + i, y + j)),
                        "the sample at {}, {} is not covered",
                        x + i,
                        y + j
                    );
                }
            }
        }
    }
    let cells_of_part = f64::from(to[0] - from[0]) * f64::from(to[1] - from[1]);
    assert!(area <= cells_of_part + 1e-6 && area >= f64::from(cells) - 1e-6, "{area} of {cells} whole cells");
    check_edges(mesh, &edges, &corner, [from, to], heights.iter().any(|height| height.is_nan()));
    worst
}

/// An edge of one triangle alone lies on a side of the part or at a void, and no vertex lies within it.
fn check_edges(
    mesh: &IndexedMesh,
    edges: &HashMap<(u32, u32), i32>,
    corner: &dyn Fn(u32) -> [f64; 3],
    [from, to]: [[u32; 2]; 2],
    has_voids: bool,
) {
    let bits = |x: f64, y: f64| (x.to_bits(), y.to_bits());
    let places: HashSet<(u64, u64)> = (0..mesh.positions.len() as u32)
        .map(|i| {
            let [x, y, _] = corner(i);
            bits((x * 16.0).round(), (y * 16.0).round())
        })
        .collect();
    assert_eq!(places.len(), mesh.positions.len(), "a vertex twice");
    for ((p, q), uses) in edges {
        let (p, q) = (corner(*p), corner(*q));
        let on_side = (0..2).any(|axis| {
            [from[axis], to[axis]].iter().any(|side| {
                (p[axis] - f64::from(*side)).abs() < 1e-9 && (q[axis] - f64::from(*side)).abs() < 1e-9
            })
        });
        if *uses == 0 || on_side {
            continue;
        }
        assert!(has_voids, "a crack along {p:?} {q:?}");
        for i in 1..16 {
            let share = f64::from(i) / 16.0;
            let at = [0, 1].map(|axis| ((p[axis] + share * (q[axis] - p[axis])) * 16.0).round());
            assert!(!places.contains(&bits(at[0], at[1])), "a vertex within the edge {p:?} {q:?}");
        }
    }
}

fn whole(terrain: &Terrain) -> [[u32; 2]; 2] {
    [[0; 2], terrain.grid().samples().map(|count| count - 1)]
}

#[test]
fn every_sample_is_within_the_bound() {
    let real = MemoryDem::from_fn([77, 51], SampleType::F32, |x, y| rugged(9, x, y) / 7.0);
    let terrains = [
        rugged_terrain([129, 129], 3, false),
        rugged_terrain([100, 129], 4, false),
        rugged_terrain([120, 90], 5, true),
        rugged_terrain([65, 40], 6, true),
        terrain_of(&real, &BuildOptions::default().spacing_m([3.0, 7.0])),
    ];
    for terrain in &terrains {
        let heights = samples(terrain);
        let mut before = usize::MAX;
        for max_error_m in [0.0, 0.4, 3.0, 25.0, 400.0, 1e6] {
            let mesh = simplify(terrain, &SimplifyOptions::default().max_error_m(max_error_m)).unwrap();
            check(terrain, &heights, &mesh, whole(terrain), max_error_m);
            assert!(mesh.triangles.len() <= before, "a larger error needs no more triangles");
            before = mesh.triangles.len();
            if max_error_m == 1e6 && !terrain.header().has_voids {
                assert!(before <= 4 * 40, "{before} triangles where any will do");
            }
        }
    }
}

#[test]
fn a_part_is_cut_along_its_sides() {
    for terrain in [rugged_terrain([100, 129], 4, false), rugged_terrain([120, 90], 5, true)] {
        let heights = samples(&terrain);
        let grid = terrain.grid();
        for (i, sides) in [[3, 5, 90, 77], [50, 41, 51, 42], [0, 0, 99, 1], [31, 32, 64, 65], [33, 1, 98, 88]]
            .into_iter()
            .enumerate()
        {
            let window = SampleWindow::within(grid, sides.map(f64::from), 1).unwrap();
            for max_error_m in [0.0, 2.0, 60.0, 1e5] {
                let options = SimplifyOptions::default().max_error_m(max_error_m).window(window);
                let mesh = simplify(&terrain, &options).unwrap();
                check(&terrain, &heights, &mesh, [window.from, window.last()], max_error_m);
                if i == 0 && max_error_m == 1e5 && !terrain.header().has_voids {
                    assert!(mesh.triangles.len() < 40, "{} triangles", mesh.triangles.len());
                }
            }
        }
    }
}

/// The bound is used: meshes are not finer than they must be by much.
#[test]
fn triangles_fall_with_the_error() {
    let dem = MemoryDem::from_fn([257, 257], SampleType::F64, |x, y| {
        200.0 * (f64::from(x) / 40.0).sin() * (f64::from(y) / 40.0).cos() + 0.05 * noise(1, x, y)
    });
    let terrain = terrain_of(&dem, &BuildOptions::default().spacing_m([10.0, 10.0]));
    let count = |max_error_m: f64| {
        simplify(&terrain, &SimplifyOptions::default().max_error_m(max_error_m)).unwrap().triangles.len()
    };
    let counts = [0.1, 1.0, 10.0].map(count);
    assert!(counts[0] > 4 * counts[1] && counts[1] > 4 * counts[2], "{counts:?}");
    assert!((120_000..=2 * 256 * 256).contains(&count(0.0)));
}

#[test]
fn what_cannot_be_is_said() {
    let terrain = rugged_terrain([65, 65], 3, false);
    let refused = |options: SimplifyOptions| simplify(&terrain, &options).unwrap_err().to_string();
    for wrong in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(refused(SimplifyOptions::default().max_error_m(wrong)).contains("0 or more metres"));
    }
    let many = refused(SimplifyOptions::default().max_error_m(0.0).max_triangles(1000));
    assert!(many.contains("more than 1,000 triangles") && many.contains("larger error"), "{many}");
    let dem = MemoryDem::from_fn([33, 33], SampleType::I16, |x, y| rugged(1, x, y));
    let steps = terrain_of(&dem, &BuildOptions::default().error(ErrorKind::Step));
    let said = simplify(&steps, &SimplifyOptions::default()).unwrap_err().to_string();
    assert!(said.contains("bounded errors"), "{said}");
}
