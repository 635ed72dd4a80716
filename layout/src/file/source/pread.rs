//! The terrain file read by positioned reads: no map, hence no SIGBUS when someone truncates the file.

use super::Source;
use crate::error::LayoutError;
use crate::file::disk::read_at;
use crate::file::opening::without_waiting;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A terrain file behind positioned reads.
#[derive(Debug)]
pub struct PreadSource {
    path: PathBuf,
    file: File,
    byte_count: u64,
}

impl PreadSource {
    /// Opens the file at `path` and takes a shared advisory lock on it, where the file system has locks. Windows has none that are advisory: a lock of
    /// a reader's would keep every commit from being written, so that there none is taken.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if it cannot be opened or someone is writing to it; [`LayoutError::NotThisFormat`] for what is not a regular file.
    pub fn open(path: &Path) -> Result<Self, LayoutError> {
        let file = without_waiting(File::options().read(true))
            .open(path)
            .map_err(|e| LayoutError::io(path, "cannot open the file", e))?;
        Self::over(path, file)
    }

    /// The file that `path` was opened as, for those who write to the very file that they read.
    pub(crate) fn over(path: &Path, file: File) -> Result<Self, LayoutError> {
        let meta =
            file.metadata().map_err(|e| LayoutError::io(path, "cannot ask for the file's length", e))?;
        if !meta.is_file() {
            return Err(LayoutError::not_this_format(
                path,
                "this is not a regular file; name a terrain file (.iqt)",
            ));
        }
        #[cfg(not(windows))]
        match file.try_lock_shared() {
            Ok(()) => {}
            Err(std::fs::TryLockError::WouldBlock) => {
                let busy = std::io::Error::new(ErrorKind::WouldBlock, "another program is writing to it");
                return Err(LayoutError::io(path, "cannot open the file", busy));
            }
            // File systems without locks still read.
            Err(std::fs::TryLockError::Error(_)) => {}
        }
        Ok(Self { path: path.to_owned(), byte_count: meta.len(), file })
    }

    pub(super) fn file(&self) -> &File {
        &self.file
    }
}

impl Source for PreadSource {
    fn path(&self) -> &Path {
        &self.path
    }

    fn byte_count(&self) -> u64 {
        self.byte_count
    }

    fn measure_again(&mut self) -> Result<(), LayoutError> {
        let meta = self
            .file
            .metadata()
            .map_err(|e| LayoutError::io(&self.path, "cannot ask for the file's length", e))?;
        self.byte_count = meta.len();
        Ok(())
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        read_at(&self.file, buffer, offset).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                &self.path,
                format!("byte {offset}"),
                "the file is shorter than it was when it was opened; restore a copy or build it again",
            ),
            _ => LayoutError::io(&self.path, "cannot read the file", e),
        })
    }
}
