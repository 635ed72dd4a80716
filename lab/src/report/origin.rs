//! Where figures come from: what was flown, for which pictures, and how it was made. It stands in JSON objects and as lines before the names of a table's columns.
//!
//! Each such line begins with `# `, which readers of CSV can be told to pass over (`comment="#"` in pandas, `comment.char="#"` in R). No value has a line
//! break, whatever a file is called.

use crate::made::Made;
use serde::Serialize;
use std::io::{self, Write};
use terrasoar::refine::Culling;
use terrasoar::view::{ErrorMetric, Viewport};
use terrasoar_layout::printable;

/// What was flown, as it stands in the report's titles.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportTitle {
    /// The terrain's name.
    pub terrain: String,
    /// The flight's name.
    pub flight: String,
    /// Tolerance in pixels.
    pub tolerance_px: f64,
    /// How errors were measured.
    pub metric: ErrorMetric,
    /// Size of the picture.
    pub viewport: Viewport,
    /// Heights were multiplied by this.
    pub exaggeration: f64,
    /// What was left out of view.
    pub culling: Culling,
    /// Memory for pages that were read as frames needed them, in MiB; `None` if records were taken where they lie.
    pub cache_mib: Option<u64>,
    /// How it was made, if that is said.
    pub made: Option<Made>,
}

impl ReportTitle {
    /// The same for JSON objects.
    pub fn origin(&self) -> Origin<'_> {
        Origin {
            terrain: &self.terrain,
            flight: &self.flight,
            tolerance_px: self.tolerance_px,
            metric: self.metric.name(),
            viewport_px: self.viewport.size_px(),
            exaggeration: self.exaggeration,
            culling: self.culling.name(),
            cache_mib: self.cache_mib,
            made: self.made.as_ref(),
        }
    }
}

/// Where figures come from, under the names that reports use.
#[derive(Debug, Clone, Copy, Serialize)]
#[non_exhaustive]
pub struct Origin<'a> {
    /// The terrain's name.
    pub terrain: &'a str,
    /// The flight's name.
    pub flight: &'a str,
    /// Tolerance in pixels.
    pub tolerance_px: f64,
    /// How errors were measured.
    pub metric: &'a str,
    /// Size of the picture, wide and high.
    pub viewport_px: [u32; 2],
    /// Heights were multiplied by this.
    pub exaggeration: f64,
    /// What was left out of view.
    pub culling: &'a str,
    /// Memory for pages that were read as frames needed them, in MiB; `None` if records were taken where they lie.
    pub cache_mib: Option<u64>,
    /// How it was made, if that is said.
    pub made: Option<&'a Made>,
}

impl Origin<'_> {
    /// Writes a line for each thing that is known; `engine` is that of all frames, if there is one.
    pub(super) fn write(&self, to: &mut dyn Write, engine: Option<&str>) -> io::Result<()> {
        if let Some(Made { program, commit, machine, date, command }) = self.made {
            line(to, "program", program)?;
            commit.iter().try_for_each(|commit| line(to, "commit", commit))?;
            line(to, "machine", machine)?;
            line(to, "date", date)?;
            line(to, COMMAND, command)?;
        }
        line(to, "terrain", self.terrain)?;
        line(to, "flight", self.flight)?;
        engine.iter().try_for_each(|engine| line(to, "engine", engine))?;
        line(to, "tolerance_px", &self.tolerance_px.to_string())?;
        line(to, "metric", self.metric)?;
        let [wide, high] = self.viewport_px;
        line(to, "viewport_px", &format!("{wide}x{high}"))?;
        line(to, "exaggeration", &self.exaggeration.to_string())?;
        line(to, "culling", self.culling)?;
        self.cache_mib.iter().try_for_each(|mib| line(to, "cache_mib", &mib.to_string()))
    }
}

/// Name of the line with the command.
const COMMAND: &str = "command";

/// The command that a table of ours says it was made by, if it says so; `start` is how it begins.
pub fn command_of(start: &[u8]) -> Option<String> {
    let remarks = start.split(|byte| *byte == b'\n').take_while(|line| line.starts_with(b"# "));
    let head = format!("# {COMMAND}: ");
    let mut values = remarks.filter_map(|line| line.strip_prefix(head.as_bytes()));
    values.next().map(|value| String::from_utf8_lossy(value).into_owned())
}

fn line(to: &mut dyn Write, name: &str, value: &str) -> io::Result<()> {
    writeln!(to, "# {name}: {}", printable::line(value))
}

/// What follows the preamble at a file's start: its first line that is no remark, and all after it.
pub(super) fn skipped(mut start: &[u8]) -> &[u8] {
    while start.starts_with(b"# ") {
        let Some(end) = start.iter().position(|byte| *byte == b'\n') else { return &[] };
        start = &start[end + 1..];
    }
    start
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_stays_in_its_line_and_the_columns_are_found_behind() {
        let made =
            Made::new("terrasoar 9", "linux", "2026-11-26T15:26:16Z").command(&["a\nb".into(), "c d".into()]);
        let origin = Origin {
            terrain: "hill\n# flight: none.iqt",
            flight: "low.flight",
            tolerance_px: 1.5,
            metric: "ball",
            viewport_px: [800, 600],
            exaggeration: 2.0,
            culling: "vertices",
            cache_mib: Some(64),
            made: Some(&made),
        };
        let mut text = Vec::new();
        origin.write(&mut text, Some("soar")).unwrap();
        text.extend(b"frame,triangles\n0,2\n");
        assert_eq!(skipped(&text), b"frame,triangles\n0,2\n");
        assert!(command_of(&text).unwrap().ends_with(" \"c d\""));
        assert_eq!(command_of(b"frame\n# command: a\n"), None);
        let text = String::from_utf8(text).unwrap();
        let names: Vec<&str> =
            text.lines().filter_map(|line| line.strip_prefix("# ")?.split(": ").next()).collect();
        assert_eq!(
            names,
            [
                "program",
                "machine",
                "date",
                "command",
                "terrain",
                "flight",
                "engine",
                "tolerance_px",
                "metric",
                "viewport_px",
                "exaggeration",
                "culling",
                "cache_mib"
            ]
        );
        assert_eq!(skipped(b"frame\n"), b"frame\n");
        assert_eq!(skipped(b"# endless"), b"");
    }
}
