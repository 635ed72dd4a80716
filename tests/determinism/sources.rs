//! No function of the system's library decides about what is shared: a search of the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// Methods of floating-point numbers whose last bits the standard library leaves to the system.
const OF_THE_SYSTEM: [&str; 26] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh",
    "acosh", "atanh", "ln", "ln_1p", "log", "log2", "log10", "exp", "exp2", "exp_m1", "powf", "powi",
    "hypot", "cbrt",
];
/// Of glam: they call those.
const OF_GLAM: [&str; 6] =
    ["from_axis_angle", "from_rotation_x", "from_rotation_y", "from_rotation_z", "angle_between", "slerp"];
/// What is searched: the file and what changes it, engines, flights and edits, what data is read and made up. Map projections are others' code.
const FOLDERS: [&str; 3] = ["layout/src", "src", "import/src"];
/// Files for tests alone, and the one that the others take these functions from.
const NOT_SEARCHED: [&str; 3] = ["layout/src/portable.rs", "layout/src/testing", "src/testing.rs"];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Calls of these functions in code that is not for tests.
fn calls(source: &str) -> Vec<(usize, &'static str)> {
    let is_tests = |at: &usize| {
        source[*at..].lines().nth(1).is_some_and(|line| line.contains("mod ") && line.ends_with('{'))
    };
    let end = source.match_indices("#[cfg(test)]").map(|(at, _)| at).find(is_tests);
    let code = &source[..end.unwrap_or(source.len())];
    let mut found = Vec::new();
    for (number, line) in code.lines().enumerate() {
        let line = line.split("//").next().unwrap();
        let names = OF_THE_SYSTEM.iter().chain(&OF_GLAM);
        for name in names {
            let is_method = [
                format!(".{name}("),
                format!("f64::{name}"),
                format!("f32::{name}"),
                format!("Quat::{name}"),
            ];
            let is_called = is_method.iter().any(|call| {
                line.match_indices(call.as_str()).any(|(at, _)| {
                    let after = line[at + call.len()..].chars().next();
                    call.ends_with('(') || !after.is_some_and(|c| c.is_alphanumeric() || c == '_')
                })
            });
            // A log of events has a method of that name.
            if is_called && !line.contains("self.log()") {
                found.push((number + 1, *name));
            }
        }
    }
    found
}

#[test]
fn no_function_of_the_system_decides() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    FOLDERS.iter().for_each(|folder| rust_files(&root.join(folder), &mut files));
    files.retain(|file| !NOT_SEARCHED.iter().any(|not| file.starts_with(root.join(not))));
    files.retain(|file| file.file_name().is_none_or(|name| name != "tests.rs"));
    assert!(files.len() > 150, "only {} files were found", files.len());
    let mut wrong = Vec::new();
    for file in files {
        let source = fs::read_to_string(&file).unwrap().replace("\r\n", "\n");
        for (line, name) in calls(&source) {
            wrong.push(format!("{}:{line}: {name}", file.strip_prefix(root).unwrap().display()));
        }
    }
    assert!(wrong.is_empty(), "take these from terrasoar_layout::portable:\n{}", wrong.join("\n"));
}

#[test]
fn made_up_calls_are_found() {
    let source = "let a = x.sin();\nlet b = v.map(f64::exp);\nlet c = f64::from(x); // x.cos()\nlet d = DQuat::from_axis_angle(a, b);\n\n#[cfg(test)]\nmod tests {\nx.cos()\n}";
    assert_eq!(calls(source), [(1, "sin"), (2, "exp"), (4, "from_axis_angle")]);
}
