//! What is published: each package by itself has all that building it takes, says what it is, brings its licences, and holds nothing else.
//!
//! Read are `cargo metadata`, `cargo package --list` and the sources, offline. Nothing is packed or compiled.

#[path = "../support/workspace.rs"]
mod workspace;

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};
use workspace::{cargo, root};

/// Packages that are published, in an order in which they can be, and the most bytes of the files of each.
const PACKAGES: [(&str, u64); 7] = [
    ("terrasoar-layout", 1_700_000),
    ("terrasoar-import", 1_900_000),
    ("terrasoar", 900_000),
    ("terrasoar-render", 500_000),
    ("terrasoar-scene", 350_000),
    ("terrasoar-lab", 400_000),
    ("terrasoar-cli", 750_000),
];

/// What no package holds: tests, their data, pictures, elevation data.
const FOREIGN_FOLDERS: [&str; 8] =
    ["tests", "benches", "fixtures", "image_fixtures", "snapshots", "data", "regressions", "docs"];
const FOREIGN_ENDINGS: [&str; 8] = ["png", "jpg", "tif", "bt", "hgt", "iqt", "gif", "svg"];

/// Words of crates.io; it refuses others.
const CATEGORIES: [&str; 10] = [
    "command-line-utilities",
    "development-tools::profiling",
    "encoding",
    "graphics",
    "parser-implementations",
    "rendering",
    "rendering::engine",
    "science::geo",
    "visualization",
    "wasm",
];

/// All packages of the workspace by name.
fn packages() -> BTreeMap<String, Value> {
    let told = cargo(&["metadata", "--no-deps", "--offline", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&told).unwrap();
    let all = metadata["packages"].as_array().unwrap().iter();
    all.map(|package| (package["name"].as_str().unwrap().to_owned(), package.clone())).collect()
}

fn folder_of(package: &Value) -> PathBuf {
    Path::new(package["manifest_path"].as_str().unwrap()).parent().unwrap().to_owned()
}

fn words(list: &Value) -> Vec<&str> {
    list.as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect()
}

/// The files of a package, those that cargo makes left out.
fn listed(name: &str) -> BTreeSet<PathBuf> {
    let told = cargo(&["package", "--list", "--offline", "--allow-dirty", "-p", name]);
    let made = ["Cargo.toml.orig", "Cargo.lock", ".cargo_vcs_info.json"];
    told.lines().filter(|line| !made.contains(line)).map(PathBuf::from).collect()
}

/// The files under a folder, by their path from `base`.
fn files_in(folder: &Path, base: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files_in(&path, base));
        } else {
            found.push(path.strip_prefix(base).unwrap().to_owned());
        }
    }
    found
}

/// `path` without `.` and `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if plain.pop() => {}
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

/// Files that a source takes in by name, from the source's folder.
fn taken_in(source: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for opening in ["include_str!(\"", "include_bytes!(\"", "#[path = \""] {
        let rests = source.match_indices(opening).map(|(at, opening)| &source[at + opening.len()..]);
        found.extend(rests.filter_map(|rest| rest.split('"').next()));
    }
    found
}

#[test]
fn all_that_is_published_is_here_and_nothing_else_is() {
    let published: BTreeSet<String> = packages()
        .into_iter()
        .filter(|(_, package)| package["publish"].is_null())
        .map(|(name, _)| name)
        .collect();
    assert_eq!(published, PACKAGES.map(|(name, _)| name.to_owned()).into());
    assert_eq!(packages()["terrasoar-fuzz"]["publish"], serde_json::json!([]));
}

