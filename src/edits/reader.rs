//! Reads a script. Lines are gathered into batches, and every number is checked as far as that is possible without a terrain.
//!
//! The text is read as a whole (an edit's line takes some 60 bytes, and a script may have a million edits), then taken line by line.

use super::format::{self, Line, MAGIC, MAX_EDITS, MAX_LINE_BYTES, UNITS, VERSION};
use super::{Batch, Moment, Script, ScriptError};
use crate::flight::format::excerpt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Most bytes of a script.
const MAX_BYTES: u64 = 256 << 20;

impl Script {
    /// Reads a script. Files that stamps name are not looked at yet.
    ///
    /// # Errors
    /// Any [`ScriptError`] but [`ScriptError::Write`], [`ScriptError::Stamp`] and [`ScriptError::Unwritable`].
    pub fn read(path: &Path) -> Result<Self, ScriptError> {
        let failed = |source| ScriptError::Read { path: path.into(), source };
        let file = File::open(path).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
        Self::parse(&bytes, path)
    }

    /// Reads the text of a script, which errors call `path`.
    ///
    /// # Errors
    /// As [`Script::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, ScriptError> {
        let mut lines = Lines { rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), path, line: 0 };
        let version = read_header(&mut lines)?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(lines.fault(format!("the script is larger than {} MiB; split it", MAX_BYTES >> 20)));
        }
        let mut gathered = Gathered::default();
        while let Some(text) = lines.next()? {
            let taken = format::parse(text, version).and_then(|line| gathered.take(line, lines.line));
            taken.map_err(|problem| lines.fault(problem))?;
        }
        let line = lines.line;
        let batches =
            gathered.finish().map_err(|problem| ScriptError::Line { path: path.into(), line, problem })?;
        if batches.is_empty() {
            return Err(ScriptError::NoEdits { path: path.into() });
        }
        Ok(Self { batches })
    }
}

/// The lines of a text, counted.
struct Lines<'a> {
    rest: &'a [u8],
    path: &'a Path,
    line: u64,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Result<Option<&'a str>, ScriptError> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        self.line += 1;
        let end = self.rest.iter().position(|&byte| byte == b'\n').unwrap_or(self.rest.len());
        let (line, after) = self.rest.split_at(end);
        self.rest = after.strip_prefix(b"\n").unwrap_or(after);
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.len() > MAX_LINE_BYTES {
            return Err(self.fault(format!(
                "the line is longer than {MAX_LINE_BYTES} bytes; put each edit on a line of its own"
            )));
        }
        match std::str::from_utf8(line) {
            Ok(text) => Ok(Some(text)),
            Err(_) => Err(self.fault(
                "the line is not UTF-8 text; the file is damaged or was saved in another encoding".into(),
            )),
        }
    }

    fn fault(&self, problem: String) -> ScriptError {
        ScriptError::Line { path: self.path.into(), line: self.line, problem }
    }
}

/// Reads the first two lines; gives the version.
fn read_header(lines: &mut Lines<'_>) -> Result<u32, ScriptError> {
    let not_a_script = |found: &str| ScriptError::NotAScript { path: lines.path.into(), found: found.into() };
    let is_empty = lines.rest.is_empty();
    let not_text =
        not_a_script(if is_empty { "nothing: it is empty" } else { "bytes that are not a line of text" });
    let Ok(Some(first)) = lines.next() else { return Err(not_text) };
    let mut words = first.split_ascii_whitespace();
    let path = lines.path;
    let not_a_script = || ScriptError::NotAScript { path: path.into(), found: excerpt(first) };
    let version = match (words.next(), words.next(), words.next()) {
        (Some(MAGIC), Some(version), None) if version.bytes().all(|b| b.is_ascii_digit()) => version,
        _ => return Err(not_a_script()),
    };
    let version = match version.parse::<u32>() {
        Ok(version @ 1..=VERSION) => version,
        Ok(0) => return Err(not_a_script()),
        _ => return Err(ScriptError::Newer { path: path.into(), found: excerpt(version) }),
    };
    let second = lines.next()?.unwrap_or_default();
    if second.split_ascii_whitespace().eq(UNITS) {
        return Ok(version);
    }
    Err(ScriptError::Line {
        path: path.into(),
        line: 2,
        problem: format!(
            "found {}; the second line must be `{}`, the only units there are",
            excerpt(second),
            UNITS.join(" ")
        ),
    })
}

/// Batches so far.
#[derive(Default)]
struct Gathered {
    batches: Vec<Batch>,
    /// The batch that further edits belong to.
    open: Option<Batch>,
    moment: Option<Moment>,
    edits: u64,
}

impl Gathered {
    fn take(&mut self, line: Line, at: u64) -> Result<(), String> {
        let is_named = self.open.as_ref().is_some_and(|batch| batch.name.is_some());
        match line {
            Line::Comment => {}
            Line::Blank if is_named => {}
            Line::Blank => self.close(),
            Line::Step(step) => {
                if self.edits == MAX_EDITS {
                    return Err(format!("the script has more than {MAX_EDITS} edits; split it"));
                }
                self.edits += 1;
                let moment = self.moment;
                let batch = self.open.get_or_insert_with(|| Batch { moment, line: at, ..Batch::default() });
                if batch.steps.is_empty() {
                    batch.line = at;
                }
                batch.steps.push(step);
            }
            Line::Batch(_) | Line::Moment(_) if is_named => {
                return Err("the batch above has no end; write `end` on the line before".into());
            }
            Line::Batch(name) => {
                self.close();
                self.open =
                    Some(Batch { name: Some(name), moment: self.moment, line: at, ..Batch::default() });
            }
            Line::Moment(moment) => {
                self.close();
                if let Some(fault) = self.moment.and_then(|before| order_fault(before, moment)) {
                    return Err(fault);
                }
                self.moment = Some(moment);
            }
            Line::End if is_named => {
                if self.open.as_ref().is_some_and(|batch| batch.steps.is_empty()) {
                    return Err("the batch has no edits; add some before `end`, or drop it".into());
                }
                self.close();
            }
            Line::End => {
                return Err(
                    "nothing is open that `end` could end; drop it, or write `batch NAME` first".into()
                );
            }
        }
        Ok(())
    }

    fn close(&mut self) {
        self.batches.extend(self.open.take());
    }

    fn finish(mut self) -> Result<Vec<Batch>, String> {
        if let Some(Batch { name: Some(name), .. }) = &self.open {
            return Err(format!("the batch {} has no end; write `end` behind its last edit", excerpt(name)));
        }
        self.close();
        Ok(self.batches)
    }
}

/// Why a moment cannot come after another.
pub(super) fn order_fault(before: Moment, after: Moment) -> Option<String> {
    match (before, after) {
        (Moment::Frame(before), Moment::Frame(after)) if after < before => Some(format!(
            "frame {after} comes after frame {before}; put the edits in the order they are done"
        )),
        (Moment::Seconds(before), Moment::Seconds(after)) if after < before => {
            Some(format!("{after} s come after {before} s; put the edits in the order they are done"))
        }
        (Moment::Frame(_), Moment::Seconds(_)) | (Moment::Seconds(_), Moment::Frame(_)) => {
            Some("frames and seconds are mixed; use `frame N` or `at SECONDS` throughout".into())
        }
        _ => None,
    }
}
