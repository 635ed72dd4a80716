//! The command line: what was typed becomes a checked plan, and one match hands it to one function a verb.
//!
//! Each verb is a file with its arguments, help and function; clap and the value parsers in [`parse`] check what can be checked without
//! opening a file. Results go to standard output, everything else to standard error. **Exit codes: 0 done, 1 failed, 2 the command line
//! itself is wrong.** If the reader of our output closes it early, the program ends quietly.

mod area;
mod build;
mod built;
mod cache;
mod cap;
mod clock;
mod compare;
mod compare_ground;
mod completions;
mod defect;
mod drape;
mod edit;
mod export;
mod flight;
mod guess;
mod height;
mod info;
mod iobench;
mod made;
mod man;
mod mesh;
#[cfg(feature = "pictures")]
mod movie;
#[cfg(feature = "pictures")]
mod movie_file;
mod output;
mod outputs;
mod overlays;
mod pack;
mod pages;
mod parse;
#[cfg(feature = "pictures")]
mod picture;
#[cfg(not(feature = "view"))]
mod pictureless;
mod progress;
#[cfg(feature = "pictures")]
mod quiet;
mod remedy;
mod replay;
#[cfg(unix)]
mod signals;
mod siting;
#[cfg(feature = "pictures")]
mod snapshot;
mod sweep;
mod synth;
mod terrain;
mod tiles;
mod verify;
#[cfg(feature = "view")]
mod view;
mod within;
#[cfg(feature = "pictures")]
mod world_file;

#[cfg(not(feature = "view"))]
use pictureless::view;
#[cfg(not(feature = "pictures"))]
use pictureless::{movie, snapshot};

use clap::{CommandFactory as _, Parser, Subcommand};
use std::borrow::Cow;
use std::fmt;
use std::process::ExitCode;
use terrasoar_layout::printable;

/// Fly over terrain far larger than memory.
///
/// Elevation data (GeoTIFF, SRTM .hgt, netCDF, ASCII grids, PNG and others) become one terrain file (.iqt). It is drawn, flown over and
/// edited, with every visible sample within a tolerance in pixels, and only the parts that a view needs are read.
#[derive(Debug, Parser)]
#[command(
    name = "terrasoar",
    version,
    long_version = made::LONG_VERSION.as_str(),
    after_help = "\
Examples, in the order of the work:
  terrasoar build alps.tif -o alps.iqt
  terrasoar drape alps.iqt --image alps-photo.tif
  terrasoar crater alps.iqt --at 1500,820 --radius 40 --depth 9
  terrasoar info alps.iqt
  terrasoar snapshot alps.iqt -o alps.png
  terrasoar export alps.iqt -o edited.tif
  terrasoar mesh alps.iqt --max-error 2 -o alps.glb
  terrasoar compare-ground alps.iqt --picture changes.png
  terrasoar flight straight alps.iqt -o alps.flight --frames 1000 --incoherence 0.6
  terrasoar compare alps.iqt --flight alps.flight --engines soar,smart -o report

No elevation data at hand: terrasoar synth --size 4097 --seed 1 -o land.tif
Exit codes: 0 done, 1 failed, 2 wrong command line."
)]
struct Typed {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Build(build::Args),
    Drape(drape::Args),
    Edit(edit::Args),
    Crater(edit::crater::Args),
    Undo(edit::past::UndoArgs),
    Redo(edit::past::RedoArgs),
    History(edit::past::HistoryArgs),
    Compact(edit::compact::Args),
    Pack(pack::PackArgs),
    Unpack(pack::UnpackArgs),
    Info(info::Args),
    Verify(verify::Args),
    Height(height::Args),
    Export(export::Args),
    CompareGround(compare_ground::Args),
    Synth(synth::Args),
    Flight(flight::Args),
    Replay(replay::Args),
    Compare(compare::Args),
    Iobench(iobench::Args),
    Mesh(mesh::Args),
    View(view::Args),
    Snapshot(snapshot::Args),
    Movie(movie::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// The whole command line, for what is made of it: completions and pages of the manual.
fn command() -> clap::Command {
    let mut command = Typed::command();
    command.build();
    command
}

/// A command line that clap accepts and that still makes no sense.
#[derive(Debug)]
struct WrongUsage(String);

impl fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// An error that is told in several lines, each of which may hold text from a file.
#[derive(Debug)]
struct Lines(Vec<String>);

impl fmt::Display for Lines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, line) in self.0.iter().enumerate() {
            let end = if i == 0 { "" } else { "\n" };
            write!(f, "{end}{}", printable::line(line))?;
        }
        Ok(())
    }
}

