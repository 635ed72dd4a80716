//! One writer at a time: a lock on the terrain file itself, so that no other name of it, a link or another path, makes a second writer.
//!
//! Readers hold a shared lock on the whole file for as long as they have it open, and appending need not wait for them (FORMAT.md, section 7.4). So writers exclude each other by a lock on
//! one byte far behind any file's end. **The lock belongs to the open file:** it ends with the process, however that ends, and leaves nothing behind. In a process that goes on it is given back explicitly,
//! because a program that is being started at that moment has copies of all open files for a while. No file is made beside the terrain. Code that replaces a file by a new one takes part: it takes the same lock, shared with others that replace.
//!
//! Linux locks the byte (an open file description lock). On Windows a writer opens the file so that no other process can open it for writing; code that replaces it opens it so that only others that
//! replace can. On other systems no other writer is kept out: macOS has such a lock, but no safe function for it. Nor is one kept out on file systems without locks.

use crate::error::LayoutError;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Times that a file may be replaced under its name while its lock is taken.
const MOST_TRIES: u32 = 100;

/// The right to write to a terrain file, and the file. Each clone has the right too.
#[derive(Debug, Clone)]
pub(crate) struct WriteLock {
    locked: Arc<Locked>,
}

/// A file whose lock is given back when it is dropped.
#[derive(Debug)]
struct Locked(File);

impl Drop for Locked {
    fn drop(&mut self) {
        system::unlock(&self.0);
    }
}

impl WriteLock {
    /// Opens the file at `path` for reading and writing, and takes its lock.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while another has it; [`LayoutError::NotThisFormat`] for what is not a regular file; [`LayoutError::Io`].
    pub(crate) fn take(path: &Path) -> Result<Self, LayoutError> {
        for _ in 0..MOST_TRIES {
            let file = match system::open_for_writing(path) {
                Ok(file) => file,
                Err(e) if system::is_taken(&e) => return Err(taken(path)),
                Err(e) => return Err(LayoutError::io(path, "cannot open the file for writing", e)),
            };
            check_regular(&file, path)?;
            if !system::lock(&file, system::Kind::Exclusive) {
                return Err(taken(path));
            }
            let locked = Locked(file);
            // Whoever had the lock may have put another file in its place between our opening and locking it.
            if is_named(&locked.0, path) {
                return Ok(Self { locked: Arc::new(locked) });
            }
        }
        Err(taken(path))
    }

    /// The file, open for reading and writing.
    pub(crate) fn file(&self) -> &File {
        &self.locked.0
    }

    /// Whether `path` is another name of the file.
    pub(crate) fn is_of(&self, path: &Path) -> bool {
        is_named(self.file(), path)
    }

    /// Refuses to replace a file that has other names (hard links), which would go on naming the old one.
    pub(crate) fn check_only_name(&self, path: &Path) -> Result<(), LayoutError> {
        match names(self.file()) {
            0 | 1 => Ok(()),
            names => Err(LayoutError::Usage(format!(
                "{}: the file has {names} names (hard links), and writing it anew would leave the others with the old contents; \
                 write to a new file instead, or remove the other names first",
                path.display()
            ))),
        }
    }
}

/// Keeps writers away from a file while it is replaced by another.
#[derive(Debug)]
pub(super) struct ReplaceLock {
    _locked: Option<Locked>,
}

impl ReplaceLock {
    /// Of whatever regular file `path` names; of nothing where there is none, or none that may be read.
    pub(super) fn take(path: &Path) -> Result<Self, LayoutError> {
        if !std::fs::symlink_metadata(path).is_ok_and(|meta| meta.is_file()) {
            return Ok(Self { _locked: None });
        }
        let file = match system::open_for_reading(path) {
            Ok(file) => file,
            Err(e) if system::is_taken(&e) => return Err(taken(path)),
            Err(_) => return Ok(Self { _locked: None }),
        };
        if !system::lock(&file, system::Kind::Shared) {
            return Err(taken(path));
        }
        Ok(Self { _locked: Some(Locked(file)) })
    }
}

