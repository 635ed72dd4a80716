//! `terrasoar completions`: what a shell needs to complete the program's command line.

use super::command;
use super::output::print_rows;
use anyhow::Result;
use clap_complete::Shell;

/// Print a script with which a shell completes verbs, flags and their values.
///
/// The shell reads it from a folder of its own; the examples name the usual ones. Start a new shell afterwards.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar completions bash > ~/.local/share/bash-completion/completions/terrasoar
  terrasoar completions zsh > ~/.zfunc/_terrasoar      (a folder that is in your fpath)
  terrasoar completions fish > ~/.config/fish/completions/terrasoar.fish")]
pub(super) struct Args {
    /// The shell that reads the script.
    #[arg(value_enum)]
    shell: Shell,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "terrasoar", &mut script);
    print_rows(&script)
}
