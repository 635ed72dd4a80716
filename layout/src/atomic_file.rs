//! A file that appears under its name only when it is complete.
//!
//! On Linux the bytes go to a file without a name, so that even a killed process leaves nothing behind; elsewhere, and on file
//! systems without nameless files, to a temporary file beside the target that is removed when dropped.
//! Publishing syncs the bytes, then renames over whatever had the name.
//!
//! **A nameless file cannot replace another.** Where the target exists it gets a name of its own first, `.NAME.*.terrasoar-new`, and is renamed at once. A process killed between
//! these two calls leaves a complete file of that name; whoever publishes to the same target later takes it away.

pub(crate) use crate::disk::read_at;
use crate::disk::{Disk, SystemDisk};
use crate::error::LayoutError;
use std::fs::File;
use std::path::{Path, PathBuf};
#[cfg(target_os = "linux")]
use std::time::Duration;

/// A file being written.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    inner: Inner,
}

#[derive(Debug)]
enum Inner {
    #[cfg(target_os = "linux")]
    Nameless(File),
    Named(tempfile::NamedTempFile),
}

/// The folder a file lies in; the current one for a bare name.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

impl AtomicFile {
    /// Starts a file that will be called `target`.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if its folder does not exist or cannot be written to; [`LayoutError::Usage`] if `target` is a folder.
    pub fn create(target: &Path) -> Result<Self, LayoutError> {
        if target.is_dir() {
            return Err(LayoutError::Usage(format!(
                "{}: the output is a folder; name a file in it",
                target.display()
            )));
        }
        #[cfg(target_os = "linux")]
        if let Some(file) = nameless(folder_of(target)) {
            return Ok(Self { target: target.to_owned(), inner: Inner::Nameless(file) });
        }
        let file = tempfile::Builder::new()
            .prefix(".terrasoar-")
            .suffix(".partial")
            .tempfile_in(folder_of(target))
            .map_err(|e| LayoutError::io(target, "cannot create the file", e))?;
        Ok(Self { target: target.to_owned(), inner: Inner::Named(file) })
    }

    /// The file to write to.
    pub fn file(&self) -> &File {
        match &self.inner {
            #[cfg(target_os = "linux")]
            Inner::Nameless(file) => file,
            Inner::Named(file) => file.as_file(),
        }
    }

    /// Name it will have.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Syncs what was written and gives the file its name, replacing what had it.
    ///
    /// # Errors
    /// [`LayoutError::Io`]; nothing is left behind then.
    pub fn publish(self) -> Result<(), LayoutError> {
        self.publish_on(&SystemDisk)
    }

    /// As [`AtomicFile::publish`], synced by `disk`.
    pub(crate) fn publish_on(self, disk: &dyn Disk) -> Result<(), LayoutError> {
        let target = self.target;
        let failed = |e| {
            let when_full = "cannot write the file, for which there is no room; make some on its disk, or name an output on another";
            LayoutError::write(&target, "cannot write the file", when_full, e)
        };
        match self.inner {
            #[cfg(target_os = "linux")]
            Inner::Nameless(file) => {
                disk.sync(&file).map_err(failed)?;
                name_file(&file, &target).map_err(failed)
            }
            Inner::Named(file) => {
                disk.sync(file.as_file()).map_err(failed)?;
                file.persist(&target).map(drop).map_err(|e| failed(e.error))
            }
        }
    }
}

#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    openat(CWD, folder, flags, Mode::from_raw_mode(0o644)).ok().map(File::from)
}

#[cfg(target_os = "linux")]
fn name_file(file: &File, target: &Path) -> std::io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    use std::os::fd::AsRawFd;
    let link = PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()));
    if !target.exists() && linkat(CWD, &link, CWD, target, AtFlags::SYMLINK_FOLLOW).is_ok() {
        return Ok(());
    }
    remove_left(target, STALE);
    tempfile::Builder::new()
        .prefix(&prefix_before(target))
        .suffix(SUFFIX_BEFORE)
        .make_in(folder_of(target), |name| Ok(linkat(CWD, &link, CWD, name, AtFlags::SYMLINK_FOLLOW)?))?
        .into_temp_path()
        .persist(target)
        .map_err(|e| e.error)
}

