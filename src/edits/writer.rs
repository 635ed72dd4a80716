//! Writes a script, and refuses what would not read back as itself. [`Script::write`] replaces the file only once it is complete.

use super::format::{MAGIC, MAX_EDITS, UNITS, name_fault, push_moment, push_step, version_of};
use super::reader::order_fault;
use super::{Script, ScriptError};
use crate::sink::FileSink;
use std::io::Write;
use std::path::Path;

impl Script {
    /// Writes the script to `path`: a file appears when it is complete, a stream such as a pipe is written to directly.
    ///
    /// # Errors
    /// [`ScriptError::Write`], [`ScriptError::Output`], [`ScriptError::Unwritable`] or [`ScriptError::NoEdits`].
    pub fn write(&self, path: &Path) -> Result<(), ScriptError> {
        let text = self.to_text(path)?;
        let mut sink = FileSink::create(path).map_err(ScriptError::of_output)?;
        sink.write_all(text.as_bytes()).map_err(|source| ScriptError::Write { path: path.into(), source })?;
        sink.publish().map_err(ScriptError::of_output)
    }

    /// The script as text; errors call it `path`.
    ///
    /// # Errors
    /// [`ScriptError::Unwritable`] or [`ScriptError::NoEdits`].
    pub fn to_text(&self, path: &Path) -> Result<String, ScriptError> {
        if self.batches.is_empty() {
            return Err(ScriptError::NoEdits { path: path.into() });
        }
        // The lowest version that holds all of it, so that older programs read what they can.
        let steps = self.batches.iter().flat_map(|batch| &batch.steps);
        let version = steps.map(version_of).max().unwrap_or(1);
        let mut text = format!("{MAGIC} {version}\n{}\n", UNITS.join(" "));
        let (mut before, mut edits) = (None, 0);
        for (batch, number) in self.batches.iter().zip(1..) {
            let refused = |problem| ScriptError::Unwritable { path: path.into(), batch: number, problem };
            edits += batch.steps.len() as u64;
            if batch.steps.is_empty() {
                return Err(refused("it has no edits; drop it".into()));
            }
            if edits > MAX_EDITS {
                return Err(refused(format!("a script has at most {MAX_EDITS} edits; split it")));
            }
            text.push('\n');
            match (before, batch.moment) {
                (None, None) => {}
                (Some(_), None) => {
                    return Err(refused("it has no moment, and the one before it has; put it first".into()));
                }
                (None, Some(moment)) => push_line(&mut text, |line| push_moment(line, moment)),
                (Some(before), Some(moment)) => {
                    if let Some(fault) = order_fault(before, moment) {
                        return Err(refused(fault));
                    }
                    if before != moment {
                        push_line(&mut text, |line| push_moment(line, moment));
                    }
                }
            }
            before = batch.moment;
            if let Some(name) = &batch.name {
                if let Some(fault) = name_fault(name) {
                    return Err(refused(fault));
                }
                push_line(&mut text, |line| line.push_str(&format!("batch {name}")));
            }
            let mut line = String::new();
            for step in &batch.steps {
                line.clear();
                push_step(&mut line, step, version).map_err(refused)?;
                text.push_str(&line);
                text.push('\n');
            }
            if batch.name.is_some() {
                text.push_str("end\n");
            }
        }
        Ok(text)
    }
}

fn push_line(text: &mut String, write: impl FnOnce(&mut String)) {
    write(text);
    text.push('\n');
}
