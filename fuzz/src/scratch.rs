//! A folder for the files of one run, in memory where there is a file system in memory; removed when it is dropped.

use std::path::Path;
use tempfile::TempDir;

/// A new folder. `TMPDIR` decides where, if it is set.
pub(crate) fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    let is_chosen = std::env::var_os("TMPDIR").is_some() || !memory.is_dir();
    let made = if is_chosen { tempfile::tempdir() } else { tempfile::tempdir_in(memory) };
    made.expect("a temporary folder can be made")
}
