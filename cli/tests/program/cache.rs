//! Elevation data where a terrain file is asked for: built into the folder for caches, and taken from there.

use crate::support::{Bench, text};

/// The files that are kept.
fn kept(bench: &Bench) -> Vec<String> {
    let folder = bench.cache().join("terrasoar/terrains");
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn elevation_data_is_built_once_and_again_when_it_changes() {
    let bench = Bench::with_terrain();
    let (built, asked) =
        (["height", "land.iqt", "--at", "400,600"], ["height", "land.tif", "--at", "400,600"]);
    let wanted = bench.good(&built);
    let words = |args: &[&str]| {
        let output = bench.run(args);
        let told = text(&output.stderr);
        assert!(output.status.success(), "{told}");
        (text(&output.stdout), told)
    };
    let (height, told) = words(&asked);
    assert_eq!(height, wanted);
    let [name] = &kept(&bench)[..] else { panic!("{:?}", kept(&bench)) };
    assert!(name.starts_with("land-") && told.contains(name.as_str()), "{told}");
    assert!(told.contains("is built into") && told.contains("terrasoar build land.tif -o"), "{told}");
    let (height, told) = words(&asked);
    assert_eq!(height, wanted);
    assert!(told.contains("was built before") && told.contains(name.as_str()), "{told}");
    let (out, told) = words(&["info", "land.tif", "--json"]);
    assert!(out.contains("\"samples\"") && told.contains("was built before"), "{told}");
    assert_eq!(kept(&bench).len(), 1);
    // A kept file that is damaged is built again.
    std::fs::write(bench.cache().join("terrasoar/terrains").join(name), b"nothing").unwrap();
    assert_eq!(words(&asked).0, wanted);
    // So is one whose elevation data is another now.
    bench.good(&["synth", "--size", "129", "--seed", "6", "-o", "land.tif"]);
    let (other, told) = words(&asked);
    assert!(other != wanted && told.contains("is built into"), "{told}");
    assert_eq!(kept(&bench).len(), 2);
    assert_eq!(bench.names(), ["land.iqt", "land.tif"], "nothing is left beside the data");
}

#[test]
fn a_folder_that_cannot_be_written_to_is_said() {
    let bench = Bench::with_terrain();
    std::fs::write(bench.path("file"), "").unwrap();
    let mut command = bench.command(&["info", "land.tif"]);
    let output = command.env("XDG_CACHE_HOME", bench.path("file")).output().unwrap();
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(
        told.contains("no terrain could be built") && told.contains("terrasoar build land.tif -o"),
        "{told}"
    );
}

#[test]
fn what_is_edited_has_to_be_a_terrain_file() {
    let bench = Bench::with_terrain();
    let crater = ["crater", "land.tif", "--at", "400,600", "--radius", "40", "--depth", "9"];
    assert!(bench.bad(1, &crater).contains("not a terrain file"));
    assert!(kept(&bench).is_empty());
}
