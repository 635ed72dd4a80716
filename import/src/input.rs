//! Opens the files that are read: regular ones, and no others.
//!
//! Opening a pipe waits for a writer, and a device may never end. Neither can be read in several places at once, as readers here do. So the kind of file
//! is checked before it is opened, and once more afterwards. Cost: two calls of the system.

use std::fs::{File, FileType};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::opening::without_waiting;

/// Opens the regular file that `path` leads to; `action` as for [`LayoutError::io`].
///
/// # Errors
/// [`LayoutError::NotThisFormat`] for anything else than a regular file; I/O.
pub(crate) fn open(path: &Path, action: &'static str) -> Result<File, LayoutError> {
    let failed = |source| LayoutError::io(path, action, source);
    check(path, std::fs::metadata(path).map_err(failed)?.file_type())?;
    let file = without_waiting(File::options().read(true)).open(path).map_err(failed)?;
    check(path, file.metadata().map_err(failed)?.file_type())?;
    Ok(file)
}

fn check(path: &Path, kind: FileType) -> Result<(), LayoutError> {
    if kind.is_file() {
        return Ok(());
    }
    Err(LayoutError::not_this_format(path, format!("this is {}", other_kind(kind))))
}

/// What a name leads to that is no regular file, and what to do.
fn other_kind(kind: FileType) -> &'static str {
    if kind.is_dir() {
        return "a folder; name the file in it";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a pipe, which cannot be read in several places; write what comes out of it to a file and name that";
        }
        if kind.is_socket() {
            return "a socket and no file; name a file";
        }
    }
    "a device and no file; copy what it holds to a file and name that"
}
