//! Why there is no window: a message that says what is missing and what to do instead.
//!
//! The window library's own message begins with a place in its source text, which is left out.

use std::ffi::OsString;
use std::fmt::Display;

/// What to do without a display.
const INSTEAD: &str = "Run it on a desktop, or over ssh -X; without a display `terrasoar snapshot` makes pictures and `terrasoar movie` makes films, and all other verbs need none";

/// Why the window's events cannot be had.
pub(super) fn refusal(error: &dyn Display) -> anyhow::Error {
    anyhow::anyhow!(words(&plain(error), |name| std::env::var_os(name)))
}

/// The words, where variables have such values.
fn words(cause: &str, variable: impl Fn(&str) -> Option<OsString>) -> String {
    let set = |name: &str| variable(name).filter(|value| !value.is_empty());
    // In the order in which they are looked at.
    let named = ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"]
        .into_iter()
        .find_map(|name| Some((name, set(name)?)));
    match named {
        None if cfg!(all(unix, not(target_os = "macos"))) => {
            format!(
                "no window can be opened: there is no display, for neither DISPLAY nor WAYLAND_DISPLAY is set. {INSTEAD}"
            )
        }
        Some((name, value)) if cfg!(all(unix, not(target_os = "macos"))) => {
            let value = value.to_string_lossy();
            format!(
                "no window can be opened on the display that {name} names, {value:?}: {cause}. See that it is there and lets this user in. {INSTEAD}"
            )
        }
        _ => format!("no window can be opened: {cause}. {INSTEAD}"),
    }
}

/// What an error of the window library says, without the place in its source that it begins with, and without a full stop.
pub(super) fn plain(error: &dyn Display) -> String {
    let text = error.to_string();
    let said = text.strip_prefix("os error at ").and_then(|rest| {
        // FILE:LINE: what is wrong.
        let (_, line_and_words) = rest.split_once(".rs:")?;
        Some(line_and_words.split_once(": ")?.1)
    });
    said.unwrap_or(&text).trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_source_text_are_left_out() {
        let said = "os error at /home/x/.cargo/registry/winit-0.30.13/src/platform_impl/linux/mod.rs:765: neither A nor B is set.";
        assert_eq!(plain(&said), "neither A nor B is set");
        assert_eq!(plain(&"os error at C:\\a.rs\\b.rs:7: no: luck"), "no: luck");
        for other in ["os error at", "os error at x", "Exit Failure: 3", ""] {
            assert_eq!(plain(&other), other);
        }
    }

    #[cfg(all(unix, not(target_os = "macos")))]
    #[test]
    fn what_is_missing_is_named_and_what_to_do_instead() {
        let all = |set: &'static [(&'static str, &'static str)]| {
            let value =
                move |name: &str| set.iter().find(|(n, _)| *n == name).map(|(_, v)| OsString::from(*v));
            words("it does not answer", value)
        };
        for none in [&[][..], &[("DISPLAY", ""), ("WAYLAND_DISPLAY", "")]] {
            let words = all(none);
            assert!(
                words.contains("there is no display")
                    && words.contains("DISPLAY")
                    && words.contains("WAYLAND_DISPLAY")
            );
            assert!(
                words.contains("snapshot")
                    && words.contains("movie")
                    && !words.contains("it does not answer")
            );
        }
        let words = all(&[("DISPLAY", ":77"), ("WAYLAND_DISPLAY", "")]);
        assert!(
            words.contains("DISPLAY names, \":77\": it does not answer") && words.contains("snapshot"),
            "{words}"
        );
        let words = all(&[("DISPLAY", ":77"), ("WAYLAND_DISPLAY", "wayland-9")]);
        assert!(words.contains("WAYLAND_DISPLAY names, \"wayland-9\""), "{words}");
    }
}
