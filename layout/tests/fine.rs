//! Fine records: the heights of compact ones, errors and radii near those of exact ones, and room for steeper ground on demand.

mod common;

use common::MemoryDem;
use proptest::prelude::*;
use std::path::Path;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{Area, Edit, EditSession, SampleRect, room_for};
use terrasoar_layout::file::header::ErrorKind;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::{RecordKind, Vertex, VertexClass};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

fn built(folder: &Path, dem: &MemoryDem, options: &BuildOptions, record: RecordKind) -> Terrain {
    let path = folder.join("t.iqt");
    build(dem, &path, &options.clone().record(record), &Silent).unwrap();
    let terrain = Terrain::open(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    terrain
}

fn vertices(terrain: &Terrain, side: u32) -> Vec<(GridPoint, Vertex)> {
    let points = (0..side).flat_map(|y| (0..side).map(move |x| GridPoint::new(x, y)));
    with_records!(terrain.records().unwrap(), records => points.map(|p| (p, records.vertex_at(p))).collect())
}

/// Radii of flat ground by level, after FORMAT.md, section 3.1.
fn flat_radii_m([dx, dy]: [f64; 2]) -> Vec<f64> {
    let leg = |level: u32| {
        let s = f64::from(1u32 << (level / 2));
        if level % 2 == 1 { s * dx.max(dy) } else { 0.5 * s * dx.hypot(dy) }
    };
    let mut all = vec![0.0];
    (1..12).for_each(|level| all.push(all[level as usize - 1] + leg(level)));
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Errors are rounded up by one step at most, whatever lies below: rounding up keeps order, so steps do not add up. What a radius has above flat ground's is rounded up at each level, and levels shrink by the root of two: four steps hold all of it.
    #[test]
    fn errors_and_radii_are_near_exact_ones(seed in 0u32..1000, tall in prop_oneof![Just(3.0), Just(60.0), Just(900.0)], uneven: bool) {
        let dem = MemoryDem::from_fn([65, 65], SampleType::I16, |x, y| {
            let (u, v) = (f64::from(x), f64::from(y));
            let rough = f64::from((((x * 31 + seed) * 57) ^ (y * 17 + seed)) % 97) / 97.0;
            (tall * ((u * 0.1).sin() + (v * 0.07).cos() + 0.2 * rough)).round()
        });
        let folder = tempfile::tempdir().unwrap();
        // Bounded errors at the border are sums of rounded ones; these are not.
        let options = BuildOptions::default().error(ErrorKind::Step).spacing_m(if uneven { [10.0, 17.0] } else { [10.0; 2] });
        let [fine, exact] = [RecordKind::Fine, RecordKind::Exact16].map(|kind| built(folder.path(), &dem, &options, kind));
        prop_assert_eq!(fine.header().record_kind, RecordKind::Fine);
        let grid = *fine.grid();
        let flat_m = flat_radii_m(grid.spacing_m());
        for ((p, fine), (_, exact)) in vertices(&fine, 65).into_iter().zip(vertices(&exact, 65)) {
            prop_assert_eq!(fine.height_m, exact.height_m);
            prop_assert_eq!((fine.class, exact.class), (VertexClass::Plain, VertexClass::Plain));
            // Exact records are rounded up too, to singles or halves of them.
            prop_assert!(fine.error_m >= exact.error_m / 1.008, "{p:?} {fine:?} {exact:?}");
            prop_assert!(fine.error_m <= exact.error_m * 2.0f64.powf(1.0 / 64.0) * 1.000_001, "{p:?} {fine:?} {exact:?}");
            if grid.is_corner(p) {
                continue;
            }
            let flat_m = flat_m[grid.level(p) as usize];
            let excess = |radius_m: f64| (radius_m - flat_m).max(0.0);
            let step_m = (excess(fine.radius_m) / 8.0).max(flat_m / 128.0);
            prop_assert!(fine.radius_m >= exact.radius_m / 1.03 && excess(fine.radius_m) <= excess(exact.radius_m) + 4.0 * step_m, "{p:?} {flat_m} {fine:?} {exact:?}");
        }
    }
}

/// Fine records tell steep radii in coarser steps than they have to: only as steep as the ground is, and a little more. A cliff takes a wider file, which has fine records too.
#[test]
fn cliffs_take_a_wider_file_of_fine_records() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    let dem = MemoryDem::from_fn([90, 70], SampleType::I16, |x, y| f64::from(3 * x + 2 * y));
    let options = BuildOptions::default().spacing_m([10.0; 2]).record(RecordKind::Fine);
    build(&dem, &path, &options, &Silent).unwrap();
    let rect = SampleRect { west: 30, south: 30, east: 50, north: 40 };
    let cliff = Edit::Set { area: Area::Rect(rect), height_m: 900.0 };
    let mut session = EditSession::open(&path).unwrap();
    let Err(LayoutError::OutOfRange { problem, heights_m, .. }) = session.apply(std::slice::from_ref(&cliff))
    else {
        panic!("a cliff of 700 m over 10 fits")
    };
    assert!(problem.contains("steeper"), "{problem}");
    let room = room_for(session.header(), heights_m);
    let header = session.widen(room, 512, &Silent).unwrap();
    assert_eq!(header.record_kind, RecordKind::Fine);
    let mut session = EditSession::open(&path).unwrap();
    session.apply(&[cliff]).unwrap();
    session.commit("cliff").unwrap();
    let terrain = Terrain::open(&path).unwrap();
    assert!(verify(&terrain, &|_| {}).unwrap().problems.is_empty());
    assert_eq!(terrain.height_m(405.0, 355.0).unwrap(), Some(900.0));
}