impl std::error::Error for Lines {}

/// Advice that fits: to give an unknown flag as the name of a file never does, and numbers left over are those of a place.
fn advised(mut error: clap::Error) -> clap::Error {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let mut tips = match error.get(ContextKind::Suggested) {
        Some(ContextValue::StyledStrs(tips)) => tips.clone(),
        _ => Vec::new(),
    };
    tips.retain(|tip| !tip.to_string().contains("as a value"));
    if let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidArg)
        && word.trim_end_matches(',').parse::<f64>().is_ok()
    {
        tips.push("the numbers of a place are joined by commas, without spaces, such as 1500,820.5".into());
    }
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
    error
}

/// Ends the program with what is wrong with the command line, or with help.
fn refuse(error: &clap::Error) -> ! {
    if std::env::args_os().all(|arg| matches!(printable::line(&arg.to_string_lossy()), Cow::Borrowed(_))) {
        error.exit();
    }
    // The terminal would obey what was typed: it is told without colours, and spelt out.
    output::complain_lines(error.render().to_string().trim_end());
    std::process::exit(error.exit_code())
}

/// The whole program.
pub(crate) fn run() -> ExitCode {
    #[cfg(unix)]
    signals::heed();
    defect::guarded(carry_out)
}

fn carry_out() -> ExitCode {
    let verb = Typed::try_parse().unwrap_or_else(|error| refuse(&advised(error))).verb;
    #[cfg(feature = "pictures")]
    if matches!(verb, Verb::Compare(_) | Verb::Snapshot(_) | Verb::Movie(_) | Verb::View(_)) {
        quiet::begin();
    }
    let done = match verb {
        Verb::Build(args) => build::run(&args),
        Verb::Drape(args) => drape::run(&args),
        Verb::Edit(args) => edit::run(&args),
        Verb::Crater(args) => edit::crater::run(&args),
        Verb::Undo(args) => edit::past::undo(&args),
        Verb::Redo(args) => edit::past::redo(&args),
        Verb::History(args) => edit::past::list(&args),
        Verb::Compact(args) => edit::compact::run(&args),
        Verb::Pack(args) => pack::run_pack(&args),
        Verb::Unpack(args) => pack::run_unpack(&args),
        Verb::Info(args) => info::run(&args),
        Verb::Verify(args) => verify::run(&args),
        Verb::Height(args) => height::run(&args),
        Verb::Export(args) => export::run(&args),
        Verb::CompareGround(args) => compare_ground::run(&args),
        Verb::Synth(args) => synth::run(&args),
        Verb::Flight(args) => flight::run(&args),
        Verb::Replay(args) => replay::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Iobench(args) => iobench::run(&args),
        Verb::Mesh(args) => mesh::run(&args),
        Verb::View(args) => view::run(&args),
        Verb::Snapshot(args) => snapshot::run(&args),
        Verb::Movie(args) => movie::run(&args),
        Verb::Completions(args) => completions::run(&args),
        Verb::Man(args) => man::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if output::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            output::complain_lines(&format!("error: {}", remedy::spoken(&error)));
            ExitCode::from(if error.is::<WrongUsage>() { 2 } else { 1 })
        }
    }
}

/// The chain of causes in one line, unless one of them is of several; causes that their effect already spells out are not repeated.
fn message(error: &anyhow::Error) -> String {
    let mut text = String::new();
    let shown = |cause: &(dyn std::error::Error + 'static)| {
        let told = cause.to_string();
        if cause.is::<Lines>() { told } else { printable::line(&told).into_owned() }
    };
    for cause in error.chain().map(shown) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        <Typed as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn causes_are_told_once() {
        let error = anyhow::anyhow!("disk full").context("f: cannot write: disk full").context("no report");
        assert_eq!(message(&error), "no report: f: cannot write: disk full");
    }
}
