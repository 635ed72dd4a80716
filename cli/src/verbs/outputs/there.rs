//! What kind of file is there already, in words.

use crate::lost::may_have_lost_a_commit;
use crate::verbs::output::grouped;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use terrasoar_lab::report::START_BYTES;
use terrasoar_layout::edit::history;
use terrasoar_layout::file::header;
use terrasoar_layout::imagery::Imagery;
use terrasoar_layout::read::terrain::Terrain;

/// The first bytes of a file, enough to know its kind.
pub(super) fn start_of(path: &Path) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path)?.take(START_BYTES as u64).read_to_end(&mut start)?;
    Ok(start)
}

/// What a terrain file holds that a build would not bring back; nothing inside if there is no such, and nothing at all if the file is no terrain file.
pub(super) fn terrain(path: &Path, start: &[u8]) -> Option<Option<String>> {
    if !start.starts_with(&header::MAGIC) {
        return None;
    }
    let Ok(terrain) = Terrain::open_unmapped(path) else {
        return Some(Some("a terrain file that cannot be opened".into()));
    };
    let header = terrain.header();
    let mut held = Vec::new();
    if header.history.is_some() {
        held.push(match history(&terrain) {
            Ok(commits) => counted(commits.len() as u64, "commit of edits", "commits of edits"),
            Err(_) => "edits".into(),
        });
    }
    if header.imagery.is_some() {
        held.push(match Imagery::open(&terrain) {
            Ok(Some(imagery)) => format!("a picture of {}", counted(imagery.stored_tiles(), "tile", "tiles")),
            _ => "a picture".into(),
        });
    }
    // A commit that cannot be read any more may be there, and a person may have a way to it.
    if may_have_lost_a_commit(&terrain) {
        held.push("a damaged header".into());
    }
    let held = held.join(" and ");
    Some((!held.is_empty()).then(|| format!("a terrain that holds {held}")))
}

fn counted(count: u64, one: &str, more: &str) -> String {
    format!("{} {}", grouped(count), if count == 1 { one } else { more })
}

/// How files begin, and what they are.
const STARTS: &[(usize, &[u8], &str)] = &[
    (0, b"\x89IQO\r\n\x1a\n", "an overlay of edits"),
    (0, b"terrasoar-flight ", "a flight"),
    (0, b"terrasoar-edits ", "a script of edits"),
    (0, b"\x89PNG", "a PNG picture"),
    (0, b"II*\0", "a TIFF file"),
    (0, b"MM\0*", "a TIFF file"),
    (0, b"II+\0", "a TIFF file"),
    (0, b"MM\0+", "a TIFF file"),
    (0, b"binterr", "a BT elevation file"),
    (0, b"\xff\xd8\xff", "a JPEG picture"),
    (0, b"GIF8", "a GIF picture"),
    (4, b"ftyp", "a film"),
    (0, b"ply", "a PLY mesh"),
    (0, b"glTF", "a glTF scene"),
    (0, b"<svg", "an SVG drawing"),
    (0, b"PK\x03\x04", "a zip archive"),
    (0, b"\x1f\x8b", "a gzip archive"),
    (0, b"%PDF", "a PDF document"),
];

/// A kind of file by its start.
pub(super) fn named(start: &[u8]) -> String {
    let known =
        STARTS.iter().find(|(at, begins, _)| start.get(*at..).is_some_and(|rest| rest.starts_with(begins)));
    if let Some((_, begins, name)) = known {
        // Sixteen bits of grey are heights to most who keep such a file.
        let deep_grey = *begins == b"\x89PNG" && start.get(24..26) == Some(&[16, 0]);
        return if deep_grey { "a PNG of 16-bit grey".into() } else { (*name).into() };
    }
    if is_text(start) { "a text file".into() } else { "a file of another kind".into() }
}

/// Whether bytes read as text, but for a character that the end cuts.
fn is_text(start: &[u8]) -> bool {
    let text = match std::str::from_utf8(start) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&start[..error.valid_up_to()]).unwrap_or_default()
        }
        Err(_) => return false,
    };
    !text.is_empty() && !text.chars().any(|c| c.is_control() && !matches!(c, '\n' | '\r' | '\t'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_their_start() {
        for (start, name) in [
            (&b"II*\0\x08\0"[..], "a TIFF file"),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x09\0\0\0\x09\x10\0", "a PNG of 16-bit grey"),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x09\0\0\0\x09\x08\x02", "a PNG picture"),
            (b"\x89PNG", "a PNG picture"),
            ("Grüße\n".as_bytes(), "a text file"),
            (&"Grüße".as_bytes()[..3], "a text file"),
            (b"\x01\x02\x03", "a file of another kind"),
            (b"\xff\xfe", "a file of another kind"),
        ] {
            assert_eq!(named(start), name, "{start:?}");
        }
    }
}
