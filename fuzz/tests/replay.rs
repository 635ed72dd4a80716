//! Every body over its seeds, over all that fuzzing ever found, and over mutations that repeat. `TERRASOAR_MUTATIONS` says how many a target.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use terrasoar_fuzz::mutation::mutate;
use terrasoar_fuzz::{TARGETS, Target};

/// Mutations of a target where nothing else is said.
const MUTATIONS: u64 = 200;
/// A run that takes longer hangs, for one takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// Memory is counted for the whole process, so one body runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

fn replay(name: &str) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target");
    let seeds = (target.seeds)();
    assert!(seeds.len() > 3, "only {} seeds", seeds.len());
    for (input, bytes) in seeds.iter().chain(&target.regressions()) {
        run(target, input, bytes);
    }
    let mutations = std::env::var("TERRASOAR_MUTATIONS").map_or(MUTATIONS, |number| number.parse().expect("a number"));
    for number in 0..mutations {
        let (input, bytes) = &seeds[number as usize % seeds.len()];
        run(target, &format!("{input}, mutation {number}"), &mutate(bytes, number, target.is_text));
    }
}

fn run(target: &Target, input: &str, bytes: &[u8]) {
    let begun = Instant::now();
    if let Err(panic) = std::panic::catch_unwind(|| target.run(bytes)) {
        // Kept for whoever looks into it; a name in the folder of temporary files can always be made.
        let kept = std::env::temp_dir().join(format!("terrasoar-{}-finding", target.name));
        let _ = std::fs::write(&kept, bytes);
        eprintln!("{} over {input}: the input is in {}", target.name, kept.display());
        std::panic::resume_unwind(panic);
    }
    assert!(begun.elapsed() < PATIENCE, "{} over {input} took {:?}", target.name, begun.elapsed());
}

#[test]
fn elevation_data() {
    replay("import");
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
        let name = folder.unwrap().file_name();
        assert!(TARGETS.iter().any(|target| name == target.name), "{name:?} is no target's");
    }
}
