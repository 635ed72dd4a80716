//! `terrasoar man`: the help of the program and of each verb as pages of the system's manual.

use super::output::{print, print_rows};
use super::{WrongUsage, command};
use anyhow::{Context as _, Result};
use clap::Command;
use clap_mangen::Man;

/// Print a page of the manual, in the form that man reads.
///
/// Without a verb it is the page of the program as a whole.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar man build | man -l -
  terrasoar man build > ~/.local/share/man/man1/terrasoar-build.1")]
pub(super) struct Args {
    /// Verb whose page is printed.
    #[arg(value_name = "VERB")]
    verb: Option<String>,
    /// List the verbs that have a page, one a line.
    #[arg(long, conflicts_with = "verb")]
    list: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let program = command();
    if args.list {
        let names: Vec<&str> = verbs(&program).map(Command::get_name).collect();
        return print(&names.join("\n"));
    }
    let Some(name) = &args.verb else { return print_page(&program) };
    match verbs(&program).find(|verb| verb.get_name() == name) {
        Some(verb) => print_page(verb),
        None => Err(WrongUsage(format!(
            "there is no verb {name:?}; terrasoar man --list lists those that have a page"
        ))
        .into()),
    }
}

/// All verbs but the one that clap adds for help.
fn verbs(program: &Command) -> impl Iterator<Item = &Command> {
    program.get_subcommands().filter(|verb| verb.get_name() != "help")
}

fn print_page(command: &Command) -> Result<()> {
    let mut page = Vec::new();
    Man::new(command.clone().disable_help_subcommand(true))
        .source(concat!("terrasoar ", env!("CARGO_PKG_VERSION")))
        .manual("Terrasoar")
        .render(&mut page)
        .context("cannot make the page")?;
    print_rows(&page)
}
