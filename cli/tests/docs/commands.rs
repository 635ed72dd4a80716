//! The commands of a page, run in order, and what they print against what the page shows.
//!
//! In a block `sh` all lines are run, and each must succeed. In a block `console` lines that begin with `$ ` are commands, and what follows each is what it
//! prints; one fails if and only if an error is shown.

use crate::page::{Block, Page, root};
use crate::{Wrong, fields, shell, shown};
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// The page whose files all others use.
const FIRST: &str = "docs/first-steps.md";

/// A command and what the page shows of its output.
struct Step<'p> {
    typed: Vec<&'p str>,
    shown: Vec<&'p str>,
}

/// What is wrong with a page's commands.
pub fn wrong(page: &Page) -> Wrong {
    if page.name == FIRST {
        return first().1.clone();
    }
    // README.md begins with nothing.
    let folder = shell::copy_of((page.name != "README.md").then(|| first().0.path()));
    all(page, folder.path())
}

/// The folder that the first steps make, and what is wrong with them.
fn first() -> &'static (TempDir, Wrong) {
    static FOLDER: OnceLock<(TempDir, Wrong)> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let wrong = all(&Page::read(&root().join(FIRST)), folder.path());
        (folder, wrong)
    })
}

fn all(page: &Page, folder: &Path) -> Wrong {
    let mut wrong = Vec::new();
    let mut blessed = Vec::new();
    for block in page.blocks.iter().filter(|block| block.not_run.is_none()) {
        match block.words.first().map(String::as_str) {
            Some("sh") => wrong.extend(script(page, block, folder)),
            Some("console") => {
                let (is, told) = console(page, block, folder);
                wrong.extend(told);
                blessed.push((block.body.clone(), is));
            }
            _ => {}
        }
    }
    if std::env::var_os("TERRASOAR_BLESS").is_some_and(|value| value == "1") {
        let mut text = page.text.clone();
        for (range, is) in blessed.into_iter().rev() {
            text.replace_range(range, &is);
        }
        std::fs::write(root().join(&page.name), text).unwrap();
    }
    wrong.extend(fields::wrong(page, folder));
    wrong
}

/// Where a block begins, for a message.
pub fn place(page: &Page, block: &Block) -> String {
    format!("{}:{}", page.name, 1 + page.text[..block.body.start].matches('\n').count())
}

fn script(page: &Page, block: &Block, folder: &Path) -> Option<String> {
    let lines = page.text[block.body.clone()].lines();
    let lines: Vec<&str> = lines.filter(|line| shell::can_draw() || !shell::draws(line)).collect();
    let ended = shell::run(&lines.join("\n"), folder);
    (!ended.is_good).then(|| format!("{}: a command fails: {}", place(page, block), ended.said))
}

/// Runs a block; gives what it should hold, and what is wrong.
fn console(page: &Page, block: &Block, folder: &Path) -> (String, Wrong) {
    let figures = block.words.iter().any(|word| word == "figures");
    let (mut is, mut wrong) = (String::new(), Vec::new());
    for step in steps(&page.text[block.body.clone()]) {
        let typed = step.typed.join("\n");
        let as_typed = |is: &mut String| is.push_str(&format!("$ {}\n", step.typed.join("\n> ")));
        as_typed(&mut is);
        if shell::draws(&typed) && !shell::can_draw() {
            step.shown.iter().for_each(|line| is.push_str(&format!("{line}\n")));
            continue;
        }
        let ended = shell::run(&typed, folder);
        let printed: Vec<&str> = ended.said.lines().collect();
        let holds = shown::shows(&step.shown, &printed, figures);
        let error_is_shown = step.shown.iter().any(|line| line.starts_with("error: "));
        // A page is not made to show an error that it did not mean to show.
        let is_kept = holds || ended.is_good == error_is_shown;
        let lines = if is_kept { &step.shown } else { &printed };
        lines.iter().for_each(|line| is.push_str(&format!("{line}\n")));
        if !holds {
            wrong.push(format!(
                "{}: `{typed}` prints\n{}\nand the page shows\n{}",
                place(page, block),
                ended.said.trim_end(),
                step.shown.join("\n")
            ));
        }
        if ended.is_good == error_is_shown {
            let how = if ended.is_good { "succeeds" } else { "fails" };
            wrong.push(format!("{}: `{typed}` {how}: {}", place(page, block), ended.said));
        }
    }
    (is, wrong)
}

/// The commands of a block. A line that ends in a backslash goes on in the next one, behind `> `.
fn steps(body: &str) -> Vec<Step<'_>> {
    let mut steps: Vec<Step<'_>> = Vec::new();
    for line in body.lines() {
        if let Some(typed) = line.strip_prefix("$ ") {
            steps.push(Step { typed: vec![typed], shown: Vec::new() });
            continue;
        }
        let step = steps.last_mut().unwrap_or_else(|| panic!("a block begins with output: {line}"));
        let goes_on = step.shown.is_empty() && step.typed.last().unwrap().ends_with('\\');
        match line.strip_prefix("> ").filter(|_| goes_on) {
            Some(more) => step.typed.push(more),
            None => step.shown.push(line),
        }
    }
    steps
}
