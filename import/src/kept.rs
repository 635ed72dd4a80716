//! Bytes that will be needed again: in memory where that is allowed, else in a nameless temporary file.
//!
//! What was never written is zero. Read and written by any number of threads at once; a part is written by one of them at a time.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::{read_at, write_at};

enum Place {
    Memory(RwLock<Vec<u8>>),
    File(File),
}

/// So many bytes, kept.
pub(crate) struct Kept {
    place: Place,
    folder: PathBuf,
    /// What fails where the file does, in words that its folder follows: "cannot keep the mask in a temporary file in".
    action: &'static str,
}

impl Kept {
    /// So many bytes, all zero, in memory or in a file in `folder`.
    pub(crate) fn new(
        bytes: u64,
        in_memory: bool,
        folder: &Path,
        action: &'static str,
    ) -> Result<Self, LayoutError> {
        let place = match usize::try_from(bytes).ok().filter(|_| in_memory) {
            Some(bytes) => Place::Memory(RwLock::new(vec![0; bytes])),
            None => {
                let made = tempfile::tempfile_in(folder).and_then(|file| file.set_len(bytes).map(|()| file));
                Place::File(made.map_err(|source| LayoutError::io(folder, action, source))?)
            }
        };
        Ok(Self { place, folder: folder.to_owned(), action })
    }

    fn failed(&self, source: std::io::Error) -> LayoutError {
        LayoutError::io(&self.folder, self.action, source)
    }

    /// Writes bytes from a place on, all of which lie in what is kept.
    pub(crate) fn write(&self, at: u64, bytes: &[u8]) -> Result<(), LayoutError> {
        match &self.place {
            Place::Memory(all) => {
                let mut all = all.write().unwrap_or_else(PoisonError::into_inner);
                all[at as usize..at as usize + bytes.len()].copy_from_slice(bytes);
                Ok(())
            }
            Place::File(file) => write_at(file, bytes, at).map_err(|source| self.failed(source)),
        }
    }

    /// Gives `length` bytes from a place on to `look`. `buffer` is for those of a file.
    pub(crate) fn read(
        &self,
        at: u64,
        length: usize,
        buffer: &mut Vec<u8>,
        look: impl FnOnce(&[u8]),
    ) -> Result<(), LayoutError> {
        match &self.place {
            Place::Memory(all) => {
                look(&all.read().unwrap_or_else(PoisonError::into_inner)[at as usize..at as usize + length]);
            }
            Place::File(file) => {
                buffer.resize(length, 0);
                read_at(file, buffer, at).map_err(|source| self.failed(source))?;
                look(buffer);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_and_files_keep_the_same() {
        let folder = tempfile::tempdir().unwrap();
        for in_memory in [true, false] {
            let kept =
                Kept::new(1000, in_memory, folder.path(), "cannot keep the test in a temporary file in")
                    .unwrap();
            kept.write(990, b"ten bytes.").unwrap();
            kept.write(3, b"and").unwrap();
            let mut seen: Vec<u8> = Vec::new();
            let mut buffer = Vec::new();
            kept.read(985, 15, &mut buffer, |bytes| seen.extend(bytes)).unwrap();
            kept.read(0, 8, &mut buffer, |bytes| seen.extend(bytes)).unwrap();
            assert_eq!(seen, b"\0\0\0\0\0ten bytes.\0\0\0and\0\0");
        }
        assert!(
            Kept::new(8, false, &folder.path().join("none"), "cannot keep the test in a temporary file in")
                .is_err()
        );
    }
}
