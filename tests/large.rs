//! Squares of more than 65,537 samples a side, nearly all void: slots need more than 32 bits, and of the largest more than 40, and places in metres more than 24. Engines fly over islands in them and draw one mesh, that of
//! SOAR, which is made anew in every frame (the definition looks at every vertex there is); edits, packed files and files written anew hold what the source said.

mod common;

use common::checks::{keys, triangles, views};
use common::{frame, rugged};
use std::path::Path;
use std::sync::Arc;
use terrasoar::flight::FlightFrame;
use terrasoar::mesh::Triangle;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{ModelDisk, Prefetch, Streamed};
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, MemoryDem, SampleSink, SampleType, Window};
use terrasoar_layout::edit::{Crater, Edit, EditSession, compact};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::packing::{pack, unpack};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

const SPACING_M: [f64; 2] = [10.0, 12.0];

/// Squares of rugged ground, each from its south-west sample, in a square of voids.
struct Islands {
    info: DemInfo,
    /// From the south to the north, none beside another.
    at: Vec<[u32; 2]>,
}

/// Samples a side of an island.
const ISLAND: u32 = 200;

impl Islands {
    /// One in the middle, where the quadtree is cut in four, one in the south-west, one in the north-east.
    fn new(side: u32) -> Self {
        let info = MemoryDem::from_fn([2, 2], SampleType::I16, |_, _| 0.0).info().clone();
        let (middle, last) = (side / 2, side - ISLAND);
        Self {
            info: DemInfo { samples_wide: side, samples_high: side, ..info },
            at: vec![[0, 0], [middle - 90, middle - 110], [last, last]],
        }
    }

    fn height(&self, x: u32, y: u32) -> Option<f64> {
        let on = |v: u32, from: u32| (from..from + ISLAND).contains(&v);
        self.at.iter().any(|at| on(x, at[0]) && on(y, at[1])).then(|| rugged(7, x, y))
    }
}

impl DemSource for Islands {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let side = self.info.samples_wide;
        let mut south = 0;
        for [west, y] in self.at.iter().copied() {
            let below = y - south;
            if below > 0 {
                sink.put_void(Window { col: 0, row: side - y, width: side, height: below })?;
            }
            let (row, height) = (side - y - ISLAND, ISLAND);
            let east = west + ISLAND;
            sink.put_void(Window { col: 0, row, width: west, height })?;
            sink.put_void(Window { col: east, row, width: side - east, height })?;
            let rows = (y..y + ISLAND).rev();
            let samples: Vec<f64> = rows.flat_map(|y| (west..east).map(move |x| rugged(7, x, y))).collect();
            sink.put(Window { col: west, row, width: ISLAND, height }, &samples)?;
            south = y + ISLAND;
        }
        if south < side {
            sink.put_void(Window { col: 0, row: 0, width: side, height: side - south })?;
        }
        Ok(())
    }
}

/// All heights of islands and of what lies around them, and of places anywhere.
fn check_heights(dem: &Islands, terrain: &Terrain) {
    let last = dem.info.samples_wide - 1;
    let around = |from: u32| from.saturating_sub(2)..=(from + ISLAND + 1).min(last);
    let near = dem.at.iter().flat_map(|at| around(at[1]).flat_map(|y| around(at[0]).map(move |x| [x, y])));
    let far = (0..2000u32).map(|i| [i.wrapping_mul(2_654_435_761) % last, i.wrapping_mul(40_503_001) % last]);
    with_records!(terrain.records().unwrap(), records => {
        for [x, y] in near.chain(far) {
            let v = records.vertex_at(GridPoint::new(x, y));
            assert_eq!(Some(v.height_m).filter(|_| !v.class.is_void()), dem.height(x, y), "({x}, {y})");
        }
    });
}

fn check_sound(path: &Path) -> Terrain {
    let terrain = Terrain::open(path).unwrap();
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    terrain
}

/// A flight low over the island whose south-west sample is `at`.
fn flight(terrain: &Terrain, at: [u32; 2]) -> impl Iterator<Item = FlightFrame> + Clone {
    let [wide, high] = terrain.grid().extent_m();
    let place = move |x: f64, y: f64| {
        [(f64::from(at[0]) + x) * SPACING_M[0] / wide, (f64::from(at[1]) + y) * SPACING_M[1] / high]
    };
    let frames: Vec<FlightFrame> = (0..16)
        .map(|i| {
            frame(
                terrain,
                place(60.0 + 5.0 * f64::from(i), 20.0 + 3.0 * f64::from(i)),
                1400.0,
                5.0 * f64::from(i),
                -30.0,
            )
        })
        .collect();
    frames.into_iter()
}

/// An engine, as its triangles for a view.
type Flown<'e> = Box<dyn FnMut(&View) -> Vec<Triangle> + 'e>;

