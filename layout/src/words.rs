//! Numbers and texts of files in a form that is fit for messages and headers.
//!
//! A file may hold any number and any text. A number of three hundred digits is shown as a power of ten. A text could move a terminal's cursor,
//! ring its bell or turn what follows from right to left, so such characters are left out. Cost: one pass over what is shown.

use crate::printable::is_harmless;

/// A number as people read it: with its power of ten where it would be long.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value.is_finite() && size != 0.0 && !(1e-5..1e10).contains(&size) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Digits of a whole number with the thousands set apart by commas.
///
/// ```
/// assert_eq!(terrasoar_layout::words::thousands("1234567"), "1,234,567");
/// ```
pub fn thousands(digits: &str) -> String {
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// At most `most` characters of `text`, without those that do something rather than show something.
pub fn harmless(text: &str, most: usize) -> String {
    text.chars().filter(|c| is_harmless(*c)).take(most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_numbers_are_shown_with_their_power_of_ten() {
        assert_eq!([0.0, -9999.5, 1e6, 0.001].map(number), ["0", "-9999.5", "1000000", "0.001"]);
        assert_eq!([1e308, -2.5e-300].map(number), ["1e308", "-2.5e-300"]);
        assert_eq!([f64::NAN, f64::INFINITY].map(number), ["NaN", "inf"]);
    }

    #[test]
    fn characters_that_act_are_left_out() {
        assert_eq!(harmless("\u{1b}[31mWGS\u{7} 84\r\n\u{202e}\u{9b}2J", 99), "[31mWGS 842J");
        assert_eq!(harmless("Zürich / 東京", 6), "Zürich");
    }
}
