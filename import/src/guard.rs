//! Keeps a panic inside a third-party decoder from leaving the reader; and tells what is a file's fault.
//!
//! The decoders are fuzzed by their makers, but they still have assertions and index into arrays. If one of them panics on hostile bytes,
//! the file is damaged, and the program goes on. Every caller drops the state that a panic interrupted.
//! A program that reports panics can ask whether a panic is one of these ([`is_guarded`]). Cost: none where nothing panics.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use terrasoar_layout::dem::Warning;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

thread_local! {
    /// How many guards this thread is in.
    static GUARDS: Cell<u32> = const { Cell::new(0) };
}

/// Whether this thread is where a panic becomes an error of the file, and so is no defect.
pub fn is_guarded() -> bool {
    GUARDS.get() > 0
}

/// Runs `decode`; a panic in it becomes [`LayoutError::Damaged`] at `place` of `path`.
pub(crate) fn guard<T>(
    path: &Path,
    place: impl FnOnce() -> String,
    decode: impl FnOnce() -> Result<T, LayoutError>,
) -> Result<T, LayoutError> {
    GUARDS.set(GUARDS.get() + 1);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    GUARDS.set(GUARDS.get() - 1);
    decoded.unwrap_or_else(|_| {
        Err(LayoutError::damaged(
            path,
            place(),
            "the decoder gave up on these bytes; fetch or write the file again",
        ))
    })
}

/// Runs `decode`; a panic in it is nothing.
pub(crate) fn quiet<T>(decode: impl FnOnce() -> T) -> Option<T> {
    GUARDS.set(GUARDS.get() + 1);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    GUARDS.set(GUARDS.get() - 1);
    decoded.ok()
}

/// Whether an error is of the machine and not of the file.
pub(crate) fn is_ours(error: &LayoutError) -> bool {
    // Too many open files, in the process or the system; no memory.
    const OURS: [i32; 3] = [24, 23, 12];
    match error {
        LayoutError::Io { source, .. } => {
            source.raw_os_error().is_some_and(|code| OURS.contains(&code))
                || matches!(
                    source.kind(),
                    std::io::ErrorKind::StorageFull
                        | std::io::ErrorKind::QuotaExceeded
                        | std::io::ErrorKind::FileTooLarge
                )
        }
        _ => false,
    }
}

/// What is said of a file of several that was left out, `why`.
pub(crate) fn left_out(why: &str) -> Warning {
    let why = harmless(why, 360);
    Warning::new(format!("{why}; the file was left out: its ground is that of other files, or void"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_damage_and_known_as_such_while_it_happens() {
        let path = Path::new("a");
        assert!(!is_guarded());
        let inner = guard(path, || "here".into(), || guard(path, || "there".into(), || Ok(is_guarded())));
        assert!(inner.unwrap() && !is_guarded());
        let error = guard::<()>(path, || "here".into(), || panic!("an assertion of a decoder"));
        assert!(error.unwrap_err().to_string().starts_with("a: here: the decoder gave up"));
        assert!(!is_guarded());
    }
}
