//! The examples run, and say what they are to say.

#[path = "support/examples.rs"]
mod examples;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;

fn run(name: &str, terrain: &Path) -> String {
    run_with(name, &[terrain])
}

fn run_with(name: &str, files: &[&Path]) -> String {
    let Output { status, stdout, stderr } =
        Command::new(examples::built("terrasoar", name).unwrap()).args(files).output().unwrap();
    assert!(status.success(), "{name}: {}", String::from_utf8_lossy(&stderr));
    assert!(stderr.is_empty(), "{name}: {}", String::from_utf8_lossy(&stderr));
    String::from_utf8(stdout).unwrap()
}

fn terrain() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let hill = |x: u32, y: u32| 500.0 + 300.0 * (f64::from(x) / 40.0).sin() * (f64::from(y) / 30.0).cos();
    let dem =
        MemoryDem::from_fn([513, 513], SampleType::I16, |x, y| hill(x, y).round() + f64::from((x ^ y) % 7));
    build(&dem, &path, &BuildOptions::default().spacing_m([30.0; 2]), &Silent).unwrap();
    (folder, path)
}

#[test]
fn a_replay_draws_the_same_with_three_engines() {
    let (_folder, path) = terrain();
    let said = run("replay", &path);
    let triangles: Vec<&str> = said.lines().map(|line| line.split_whitespace().nth(1).unwrap()).collect();
    assert_eq!(triangles.len(), 3, "{said}");
    assert!(triangles[0].parse::<f64>().unwrap() > 1000.0, "{said}");
    assert!(triangles.iter().all(|n| *n == triangles[0]), "{said}");
}

#[test]
fn a_million_heights_are_those_of_the_file() {
    let (_folder, path) = terrain();
    let said = run("heights", &path);
    assert!(said.starts_with("1000000 of 1000000 places have ground, "), "{said}");
    // The mean of the samples is that of the surface between them, but for the rim.
    let mean: f64 = said.split("ground, ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    let terrain = terrasoar::Terrain::open(&path).unwrap();
    let at = |i: u32, j: u32| terrain.height_m(f64::from(i) * 120.0, f64::from(j) * 120.0).unwrap().unwrap();
    let sum: f64 = (0..128).flat_map(|j| (0..128).map(move |i| at(i, j))).sum();
    assert!((mean - sum / (128.0 * 128.0)).abs() < 10.0, "{mean} against {}", sum / (128.0 * 128.0));
}

#[test]
fn edits_while_flying_are_made_saved_and_taken_back() {
    let (_folder, path) = terrain();
    let heights = || {
        let terrain = terrasoar::Terrain::open(&path).unwrap();
        (0..64)
            .map(|i| terrain.height_m(f64::from(i) * 240.0, f64::from(i) * 200.0).unwrap())
            .collect::<Vec<_>>()
    };
    let before = heights();
    let said = run("edit", &path);
    assert!(said.contains(" craters in ") && said.contains("all on the disk"), "{said}");
    assert!(said.lines().filter(|line| line.contains("now Some(")).count() > 5, "{said}");
    assert!(said.contains(" commits taken back") && !said.contains("\n0 commits taken back"), "{said}");
    assert_eq!(heights(), before);
}

#[test]
fn the_steps_make_land_fly_over_it_and_save_craters() {
    let folder = tempfile::tempdir().unwrap();
    let [land, save] = ["land.iqt", "save.iqo"].map(|name| folder.path().join(name));
    let said = run("step_1_terrain", &land);
    assert!(said.contains("land.iqt: heights from "), "{said}");
    assert_eq!(terrasoar::Terrain::open(&land).unwrap().extent_m(), [10_240.0; 2]);

    let said = run("step_2_fly", &land);
    let lines: Vec<&str> = said.lines().collect();
    let [triangles, foot, far, shot] = lines[..] else { panic!("{said}") };
    assert!(triangles.split(' ').next().unwrap().parse::<u32>().unwrap() > 1000, "{said}");
    let exact_m = terrasoar::Terrain::open(&land).unwrap().height_m(5120.0, 7168.0).unwrap().unwrap();
    assert_eq!(foot, format!("the ground is {exact_m:.2} m high"));
    assert_eq!(far, "a far place is exact: true");
    assert!(shot.starts_with("the shot lands ") && !shot.ends_with("nowhere"), "{said}");

    let said = run_with("step_6_save", &[&land, &save]);
    assert!(said.contains(" pages written") && said.contains("with the overlay Some("), "{said}");
    // The crater was committed and taken back; the overlay has it for good.
    let height_m = |terrain: terrasoar::Terrain| terrain.height_m(5120.0, 5120.0).unwrap().unwrap();
    let was_m = height_m(terrasoar::Terrain::open(&land).unwrap());
    let is_m = height_m(terrasoar::Terrain::open_with_overlay(&land, &save).unwrap());
    assert!((was_m - is_m - 10.0).abs() < 0.1, "{was_m} {is_m}");
}
