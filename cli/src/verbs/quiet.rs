//! Keeps a driver's complaint off standard error where there is no folder for a session's sockets.
//!
//! Mesa's layer that chooses a device looks for a Wayland display whenever a device is asked for, and libwayland writes "error: XDG_RUNTIME_DIR is invalid or not set" each time where that
//! variable names no folder: in containers, over ssh, under cron. Only that variable changes it, and a program cannot set its own variables without `unsafe`.
//! So the program starts itself once more, in the same process and before it has done anything, with the variable set to a folder that does not exist. With such
//! an absolute name no display is found either, so nothing else changes. Cost: a few milliseconds, where the variable is not set.

#[cfg(target_os = "linux")]
use std::os::unix::process::CommandExt;
#[cfg(target_os = "linux")]
use std::process::Command;

/// The variable.
#[cfg(any(target_os = "linux", test))]
const NAME: &str = "XDG_RUNTIME_DIR";
/// What it is set to: by an old custom no system has such a folder.
#[cfg(target_os = "linux")]
const NOWHERE: &str = "/nonexistent";

/// To be called before any thread is started and any file is opened, by verbs that draw. Where it cannot help the complaint stays.
pub(super) fn begin() {
    #[cfg(target_os = "linux")]
    {
        let is_set = std::env::var_os(NAME).is_some_and(|folder| is_absolute(&folder));
        let mut words = std::env::args_os();
        if let (false, Some(name), Ok(program)) = (is_set, words.next(), std::env::current_exe()) {
            // It returns only if it cannot be done.
            let _ = Command::new(program).arg0(name).args(words).env(NAME, NOWHERE).exec();
        }
    }
}

/// Whether libwayland takes it for the name of a folder.
#[cfg(any(target_os = "linux", test))]
fn is_absolute(folder: &std::ffi::OsStr) -> bool {
    folder.as_encoded_bytes().first() == Some(&b'/')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_libwayland_takes_for_a_folder_is_left_alone() {
        assert_eq!(NAME, "XDG_RUNTIME_DIR");
        for (folder, is) in [("/run/user/1000", true), ("/nonexistent", true), ("run", false), ("", false)] {
            assert_eq!(is_absolute(folder.as_ref()), is, "{folder:?}");
        }
    }
}
