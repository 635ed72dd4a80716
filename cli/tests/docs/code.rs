//! Programs in pages: each block shows a file that is compiled elsewhere, or a part of one, and says which.
//!
//! `<!-- code: examples/edit.rs -->` before a block means the whole file, `<!-- code: examples/edit.rs crater -->` what stands in it between the lines `// begin: crater` and
//! `// end: crater`. `TERRASOAR_BLESS=1` writes the files' text into the pages. Dependency lines are held against the versions that this repository is built with.

use crate::Wrong;
use crate::commands::place;
use crate::page::{Page, root};
use std::fs;

/// What marks the parts of a file.
const MARKS: [&str; 2] = ["// begin: ", "// end: "];

/// What is wrong with programs in pages of `docs/`.
pub fn wrong(pages: &[Page]) -> Wrong {
    let mut wrong = Vec::new();
    let mut shown = 0;
    for page in pages.iter().filter(|page| page.name.starts_with("docs/")) {
        let mut blessed = Vec::new();
        for block in &page.blocks {
            let is_program = matches!(block.words.first().map(String::as_str), Some("rust" | "wgsl"));
            let Some(code) = &block.code else {
                if is_program {
                    let at = place(page, block);
                    wrong.push(format!("{at}: say which file this is of: <!-- code: examples/… -->"));
                }
                continue;
            };
            shown += 1;
            let mut words = code.split(' ');
            let (file, name) = (words.next().unwrap_or_default(), words.next());
            let text = fs::read_to_string(root().join(file)).map(|text| text.replace("\r\n", "\n"));
            let Some(is) = text.ok().and_then(|text| part(&text, name)) else {
                wrong.push(format!("{}: there is no {code}", place(page, block)));
                continue;
            };
            if page.text[block.body.clone()] != is {
                wrong
                    .push(format!("{}: differs from {code}; TERRASOAR_BLESS=1 mends it", place(page, block)));
                blessed.push((block.body.clone(), is));
            }
        }
        if !blessed.is_empty() && std::env::var_os("TERRASOAR_BLESS").is_some_and(|value| value == "1") {
            let mut text = page.text.clone();
            for (range, is) in blessed.into_iter().rev() {
                text.replace_range(range, &is);
            }
            fs::write(root().join(&page.name), text).unwrap();
        }
    }
    assert!(shown > 5, "only {shown} programs were found");
    wrong
}

/// A part of a file, moved to the left margin, or all of it, without marks. `None` unless the part begins and ends once.
pub fn part(text: &str, name: Option<&str>) -> Option<String> {
    let is_mark = |line: &str| MARKS.iter().any(|mark| line.trim_start().starts_with(mark));
    let all: Vec<&str> = text.lines().collect();
    let lines = match name {
        None => &all[..],
        Some(name) => {
            let [begin, end] = MARKS.map(|mark| {
                let mark = format!("{mark}{name}");
                let mut places =
                    all.iter().enumerate().filter(|(_, line)| line.trim() == mark).map(|(i, _)| i);
                places.next().filter(|_| places.next().is_none())
            });
            all.get(begin? + 1..end?)?
        }
    };
    let lines: Vec<&str> = lines.iter().copied().filter(|line| !is_mark(line)).collect();
    let indent = |line: &&str| line.len() - line.trim_start().len();
    let left = lines.iter().filter(|line| !line.trim().is_empty()).map(indent).min().unwrap_or(0);
    Some(lines.iter().map(|line| format!("{}\n", line.get(left..).unwrap_or("").trim_end())).collect())
}

/// What is wrong with dependency lines in pages for embedders.
pub fn wrong_lines(pages: &[Page]) -> Wrong {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let workspace = &manifest["workspace"];
    let version_of = |name: &str| match name {
        "terrasoar-cli" => None,
        _ => version(workspace["dependencies"].get(name)?),
    };
    let mut wrong = Vec::new();
    let mut looked_at = 0;
    for page in pages.iter().filter(|page| page.name.starts_with("docs/embedding/")) {
        for block in page.blocks.iter().filter(|block| block.words.first().is_some_and(|word| word == "toml"))
        {
            let at = place(page, block);
            let lines: toml::Table = match page.text[block.body.clone()].parse() {
                Ok(lines) => lines,
                Err(_) => {
                    wrong.push(format!("{at}: is no TOML"));
                    continue;
                }
            };
            let Some(dependencies) = lines.get("dependencies").and_then(toml::Value::as_table) else {
                continue;
            };
            for (name, said) in dependencies {
                looked_at += 1;
                let Some(is) = version_of(name) else {
                    wrong.push(format!("{at}: {name} is not used here, so nothing holds its line"));
                    continue;
                };
                if let Some(said) = version(said)
                    && !(is == said || is.starts_with(&format!("{said}.")))
                {
                    wrong.push(format!("{at}: {name} is {is} here, the page says {said}"));
                }
                let is_there = |path: &str| root().join(path).join("Cargo.toml").exists();
                if let Some(path) = said.get("path").and_then(toml::Value::as_str)
                    && !path
                        .strip_prefix("../terrasoar")
                        .is_some_and(|rest| is_there(rest.trim_start_matches('/')))
                {
                    wrong.push(format!("{at}: there is no {path}"));
                }
            }
        }
    }
    assert!(looked_at > 5, "only {looked_at} dependency lines were found");
    wrong
}

fn version(line: &toml::Value) -> Option<String> {
    let text = line.as_str().or_else(|| line.get("version")?.as_str());
    text.map(str::to_owned)
}
