//! How much the README says, what the book holds, and which blocks are not run.

use crate::Wrong;
use crate::commands::place;
use crate::page::Page;
use std::collections::BTreeSet;

/// Most words of README.md, counted as `wc -w` does.
const README_WORDS: usize = 1_000;

/// Blocks of commands that are not run: those that install or compile, those that open a window, and one that takes programs of others.
const NOT_RUN: usize = 14;

pub fn wrong_readme(pages: &[Page]) -> Wrong {
    let readme = pages.iter().find(|page| page.name == "README.md").unwrap();
    let words = readme.text.split_whitespace().count();
    match words {
        0..=README_WORDS => Vec::new(),
        _ => vec![format!("README.md has {words} words, over {README_WORDS}; docs/ has room")],
    }
}

/// Pages of `docs/` that are not in the book, and chapters twice in it. That its links lead somewhere is seen to with all others.
pub fn wrong_book(pages: &[Page]) -> Wrong {
    let summary = pages.iter().find(|page| page.name == "docs/SUMMARY.md").unwrap();
    let mut chapters = BTreeSet::new();
    let mut wrong = Vec::new();
    for link in &summary.links {
        if !chapters.insert(format!("docs/{}", link.to)) {
            wrong.push(format!("docs/SUMMARY.md has {} twice", link.to));
        }
    }
    let docs = pages.iter().filter(|page| page.name.starts_with("docs/") && page.name != "docs/SUMMARY.md");
    let left_out = docs.filter(|page| !chapters.contains(&page.name));
    wrong.extend(left_out.map(|page| format!("{} is not in docs/SUMMARY.md", page.name)));
    wrong
}

/// Blocks that nobody would run without noticing, and how many are not run for a reason.
pub fn wrong_blocks(pages: &[Page]) -> Wrong {
    let mut wrong = Vec::new();
    let mut not_run = 0;
    for page in pages.iter().filter(|page| page.is_run()) {
        for block in &page.blocks {
            let words: Vec<&str> = block.words.iter().map(String::as_str).collect();
            let is_command = matches!(words.first(), Some(&("sh" | "console")));
            // There `terrasoar = ` is a dependency.
            let is_toml = words.first() == Some(&"toml");
            let body = &page.text[block.body.clone()];
            if !is_command
                && !is_toml
                && body.lines().any(|line| line.trim_start_matches("$ ").starts_with("terrasoar "))
            {
                let at = place(page, block);
                wrong.push(format!("{at}: commands stand in blocks marked sh or console"));
            }
            if is_command && words.iter().skip(1).any(|word| *word != "figures") {
                wrong.push(format!("{}: what does {words:?} mean?", place(page, block)));
            }
            match &block.not_run {
                Some(_) if !is_command => {
                    wrong.push(format!("{}: is not run anyhow", place(page, block)));
                }
                Some(why) => {
                    not_run += 1;
                    if why.split_whitespace().count() < 3 {
                        wrong.push(format!("{}: say why it is not run", place(page, block)));
                    }
                }
                None => {}
            }
        }
    }
    if not_run != NOT_RUN {
        wrong.push(format!("{not_run} blocks are not run; this test knows of {NOT_RUN}"));
    }
    wrong
}
