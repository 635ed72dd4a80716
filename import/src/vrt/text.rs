//! The text of a virtual raster, taken apart into a tree within bounds: entities are refused, and so is a text whose tree would take more memory than is allowed.

use crate::options::OpenOptions;
use crate::xml::{self, Crowd};
use roxmltree::{Document, ParsingOptions};
use std::io::Read;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Share of the memory allowed that the text may take, and that its tree may.
const TEXT_SHARE: u64 = 16;
const TREE_SHARE: u64 = 4;

/// Whether a file begins as a virtual raster.
pub(crate) fn is_vrt(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let begins = head.starts_with(b"<VRTDataset");
    begins
        || (head.starts_with(b"<?xml") || head.starts_with(b"<!--"))
            && head.windows(11).any(|part| part == b"<VRTDataset")
}

/// Whether the file at `path` can be read and is a virtual raster.
pub(super) fn is_virtual(path: &Path) -> bool {
    let mut head = Vec::new();
    let opened = crate::input::open(path, "cannot open the file");
    opened.is_ok_and(|file| file.take(4096).read_to_end(&mut head).is_ok()) && is_vrt(&head)
}

/// The text of the file at `path`.
///
/// # Errors
/// I/O; [`LayoutError::Unsupported`] for one that is too long.
pub(super) fn read(path: &Path, options: &OpenOptions) -> Result<String, LayoutError> {
    let allowed = options.memory_mib.unwrap_or(512) << 20;
    let most = allowed / TEXT_SHARE;
    let mut bytes = Vec::new();
    crate::input::open(path, "cannot open the virtual raster")?
        .take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| LayoutError::io(path, "cannot read the virtual raster", source))?;
    if bytes.len() as u64 > most {
        return Err(too_large(path, format!("its text is longer than {} MiB", most >> 20)));
    }
    match xml::check(&bytes, allowed / TREE_SHARE) {
        Ok(()) => {}
        Err(Crowd::Large(nodes)) => return Err(too_large(path, format!("it has {nodes} elements"))),
        Err(Crowd::Steep) => {
            return Err(LayoutError::damaged(
                path,
                "its text",
                "its elements lie too deep in each other, or have too many attributes; write it again with gdalbuildvrt",
            ));
        }
    }
    Ok(String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}').to_owned())
}

fn too_large(path: &Path, why: String) -> LayoutError {
    LayoutError::unsupported(
        path,
        format!(
            "{why}, which is more than the memory allowed is good for; name the files that it lists, or allow more memory"
        ),
    )
    .mended_by(Remedy::Memory { enough_mib: None })
}

/// The tree of a text.
///
/// # Errors
/// [`LayoutError::Damaged`] where it is none.
pub(super) fn tree<'t>(path: &Path, text: &'t str) -> Result<Document<'t>, LayoutError> {
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    let parsed = crate::guard::guard(
        path,
        || "its text".into(),
        || {
            Document::parse_with_options(text, options).map_err(|error| {
                let (place, why) = match error {
                    roxmltree::Error::DtdDetected => {
                        ("its text".into(), "it declares entities, which no virtual raster needs")
                    }
                    error => {
                        let at = error.pos();
                        (format!("line {}, column {}", at.row, at.col), "the text is no XML from here on")
                    }
                };
                LayoutError::damaged(path, place, format!("{why}; write it again with gdalbuildvrt"))
            })
        },
    )?;
    Ok(parsed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(text: &str, memory_mib: u64) -> Result<usize, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vrt");
        std::fs::write(&path, text).unwrap();
        let options = OpenOptions { memory_mib: Some(memory_mib), ..OpenOptions::default() };
        let text = read(&path, &options).map_err(|error| error.to_string())?;
        tree(&path, &text).map(|tree| tree.root().descendants().count()).map_err(|error| error.to_string())
    }

    #[test]
    fn bombs_end_in_words() {
        let bomb = "<!DOCTYPE a [<!ENTITY x \"ha\"><!ENTITY y \"&x;&x;&x;\">]><VRTDataset>&y;</VRTDataset>";
        assert!(opened(bomb, 64).unwrap_err().contains("entities"));
        assert!(opened(&"<a>".repeat(100_000), 64).unwrap_err().contains("too deep"));
        let crowd: String = (0..100_000).map(|i| format!(" a{i}=\"\"")).collect();
        assert!(opened(&format!("<a{crowd}/>"), 64).unwrap_err().contains("too many attributes"));
        assert!(
            opened(&format!("<a>{}</a>", "<b/>".repeat(200_000)), 64)
                .unwrap_err()
                .contains("200002 elements")
        );
        assert!(opened(&"x".repeat(5 << 20), 64).unwrap_err().contains("longer than 4 MiB"));
        let plain = "<?xml version=\"1.0\"?><!-- a --><VRTDataset><a b=\"c\">d</a><a/><a></a></VRTDataset>";
        assert!(opened(plain, 64).unwrap() > 5);
        assert!(opened("<a><b></a>", 64).unwrap_err().contains("line 1"));
        assert!(
            is_vrt(plain.as_bytes()) && is_vrt(b"\xef\xbb\xbf \n<VRTDataset/>") && !is_vrt(b"<PAMDataset/>")
        );
    }
}
