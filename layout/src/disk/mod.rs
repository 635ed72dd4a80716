//! What a build asks of the disk: a handful of calls on open files, behind one trait, so that a disk that fails or fills can stand in for
//! the system's.
//!
//! Every byte of a terrain file and of the samples on their way to it passes through here. Invariant: an offset and a length say where; no file has a
//! position that threads could quarrel over.

#[cfg(any(test, feature = "testing"))]
mod testing;

#[cfg(any(test, feature = "testing"))]
pub use testing::{FailingDisk, Failure};

use std::fs::File;
use std::io::{ErrorKind, Result};

/// Calls on files that are being written.
pub trait Disk: Sync + std::fmt::Debug {
    /// Writes all of `bytes` at `offset`.
    ///
    /// # Errors
    /// The system's; some of the bytes may have been written then.
    fn write_at(&self, file: &File, bytes: &[u8], offset: u64) -> Result<()>;

    /// Fills `bytes` from `offset`.
    ///
    /// # Errors
    /// The system's; a file that ends earlier.
    fn read_at(&self, file: &File, bytes: &mut [u8], offset: u64) -> Result<()>;

    /// Makes the file `length` bytes long; what it gains is zero and takes no room where the file system has holes.
    ///
    /// # Errors
    /// The system's.
    fn set_len(&self, file: &File, length: u64) -> Result<()>;

    /// Returns when the file's bytes are on the disk.
    ///
    /// # Errors
    /// The system's.
    fn sync(&self, file: &File) -> Result<()>;
}

/// The system's own.
#[derive(Debug, Clone, Copy)]
pub struct SystemDisk;

impl Disk for SystemDisk {
    fn write_at(&self, file: &File, bytes: &[u8], offset: u64) -> Result<()> {
        #[cfg(unix)]
        return std::os::unix::fs::FileExt::write_all_at(file, bytes, offset);
        #[cfg(windows)]
        {
            let mut done = 0;
            while done < bytes.len() {
                done +=
                    std::os::windows::fs::FileExt::seek_write(file, &bytes[done..], offset + done as u64)?;
            }
            Ok(())
        }
    }

    fn read_at(&self, file: &File, bytes: &mut [u8], offset: u64) -> Result<()> {
        read_at(file, bytes, offset)
    }

    fn set_len(&self, file: &File, length: u64) -> Result<()> {
        file.set_len(length)
    }

    fn sync(&self, file: &File) -> Result<()> {
        file.sync_all()
    }
}

/// Writes all of `bytes` at `offset`.
pub(crate) fn write_at(file: &File, bytes: &[u8], offset: u64) -> Result<()> {
    SystemDisk.write_at(file, bytes, offset)
}

/// Fills `bytes` from `offset`.
pub(crate) fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset);
    #[cfg(windows)]
    {
        let mut done = 0;
        while done < bytes.len() {
            match std::os::windows::fs::FileExt::seek_read(file, &mut bytes[done..], offset + done as u64)? {
                0 => return Err(ErrorKind::UnexpectedEof.into()),
                count => done += count,
            }
        }
        Ok(())
    }
}

/// Whether there was no room: the disk is full, or a quota or limit of the size of files is reached.
pub(crate) fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge)
}
