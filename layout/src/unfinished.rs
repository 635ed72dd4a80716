//! Files and folders that have a name before they are complete, and how they are removed when a signal ends the program.
//!
//! Code that makes one removes it when it fails, but a signal ends the process before that. So all of them are on one list of the process, and a program that handles signals calls
//! [`remove_all`] before it ends. Where files need no name, as on Linux, the list is nearly always empty. **A name is on the list from the moment that it exists**, because it is made
//! while the list is locked.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

static LIST: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Keeps a name on the list for as long as it lives.
#[derive(Debug)]
#[must_use]
pub struct Guard(PathBuf);

/// Makes a file or folder, whose path `make` returns beside what it is, and puts it on the list.
///
/// # Errors
/// Those of `make`.
pub fn make<T>(make: impl FnOnce() -> io::Result<(PathBuf, T)>) -> io::Result<(Guard, T)> {
    let mut list = LIST.lock().unwrap_or_else(PoisonError::into_inner);
    let (path, made) = make()?;
    // The folder that the program runs in may change.
    let path = std::path::absolute(&path).unwrap_or(path);
    list.push(path.clone());
    Ok((Guard(path), made))
}

impl Guard {
    /// Gives what was made its own name by `give`, and takes it off the list, both at once: a signal comes before, and takes all of it away, or after. In between it could take away a part.
    ///
    /// # Errors
    /// Those of `give`.
    pub fn finish<T>(mut self, give: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        let mut list = LIST.lock().unwrap_or_else(PoisonError::into_inner);
        let given = give()?;
        let path = std::mem::take(&mut self.0);
        if let Some(at) = list.iter().position(|listed| *listed == path) {
            list.swap_remove(at);
        }
        drop(list);
        Ok(given)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        let mut list = LIST.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = list.iter().position(|path| *path == self.0) {
            list.swap_remove(at);
        }
    }
}

/// Removes everything on the list, for good. A thread that would add to the list afterwards waits for the end of the process, which should follow at once.
pub fn remove_all() {
    let mut list = LIST.lock().unwrap_or_else(PoisonError::into_inner);
    list.drain(..).for_each(|path| remove(&path));
    std::mem::forget(list);
}

/// Removes a file or a folder. What does not go cannot be helped any more.
fn remove(path: &Path) {
    let is_folder = std::fs::symlink_metadata(path).is_ok_and(|meta| meta.is_dir());
    let _ = if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_listed_while_its_guard_lives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let listed = || LIST.lock().unwrap().contains(&path);
        let make_it = || std::fs::write(&path, "half").map(|()| (path.clone(), ()));
        let (guard, ()) = make(make_it).unwrap();
        assert!(listed());
        drop(guard);
        assert!(!listed());
        assert!(make::<()>(|| Err(io::ErrorKind::StorageFull.into())).is_err());
        remove(&path);
        std::fs::create_dir_all(path.join("b")).unwrap();
        remove(&path);
        remove(&path);
        assert!(!path.exists());
    }
}