fn taken(path: &Path) -> LayoutError {
    LayoutError::Usage(format!("{}: another program is writing to it; wait until it is done", path.display()))
}

fn check_regular(file: &File, path: &Path) -> Result<(), LayoutError> {
    let meta = file.metadata().map_err(|e| LayoutError::io(path, "cannot ask what the file is", e))?;
    if meta.is_file() {
        return Ok(());
    }
    Err(LayoutError::not_this_format(path, "this is not a regular file; name a terrain file (.iqt)"))
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
    #[cfg(not(unix))]
    {
        let place = |file| same_file::Handle::from_file(file);
        match (file.try_clone().and_then(place), same_file::Handle::from_path(path)) {
            (Ok(ours), Ok(named)) => ours == named,
            _ => false,
        }
    }
}

/// Names that a file has.
fn names(file: &File) -> u64 {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        file.metadata().map_or(1, |meta| meta.nlink())
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        1
    }
}

#[cfg(unix)]
mod system {
    use crate::file::opening::without_waiting;
    use std::fs::File;
    use std::io::{Error, Result};
    use std::path::Path;

    #[derive(Clone, Copy)]
    pub(super) enum Kind {
        Exclusive,
        Shared,
    }

    pub(super) fn open_for_writing(path: &Path) -> Result<File> {
        without_waiting(File::options().read(true).write(true)).open(path)
    }

    pub(super) fn open_for_reading(path: &Path) -> Result<File> {
        without_waiting(File::options().read(true)).open(path)
    }

    pub(super) fn is_taken(_: &Error) -> bool {
        false
    }

    /// Whether the lock was to be had; it is where the file system has no locks.
    pub(super) fn lock(file: &File, kind: Kind) -> bool {
        byte::set(file, kind)
    }

    pub(super) fn unlock(file: &File) {
        byte::give_back(file);
    }

    #[cfg(any(target_os = "linux", target_os = "android"))]
    mod byte {
        use super::{File, Kind};
        use nix::errno::Errno;
        use nix::fcntl::{FcntlArg, fcntl};
        use nix::libc;

        pub(super) fn set(file: &File, kind: Kind) -> bool {
            let set = match kind {
                Kind::Exclusive => call(file, libc::F_WRLCK as libc::c_short),
                Kind::Shared => call(file, libc::F_RDLCK as libc::c_short),
            };
            !matches!(set, Err(Errno::EAGAIN | Errno::EACCES))
        }

        pub(super) fn give_back(file: &File) {
            // It ends with the process in any case.
            let _ = call(file, libc::F_UNLCK as libc::c_short);
        }

        fn call(file: &File, l_type: libc::c_short) -> nix::Result<i32> {
            let l_whence = libc::SEEK_SET as libc::c_short;
            let byte = libc::flock { l_type, l_whence, l_start: libc::off_t::MAX - 1, l_len: 1, l_pid: 0 };
            fcntl(file, FcntlArg::F_OFD_SETLK(&byte))
        }
    }

    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    mod byte {
        use super::{File, Kind};

        pub(super) fn set(_: &File, _: Kind) -> bool {
            true
        }

        pub(super) fn give_back(_: &File) {}
    }
}

#[cfg(windows)]
mod system {
    use std::fs::File;
    use std::io::{Error, Result};
    use std::os::windows::fs::OpenOptionsExt;
    use std::path::Path;

    #[derive(Clone, Copy)]
    pub(super) enum Kind {
        Exclusive,
        Shared,
    }

    /// Others may read the file and replace it, and may not write to it: FILE_SHARE_READ and FILE_SHARE_DELETE.
    const OTHERS_READ: u32 = 0x1 | 0x4;
    /// ERROR_SHARING_VIOLATION.
    const SHARING_VIOLATION: i32 = 32;

    pub(super) fn open_for_writing(path: &Path) -> Result<File> {
        File::options().read(true).write(true).share_mode(OTHERS_READ).open(path)
    }

    /// Not while anybody has it open for writing, nor does anybody get it for writing then.
    pub(super) fn open_for_reading(path: &Path) -> Result<File> {
        File::options().read(true).share_mode(OTHERS_READ).open(path)
    }

