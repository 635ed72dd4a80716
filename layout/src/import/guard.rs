//! Keeps a panic inside a third-party decoder from leaving the reader.
//!
//! The decoders are fuzzed by their makers, and still assert and index; on hostile bytes an assertion
//! that fires is damage in the file and nothing else. State that a panic interrupted is dropped by
//! every caller. Cost: none on the good path.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::error::LayoutError;

/// Runs `decode`; a panic in it becomes [`LayoutError::Damaged`] at `place` of `path`.
pub(crate) fn guard<T>(
    path: &Path,
    place: impl FnOnce() -> String,
    decode: impl FnOnce() -> Result<T, LayoutError>,
) -> Result<T, LayoutError> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(LayoutError::damaged(
            path,
            place(),
            "the decoder gave up on these bytes; fetch or write the file again",
        ))
    })
}
