//! What can be wrong with a flight file: each error names the file, the line, what was found and what to do.

use super::format::{MAX_FRAMES, MAX_LINE_BYTES, MAX_NOTES, VERSION};
use std::path::PathBuf;
use terrasoar_layout::LayoutError;

/// Why a flight cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// The file is missing or cannot be read.
    #[error("cannot read flight {}: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write flight {}: {source}; check the folder, its permissions and its free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be what it was to be, whatever is in it.
    #[error(transparent)]
    Output(LayoutError),
    /// The first line is not a flight file's.
    #[error(
        "{}:1: not a flight file: it starts with {found} instead of `terrasoar-flight {VERSION}`; name a flight file, or generate one",
        path.display()
    )]
    NotAFlight {
        /// The file.
        path: PathBuf,
        /// How it starts, shortened.
        found: String,
    },
    /// A later version of the format.
    #[error(
        "{}:1: this is version {found} of the flight format and this program reads version {VERSION}; use a newer terrasoar",
        path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: String,
    },
    /// The second line does not name the units.
    #[error(
        "{}:2: found {found}; the second line must be `units metres degrees seconds`, the only units there are",
        path.display()
    )]
    Units {
        /// The file.
        path: PathBuf,
        /// The line, shortened.
        found: String,
    },
    /// A line holds bytes that are not UTF-8.
    #[error("{}:{line}: the line is not UTF-8 text; the file is damaged or was saved in another encoding", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
    },
    /// A line is longer than the format allows.
    #[error("{}:{line}: the line is longer than {MAX_LINE_BYTES} bytes; put each frame on a line of its own", path.display())]
    LineTooLong {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
    },
    /// A frame does not have eight fields.
    #[error(
        "{}:{line}: {found} fields instead of 8; a frame is time_s east_m north_m up_m yaw_deg pitch_deg roll_deg vfov_deg",
        path.display()
    )]
    FieldCount {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// How many fields it has.
        found: usize,
    },
    /// A field is not a decimal number.
    #[error("{}:{line}: {field} is {found}, not a number; write a decimal such as 12.5 or -3e4", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The field.
        field: &'static str,
        /// Its text, shortened.
        found: String,
    },
    /// A field is infinite, not a number, or too large for 64 bits.
    #[error("{}:{line}: {field} is {found}, which is not a finite number; give a finite one", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The field.
        field: &'static str,
        /// Its text, shortened.
        found: String,
    },
    /// A field lies outside its range.
    #[error("{}:{line}: {field} is {found}; it must be {allowed}", path.display())]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The field.
        field: &'static str,
        /// Its value.
        found: f64,
        /// The range allowed, in words.
        allowed: &'static str,
    },
    /// A frame's time is before that of the frame above it.
    #[error(
        "{}:{line}: time_s goes back from {before} to {found}; put the frames in the order flown",
        path.display()
    )]
    TimeBackwards {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The frame's time in seconds.
        found: f64,
        /// The time of the frame before, in seconds.
        before: f64,
    },
    /// The file has no frame.
    #[error("{}: the flight has no frames; add at least one after the units line", path.display())]
    NoFrames {
        /// The file.
        path: PathBuf,
    },
    /// The file has more frames than the format allows.
    #[error("{}:{line}: the flight has more than {MAX_FRAMES} frames; split it", path.display())]
    TooManyFrames {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
    },
    /// The file has more notes than the format allows.
    #[error("{}:{line}: the flight has more than {MAX_NOTES} notes; drop some", path.display())]
    TooManyNotes {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
    },
    /// A note to be written that would not read back as itself.
    #[error(
        "{}:{line}: the note {name}: {value} cannot be written; a name matches [a-z][a-z0-9-]* and a value is a short single line without white space around it",
        path.display()
    )]
    Note {
        /// The file.
        path: PathBuf,
        /// The line it would have been, from 1.
        line: u64,
        /// Its name, shortened.
        name: String,
        /// Its value, shortened.
        value: String,
    },
}

impl FlightError {
    /// What went wrong where a flight was to go.
    pub(super) fn of_output(error: LayoutError) -> Self {
        match error {
            LayoutError::Io { path, source, .. } => Self::Write { path, source },
            other => Self::Output(other),
        }
    }
}
