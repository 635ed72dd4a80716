//! A file that appears under its name only when it is complete.
//!
//! On Linux the bytes go to a file without a name, so that even a killed process leaves nothing behind; elsewhere, and on file
//! systems without nameless files, to a temporary file beside the target that is removed when dropped.
//! Publishing syncs the bytes, gives them the name in place of whatever had it, and syncs the folder. After that the new file is there even if the power fails.
//!
//! **What the name stood for stays.** A symbolic link goes on leading to the file, which is replaced where it really lies. The new file takes over the mode of the one it replaces, and its owner
//! where the system allows that; a file that replaces none has the mode that the process gives new files. What is no regular file, such as a device, is not replaced. A terrain that somebody is
//! writing to is not replaced either (`lock`), nor one that was edited after the new file was begun (`seen`).
//!
//! **A nameless file cannot replace another.** Where the target exists it gets a name of its own first, `.NAME.*.terrasoar-new`, and is renamed at once. A process killed between
//! these two calls leaves a complete file of that name; the next publication to the same target removes it. A file that has a name before it is complete is on the list of [`unfinished`].

use super::disk::{Disk, SystemDisk};
use super::lock::{ReplaceLock, WriteLock};
use super::seen::Seen;
use crate::error::LayoutError;
use crate::unfinished;
use std::fs::{File, Metadata};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
#[cfg(target_os = "linux")]
use std::time::Duration;

/// A file being written.
#[derive(Debug)]
pub struct AtomicFile {
    /// What it was asked for as, for messages.
    target: PathBuf,
    /// Where that leads.
    place: PathBuf,
    /// What was there when it was begun.
    seen: Seen,
    inner: Inner,
}

#[derive(Debug)]
enum Inner {
    #[cfg(target_os = "linux")]
    Nameless(File),
    Named(unfinished::Guard, tempfile::NamedTempFile),
}

/// Whom a file replaces.
#[derive(Clone, Copy)]
enum Replaced<'l> {
    /// Nobody: something that has the name stays.
    None,
    /// Whatever has the name, unless somebody is writing to it.
    Any,
    /// A file that the caller has the lock of.
    Held(&'l WriteLock),
}

/// The folder a file lies in; the current one for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Symbolic links that one name may lead through, as on Linux.
const MOST_LINKS: u32 = 40;

/// Where symbolic links lead from `path`, whether something is there or not.
fn resolved(path: &Path) -> std::io::Result<PathBuf> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::symlink_metadata(&at) {
            Ok(meta) if meta.file_type().is_symlink() => {
                let to = std::fs::read_link(&at)?;
                at = folder_of(&at).join(to);
            }
            _ => return Ok(at),
        }
    }
    Err(std::io::Error::other("it is a circle of symbolic links"))
}

impl AtomicFile {
    /// Starts a file that will be called `target`, or will lie where `target` leads to if that is a symbolic link.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if its folder does not exist or cannot be written to; [`LayoutError::Usage`] if `target` is something other than a regular file: a folder, a device, a FIFO.
    pub fn create(target: &Path) -> Result<Self, LayoutError> {
        let failed = |e| LayoutError::io(target, "cannot create the file", e);
        let (target, place) = (target.to_owned(), resolved(target).map_err(failed)?);
        check_replaceable(&target, &place)?;
        let seen = Seen::at(&place);
        #[cfg(target_os = "linux")]
        if let Some(file) = nameless(folder_of(&place), super::disk::way_to) {
            return Ok(Self { target, place, seen, inner: Inner::Nameless(file) });
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".terrasoar-").suffix(".partial");
        #[cfg(unix)]
        {
            // As any other new file: the process's mask takes bits away.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(NEW_FILE_MODE));
        }
        let (guard, file) = unfinished::make(|| {
            let file = builder.tempfile_in(folder_of(&place))?;
            Ok((file.path().to_owned(), file))
        })
        .map_err(failed)?;
        Ok(Self { target, place, seen, inner: Inner::Named(guard, file) })
    }

    /// The file to write to.
    pub fn file(&self) -> &File {
        match &self.inner {
            #[cfg(target_os = "linux")]
            Inner::Nameless(file) => file,
            Inner::Named(_, file) => file.as_file(),
        }
    }

    /// Name it will have, as it was asked for.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Syncs what was written and gives the file its name, replacing what had it.
    ///
    /// # Errors
    /// [`LayoutError::Io`], and [`LayoutError::Usage`] while another program writes to the file that is to be replaced; nothing is left behind then. If only the last step fails, which brings the
    /// new name to the disk, the new file is there, and the error says so.
    pub fn publish(self) -> Result<(), LayoutError> {
        self.publish_on(&SystemDisk)
    }

    /// As [`AtomicFile::publish`], by the calls of `disk`.
    pub(crate) fn publish_on(self, disk: &dyn Disk) -> Result<(), LayoutError> {
        self.finish(disk, Replaced::Any).map(drop)
    }

    /// As [`AtomicFile::publish_on`], in place of the file that `lock` is of.
    pub(crate) fn publish_over(self, disk: &dyn Disk, lock: &WriteLock) -> Result<(), LayoutError> {
        self.finish(disk, Replaced::Held(lock)).map(drop)
    }

    /// As [`AtomicFile::publish_on`], unless something has the name: whether it was published.
    pub(crate) fn publish_new_on(self, disk: &dyn Disk) -> Result<bool, LayoutError> {
        self.finish(disk, Replaced::None)
    }

