//! Ten thousand craters on each of the committed DEMs: every record is a rebuild's, and undoing brings every byte back.

use std::path::Path;
use terrasoar::edits::rain::Rain;
use terrasoar_layout::build::{BuildOptions, HeightRoom, build, rebuild};
use terrasoar_layout::edit::{Edit, EditSession, widen};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::verify::verify;

const CRATERS: u64 = 10_000;
/// Craters of a commit.
const BATCH: u64 = 500;

fn pages(terrain: &Terrain) -> Vec<u8> {
    (0..terrain.header().record_pages()).flat_map(|i| terrain.checked_page(i).unwrap().to_vec()).collect()
}

fn bombard(dem: &str, spacing_m: Option<[f64; 2]>, z_scale: f64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    let dem = terrasoar_import::open(&[Path::new("tests/data").join(dem)]).unwrap();
    build(&*dem, &path, &BuildOptions::default().spacing_m(spacing_m).z_scale(z_scale), &Silent).unwrap();
    let [low, high] = Terrain::open(&path).unwrap().header().height_range_m;
    let room = HeightRoom { lowest_m: low - 2000.0, highest_m: high + 2000.0 };
    widen(&SystemDisk, &path, room, 512, &Silent).unwrap();
    let before = pages(&Terrain::open(&path).unwrap());

    let mut session = EditSession::open(&path).unwrap();
    let grid = *session.editor().terrain().grid();
    let ([wide, high], [dx, _]) = (grid.extent_m(), grid.spacing_m());
    let rain = Rain {
        count: CRATERS,
        seed: 5,
        // Over the borders too.
        extent_m: [-3.0 * dx, -3.0 * dx, wide + 3.0 * dx, high + 3.0 * dx],
        radius_m: [1.5 * dx, 8.0 * dx],
        depth_ratio: [0.1, 0.4],
        batch: BATCH,
    };
    let craters: Vec<Edit> = rain.craters().map(Edit::Crater).collect();
    for batch in craters.chunks(BATCH as usize) {
        session.apply(batch).unwrap();
        session.commit("craters").unwrap();
    }
    let edited = Terrain::open(&path).unwrap();
    assert!(verify(&edited, &|_| {}).unwrap().is_sound());
    let anew = folder.path().join("anew.iqt");
    rebuild(&SystemDisk, &edited, &anew, None, 512, &Silent).unwrap();
    let (ours, theirs) = (pages(&edited), pages(&Terrain::open(&anew).unwrap()));
    assert!(ours != before && ours == theirs, "a rebuild has other records");

    let mut undone = 0;
    while session.undo().unwrap().is_some() {
        undone += 1;
    }
    assert_eq!(undone, CRATERS / BATCH);
    assert!(pages(&Terrain::open(&path).unwrap()) == before, "undoing leaves something");
}

#[test]
fn puget_sound() {
    bombard("puget_sound_1025.png", Some([160.0; 2]), 0.1);
}

#[test]
fn crater_lake() {
    bombard("crater_lake_1025.bt", None, 1.0);
}
