//! The one error type of this crate. Its variants tell apart what a caller would handle apart:
//! not our format, damaged, unsupported, I/O, wrong usage. Every message says what, where, and
//! what to do. The program adds by which flag or button that is done ([`Remedy`]).

use crate::remedy::Remedy;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Anything that can go wrong between a DEM and a terrain file, or in reading one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// The operating system refused an operation on a file.
    #[error("{}: {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was attempted, as a phrase: "cannot open the file".
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
        /// What would mend it, where that can be asked for.
        remedy: Option<Remedy>,
    },
    /// The file is not of the format it was taken for.
    #[error("{}: {problem}", path.display())]
    NotThisFormat {
        /// The file.
        path: PathBuf,
        /// What it is not, and what to do.
        problem: String,
    },
    /// The file is of the right format, but a part of it is damaged, cut short or contradicts itself.
    #[error("{}: {place}: {problem}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where in the file: "header", "tile 17", "page 4711".
        place: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// The file is sound but uses something this version cannot read.
    #[error("{}: {problem}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it uses, and what to do instead.
        problem: String,
        /// What would mend it, where that can be asked for.
        remedy: Option<Remedy>,
    },
    /// An edit leads to heights, or to slopes, that the file's records cannot hold.
    #[error("{}: {problem}", path.display())]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Lowest and highest height in metres that the edit asks for.
        heights_m: [f64; 2],
        /// What does not fit, and what to do.
        problem: String,
    },
    /// The request cannot be met as asked: a budget too small, a size out of range.
    #[error("{0}")]
    Usage(String),
    /// As [`LayoutError::Usage`], where one thing that can be asked for would mend it.
    #[error("{problem}")]
    Unmet {
        /// What cannot be met, and what to do.
        problem: String,
        /// What would mend it.
        remedy: Remedy,
    },
}

impl LayoutError {
    /// An I/O error on `path` while attempting `action` ("cannot read the file").
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source, remedy: None }
    }

    /// A failed write to `path`: `action` as for [`LayoutError::io`], or `when_full`, which says what to do, where there was no room.
    pub fn write(path: &Path, action: &'static str, when_full: &'static str, source: std::io::Error) -> Self {
        let action = if is_full(&source) { when_full } else { action };
        Self::io(path, action, source)
    }

    /// A format mismatch.
    pub fn not_this_format(path: &Path, problem: impl Into<String>) -> Self {
        Self::NotThisFormat { path: path.to_owned(), problem: problem.into() }
    }

    /// Damage at `place` of `path`.
    pub fn damaged(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// As [`LayoutError::damaged`], of a terrain file: says what to do.
    pub(crate) fn damaged_terrain(path: &Path, place: String, problem: impl std::fmt::Display) -> Self {
        Self::damaged(path, place, format!("{problem}; restore a copy of the file or build it again"))
    }

    /// Something sound but not supported.
    pub fn unsupported(path: &Path, problem: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), problem: problem.into(), remedy: None }
    }

    /// The same error with what would mend it. Of no effect on errors that nothing asked for can mend: damage, another format, heights out of range.
    pub fn mended_by(mut self, mends: Remedy) -> Self {
        match &mut self {
            Self::Io { remedy, .. } | Self::Unsupported { remedy, .. } => *remedy = Some(mends),
            Self::Unmet { remedy, .. } => *remedy = mends,
            Self::Usage(problem) => {
                return Self::Unmet { problem: std::mem::take(problem), remedy: mends };
            }
            Self::NotThisFormat { .. } | Self::Damaged { .. } | Self::OutOfRange { .. } => {}
        }
        self
    }

    /// What would mend it, if that can be asked for.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Io { remedy, .. } | Self::Unsupported { remedy, .. } => *remedy,
            Self::Unmet { remedy, .. } => Some(*remedy),
            Self::NotThisFormat { .. } | Self::Damaged { .. } | Self::OutOfRange { .. } | Self::Usage(_) => {
                None
            }
        }
    }
}

/// Whether there was no room: the disk is full, or a quota or limit of the size of files is reached.
pub(crate) fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge)
}
