//! Checks what ARCHITECTURE.md says of the code: which package uses which, that no module uses one that uses it, how long files are, where code is
//! unsafe, and how much an embedder compiles.
//!
//! Read are `cargo metadata`, `cargo tree` and the sources, these as words: comments and literals left out, paths followed as far as they lead
//! through modules. Code of tests counts nowhere but in the length of its file.

mod lex;
mod modules;
mod rings;
#[path = "../support/workspace.rs"]
mod workspace;

use lex::words;
use modules::Modules;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use workspace::{cargo, root};

/// Packages, and those of the workspace that each may use.
const PACKAGES: [(&str, &[&str]); 7] = [
    ("terrasoar-layout", &[]),
    ("terrasoar-render", &["terrasoar", "terrasoar-layout"]),
    ("terrasoar-import", &["terrasoar-layout"]),
    ("terrasoar", &["terrasoar-layout"]),
    ("terrasoar-scene", &["terrasoar", "terrasoar-layout", "terrasoar-render"]),
    ("terrasoar-lab", &["terrasoar", "terrasoar-layout"]),
    (
        "terrasoar-cli",
        &[
            "terrasoar",
            "terrasoar-import",
            "terrasoar-lab",
            "terrasoar-layout",
            "terrasoar-render",
            "terrasoar-scene",
        ],
    ),
];

/// Crates that belong to one package each.
const OWNED: [(&str, &str); 8] = [
    ("anyhow", "terrasoar-cli"),
    ("clap", "terrasoar-cli"),
    ("egui", "terrasoar-cli"),
    ("indicatif", "terrasoar-cli"),
    ("memmap2", "terrasoar-layout"),
    ("plotters", "terrasoar-lab"),
    ("wgpu", "terrasoar-render"),
    ("winit", "terrasoar-cli"),
];

/// Most lines of a file.
const MOST_LINES: usize = 450;

/// Most crates that a program which embeds the engine compiles, the engine's own included.
const MOST_CRATES: usize = 55;

/// The only files with unsafe code: a map, an io_uring, a hint to the processor, instructions that not every processor has, a library's name, a signal.
const UNSAFE: [&str; 7] = [
    "cli/src/verbs/signals.rs",
    "layout/src/file/source/map.rs",
    "layout/src/file/source/uring.rs",
    "layout/src/imagery/encode.rs",
    "layout/src/packed/wide.rs",
    "layout/src/read/prefetch.rs",
    "src/refine/kinetic/time/certificate/batch.rs",
];

/// The packages of the workspace, those that are never published left out.
fn packages() -> Vec<Value> {
    let told = cargo(&["metadata", "--no-deps", "--offline", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&told).unwrap();
    let all = metadata["packages"].as_array().unwrap().clone();
    all.into_iter().filter(|package| package["publish"].is_null()).collect()
}

fn text<'v>(value: &'v Value, field: &str) -> &'v str {
    value[field].as_str().unwrap()
}

#[test]
fn packages_use_only_what_lies_below_them() {
    let mut found = Vec::new();
    for package in &packages() {
        let name = text(package, "name");
        let Some((_, allowed)) = PACKAGES.iter().find(|(known, _)| *known == name) else {
            found.push(format!("{name}: say in this test what it may use"));
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap() {
            // What tests use is their own affair.
            if dependency["kind"] == "dev" {
                continue;
            }
            let used = text(dependency, "name");
            if used.starts_with("terrasoar") && !allowed.contains(&used) {
                found.push(format!("{name} uses {used}"));
            }
            if let Some((_, owner)) = OWNED.iter().find(|(owned, owner)| *owned == used && *owner != name) {
                found.push(format!("{name} uses {used}, which is {owner}'s"));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_module_uses_what_uses_it() {
    let mut found = Vec::new();
    let mut read = 0;
    for package in &packages() {
        for target in package["targets"].as_array().unwrap() {
            let kind = target["kind"][0].as_str().unwrap();
            if kind == "lib" || kind == "bin" {
                let modules = Modules::read(Path::new(text(target, "src_path")));
                read += modules.count();
                found.extend(
                    rings::of(&modules).into_iter().map(|ring| format!("{}: {ring}", text(package, "name"))),
                );
            }
        }
    }
    assert!(read > 200, "only {read} modules were read");
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn files_are_short() {
    let mut long = Vec::new();
    for file in sources(&["."]) {
        let lines = fs::read_to_string(root().join(&file)).unwrap().lines().count();
        if lines > MOST_LINES {
            long.push(format!("{}: {lines} lines", file.display()));
        }
    }
    assert!(long.is_empty(), "over {MOST_LINES} lines, so more than one idea:\n{}", long.join("\n"));
}

#[test]
fn unsafe_code_is_where_it_is_said_to_be() {
    let folders = ["src", "layout/src", "import/src", "render/src", "scene/src", "lab/src", "cli/src"];
    let is_unsafe =
        |file: &PathBuf| words(&fs::read_to_string(root().join(file)).unwrap()).iter().any(|w| w == "unsafe");
    let found: BTreeSet<String> = sources(&folders)
        .into_iter()
        .filter(is_unsafe)
        .map(|file| file.to_string_lossy().replace('\\', "/"))
        .collect();
    assert_eq!(found, UNSAFE.map(str::to_owned).into());
}

#[test]
fn an_embedder_compiles_few_crates() {
    let told = cargo(&[
        "tree",
        "--offline",
        "-p",
        "terrasoar",
        "-e",
        "normal",
        "--prefix",
        "none",
        "--format",
        "{p}",
    ]);
    let crates: BTreeSet<&str> =
        told.lines().map(|line| line.trim_end_matches(" (*)")).filter(|l| !l.is_empty()).collect();
    assert!(crates.len() > 10, "{told}");
    // What the documentation says holds on Linux; elsewhere it is about as many.
    if cfg!(target_os = "linux") {
        let said = format!("{} crates", crates.len() - 1);
        for page in ["EMBEDDING.md", "docs/embedding/targets.md"] {
            assert!(
                fs::read_to_string(root().join(page)).unwrap().contains(&said),
                "{page} does not say {said}"
            );
        }
    }
    assert!(crates.len() <= MOST_CRATES, "{} crates:\n{}", crates.len(), Vec::from_iter(crates).join("\n"));
}

/// The sources in some folders, by their path from the root; what is built left out.
fn sources(folders: &[&str]) -> Vec<PathBuf> {
    let mut left: Vec<PathBuf> = folders.iter().map(|folder| root().join(folder)).collect();
    let mut files = Vec::new();
    while let Some(folder) = left.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && !name.starts_with('.') {
                    left.push(path);
                }
            } else if name.ends_with(".rs") {
                files.push(path.strip_prefix(root()).unwrap().to_owned());
            }
        }
    }
    assert!(!files.is_empty());
    files.sort();
    files
}
