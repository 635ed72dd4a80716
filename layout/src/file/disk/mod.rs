//! The calls that writers make of the disk, on open files and on names, behind one trait. So a disk that fails, fills or forgets can stand in for
//! the system's.
//!
//! Every byte of a terrain file passes through here, every byte of the samples on their way to it, and every name that such a file gets. Invariant: each call says offset and length; no file
//! has a position that threads would have to share.

#[cfg(any(test, feature = "testing"))]
mod failing;
#[cfg(any(test, feature = "testing"))]
mod forgetful;

#[cfg(any(test, feature = "testing"))]
pub use failing::{FailingDisk, Failure};
#[cfg(any(test, feature = "testing"))]
pub use forgetful::{ForgetfulDisk, PowerCut};

use std::fs::File;
use std::io::{ErrorKind, Result};
use std::path::Path;

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

    /// Gives a file that has no name yet the name `to`, which nothing may have.
    ///
    /// # Errors
    /// The system's, which has no nameless files everywhere; [`ErrorKind::AlreadyExists`] where something has the name.
    fn link(&self, file: &File, to: &Path) -> Result<()>;

    /// Gives what is called `from` the name `to`, in place of whatever has it.
    ///
    /// # Errors
    /// The system's.
    fn rename(&self, from: &Path, to: &Path) -> Result<()>;

    /// Returns when the names in a folder are on the disk: a new name is not before this.
    ///
    /// # Errors
    /// The system's. Systems and file systems that do not know how to say so.
    fn sync_folder(&self, folder: &Path) -> Result<()>;
}

/// The way to an open file, also to one without a name. It leads nowhere in a system without `/proc`, such as a bare chroot.
#[cfg(target_os = "linux")]
pub(super) fn way_to(file: &File) -> std::path::PathBuf {
    use std::os::fd::AsRawFd;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
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

    fn link(&self, file: &File, to: &Path) -> Result<()> {
        #[cfg(target_os = "linux")]
        {
            use rustix::fs::{AtFlags, CWD, linkat};
            Ok(linkat(CWD, way_to(file), CWD, to, AtFlags::SYMLINK_FOLLOW)?)
        }
        #[cfg(not(target_os = "linux"))]
        {
            let _ = (file, to);
            Err(ErrorKind::Unsupported.into())
        }
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        std::fs::rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> Result<()> {
        #[cfg(unix)]
        {
            // A folder that may be written to and not be read cannot be opened, and some file systems sync no folders: there is no more to be had there.
            let cannot = |e: &std::io::Error| {
                matches!(
                    e.kind(),
                    ErrorKind::PermissionDenied | ErrorKind::InvalidInput | ErrorKind::Unsupported
                )
            };
            match File::open(folder).and_then(|folder| folder.sync_all()) {
                Err(error) if cannot(&error) => Ok(()),
                done => done,
            }
        }
        // Elsewhere folders are not files that could be synced.
        #[cfg(not(unix))]
        {
            let _ = folder;
            Ok(())
        }
    }
}

/// Brings the names in a folder to the disk, where the system can.
///
/// # Errors
/// The system's. Systems and file systems that sync no folders do not say so.
pub fn sync_folder(folder: &Path) -> Result<()> {
    SystemDisk.sync_folder(folder)
}

/// Writes all of `bytes` at `offset`.
pub fn write_at(file: &File, bytes: &[u8], offset: u64) -> Result<()> {
    SystemDisk.write_at(file, bytes, offset)
}

/// Fills `bytes` from `offset`.
pub fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset);
    #[cfg(windows)]
    {
        let mut done = 0;
        while done < bytes.len() {
            match std::os::windows::fs::FileExt::seek_read(file, &mut bytes[done..], offset + done as u64)? {
                0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
                count => done += count,
            }
        }
        Ok(())
    }
}
