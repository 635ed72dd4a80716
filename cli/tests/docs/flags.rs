//! The flags of a verb's page, against those of its `--help`: names, values, and what holds without them.

use crate::page::{Cell, Page};
use crate::{Wrong, shell};
use std::collections::{BTreeMap, BTreeSet};

/// Flags of other programs, and of all verbs.
const KNOWN: [&str; 9] = [
    "--help",
    "--version",
    "--path",
    "--locked",
    "--release",
    "--bin",
    "--features",
    "--no-default-features",
    "--full",
];

/// A flag as `--help` and a page both tell it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Flag {
    /// `-o`, or nothing.
    short: String,
    /// `--output`.
    long: String,
    /// `<OUT.iqt>`, or nothing.
    value: String,
    /// What holds without it, where the program has a word for that.
    default: Option<String>,
}

/// The verbs, as the program lists them.
fn verbs() -> Vec<String> {
    let help = shell::help("");
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let listed = listed.take_while(|line| line.starts_with("  "));
    // What is indented further goes on with what the verb does.
    let listed = listed.filter(|line| !line.starts_with("   "));
    let names = listed.filter_map(|line| line.split_whitespace().next());
    let names: Vec<String> = names.filter(|name| *name != "help").map(str::to_owned).collect();
    assert!(names.len() > 10, "{help}");
    names
}

/// What is wrong with the tables of flags.
pub fn wrong(pages: &[Page]) -> Wrong {
    let mut wrong = Vec::new();
    for verb in verbs() {
        let name = format!("docs/manual/{verb}.md");
        let Some(page) = pages.iter().find(|page| page.name == name) else {
            wrong.push(format!("{name} is missing: each verb has a page, with a table of its flags"));
            continue;
        };
        let (told, real) = (of_page(page, &mut wrong), of_help(&shell::help(&verb)));
        for flag in real.difference(&told) {
            wrong.push(format!("{name}: lacks {flag:?}"));
        }
        for flag in told.difference(&real) {
            wrong.push(format!("{name}: has {flag:?}, which --help has not"));
        }
    }
    wrong
}

fn of_page(page: &Page, wrong: &mut Wrong) -> BTreeSet<Flag> {
    let mut flags = BTreeSet::new();
    for row in page.tables.iter().filter(|table| table.section == "flags").flat_map(|table| &table.rows) {
        let (short, long) = match row[0].codes.as_slice() {
            [long] => ("", long),
            [short, long] => (short.as_str(), long),
            other => {
                wrong.push(format!("{}: {other:?} is no flag", page.name));
                continue;
            }
        };
        let (long, value) = long.split_once(' ').unwrap_or((long, ""));
        let is_word = |cell: &&Cell| cell.codes.first() == Some(&cell.text);
        let flag = Flag {
            short: short.into(),
            long: long.into(),
            value: value.into(),
            default: Some(&row[1]).filter(is_word).map(|cell| cell.text.clone()),
        };
        if row.len() != 3 || row[2].text.is_empty() {
            wrong.push(format!("{}: says nothing of {long}", page.name));
        }
        if !flags.insert(flag) {
            wrong.push(format!("{}: has {long} twice", page.name));
        }
    }
    flags
}

/// The flags of a help text, `--help` itself left out.
fn of_help(help: &str) -> BTreeSet<Flag> {
    let mut flags: Vec<Flag> = Vec::new();
    let mut is_flag = false;
    for line in help.lines().take_while(|line| !line.starts_with("Example")) {
        let indent = line.len() - line.trim_start().len();
        let told = line.trim_start();
        let (short, rest) = match told.split_once(", ") {
            Some((short, rest)) if short.len() == 2 && short.starts_with('-') => (short, rest),
            _ => ("", told),
        };
        if (2..=6).contains(&indent) {
            is_flag = rest.starts_with("--");
            if is_flag {
                // In the short form what it does stands behind two blanks.
                let rest = rest.split("  ").next().unwrap();
                let (long, value) = rest.split_once(' ').unwrap_or((rest, ""));
                let flag =
                    Flag { short: short.into(), long: long.into(), value: value.into(), default: None };
                flags.push(flag);
            }
        } else if indent == 0 && !line.is_empty() {
            is_flag = false;
        }
        let default = told.split_once("[default: ").and_then(|(_, rest)| rest.split_once(']'));
        if let (true, Some((default, _))) = (is_flag, default) {
            flags.last_mut().unwrap().default = Some(default.to_owned());
        }
    }
    assert!(flags.iter().any(|flag| flag.long == "--help"), "{help}");
    flags.retain(|flag| flag.long != "--help");
    flags.into_iter().collect()
}

/// What is wrong with flags in words and commands, wherever they stand.
pub fn wrong_typed(pages: &[Page]) -> Wrong {
    let mut flags: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for verb in verbs() {
        let help = shell::help(&verb);
        let mut names: BTreeSet<String> = of_help(&help).into_iter().map(|flag| flag.long).collect();
        let aliases = help.split("[alias: ").skip(1).filter_map(|rest| rest.split(']').next());
        names.extend(aliases.map(str::to_owned));
        flags.insert(verb, names);
    }
    let all: BTreeSet<&str> = flags.values().flatten().map(String::as_str).chain(KNOWN).collect();
    let mut wrong = Vec::new();
    for page in pages.iter().filter(|page| !page.is_history()) {
        if page.is_run() {
            // Those of other programs are theirs.
            let is_ours = |span: &&String| span.starts_with("--") || span.starts_with("terrasoar ");
            for word in page.spans.iter().filter(is_ours).flat_map(|span| span.split_whitespace()) {
                if word.starts_with("--") && !all.contains(word) {
                    wrong.push(format!("{}: no verb has {word}", page.name));
                }
            }
        }
        // Indented ones have no words.
        let are_typed = |words: &[String]| words.first().is_none_or(|word| word == "sh" || word == "console");
        let blocks = page.blocks.iter().filter(|block| are_typed(&block.words));
        let lines = blocks.flat_map(|block| page.text[block.body.clone()].lines());
        for line in lines.map(|line| line.trim_start().trim_start_matches("$ ")) {
            let Some(typed) = line.strip_prefix("terrasoar ") else { continue };
            let typed = typed.split(" #").next().unwrap_or(typed);
            let mut words = typed.split_whitespace();
            let verb = words.next().unwrap_or_default();
            if verb.starts_with('-') {
                continue;
            }
            let Some(known) = flags.get(verb) else {
                wrong.push(format!("{}: there is no verb {verb}: {line}", page.name));
                continue;
            };
            for word in words.filter(|word| word.starts_with("--")) {
                if !known.contains(word) && !KNOWN.contains(&word) {
                    wrong.push(format!("{}: {verb} has no {word}: {line}", page.name));
                }
            }
        }
    }
    wrong
}
