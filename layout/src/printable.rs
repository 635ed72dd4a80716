//! Makes text from files, names and command lines safe to show. Characters that a terminal would obey, or that make a text look like another one, are spelt out.
//!
//! These are control characters (C0, DEL, C1), characters that turn the direction of writing, and characters that take no room. Everything else stays, whatever its language. In memory and on the disk texts
//! are kept as they are; only showing them goes through here. Cost: a look at each character, a copy only if one must be spelt out.

use std::borrow::Cow;
use std::fmt::Write;

/// Whether a character may be shown as it is.
pub(crate) fn is_harmless(c: char) -> bool {
    // In order: soft hyphen, Arabic letter mark, Mongolian vowel separator, zero widths and directions, line and paragraph separators and overrides, word joiners and
    // isolates, byte order mark, interlinear marks, tags.
    !c.is_control()
        && !matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// A text in one line: line breaks and tabs are spelt out too.
///
/// ```
/// assert_eq!(terrasoar_layout::printable::line("a\x1b[31mb\n"), "a\\u{1b}[31mb\\n");
/// ```
pub fn line(text: &str) -> Cow<'_, str> {
    spelt_out(text, is_harmless)
}

/// A text of lines that are our own: line breaks and tabs stay.
pub fn lines(text: &str) -> Cow<'_, str> {
    spelt_out(text, |c| is_harmless(c) || c == '\n' || c == '\t')
}

/// JSON text that serialises to the same value: what is spelt out is so by JSON's own escapes. Line breaks are those between values, for strings have none.
pub fn json(text: &str) -> Cow<'_, str> {
    let stays = |c| is_harmless(c) || c == '\n';
    if text.chars().all(stays) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if stays(c) {
            out.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a string cannot fail.
                let _ = write!(out, "\\u{unit:04x}");
            }
        }
    }
    Cow::Owned(out)
}

fn spelt_out(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&stays) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if stays(c) { out.push(c) } else { out.extend(c.escape_default()) }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_a_terminal_obeys_is_left() {
        let hostile =
            "\x1b[2J\x1b]0;owned\x07\u{9b}31m\r\x08\x7f\u{202e}gnp\u{2066}\u{200b}\u{feff}\u{e0041}";
        for shown in [line(hostile), lines(hostile), json(hostile)] {
            assert!(shown.chars().all(|c| c.is_ascii_graphic()), "{shown}");
        }
        assert_eq!(line("a\tb\n"), "a\\tb\\n");
        assert_eq!(lines("a\tb\n\r"), "a\tb\n\\r");
    }

    #[test]
    fn languages_stay_as_they_are() {
        for text in ["Größe 3 m²", "東京", "Кавказ", "ירושלים", "العربية", "Hawaiʻi", "e\u{301}", "👍"]
        {
            assert!(matches!(line(text), Cow::Borrowed(same) if same == text), "{text}");
        }
    }

    #[test]
    fn json_keeps_its_value() {
        assert_eq!(
            json("{\n  \"a\": \"\u{7f}\u{202e}\u{e0041}\"\n}"),
            "{\n  \"a\": \"\\u007f\\u202e\\udb40\\udc41\"\n}"
        );
    }
}
