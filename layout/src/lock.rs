//! One writer at a time: a lock on a file beside the terrain file.
//!
//! Readers hold a shared lock on the terrain file itself for as long as they have it open, and appending need not wait for them (FORMAT.md, section 7);
//! so writers exclude each other on a file of their own, `NAME.lock`. The lock ends with the process, however it ends; the file is
//! removed by whoever finishes, and an empty one that a killed writer left behind hinders nobody.

use crate::error::LayoutError;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

/// The right to write to a terrain file.
#[derive(Debug)]
pub(crate) struct WriteLock {
    path: PathBuf,
    _file: File,
}

impl WriteLock {
    /// Takes the lock of the terrain file `target`.
    pub(crate) fn take(target: &Path) -> Result<Self, LayoutError> {
        let mut name = target.as_os_str().to_owned();
        name.push(".lock");
        let path = PathBuf::from(name);
        let failed = |e| LayoutError::io(&path, "cannot make the lock file", e);
        loop {
            let file =
                File::options().write(true).create(true).truncate(false).open(&path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(LayoutError::Usage(format!(
                        "{}: another program is writing to it; wait until it is done",
                        target.display()
                    )));
                }
                // File systems without locks: as with readers, nobody is kept out.
                Err(TryLockError::Error(_)) => {}
            }
            // Whoever had the lock may have removed the file between our opening and locking it.
            if is_named(&file, &path) {
                return Ok(Self { path, _file: file });
            }
        }
    }
}

impl Drop for WriteLock {
    fn drop(&mut self) {
        // Still locked: nobody else can have taken a file of this name.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Whether `path` still names the opened file.
pub(crate) fn is_named(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let place = |meta: std::fs::Metadata| (meta.dev(), meta.ino());
        match (file.metadata(), std::fs::metadata(path)) {
            (Ok(ours), Ok(named)) => place(ours) == place(named),
            _ => false,
        }
    }
    // Elsewhere an open file cannot be replaced.
    #[cfg(not(unix))]
    {
        let _ = (file, path);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_writer_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.iqt");
        let first = WriteLock::take(&target).unwrap();
        let error = WriteLock::take(&target).unwrap_err().to_string();
        assert!(error.contains("another program is writing"), "{error}");
        drop(first);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        // What a killed writer leaves.
        std::fs::write(folder.path().join("a.iqt.lock"), "").unwrap();
        drop(WriteLock::take(&target).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
