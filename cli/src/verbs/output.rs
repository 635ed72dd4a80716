//! What a verb prints: text or one JSON object on standard output, complaints on standard error.
//!
//! Invariant: everything that the program writes to a terminal goes through here, and no text from a file, a name or the command line can control the terminal.

use anyhow::{Context, Result};
use serde::Serialize;
use std::io::{self, IsTerminal, Write};
use terrasoar_layout::printable;

pub(super) use crate::numbers::{decimal, grouped};

/// What fails when standard output does.
const TO_STDOUT: &str = "cannot write to standard output";

/// Prints lines to standard output, harmlessly.
pub(super) fn print(text: &str) -> Result<()> {
    write_out(&printable::lines(text))
}

fn write_out(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| if text.ends_with('\n') { Ok(()) } else { out.write_all(b"\n") })
        .and_then(|()| out.flush())
        .context(TO_STDOUT)
}

/// Prints rows of a table to standard output: as they are to files and pipes, harmlessly to a terminal.
pub(super) fn print_rows(rows: &[u8]) -> Result<()> {
    if rows.is_empty() {
        return Ok(());
    }
    if io::stdout().is_terminal() {
        return write_out(&printable::lines(&String::from_utf8_lossy(rows)));
    }
    let mut out = io::stdout().lock();
    out.write_all(rows).and_then(|()| out.flush()).context(TO_STDOUT)
}

/// Prints one JSON object to standard output.
pub(super) fn print_json(value: &impl Serialize) -> Result<()> {
    write_out(&printable::json(
        &serde_json::to_string_pretty(value).context("cannot put the result into JSON")?,
    ))
}

/// Prints one line to standard output, harmlessly.
pub(super) fn print_line(line: &str) -> Result<()> {
    write_out(&printable::line(line))
}

/// Prints one line to standard error, harmlessly. Errors of printing are ignored.
pub(super) fn complain(line: &str) {
    complain_lines(&printable::line(line));
}

/// As [`complain`], of several lines.
pub(super) fn complain_lines(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", printable::lines(text));
}

/// Whether an error is that the reader of our output has gone. A broken pipe elsewhere is a failure like any other.
pub(super) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let is_pipe = |e: &io::Error| e.kind() == io::ErrorKind::BrokenPipe;
    error.to_string() == TO_STDOUT
        && error.chain().any(|cause| cause.downcast_ref::<io::Error>().is_some_and(is_pipe))
}

/// Lines of names and values, the values aligned, each in one line.
pub(super) fn table(rows: &[(&str, String)]) -> String {
    let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0) + 2;
    rows.iter().map(|(name, value)| format!("{name:width$}{}\n", printable::line(value))).collect()
}

/// Rows of cells in columns: the first aligned left, the others right.
pub(super) fn columns(rows: &[Vec<String>]) -> String {
    let in_one_line = |row: &Vec<String>| row.iter().map(|cell| printable::line(cell).into_owned()).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(in_one_line).collect();
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |i: usize| rows.iter().filter_map(|row| row.get(i)).map(String::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..count).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(i, (cell, w))| if i == 0 { format!("{cell:w$}") } else { format!("{cell:>w$}") })
            .collect();
        format!("{}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = [vec!["engine".to_owned(), "tests".to_owned()], vec!["soar".to_owned(), "5".to_owned()]];
        assert_eq!(columns(&rows), "engine  tests\nsoar        5\n");
        assert_eq!(table(&[("k", "10".into()), ("error", "step".into())]), "k      10\nerror  step\n");
        // A value cannot make a line of its own.
        assert_eq!(table(&[("made from", "x\nsound\x1b".into())]), "made from  x\\nsound\\u{1b}\n");
    }
}
