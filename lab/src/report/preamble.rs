//! The lines before the names of a table's columns: where its figures come from.
//!
//! Each begins with `# `, which readers of CSV can be told to pass over (`comment="#"` in pandas, `comment.char="#"` in R). No value has a line
//! break, whatever a file is called.

use crate::made::Made;
use std::io::{self, Write};
use terrasoar_layout::printable;

/// How a table of frames came about.
#[derive(Debug, Clone, Copy)]
pub(super) struct Preamble<'a> {
    pub terrain: &'a str,
    pub flight: &'a str,
    pub tolerance_px: f64,
    pub viewport_px: [u32; 2],
    pub made: Option<&'a Made>,
}

impl Preamble<'_> {
    /// Writes a line for each thing that is known.
    pub fn write(&self, to: &mut dyn Write) -> io::Result<()> {
        if let Some(Made { program, commit, machine, date, command }) = self.made {
            line(to, "program", program)?;
            commit.iter().try_for_each(|commit| line(to, "commit", commit))?;
            line(to, "machine", machine)?;
            line(to, "date", date)?;
            line(to, "command", command)?;
        }
        line(to, "terrain", self.terrain)?;
        line(to, "flight", self.flight)?;
        line(to, "tolerance_px", &self.tolerance_px.to_string())?;
        let [wide, high] = self.viewport_px;
        line(to, "viewport_px", &format!("{wide}x{high}"))
    }
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
        let preamble = Preamble {
            terrain: "hill\n# flight: none.iqt",
            flight: "low.flight",
            tolerance_px: 1.5,
            viewport_px: [800, 600],
            made: Some(&made),
        };
        let mut text = Vec::new();
        preamble.write(&mut text).unwrap();
        text.extend(b"frame,triangles\n0,2\n");
        assert_eq!(skipped(&text), b"frame,triangles\n0,2\n");
        let text = String::from_utf8(text).unwrap();
        let names: Vec<&str> =
            text.lines().filter_map(|line| line.strip_prefix("# ")?.split(": ").next()).collect();
        assert_eq!(
            names,
            ["program", "machine", "date", "command", "terrain", "flight", "tolerance_px", "viewport_px"]
        );
        assert_eq!(skipped(b"frame\n"), b"frame\n");
        assert_eq!(skipped(b"# endless"), b"");
    }
}