/// A name that is there for longer than the moment between two calls was left by a process that was killed in it.
#[cfg(target_os = "linux")]
const STALE: Duration = Duration::from_secs(10);
/// How names end that files have for that moment.
#[cfg(target_os = "linux")]
const SUFFIX_BEFORE: &str = ".terrasoar-new";

/// How they begin.
#[cfg(target_os = "linux")]
fn prefix_before(target: &Path) -> std::ffi::OsString {
    use std::os::unix::ffi::{OsStrExt, OsStringExt};
    // A file system takes names of 255 bytes, and something is added to this one.
    let target = target.file_name().unwrap_or_default().as_bytes();
    let bytes = [b".", &target[..target.len().min(200)], b"."].concat();
    std::ffi::OsString::from_vec(bytes)
}

/// Removes what was left beside `target`, if it has been there for as long as `stale`. Whatever does not go stays for another time.
#[cfg(target_os = "linux")]
fn remove_left(target: &Path, stale: Duration) {
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::MetadataExt;
    let prefix = prefix_before(target);
    let is_left =
        |name: &[u8]| name.starts_with(prefix.as_bytes()) && name.ends_with(SUFFIX_BEFORE.as_bytes());
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    for entry in std::fs::read_dir(folder_of(target)).into_iter().flatten().flatten() {
        if is_left(entry.file_name().as_bytes())
            // When it got its name, which nobody can set.
            && entry.metadata().is_ok_and(|meta| meta.ctime() + stale.as_secs() as i64 <= now.as_secs() as i64)
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_appears_before_publishing_and_nothing_else_after() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        let names = || std::fs::read_dir(folder.path()).unwrap().count();
        let file = AtomicFile::create(&target).unwrap();
        SystemDisk.write_at(file.file(), b"half", 0).unwrap();
        assert!(!target.exists());
        drop(file);
        assert_eq!(names(), 0);
        for text in ["one", "two"] {
            let file = AtomicFile::create(&target).unwrap();
            SystemDisk.write_at(file.file(), text.as_bytes(), 0).unwrap();
            file.publish().unwrap();
            assert_eq!(std::fs::read_to_string(&target).unwrap(), text);
            assert_eq!(names(), 1);
        }
        #[cfg(target_os = "linux")]
        {
            // What a process leaves that was killed in the wrong moment, and what is none of that.
            for name in [".a.x1y2.terrasoar-new", ".b.x1y2.terrasoar-new", ".a.x1y2"] {
                std::fs::write(folder.path().join(name), "left").unwrap();
            }
            remove_left(&target, STALE);
            assert_eq!(names(), 4);
            remove_left(&target, Duration::ZERO);
            assert_eq!(names(), 3);
            assert!(!folder.path().join(".a.x1y2.terrasoar-new").exists());
        }
        assert!(AtomicFile::create(folder.path()).is_err());
        assert!(AtomicFile::create(&folder.path().join("missing/x")).is_err());
    }

    #[test]
    fn names_of_any_length_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("n".repeat(255));
        for text in ["one", "two"] {
            let file = AtomicFile::create(&target).unwrap();
            SystemDisk.write_at(file.file(), text.as_bytes(), 0).unwrap();
            file.publish().unwrap();
            assert_eq!(std::fs::read_to_string(&target).unwrap(), text);
        }
    }

    /// Many publish to one name at once: none fails, and one complete file is there in the end.
    #[test]
    fn several_may_publish_to_one_name() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        std::thread::scope(|scope| {
            for i in 0..4u8 {
                let target = &target;
                scope.spawn(move || {
                    for _ in 0..50 {
                        let file = AtomicFile::create(target).unwrap();
                        SystemDisk.write_at(file.file(), &[i; 9000], 0).unwrap();
                        file.publish().unwrap();
                        let there = std::fs::read(target).unwrap();
                        assert!(there.len() == 9000 && there.iter().all(|b| *b == there[0]));
                    }
                });
            }
        });
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
