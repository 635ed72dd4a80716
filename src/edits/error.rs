//! What can be wrong with a script of edits: each error names the file, the line, what was found and what to write instead.

use super::format::VERSION;
use std::path::PathBuf;
use terrasoar_layout::LayoutError;

/// Why a script cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// The file is missing or cannot be read.
    #[error("cannot read script {}: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write script {}: {source}; check the folder, its permissions and its free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be what it was to be, whatever is in it.
    #[error(transparent)]
    Output(LayoutError),
    /// The first line is not a script's.
    #[error(
        "{}:1: not a script of edits: it starts with {found} instead of `terrasoar-edits {VERSION}`; name a script, or write that line first",
        path.display()
    )]
    NotAScript {
        /// The file.
        path: PathBuf,
        /// How it starts, shortened.
        found: String,
    },
    /// A later version of the format.
    #[error(
        "{}:1: this is version {found} of the script format and this program reads version {VERSION}; use a newer terrasoar",
        path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: String,
    },
    /// A line is not what the format has.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What is wrong with it, and what to write instead.
        problem: String,
    },
    /// The script has no edits.
    #[error("{}: the script has no edits; add at least one after the units line", path.display())]
    NoEdits {
        /// The file.
        path: PathBuf,
    },
    /// The heights of a stamp cannot be had.
    #[error("{}:{line}: stamp: {source}", path.display())]
    Stamp {
        /// The script.
        path: PathBuf,
        /// The line of the batch's first edit, from 1.
        line: u64,
        /// Why.
        source: LayoutError,
    },
    /// A script in memory that would not read back as itself.
    #[error("{}: cannot write batch {batch}: {problem}", path.display())]
    Unwritable {
        /// The file it was to be.
        path: PathBuf,
        /// The batch, from 1.
        batch: u64,
        /// Why, and what to do.
        problem: String,
    },
}

impl ScriptError {
    /// What went wrong where a script was to go.
    pub(super) fn of_output(error: LayoutError) -> Self {
        match error {
            LayoutError::Io { path, source, .. } => Self::Write { path, source },
            other => Self::Output(other),
        }
    }
}
