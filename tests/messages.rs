//! What libraries say names no flag of the command line: they do not know that they are behind one. What would mend a refusal goes with the
//! error as a `Remedy`, and `cli/src/verbs/remedy.rs` makes a flag of it.

use std::path::{Path, PathBuf};

/// Folders of library code, and what in them is the program's.
const LIBRARIES: [&str; 6] = ["layout/src", "import/src", "render/src", "src", "scene/src", "lab/src"];
const PROGRAM: [&str; 3] = ["cli/src/verbs", "cli/src/window", "cli/src/main.rs"];

#[test]
fn messages_of_libraries_name_no_flags() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in LIBRARIES {
        collect(&root.join(folder), &mut files);
    }
    files.retain(|file| !PROGRAM.iter().any(|part| file.starts_with(root.join(part))));
    assert!(files.len() > 150, "only {} files were found", files.len());
    let mut found = Vec::new();
    for file in files {
        let source = std::fs::read_to_string(&file).unwrap();
        // Tests may say what they like.
        let code = source.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
        let flags = literals(code).into_iter().filter(|(_, text)| has_flag(text));
        found.extend(flags.map(|(line, text)| format!("{}:{line}: {text}", file.display())));
    }
    assert!(found.is_empty(), "flags in messages of libraries:\n{}", found.join("\n"));
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs")
            && path.file_stem().is_some_and(|s| s != "tests")
        {
            files.push(path);
        }
    }
}

fn has_flag(text: &str) -> bool {
    text.as_bytes().windows(3).any(|w| w[..2] == *b"--" && w[2].is_ascii_alphabetic())
}

/// String literals of Rust code with the lines they begin on; comments and characters are passed over.
fn literals(code: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut rest = code;
    let line_of = |rest: &str| 1 + code[..code.len() - rest.len()].matches('\n').count();
    while let Some(first) = rest.chars().next() {
        let after = &rest[first.len_utf8()..];
        if rest.starts_with("//") {
            rest = rest.split_once('\n').map_or("", |(_, next)| next);
        } else if rest.starts_with("/*") {
            rest = rest.split_once("*/").map_or("", |(_, next)| next);
        } else if let Some(hashes) = raw_string(rest) {
            let line = line_of(rest);
            let (_, body) = rest.split_once('"').unwrap();
            let (text, next) = body.split_once(&format!("\"{hashes}")).unwrap_or((body, ""));
            found.push((line, text.to_owned()));
            rest = next;
        } else if first == '"' {
            let line = line_of(rest);
            let end = end_of(after, '"');
            found.push((line, after[..end].to_owned()));
            rest = after.get(end + 1..).unwrap_or("");
        } else if first == '\'' && (after.starts_with('\\') || after.chars().nth(1) == Some('\'')) {
            // A character; what else begins so is a lifetime.
            rest = after.get(end_of(after, '\'') + 1..).unwrap_or("");
        } else if first.is_alphanumeric() || first == '_' {
            rest = rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_');
        } else {
            rest = after;
        }
    }
    found
}

/// The hashes of a raw string that begins here.
fn raw_string(rest: &str) -> Option<&str> {
    let body = rest.strip_prefix("br").or_else(|| rest.strip_prefix('r'))?;
    let hashes = &body[..body.len() - body.trim_start_matches('#').len()];
    body[hashes.len()..].starts_with('"').then_some(hashes)
}

/// Bytes before the closing quote.
fn end_of(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            c if c == quote => return at,
            _ => {}
        }
    }
    text.len()
}

#[test]
fn the_reader_of_literals_reads_them() {
    let code = r####"
        // "--comment" it's
        let c = ['"', '\'', '\\']; /* "--too" */
        fn f<'a>(x: &'a str) {} let s = "one \" --two"; r#"three " --four"# b"five"
    "####;
    let texts: Vec<(usize, String)> = literals(code);
    let wanted = [(4, r#"one \" --two"#), (4, r#"three " --four"#), (4, "five")];
    assert_eq!(texts, wanted.map(|(line, text)| (line, text.to_owned())));
    assert!(has_flag("take --format bc1") && !has_flag("gdal_translate -co A=B -- c a----1"));
}
