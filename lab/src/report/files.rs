//! Which files a report has, and how a file of ours is recognised.
//!
//! Code that is about to replace a file asks this first. **The answer depends on how the file starts**, so that another program's table or page is recognised as such whatever it is called.

use super::html::FLIGHT_PICTURE;
use super::{ComparisonReport, command_of, csv, file_parts, html, io, origin};
use crate::picture;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Bytes from a file's start that are enough to tell.
pub const START_BYTES: usize = 1 << 16;

/// A kind of file in a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReportFile {
    /// The frames of a replay, as [`write_frames_csv`](super::write_frames_csv) writes them.
    Frames,
    /// What frames read, as [`write_io_frames_csv`](super::write_io_frames_csv) writes it.
    IoFrames,
    /// The sums.
    Summary,
    /// A plot as SVG.
    Drawing,
    /// A plot or the flight as PNG.
    Picture,
    /// The page.
    Page,
}

impl ReportFile {
    /// Whether a file that starts with `start`, its first [`START_BYTES`] or all of it, could be one of this kind.
    pub fn is_ours(self, start: &[u8]) -> bool {
        let holds = |text: &str| start.windows(text.len()).any(|window| window == text.as_bytes());
        let is_table = |names: &str| {
            origin::skipped(start).strip_prefix(names.as_bytes()).is_some_and(|rest| rest.starts_with(b"\n"))
        };
        match self {
            Self::Frames => is_table(csv::HEADER),
            Self::IoFrames => is_table(io::HEADER),
            Self::Summary => start.starts_with(b"{\n  \"terrain\": ") && holds("\n  \"tolerance_px\": "),
            Self::Drawing => {
                start.starts_with(b"<svg width=\"1200\" height=\"700\" viewBox=\"0 0 3600 2100\"")
            }
            Self::Picture => picture::is_ours(start),
            Self::Page => start.starts_with(html::OPENING.as_bytes()) && holds(html::OF),
        }
    }
}

/// The plots of a report, by their names without ending.
fn plots(stems: &[&str]) -> Vec<(String, ReportFile)> {
    let both = |stem: &&str| {
        [(format!("{stem}.svg"), ReportFile::Drawing), (format!("{stem}.png"), ReportFile::Picture)]
    };
    stems.iter().flat_map(both).collect()
}

impl ComparisonReport<'_> {
    /// The files that a report on these engines can have.
    pub fn files(engines: &[&str]) -> Vec<(String, ReportFile)> {
        let frames = file_parts(engines).into_iter().map(|part| (frames_name(&part), ReportFile::Frames));
        let mut files: Vec<_> = frames.collect();
        files.push((FLIGHT_PICTURE.into(), ReportFile::Picture));
        files.push(("summary.json".into(), ReportFile::Summary));
        files.extend(plots(&[
            "plot-vertex-tests",
            "plot-speedup-by-tolerance",
            "plot-speedup-by-incoherence",
            "plot-update-times",
            "plot-pages",
        ]));
        files.push(("report.html".into(), ReportFile::Page));
        files
    }
}

impl io::IoReport<'_> {
    /// The files that a report can have.
    pub fn files() -> Vec<(String, ReportFile)> {
        let mut files =
            vec![("frames.csv".into(), ReportFile::IoFrames), ("summary.json".into(), ReportFile::Summary)];
        files.extend(plots(&["plot-io-layouts", "plot-io-engines", "plot-io-realtime"]));
        files.push(("report.html".into(), ReportFile::Page));
        files
    }
}

