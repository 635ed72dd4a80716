//! What a refusal must be like: short enough to read, long enough to help, and harmless on a terminal.

use std::error::Error;

/// Checks the message of an error.
pub(crate) fn refused(error: &dyn Error) {
    let text = error.to_string();
    assert!((8..=1600).contains(&text.len()), "a message of {} bytes: {text:?}", text.len());
    assert!(!text.chars().any(char::is_control), "control characters on the terminal: {text:?}");
    assert!(!text.contains(".rs:") && !text.contains("panicked"), "a place in the source: {text:?}");
}

/// The value, or nothing after the refusal was looked at.
pub(crate) fn told<T, E: Error>(result: Result<T, E>) -> Option<T> {
    result.inspect_err(|error| refused(error)).ok()
}