fn over<'e, E: Engine + 'e>(mut engine: E) -> Flown<'e> {
    Box::new(move |view| {
        engine.update(view, &mut Unobserved);
        triangles(&engine)
    })
}

/// All engines over each island, against SOAR; and the streamed engine, whose pages come one by one.
fn fly(dem: &Islands, path: &Path) {
    let terrain = Terrain::open(path).unwrap();
    let streamed = Arc::new(Terrain::open_unmapped(path).unwrap());
    for at in dem.at.iter().copied() {
        let views: Vec<View> = views(flight(&terrain, at), 1.0);
        for culling in Culling::ALL {
            let Ok(ByKind::Compact(records)) = terrain.records() else { panic!("compact records") };
            let mut soar = over(Soar::new(records.clone(), culling));
            let mut engines =
                [over(Smart::new(records.clone(), culling)), over(Kinetic::new(records.clone(), culling))];
            for view in &views {
                let expected = keys(&soar(view));
                assert!(expected.len() > 50, "{}", expected.len());
                for engine in &mut engines {
                    assert!(keys(&engine(view)) == expected);
                }
            }
        }
        let ByKind::Compact(pool) = streamed.pool(16 << 20).unwrap() else { panic!("compact records") };
        let disk = ModelDisk::new(Arc::clone(&streamed), 40, 1);
        let mut flown = Streamed::new(pool, disk, Culling::Vertices, Prefetch::default());
        let Ok(ByKind::Compact(records)) = terrain.records() else { panic!("compact records") };
        let mut expected = over(Soar::new(records, Culling::Vertices));
        for view in &views {
            let frames = (0..500).find(|_| flown.update(view, &mut Unobserved).work.late == 0);
            assert!(frames.is_some(), "pages stay late");
            assert!(keys(&triangles(flown.engine())) == keys(&expected(view)));
        }
    }
}

fn check(side: u32) {
    let folder = tempfile::tempdir().unwrap();
    let [plain, packed, unpacked, anew] =
        ["plain.iqt", "packed.iqt", "unpacked.iqt", "anew.iqt"].map(|name| folder.path().join(name));
    let dem = Islands::new(side);
    let header = build(&dem, &plain, &BuildOptions::default().spacing_m(SPACING_M), &Silent).unwrap();
    assert!(header.file_bytes < 64 << 20, "{}", header.file_bytes);
    check_heights(&dem, &check_sound(&plain));
    fly(&dem, &plain);

    // Packed, and back.
    pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
    // What is void takes no room: the entries of all tiles alone would be a hundred megabytes.
    let [before, after] = [&plain, &packed].map(|path| std::fs::metadata(path).unwrap().len());
    assert!(after < before, "{after} of {before} bytes");
    check_heights(&dem, &check_sound(&packed));
    unpack(&SystemDisk, &packed, &unpacked, &Silent).unwrap();
    assert!(std::fs::read(&plain).unwrap() == std::fs::read(&unpacked).unwrap());

    // A crater on each island; all but the last stay.
    let mut session = EditSession::open(&plain).unwrap();
    for at in &dem.at {
        let centre_m = [0, 1].map(|i| (f64::from(at[i]) + 100.0) * SPACING_M[i]);
        let crater = Crater { centre_m, direction_deg: 40.0, radius_m: 150.0, depth_m: 60.0 };
        let changes = session.apply(&[Edit::Crater(crater)]).unwrap();
        assert!(changes.vertices.len() > 500, "{}", changes.vertices.len());
        session.commit("crater").unwrap();
    }
    drop(session);
    let edited = check_sound(&plain);
    let centre = |terrain: &Terrain, at: [u32; 2]| {
        terrain
            .height_m((f64::from(at[0]) + 100.0) * SPACING_M[0], (f64::from(at[1]) + 100.0) * SPACING_M[1])
            .unwrap()
            .unwrap()
    };
    for at in dem.at.iter().copied() {
        let before = dem.height(at[0] + 100, at[1] + 100).unwrap();
        assert!(centre(&edited, at) < before - 30.0, "{at:?}");
    }
    fly(&dem, &plain);

    // Written anew it is the same ground.
    compact(&SystemDisk, &plain, None, &anew, &Silent).unwrap();
    let compacted = check_sound(&anew);
    for at in dem.at.iter().copied() {
        assert_eq!(centre(&compacted, at), centre(&edited, at));
    }
    drop((edited, compacted));

    // Without its craters it is what was built.
    let mut session = EditSession::open(&plain).unwrap();
    for _ in &dem.at {
        session.undo().unwrap().unwrap();
    }
    drop(session);
    check_heights(&dem, &check_sound(&plain));
}

#[test]
fn islands_in_a_square_of_17_bits() {
    check(131_073);
}

#[test]
fn islands_in_a_square_of_20_bits() {
    check(1_048_577);
}
