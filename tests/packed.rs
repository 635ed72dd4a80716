//! Packed terrain is flown over as the terrain it was made of: every engine draws the same triangles in every frame, from a pool whose pages are unpacked as they come, and from the whole.

mod common;

use common::checks::{keys, triangles, views};
use common::{frame, noise, rugged};
use std::sync::Arc;
use terrasoar::mesh::Triangle;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar::stream::{ModelDisk, Prefetch, Streamed};
use terrasoar::view::View;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::grid::record::{RecordCodec, RecordKind};
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::kinds::ByKind;
use terrasoar_layout::read::pool::PagePool;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;

#[test]
fn engines_fly_edited_packed_terrain_as_the_terrain() {
    let compact = (SampleType::I16, None);
    let exact = |sample_type| (sample_type, Some(RecordKind::Exact8));
    for (samples, holes, (sample_type, record)) in [
        ([257, 257], false, compact),
        ([330, 190], true, compact),
        ([250, 210], true, (SampleType::I16, Some(RecordKind::Fine))),
        ([260, 190], true, exact(SampleType::F32)),
        ([150, 130], false, exact(SampleType::F64)),
    ] {
        let dem = MemoryDem::from_fn(samples, sample_type, |x, y| {
            let is_hole = holes && x + y > 0 && (noise(5, y / 9, x / 7) < 0.05 || noise(6, y, x) < 0.001);
            let height = rugged(6, x, y);
            match sample_type {
                _ if is_hole => f64::NAN,
                SampleType::F32 => f64::from((height * 1.01) as f32),
                SampleType::F64 => height * 1.01,
                _ => height,
            }
        });
        let folder = tempfile::tempdir().unwrap();
        let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.path().join(name));
        let options = BuildOptions::default().spacing_m([10.0, 12.0]).record(record);
        build(&dem, &plain, &options, &Silent).unwrap();
        pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
        // Craters on the way, one of them undone.
        for path in [&plain, &packed] {
            let mut session = EditSession::open(path).unwrap();
            for i in 0..4 {
                let centre_m = [700.0 + 300.0 * f64::from(i), 1300.0 - 200.0 * f64::from(i)];
                let crater = Crater { centre_m, direction_deg: 40.0, radius_m: 150.0, depth_m: 60.0 };
                session.apply(&[Edit::Crater(crater)]).unwrap();
                session.commit("crater").unwrap();
            }
            session.undo().unwrap().unwrap();
        }
        let plain = Terrain::open(&plain).unwrap();
        let whole = Terrain::open(&packed).unwrap();
        let streamed = Arc::new(Terrain::open_unmapped(&packed).unwrap());
        match (plain.records(), whole.records(), streamed.pool(64 << 20).unwrap()) {
            (Ok(ByKind::Compact(a)), Ok(ByKind::Compact(b)), ByKind::Compact(pool)) => {
                fly(&plain, a, b, pool, &streamed);
            }
            (Ok(ByKind::Exact8(a)), Ok(ByKind::Exact8(b)), ByKind::Exact8(pool)) => {
                fly(&plain, a, b, pool, &streamed);
            }
            (Ok(ByKind::Exact16(a)), Ok(ByKind::Exact16(b)), ByKind::Exact16(pool)) => {
                fly(&plain, a, b, pool, &streamed);
            }
            _ => panic!("three kinds of records of one terrain"),
        }
    }
}

/// Every engine over the records of the whole, and one over a pool, draws what is drawn of the terrain file.
fn fly<C: RecordCodec>(
    plain: &Terrain,
    plain_records: Records<'_, C>,
    records: Records<'_, C>,
    pool: PagePool<C>,
    streamed: &Arc<Terrain>,
) {
    let path = (0..24).map(|i| {
        let along = 0.1 + f64::from(i) * 0.025;
        frame(plain, [0.4, along], 1300.0, 15.0 + 4.0 * f64::from(i), -25.0)
    });
    for culling in Culling::ALL {
        let mut expected = Soar::new(plain_records.clone(), culling);
        let mut engines: [Flown<'_>; 4] = [
            over(Soar::new(records.clone(), culling)),
            over(Smart::new(records.clone(), culling)),
            over(Naive::new(records.clone(), culling)),
            over(Kinetic::new(records.clone(), culling)),
        ];
        for view in views(path.clone(), 1.0) {
            expected.update(&view, &mut Unobserved);
            let expected = keys(&triangles(&expected));
            assert!(expected.len() > 50);
            for engine in &mut engines {
                assert!(keys(&engine(&view)) == expected);
            }
        }
    }
    let mut flown = Streamed::new(
        pool,
        ModelDisk::new(Arc::clone(streamed), 40, 1),
        Culling::Vertices,
        Prefetch::default(),
    );
    let mut expected = Soar::new(plain_records.clone(), Culling::Vertices);
    for view in views(path, 1.0) {
        let frames = (0..500).find(|_| flown.update(&view, &mut Unobserved).work.late == 0);
        assert!(frames.is_some(), "pages stay late");
        expected.update(&view, &mut Unobserved);
        assert!(keys(&triangles(flown.engine())) == keys(&triangles(&expected)));
    }
}

/// An engine, as its triangles for a view.
type Flown<'e> = Box<dyn FnMut(&View) -> Vec<Triangle> + 'e>;

fn over<'e, E: Engine + 'e>(mut engine: E) -> Flown<'e> {
    Box::new(move |view| {
        engine.update(view, &mut Unobserved);
        triangles(&engine)
    })
}