#[test]
fn packages_say_what_they_are() {
    let all = packages();
    for (name, _) in PACKAGES {
        let package = &all[name];
        for field in ["description", "license", "repository", "readme", "rust_version"] {
            assert!(package[field].as_str().is_some_and(|text| !text.is_empty()), "{name}: {field}");
        }
        let keywords = words(&package["keywords"]);
        assert!((1..=5).contains(&keywords.len()), "{name}: crates.io takes up to five keywords");
        let is_sound = |word: &&str| {
            word.len() <= 20 && word.chars().all(|c| c.is_ascii_alphanumeric() || "-_+".contains(c))
        };
        assert!(keywords.iter().all(is_sound), "{name}: {keywords:?}");
        let categories = words(&package["categories"]);
        assert!((1..=5).contains(&categories.len()), "{name}: {categories:?}");
        assert!(categories.iter().all(|category| CATEGORIES.contains(category)), "{name}: {categories:?}");
        let is_library = words(&package["targets"][0]["kind"]).contains(&"lib");
        assert!(
            !is_library || package["metadata"]["docs"]["rs"].is_object(),
            "{name}: how docs.rs builds it"
        );
    }
}

/// Each published package can be published when those before it are: whatever it uses with a version comes earlier.
#[test]
fn packages_can_be_published_in_order() {
    let all = packages();
    for (at, (name, _)) in PACKAGES.iter().enumerate() {
        for dependency in all[*name]["dependencies"].as_array().unwrap() {
            let used = dependency["name"].as_str().unwrap();
            let is_ours = dependency["path"].is_string();
            // Those by path alone are left out of what is published; only tests may have them.
            let has_version = dependency["req"] != "*";
            if is_ours && has_version {
                let before = PACKAGES[..at].iter().any(|(earlier, _)| *earlier == used);
                assert!(before, "{name} uses {used}, which is published after it");
            }
            assert!(has_version || is_ours && dependency["kind"] == "dev", "{name}: {used} has no version");
        }
    }
}

#[test]
fn packages_bring_licences_and_nothing_foreign() {
    let all = packages();
    for (name, most_bytes) in PACKAGES {
        let (files, folder) = (listed(name), folder_of(&all[name]));
        for needed in ["Cargo.toml", "README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            assert!(files.contains(Path::new(needed)), "{name}: {needed}");
        }
        for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let ours = fs::read(folder.join(licence)).unwrap();
            assert!(
                ours == fs::read(root().join(licence)).unwrap(),
                "{name}: {licence} is another than the project's"
            );
        }
        for file in &files {
            let top = file.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
            let ending =
                file.extension().map_or(String::new(), |ending| ending.to_string_lossy().into_owned());
            let is_foreign =
                FOREIGN_FOLDERS.contains(&top.as_str()) || FOREIGN_ENDINGS.contains(&ending.as_str());
            assert!(!is_foreign, "{name} would publish {}", file.display());
        }
        let bytes: u64 = files.iter().map(|file| fs::metadata(folder.join(file)).unwrap().len()).sum();
        assert!(bytes <= most_bytes, "{name}: {bytes} bytes, over {most_bytes}");
    }
}

#[test]
fn packages_lack_nothing_that_building_takes() {
    let all = packages();
    for (name, _) in PACKAGES {
        let (files, folder) = (listed(name), folder_of(&all[name]));
        let sources = files_in(&folder.join("src"), &folder);
        assert!(sources.len() > 3, "{name}");
        for source in &sources {
            assert!(files.contains(source), "{name} lacks {}", source.display());
            if source.extension().is_none_or(|ending| ending != "rs") {
                continue;
            }
            let text = fs::read_to_string(folder.join(source)).unwrap();
            for taken in taken_in(&text) {
                let path = plain(&source.parent().unwrap().join(taken));
                assert!(
                    files.contains(&path),
                    "{name}: {} takes in {taken}, which is not there",
                    source.display()
                );
            }
        }
    }
}

#[test]
fn names_of_files_that_are_taken_in_are_found() {
    let source = r##"include_str!("a.md"); x(include_bytes!("../b.bin")); #[path = "c.rs"] mod c;"##;
    assert_eq!(taken_in(source), ["a.md", "../b.bin", "c.rs"]);
    assert_eq!(plain(Path::new("src/x/../../b.bin")), Path::new("b.bin"));
}
