//! Meshes for whose vertices there are not slots enough.

use super::*;
use crate::refine::Unobserved;
use crate::refine::kinetic::mesh::clusters::CLUSTER;
use std::collections::HashSet;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::AnyRecords;
use terrasoar_layout::read::terrain::Terrain;

/// Asserts that every edge of a triangle is an edge of another, the other way round, or lies on the border of the square.
fn check_conforming(engine: &Kinetic<impl RecordStore>) {
    let mut edges = HashSet::new();
    let mut area = 0;
    engine.for_each_triangle(&mut |corners| {
        let [a, b, c] = corners.map(|p| [i64::from(p.x()), i64::from(p.y())]);
        let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(doubled > 0, "{corners:?}");
        area += doubled;
        for i in 0..3 {
            assert!(edges.insert((corners[i], corners[(i + 1) % 3])), "{corners:?} twice");
        }
    });
    let side = engine.records.grid().side_steps();
    assert_eq!(area, 2 * i64::from(side) * i64::from(side));
    for (a, b) in &edges {
        let is_border = (a.x() == b.x() && a.x() % side == 0) || (a.y() == b.y() && a.y() % side == 0);
        assert!(is_border || edges.contains(&(*b, *a)), "a crack at {a:?} to {b:?}");
    }
}

/// Every mesh that the slots allow is whole, as large as they allow, and says what is late; with slots for all it is what it always is.
#[test]
fn where_slots_are_all_taken_the_mesh_is_coarser_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([129; 2], SampleType::I16, |x, y| f64::from((x * x * 7 + y * x * 3) % 90));
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
    let terrain = Terrain::open(&path).unwrap();
    let AnyRecords::Compact(records) = terrain.records().unwrap() else { panic!("compact records") };
    let views = [
        View::new([600.0, 100.0, 150.0], 0.0, -20.0),
        View::new([620.0, 120.0, 150.0], 3.0, -20.0),
        View::new([100.0, 1100.0, 90.0], 120.0, -30.0),
        View::new([640.0, 640.0, 2500.0], 120.0, -90.0),
    ];
    for culling in [Culling::Vertices, Culling::Clusters] {
        let mut free = Kinetic::new(records.clone(), culling);
        for budget in [Budget::default(), Budget::default().tests(5000)] {
            let limits = [5, 6, 9, 40, 333, 1500, 1 << 20].map(|most| (most, 1 << 28));
            let places = [0, 5, 8, 20, 100].map(|clusters| (1 << 29, clusters * CLUSTER));
            for (most, most_places) in limits.into_iter().chain(places) {
                let mut engine = Kinetic::new(records.clone(), culling);
                engine.vertices.limit(most);
                engine.nodes.limit(most_places);
                engine.set_budget(budget);
                for (i, view) in views.iter().cycle().take(9).enumerate() {
                    engine.update(view, &mut Unobserved);
                    free.update(view, &mut Unobserved);
                    check_conforming(&engine);
                    let used = engine.nodes.all.iter().filter(|node| node.is_split()).count() + 4;
                    assert!(used <= most, "{used} of {most}");
                    assert!(engine.nodes.all.len() <= most_places.max(CLUSTER));
                    let is_same = engine.triangle_count() == free.triangle_count();
                    let is_late = engine.work().late > 0;
                    assert!(is_same || is_late, "{most} slots, {most_places} places, frame {i}");
                    // A budget may leave tests for later, too.
                    let is_told = is_same && is_late;
                    assert!(
                        !is_told || budget.tests.is_some(),
                        "{most} slots, {most_places} places, frame {i}"
                    );
                }
            }
        }
    }
}
