//! How a report was made: by which program, on which machine, when, by which command. The caller fills this in; nothing here reads a clock.

use serde::Serialize;

/// How figures were made.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct Made {
    /// The program and its version, such as `terrasoar 0.1.0`.
    pub program: String,
    /// The commit that it was built from, where the build was told.
    pub commit: Option<String>,
    /// The machine: system, processor, its cores.
    pub machine: String,
    /// When it was written, UTC, as `2026-11-26T15:26:16Z`.
    pub date: String,
    /// The words of the command line, separated by spaces; those that hold any stand in quotation marks.
    pub command: String,
}

impl Made {
    /// By a program, on a machine, at a time.
    pub fn new(program: impl Into<String>, machine: impl Into<String>, date: impl Into<String>) -> Self {
        Self { program: program.into(), machine: machine.into(), date: date.into(), ..Self::default() }
    }

    /// Built from this commit.
    pub fn commit(self, commit: Option<String>) -> Self {
        Self { commit, ..self }
    }

    /// By these words.
    pub fn command(self, words: &[String]) -> Self {
        let quoted = |word: &String| match word.is_empty() || word.contains([' ', '\t', '"', '\'']) {
            true => format!("{word:?}"),
            false => word.clone(),
        };
        Self { command: words.iter().map(quoted).collect::<Vec<_>>().join(" "), ..self }
    }
}