    fn finish(self, disk: &dyn Disk, replaced: Replaced<'_>) -> Result<bool, LayoutError> {
        let Self { target, place, seen, inner } = self;
        let failed = |e| {
            let when_full = "cannot write the file, for which there is no room; make some on its disk, or name an output on another";
            LayoutError::write(&target, "cannot write the file", when_full, e)
        };
        let file = match &inner {
            #[cfg(target_os = "linux")]
            Inner::Nameless(file) => file,
            Inner::Named(_, file) => file.as_file(),
        };
        let old = std::fs::symlink_metadata(&place).ok().filter(Metadata::is_file);
        if let (Some(old), Replaced::Any | Replaced::Held(_)) = (&old, replaced) {
            take_over(file, old).map_err(failed)?;
        }
        disk.sync(file).map_err(failed)?;
        let _lock = match replaced {
            Replaced::Any => Some(ReplaceLock::take(&place)?),
            Replaced::Held(lock) if !lock.is_of(&place) => return Err(replaced_meanwhile(&target)),
            Replaced::Held(_) | Replaced::None => None,
        };
        // With the lock held nobody commits any more.
        if matches!(replaced, Replaced::Any) && !seen.is_still(&place) {
            return Err(replaced_meanwhile(&target));
        }
        if !matches!(replaced, Replaced::None) {
            check_replaceable(&target, &place)?;
        }
        let is_named = give_name(disk, inner, &place, replaced).map_err(failed)?;
        if is_named {
            disk.sync_folder(folder_of(&place)).map_err(|e| {
                LayoutError::io(
                    &target,
                    "the file is complete, but its name cannot be brought to the disk and may be lost at a power cut",
                    e,
                )
            })?;
        }
        Ok(is_named)
    }
}

/// What new files get, less what the process's mask takes away.
#[cfg(unix)]
const NEW_FILE_MODE: u32 = 0o666;

/// Refuses what is there and is no regular file.
fn check_replaceable(name: &Path, target: &Path) -> Result<(), LayoutError> {
    let problem = match std::fs::symlink_metadata(target) {
        Ok(meta) if meta.is_dir() => "the output is a folder; name a file in it",
        Ok(meta) if !meta.is_file() => {
            "the output is no regular file but a device, a pipe or the like; name a file"
        }
        _ => return Ok(()),
    };
    Err(LayoutError::Usage(format!("{}: {problem}", name.display())))
}

fn replaced_meanwhile(name: &Path) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: the file was changed or replaced by another meanwhile; nothing was written, do it again",
        name.display()
    ))
}

/// Owner, where the system allows that, and mode of `old` for `file`.
fn take_over(file: &File, old: &Metadata) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use rustix::fs::{Gid, Mode, Uid, fchmod, fchown};
        use std::os::unix::fs::MetadataExt;
        let ours = file.metadata()?;
        if (ours.uid(), ours.gid()) != (old.uid(), old.gid()) {
            let (owner, group) = (Uid::from_raw(old.uid()), Gid::from_raw(old.gid()));
            if fchown(file, Some(owner), Some(group)).is_err() {
                // Whoever may not give files away may still give one to a group of their own.
                let _ = fchown(file, None, Some(group));
            }
        }
        let kept = old.mode() & 0o777;
        if ours.mode() & 0o777 != kept {
            fchmod(file, Mode::from_raw_mode(kept as _))?;
        }
    }
    #[cfg(not(unix))]
    {
        let _ = (file, old);
    }
    Ok(())
}

/// Gives a synced file the name `target`; whether it got it.
fn give_name(disk: &dyn Disk, inner: Inner, target: &Path, replaced: Replaced<'_>) -> std::io::Result<bool> {
    let only_new = matches!(replaced, Replaced::None);
    match inner {
        #[cfg(target_os = "linux")]
        Inner::Nameless(file) => {
            if only_new || !target.exists() {
                match disk.link(&file, target) {
                    Ok(()) => return Ok(true),
                    Err(e) if e.kind() != ErrorKind::AlreadyExists => return Err(e),
                    Err(_) if only_new => return Ok(false),
                    Err(_) => {}
                }
            }
            remove_left(target, STALE);
            let (_guard, before) = unfinished::make(|| {
                let before = tempfile::Builder::new()
                    .prefix(&prefix_before(target))
                    .suffix(SUFFIX_BEFORE)
                    .make_in(folder_of(target), |name| disk.link(&file, name))?
                    .into_temp_path();
                Ok((before.to_path_buf(), before))
            })?;
            disk.rename(&before, target)?;
            // It is not called that any more.
            let _ = before.keep();
            Ok(true)
        }
        Inner::Named(_guard, file) if only_new => match file.persist_noclobber(target) {
            Ok(_) => Ok(true),
            Err(e) if e.error.kind() == ErrorKind::AlreadyExists => Ok(false),
            Err(e) => Err(e.error),
        },
        Inner::Named(_guard, file) => {
            let before = file.into_temp_path();
            disk.rename(&before, target)?;
            let _ = before.keep();
            Ok(true)
        }
    }
}

/// A file without a name that can be given one, where there are such files and `/proc` leads to them.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path, way_to: impl Fn(&File) -> PathBuf) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = openat(CWD, folder, flags, Mode::from_raw_mode(NEW_FILE_MODE)).ok().map(File::from)?;
    way_to(&file).exists().then_some(file)
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
mod tests;
