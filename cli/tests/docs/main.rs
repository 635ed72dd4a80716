//! The documentation, held to the program.
//!
//! * Every command in README.md and in `docs/` is run, in order, and what a page shows of its output is what it prints.
//! * The flags of a verb's page are those of its `--help`; the fields and columns it explains are those of real output. Both ways round.
//! * Every link in every Markdown file leads somewhere, and every path in code spans is there.
//! * Rust and WGSL in `docs/` is that of programs in `examples/`, which compile and run in other tests; dependency lines say the versions that are used here.
//! * README.md is short; every page of `docs/` is in the book.
//!
//! Pages are run side by side, each in a copy of the folder that `docs/first-steps.md` makes. CONTRIBUTING.md says how blocks are marked.
//! `TERRASOAR_BLESS=1` writes what is printed into the pages. Verbs that draw are left out where there is no graphics adapter.

mod code;
mod commands;
mod fields;
mod flags;
mod links;
mod made_up;
mod page;
mod shell;
mod shown;
mod text;

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;

/// What is wrong, each in words that name the file.
type Wrong = Vec<String>;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let mut trials = vec![
        trial("made_up", made_up::wrong),
        trial("links", || links::wrong(&page::all())),
        trial("paths", || links::wrong_paths(&page::all())),
        trial("book", || text::wrong_book(&page::all())),
        trial("readme", || text::wrong_readme(&page::all())),
        trial("code", || code::wrong(&page::all())),
        trial("lines", || code::wrong_lines(&page::all())),
        trial("blocks", || text::wrong_blocks(&page::all())),
        trial("flags", || flags::wrong(&page::all())),
        trial("typed", || flags::wrong_typed(&page::all())),
    ];
    for page in page::all().into_iter().filter(page::Page::is_run) {
        trials.push(Trial::ignorable_test(page.name.clone(), move || {
            if page.only_draws() && !shell::can_draw() {
                return match shell::must_draw() {
                    true => Err(Failed::from("no graphics adapter, and TERRASOAR_NEED_ADAPTER is set")),
                    false => Ok(Completion::ignored_with("no adapter")),
                };
            }
            told(commands::wrong(&page)).map(|()| Completion::Completed)
        }));
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn trial(name: &str, wrong: impl FnOnce() -> Wrong + Send + 'static) -> Trial {
    Trial::test(name, move || told(wrong()))
}

fn told(wrong: Wrong) -> Result<(), Failed> {
    if wrong.is_empty() { Ok(()) } else { Err(Failed::from(format!("\n{}", wrong.join("\n")))) }
}
