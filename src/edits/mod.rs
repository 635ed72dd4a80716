//! Scripts of edits: a list of what is done to a terrain, which can be written by hand, generated, repeated, and replayed along a flight.
//!
//! A script is a text file (`EDITS.md` beside this source specifies it) or is generated ([`rain`]). It knows no terrain; what an edit does is in
//! `terrasoar_layout::edit`. **Nothing in a script depends on a clock or on chance: the same script over the same terrain gives the same ground.** Cost: some 120 bytes an edit.
#![cfg(feature = "files")]

mod error;
mod format;
mod load;
mod place;
pub mod rain;
mod reader;
#[cfg(test)]
mod tests;
mod timed;
mod words;
mod writer;

use terrasoar_layout::edit::{Edit, StampMode};

pub use error::ScriptError;
pub use format::MAX_EDITS;
pub use load::{LoadedBatch, Loader, OpenDem};
pub use timed::timed;

/// A script: batches in the order in which they are done.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Script {
    /// The batches. Moments never decrease, and are all frames or all seconds; those without one come first.
    pub batches: Vec<Batch>,
}

/// Edits that are done together or not at all, and undone together.
#[derive(Debug, Clone, Default)]
pub struct Batch {
    /// What it is called: a short single line without white space around it.
    pub name: Option<String>,
    /// When it is done in a replay; `None`: before its first frame.
    pub moment: Option<Moment>,
    /// What is done, in this order.
    pub steps: Vec<Step>,
    /// The line of its first edit, from 1; 0 if it was not read from a file. Batches that differ in nothing else are equal.
    pub line: u64,
}

/// When a batch is done in a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moment {
    /// Before this frame, counted from 0.
    Frame(u64),
    /// Before the first frame whose time in seconds is not less.
    Seconds(f64),
}

/// One edit of a script.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// An edit that stands for itself, any but a stamp.
    Edit(Edit),
    /// A stamp whose heights lie in a file.
    Stamp(StampFile),
}

/// A stamp by the name of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StampFile {
    /// Elevation data; a relative path starts at the script's folder.
    pub file: String,
    /// The sample on which its south-west sample comes, columns east and rows north; `None`: that on which it lies by its own georeference.
    pub at: Option<[i64; 2]>,
    /// How its heights meet the ground.
    pub mode: StampMode,
}

impl PartialEq for Batch {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, self.moment, &self.steps) == (&other.name, other.moment, &other.steps)
    }
}

impl Batch {
    /// A batch of edits without name or moment.
    pub fn of(edits: impl IntoIterator<Item = Edit>) -> Self {
        Self { steps: edits.into_iter().map(Step::Edit).collect(), ..Self::default() }
    }

    /// What it is called in a file's history: its name, or what it does.
    pub fn label(&self) -> String {
        match (&self.name, self.steps.as_slice()) {
            (Some(name), _) => name.clone(),
            (None, [step]) => step.name().to_owned(),
            (None, [first, rest @ ..]) if rest.iter().all(|step| step.name() == first.name()) => {
                format!("{} x {}", self.steps.len(), first.name())
            }
            (None, steps) => format!("{} edits", steps.len()),
        }
    }
}

impl Step {
    /// Name of what it does.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Edit(edit) => edit.name(),
            Self::Stamp(_) => "stamp",
        }
    }
}

impl Moment {
    /// Whether it has come at a frame (from 0) whose time is `time_s` seconds.
    pub fn has_come(self, frame: u64, time_s: f64) -> bool {
        match self {
            Self::Frame(at) => at <= frame,
            Self::Seconds(at) => at <= time_s,
        }
    }
}

impl Script {
    /// Edits of all batches.
    pub fn edits(&self) -> u64 {
        self.batches.iter().map(|batch| batch.steps.len() as u64).sum()
    }
}
