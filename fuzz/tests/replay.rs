//! Every body over its seeds, over all that fuzzing ever found, and over mutations that repeat. `TERRASOAR_MUTATIONS` says how many a target.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use terrasoar_fuzz::mutation::mutate;
use terrasoar_fuzz::{TARGETS, Target};
use terrasoar_layout::testing::is_thorough;

/// Mutations of a target where nothing else is said, and where there is time.
const MUTATIONS: [u64; 2] = [60, 200];
/// A run that takes longer hangs, for one takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// Memory is counted for the whole process, so one body runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Findings of a target that are listed.
const LISTED: usize = 8;

fn replay(name: &str) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target");
    let seeds = (target.seeds)();
    assert!(seeds.len() > 3, "only {} seeds", seeds.len());
    let mutations = std::env::var("TERRASOAR_MUTATIONS")
        .map_or(MUTATIONS[usize::from(is_thorough())], |number| number.parse().expect("a number"));
    let mutated = (0..mutations).map(|number| {
        let (input, bytes) = &seeds[number as usize % seeds.len()];
        (format!("{input}, mutation {number}"), mutate(bytes, number, target.is_text))
    });
    let inputs = seeds.iter().cloned().chain(target.regressions()).chain(mutated);
    let findings: Vec<String> =
        inputs.filter_map(|(input, bytes)| run(target, &input, &bytes)).take(LISTED).collect();
    assert!(findings.is_empty(), "{}", findings.join("\n"));
}

/// Runs a body over an input; what it breaks and where the input is kept.
fn run(target: &Target, input: &str, bytes: &[u8]) -> Option<String> {
    let begun = Instant::now();
    let panic = std::panic::catch_unwind(|| target.run(bytes)).err();
    if panic.is_none() && begun.elapsed() < PATIENCE {
        return None;
    }
    let words =
        panic.as_ref().map(|panic| match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
            (Some(words), _) => words.clone(),
            (None, Some(words)) => (*words).to_owned(),
            (None, None) => "a panic without words".to_owned(),
        });
    let words = words.unwrap_or_else(|| format!("it took {:?}", begun.elapsed()));
    let file: String = input.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let kept = std::env::temp_dir().join(format!("terrasoar-{}-{file}", target.name));
    let _ = std::fs::write(&kept, bytes);
    Some(format!("{} over {input}: {words}; the input is in {}", target.name, kept.display()))
}

#[test]
fn elevation_data() {
    replay("import");
}

#[test]
fn surfer_grids() {
    replay("surfer");
}

#[test]
fn openexr_pictures() {
    replay("openexr");
}

#[test]
fn ascii_grids() {
    replay("ascii_grid");
}

#[test]
fn xyz_grids() {
    replay("xyz");
}

#[test]
fn labelled_numbers() {
    replay("labelled");
}

#[test]
fn netpbm_pictures() {
    replay("netpbm");
}

#[test]
fn headerless_heightmaps() {
    replay("raw");
}

#[test]
fn packed_tiles() {
    replay("tiles");
}

#[test]
fn map_tiles_in_pmtiles() {
    replay("pmtiles");
}

#[test]
fn map_tiles_in_mbtiles() {
    replay("mbtiles");
}

#[test]
fn map_tiles_in_folders() {
    replay("map_tile");
}

#[test]
fn packed_png() {
    replay("packed_png");
}

#[test]
fn netcdf() {
    replay("netcdf");
}

#[test]
fn grib() {
    replay("grib");
}

#[test]
fn cells_of_dted() {
    replay("dted");
}

#[test]
fn sheets_of_the_usgs() {
    replay("usgs_dem");
}

#[test]
fn virtual_rasters() {
    replay("vrt");
}

#[test]
fn pictures() {
    replay("image");
}

#[test]
fn world_files() {
    replay("world_file");
}

#[test]
fn reference_systems() {
    replay("reference_system");
}

#[test]
fn files_beside_by_gdal() {
    replay("aux_xml");
}

#[test]
fn flights() {
    replay("flight");
}

#[test]
fn scripts_of_edits() {
    replay("edits");
}

#[test]
fn sealed_terrains() {
    replay("terrain_sealed");
}

#[test]
fn packed_terrains() {
    replay("packed");
}

#[test]
fn sealed_overlays() {
    replay("overlay_sealed");
}

#[test]
fn every_target_is_replayed_and_has_a_program() {
    let manifest = include_str!("../Cargo.toml");
    for target in TARGETS {
        assert!(include_str!("replay.rs").contains(&format!("replay(\"{}\")", target.name)));
        assert!(manifest.contains(&format!("path = \"fuzz_targets/{}.rs\"", target.name)));
    }
    let folders = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/regressions")).unwrap();
    for folder in folders {
        let folder = folder.unwrap();
        let name = folder.file_name();
        assert!(
            !folder.path().is_dir() || TARGETS.iter().any(|target| name == target.name),
            "{name:?} is no target's"
        );
    }
}