    pub(super) fn is_taken(error: &Error) -> bool {
        error.raw_os_error() == Some(SHARING_VIOLATION)
    }

    pub(super) fn lock(_: &File, _: Kind) -> bool {
        true
    }

    pub(super) fn unlock(_: &File) {}
}

#[cfg(not(any(unix, windows)))]
mod system {
    use std::fs::File;
    use std::io::{Error, Result};
    use std::path::Path;

    #[derive(Clone, Copy)]
    pub(super) enum Kind {
        Exclusive,
        Shared,
    }

    pub(super) fn open_for_writing(path: &Path) -> Result<File> {
        File::options().read(true).write(true).open(path)
    }

    pub(super) fn open_for_reading(path: &Path) -> Result<File> {
        File::open(path)
    }

    pub(super) fn is_taken(_: &Error) -> bool {
        false
    }

    pub(super) fn lock(_: &File, _: Kind) -> bool {
        true
    }

    pub(super) fn unlock(_: &File) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_told(path: &Path) {
        let error = WriteLock::take(path).unwrap_err().to_string();
        assert!(error.contains("another program is writing"), "{error}");
    }

    #[test]
    fn the_second_writer_is_told_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.iqt");
        std::fs::write(&target, "x").unwrap();
        let first = WriteLock::take(&target).unwrap();
        is_told(&target);
        let clone = first.clone();
        drop(first);
        // A commit that is under way keeps the lock.
        is_told(&target);
        // What another program has inherited keeps nothing.
        let inherited = clone.file().try_clone().unwrap();
        drop(clone);
        drop(WriteLock::take(&target).unwrap());
        drop(inherited);
        drop(WriteLock::take(&target).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn every_name_of_a_file_is_locked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("real")).unwrap();
        let target = at("real/a.iqt");
        std::fs::write(&target, "x").unwrap();
        std::os::unix::fs::symlink("real/a.iqt", at("link.iqt")).unwrap();
        std::os::unix::fs::symlink("real", at("folder")).unwrap();
        std::fs::hard_link(&target, at("hard.iqt")).unwrap();
        let names = ["link.iqt", "folder/a.iqt", "hard.iqt", "real/../real/a.iqt"].map(at);
        for first in &names {
            let lock = WriteLock::take(first).unwrap();
            names.iter().for_each(|second| is_told(second));
            assert!(names.iter().all(|name| lock.is_of(name)));
            assert!(lock.check_only_name(first).unwrap_err().to_string().contains("hard links"));
        }
    }

    /// What others call `NAME.lock` is theirs, and a FIFO is no terrain.
    #[cfg(unix)]
    #[test]
    fn what_is_beside_the_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.iqt");
        std::fs::write(&target, "x").unwrap();
        let beside = folder.path().join("a.iqt.lock");
        std::fs::write(&beside, "mine").unwrap();
        drop(WriteLock::take(&target).unwrap());
        assert_eq!(std::fs::read_to_string(&beside).unwrap(), "mine");
        let fifo = folder.path().join("fifo");
        rustix::fs::mknodat(
            rustix::fs::CWD,
            &fifo,
            rustix::fs::FileType::Fifo,
            rustix::fs::Mode::from_raw_mode(0o600),
            0,
        )
        .unwrap();
        assert!(WriteLock::take(&fifo).unwrap_err().to_string().contains("not a regular file"));
        assert!(WriteLock::take(&folder.path().join("none")).is_err());
    }

    #[test]
    fn replacing_waits_for_no_one_and_keeps_writers_out() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.iqt");
        drop(ReplaceLock::take(&target).unwrap());
        std::fs::write(&target, "x").unwrap();
        let [one, two] = [0, 1].map(|_| ReplaceLock::take(&target).unwrap());
        if cfg!(any(target_os = "linux", windows)) {
            is_told(&target);
            drop((one, two));
            let writer = WriteLock::take(&target).unwrap();
            assert!(ReplaceLock::take(&target).is_err());
            drop(writer);
        }
        drop(WriteLock::take(&target).unwrap());
    }
}
