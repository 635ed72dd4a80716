//! What is said of the files of a mosaic: which were left out and why, and what may be wrong in many of them, once.
//!
//! Everything is said in the order of paths, whatever the order in which it was found. Cost: some words a file.

use super::source::{Read, Source};
use crate::guard::left_out;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Files of which is said why they were left out, others that are named, and kinds of warnings, at most.
const MOST_EXPLAINED: usize = 6;
const MOST_NAMED: usize = 2000;
const MOST_KINDS: usize = 12;

/// What was seen of files.
#[derive(Debug, Clone, Default)]
pub(super) struct Told {
    /// Files that were left out, and why.
    lost: BTreeMap<PathBuf, String>,
    /// Warnings by their words: the first file that has it, how many have it.
    warnings: BTreeMap<String, (Warning, PathBuf, usize)>,
    /// Values named as "no data", and in how many files no sample had them.
    unmatched: BTreeMap<String, usize>,
    read: usize,
}

impl Told {
    /// A file is left out.
    pub(super) fn lose(&mut self, path: &Path, error: &LayoutError) {
        self.lost.insert(path.to_owned(), error.to_string());
    }

    /// A file was looked at.
    pub(super) fn look(&mut self, source: &Source) {
        source.warnings.iter().for_each(|warning| self.warn(&source.path, warning));
    }

    /// A file was read.
    pub(super) fn read(&mut self, source: &Source, read: Read) {
        self.read += 1;
        read.warnings.iter().for_each(|warning| self.warn(&source.path, warning));
        for value in read.unmatched {
            *self.unmatched.entry(value).or_default() += 1;
        }
    }

    fn warn(&mut self, path: &Path, warning: &Warning) {
        // Words that name the file, or one beside it, are the same words of another file.
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let key = if stem.len() > 2 { warning.words.replace(&*stem, "*") } else { warning.words.clone() };
        let (kept, first, count) =
            self.warnings.entry(key).or_insert_with(|| (warning.clone(), path.to_owned(), 0));
        *count += 1;
        if path < first.as_path() {
            (*first, *kept) = (path.to_owned(), warning.clone());
        }
    }

    /// How many files were read.
    pub(super) fn count_read(&self) -> usize {
        self.read
    }

    /// That no file is left.
    pub(super) fn nothing_read(&self) -> LayoutError {
        let why = self.lost.values().next().map_or("there is none", String::as_str);
        LayoutError::Usage(format!("none of the files can be read; the first: {why}"))
    }

    /// All of it as warnings, of so many files.
    pub(super) fn warnings(&self, files: usize) -> Vec<Warning> {
        let mut all = Vec::new();
        for why in self.lost.values().take(MOST_EXPLAINED) {
            all.push(left_out(why));
        }
        if let Some(more) = self.lost.len().checked_sub(MOST_EXPLAINED).filter(|more| *more > 0) {
            let names = self.lost.keys().skip(MOST_EXPLAINED).take(MOST_NAMED);
            let names: Vec<String> = names.map(|path| harmless(&path.display().to_string(), 120)).collect();
            let rest =
                if more > MOST_NAMED { format!(", and {} more", more - MOST_NAMED) } else { String::new() };
            let all_of = self.lost.len();
            all.push(Warning::new(format!(
                "{all_of} files in all were left out, these as well: {}{rest}",
                names.join(", ")
            )));
        }
        for (warning, first, count) in self.warnings.values().take(MOST_KINDS) {
            let name = harmless(&first.display().to_string(), 120);
            let words = match count {
                1 => format!("{name}: {}", warning.words),
                count if *count >= files => format!("all files: {}", warning.words),
                count => format!("{} of {files} files, {name} the first: {}", count, warning.words),
            };
            all.push(Warning { words, mended_by: warning.mended_by.clone() });
        }
        if self.warnings.len() > MOST_KINDS {
            all.push(Warning::new(format!(
                "{} more warnings are of single files; build these alone to see them",
                self.warnings.len() - MOST_KINDS
            )));
        }
        for (value, _) in self.unmatched.iter().filter(|(_, count)| self.read > 0 && **count >= self.read) {
            all.push(
                Warning::new(format!("no sample is {}, which was named as \"no data\"", harmless(value, 40)))
                    .mended_by(Remedy::Nodata, "VALUE"),
            );
        }
        all
    }
}
