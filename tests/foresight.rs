//! Over packed terrain with bounds of errors SOAR leaves records unread that are certain not to show. Its mesh is that of the terrain file, after edits, too, and what it counts is.

mod common;

use common::checks::{keys, measured, triangles, views};
use common::{frame, noise, rugged};
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Probe};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::packing::pack;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

#[derive(Default)]
struct Reads {
    read: u64,
    foreseen: u64,
}

impl Probe for Reads {
    const HEARS_FORESEEN: bool = true;

    fn read(&mut self, _: u64) {
        self.read += 1;
    }

    fn foreseen(&mut self, _: u64) {
        self.foreseen += 1;
    }
}

/// Flies over the records of a terrain file and of the packed one, and holds the meshes against each other. What was read of each, and what was foreseen.
fn fly(
    plain: &(impl CompleteStore + Clone),
    packed: &(impl CompleteStore + Clone),
    path: &[Vec<View>],
) -> [Reads; 2] {
    let mut told = [Reads::default(), Reads::default()];
    for culling in Culling::ALL {
        let (mut expected, mut engine) =
            (Soar::new(plain.clone(), culling), Soar::new(packed.clone(), culling));
        for view in path.iter().flatten() {
            let tests = expected.update(view, &mut told[0]);
            assert_eq!(engine.update(view, &mut told[1]), tests);
            assert!(
                triangles(&engine).len() > 20 && keys(&triangles(&engine)) == keys(&triangles(&expected))
            );
        }
    }
    assert!(packed.take_error().is_none());
    told
}

#[test]
fn what_does_not_show_is_left_unread() {
    for (record, holes) in [
        (RecordKind::Compact, false),
        (RecordKind::Fine, false),
        (RecordKind::Exact8, false),
        (RecordKind::Compact, true),
    ] {
        let sample_type = if record == RecordKind::Exact8 { SampleType::F32 } else { SampleType::I16 };
        // Rough in the west alone.
        let dem = MemoryDem::from_fn([700, 530], sample_type, |x, y| {
            let is_hole = holes && x + y > 0 && noise(5, y / 9, x / 7) < 0.02;
            let height =
                if x < 250 { rugged(6, x, y) } else { 700.0 + (f64::from(x + y) * 0.02).sin() * 90.0 };
            if is_hole { f64::NAN } else { height.round() }
        });
        let folder = tempfile::tempdir().unwrap();
        let [plain, packed] = ["plain.iqt", "packed.iqt"].map(|name| folder.path().join(name));
        let options = BuildOptions::default().spacing_m([10.0, 12.0]).record(Some(record));
        build(&dem, &plain, &options, &Silent).unwrap();
        pack(&SystemDisk, &plain, &packed, &Silent).unwrap();
        for is_edited in [false, true] {
            if is_edited {
                for path in [&plain, &packed] {
                    let mut session = EditSession::open(path).unwrap();
                    for i in 0..3 {
                        let centre_m = [3000.0 + 500.0 * f64::from(i), 2000.0 + 900.0 * f64::from(i)];
                        let crater = Crater { centre_m, direction_deg: 40.0, radius_m: 250.0, depth_m: 80.0 };
                        session.apply(&[Edit::Crater(crater)]).unwrap();
                        session.commit("crater").unwrap();
                    }
                }
            }
            let (plain, packed) = (Terrain::open(&plain).unwrap(), Terrain::open_unmapped(&packed).unwrap());
            let path = (0..8).map(|i| {
                let along = 0.05 + f64::from(i) * 0.11;
                frame(&plain, [along, 0.3], 1200.0, 20.0 + 40.0 * f64::from(i), -25.0)
            });
            let path = views(path, 2.0);
            let path = [measured(&path, ErrorMetric::Ball), measured(&path, ErrorMetric::Sight)];
            let [all, read] = with_records!(plain.records().unwrap(), records => {
                with_records!(packed.paged(4 << 20), paged => fly(&records, &paged, &path))
            });
            assert_eq!(all.foreseen, 0);
            assert_eq!(all.read, read.read + read.foreseen);
            // Next to voids it takes a record to know whether a triangle is drawn.
            let least = if holes { 0 } else { all.read / 200 };
            assert!(
                read.foreseen >= least && (holes == (read.foreseen == 0)),
                "{record:?}: {} of {}",
                read.foreseen,
                all.read
            );
        }
    }
}