/// Removes from the directory `dir` what an earlier report with such `files` left there and this one, whose files are `written`, does not have. Tables that were not made by the program's verb
/// `verb` stay, and so does everything else, and what cannot be removed.
pub fn remove_stale(dir: &Path, files: &[(String, ReportFile)], verb: &str, written: &[PathBuf]) {
    for (name, kind) in files {
        let path = dir.join(name);
        if written.contains(&path) {
            continue;
        }
        let mut start = Vec::new();
        let read = File::open(&path).and_then(|file| file.take(START_BYTES as u64).read_to_end(&mut start));
        let is_table = matches!(kind, ReportFile::Frames | ReportFile::IoFrames);
        let is_of_verb = || command_of(&start).is_some_and(|command| command.contains(&format!(" {verb} ")));
        if read.is_ok() && kind.is_ours(&start) && (!is_table || is_of_verb()) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// The file with the frames of an engine, whose name is this part of it.
pub(super) fn frames_name(part: &str) -> String {
    format!("frames-{part}.csv")
}

#[cfg(test)]
mod tests {
    use super::super::{io, tests};
    use super::*;

    fn check(folder: &Path, written: &[std::path::PathBuf], files: &[(String, ReportFile)]) {
        for path in written {
            let name = path.file_name().unwrap().to_str().unwrap();
            let (_, kind) = files.iter().find(|(file, _)| file == name).expect(name);
            let bytes = std::fs::read(path).unwrap();
            let start = &bytes[..bytes.len().min(START_BYTES)];
            assert!(kind.is_ours(start), "{name}");
            for (_, other) in files.iter().filter(|(_, other)| other != kind) {
                assert!(!other.is_ours(start), "{name} as {other:?}");
            }
        }
        assert_eq!(std::fs::read_dir(folder).unwrap().count(), written.len());
    }

    #[test]
    fn every_file_written_is_foreseen_and_known() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let (written, engines) = tests::with_report(30, |report| {
            let engines: Vec<String> = report.runs.iter().map(|(engine, _)| engine.clone()).collect();
            (report.write(&a).unwrap(), engines)
        });
        let engines: Vec<&str> = engines.iter().map(String::as_str).collect();
        check(&a, &written, &ComparisonReport::files(&engines));
        let (bench, runs) = io::tests::made_up();
        let written = io::IoReport { bench: &bench, runs: &runs }.write(&b).unwrap();
        check(&b, &written, &io::IoReport::files());
    }

    #[test]
    fn what_an_earlier_report_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let written = tests::with_report(3, |report| report.write(folder.path()).unwrap());
        let at = |name: &str| folder.path().join(name);
        let table = std::fs::read_to_string(at("frames-soar.csv")).unwrap();
        let made_by = |verb: &str| format!("# command: terrasoar {verb} a.iqt --flight b.flight\n{table}");
        std::fs::write(at("frames-kinetic.csv"), made_by("compare")).unwrap();
        std::fs::write(at("frames-mine.csv"), made_by("compare")).unwrap();
        std::fs::write(at("frames-smart.csv"), made_by("replay")).unwrap();
        std::fs::write(at("frames-naive.csv"), "mine\n").unwrap();
        // Of the other report, in the same folder.
        std::fs::copy(at("plot-pages.svg"), at("plot-io-engines.svg")).ok();
        let foreseen = ComparisonReport::files(&["soar", "smart", "kinetic", "naive"]);
        let written: Vec<PathBuf> =
            written.into_iter().filter(|path| !path.ends_with("frames-smart.csv")).collect();
        remove_stale(folder.path(), &foreseen, "compare", &written);
        assert!(written.iter().all(|path| path.is_file()));
        assert!(!at("frames-kinetic.csv").exists());
        for kept in ["frames-mine.csv", "frames-smart.csv", "frames-naive.csv"] {
            assert!(at(kept).is_file(), "{kept}");
        }
        assert_eq!(at("plot-io-engines.svg").exists(), at("plot-pages.svg").exists());
    }

    #[test]
    fn files_of_others_are_not_ours() {
        let kinds = ComparisonReport::files(&["soar"]).into_iter().chain(io::IoReport::files());
        for (name, kind) in kinds {
            for start in [
                "",
                "frame,triangles\n1,2\n",
                "# terrain: a\nframe,triangles\n1,2\n",
                "{}",
                "{\n  \"terrain\": \"a\"\n}",
                "<svg width=\"1200\" height=\"700\">",
                "<!DOCTYPE html>\n<html lang=\"en\">\n<title>",
                "terrasoar-flight 1\n",
            ] {
                assert!(!kind.is_ours(start.as_bytes()), "{name}: {start}");
            }
        }
    }
}
