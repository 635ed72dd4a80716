//! What a file looks like: its name, its length and its first bytes.
//!
//! A format with a signature is recognised by it alone, whatever the file is called. Formats without one are recognised by name, and by files beside. Cost: one read of 4 KiB.

use std::ffi::OsStr;
use std::io::Read;
use std::path::Path;

use super::input;
use terrasoar_layout::error::LayoutError;

/// Bytes that are looked at.
const HEAD_BYTES: u64 = 4096;

/// A look at a file.
#[derive(Debug)]
pub(crate) struct Look<'a> {
    pub(crate) path: &'a Path,
    /// The first bytes.
    pub(crate) head: Vec<u8>,
}

impl<'a> Look<'a> {
    /// Looks at the file at `path`, which is no folder.
    ///
    /// # Errors
    /// I/O; a file that is empty or no regular one.
    pub(crate) fn at(path: &'a Path) -> Result<Self, LayoutError> {
        let file = input::open(path, "cannot open the elevation file")?;
        let failed = |source| LayoutError::io(path, "cannot read the elevation file", source);
        let length = file.metadata().map_err(failed)?.len();
        if length == 0 {
            return Err(LayoutError::not_this_format(path, "the file is empty; fetch or write it again"));
        }
        let mut head = Vec::new();
        file.take(HEAD_BYTES).read_to_end(&mut head).map_err(failed)?;
        Ok(Self { path, head })
    }

    /// Whether the file begins with `magic`.
    pub(crate) fn begins(&self, magic: &[u8]) -> bool {
        self.head.starts_with(magic)
    }

    /// Whether the file's name ends with a point and `wanted`, capitals or not.
    pub(crate) fn is_called(&self, wanted: &str) -> bool {
        is_called(self.path, wanted)
    }
}

/// Whether a name ends with a point and `wanted`, capitals or not: `hgt`, `hgt.gz`.
pub(crate) fn is_called(path: &Path, wanted: &str) -> bool {
    let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default().as_bytes();
    let Some(at) = name.len().checked_sub(wanted.len() + 1) else { return false };
    name[at] == b'.' && name[at + 1..].eq_ignore_ascii_case(wanted.as_bytes())
}

/// Classic TIFF is version 42, BigTIFF 43, in either byte order.
pub(crate) fn is_tiff(head: &[u8]) -> bool {
    [&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| head.starts_with(magic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_as_asked() {
        assert!(
            is_called(Path::new("a/N01E002.HGT.gz"), "hgt.gz")
                && is_called(Path::new("N01E002.HGT.gz"), "gz")
        );
        assert!(
            !is_called(Path::new("ahgt"), "hgt")
                && !is_called(Path::new("hgt"), "hgt")
                && !is_called(Path::new("a/.."), "hgt")
        );
    }
}
