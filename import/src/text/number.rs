//! A word as a number, fast.
//!
//! The decimal sign is a point or a comma. Up to 15 digits without an exponent are exact in a double and divided once, which rounds once, so it is
//! the nearest double (Clinger 1990, section 4); everything else is left to the standard library.

/// Powers of ten that a double holds exactly and 15 digits can need.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
/// Longest word that can be a number.
const LONGEST: usize = 400;
/// What programs write where there is no number, in lower case.
const NO_NUMBERS: [&[u8]; 12] = [
    b"nan",
    b"-nan",
    b"+nan",
    b"1.#qnan",
    b"-1.#qnan",
    b"1.#ind",
    b"-1.#ind",
    b"1.#snan",
    b"nan(ind)",
    b"-nan(ind)",
    b"1.#qnan0",
    b"-1.#ind00",
];

/// Whether a byte stands between words: blanks, ends of lines, and the marks that old systems end a file with.
pub(crate) const fn is_blank(byte: u8) -> bool {
    byte <= b' '
}

/// The words of a text.
pub(crate) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|byte| is_blank(*byte)).filter(|word| !word.is_empty())
}

/// The number that a word is, NaN for one of the ways to write that there is none; `None` if it is no number, or a thing like `1,234.5`.
pub(crate) fn number(word: &[u8]) -> Option<f64> {
    plain(word).or_else(|| any(word))
}

/// Digits with at most one decimal sign.
#[inline]
fn plain(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word.split_first()? {
        (b'-', rest) => (true, rest),
        (b'+', rest) => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() || digits.len() > 16 {
        return None;
    }
    let mut mantissa = 0u64;
    let mut point = None;
    for (i, byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => mantissa = mantissa * 10 + u64::from(byte - b'0'),
            b'.' | b',' if point.is_none() && digits.len() > 1 => point = Some(i),
            _ => return None,
        }
    }
    let decimals = point.map_or(0, |at| digits.len() - 1 - at);
    if point.is_none() && digits.len() == 16 {
        return None;
    }
    let value = mantissa as f64 / POWERS[decimals];
    Some(if negative { -value } else { value })
}

fn any(word: &[u8]) -> Option<f64> {
    if word.len() > LONGEST {
        return None;
    }
    let lower = word.to_ascii_lowercase();
    if NO_NUMBERS.contains(&lower.as_slice()) {
        return Some(f64::NAN);
    }
    // The library would read "inf" and "infinity" as well, which are no heights, and needs a point. Fortran writes exponents with a D.
    let is_numeric = |byte: &u8| byte.is_ascii_digit() || b"+-.,ed".contains(byte);
    if !lower.iter().all(is_numeric) || (lower.contains(&b',') && lower.contains(&b'.')) {
        return None;
    }
    let pointed: Vec<u8> = lower
        .iter()
        .map(|byte| match byte {
            b',' => b'.',
            b'd' => b'e',
            byte => *byte,
        })
        .collect();
    std::str::from_utf8(&pointed).ok()?.parse().ok()
}

/// A word of a file for a message: no longer than 24 characters, nothing in it that moves a cursor.
pub(crate) fn shown(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(word);
    let mut short: String = text.chars().take(24).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > 24 {
        short.push('\u{2026}');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_nearest_doubles() {
        let mut state = 1u64;
        for length in 1..=20 {
            for _ in 0..2000 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let digits = format!("{:020}", state >> 1);
                let at = (state >> 40) as usize % (length + 1);
                let text = format!(
                    "{}{}.{}",
                    if state >> 63 == 0 { "-" } else { "" },
                    &digits[..at],
                    &digits[at..length]
                );
                if text.trim_start_matches('-') == "." {
                    continue;
                }
                let wanted: f64 = text.parse().unwrap();
                assert_eq!(number(text.as_bytes()).map(f64::to_bits), Some(wanted.to_bits()), "{text}");
                let comma = text.replace('.', ",");
                assert_eq!(number(comma.as_bytes()).map(f64::to_bits), Some(wanted.to_bits()), "{comma}");
            }
        }
    }

    #[test]
    fn other_ways_to_write_numbers() {
        for (text, wanted) in [
            ("7", 7.0),
            ("+7", 7.0),
            ("-0", -0.0),
            (".5", 0.5),
            ("5.", 5.0),
            ("5,", 5.0),
            ("1e3", 1000.0),
            ("-3.4028234663852886e+38", f64::from(f32::MIN)),
            ("1,5E-1", 0.15),
            ("0.1D+02", 10.0),
            ("9007199254740993", 9_007_199_254_740_992.0),
            ("00000000000000000001.5", 1.5),
        ] {
            assert_eq!(number(text.as_bytes()), Some(wanted), "{text}");
        }
        for text in ["nan", "NaN", "-nan", "1.#QNAN", "-1.#IND", "-nan(ind)"] {
            assert!(number(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        for text in
            ["", "-", ".", ",", "+.", "1.2.3", "1,234.5", "1,2,3", "x", "1x", "inf", "e5", "--1", "0x10"]
        {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
        assert_eq!(number(&[b'1'; 1000]), None);
        assert_eq!(words(b" 1\r\n2\t3\0\x1a").collect::<Vec<_>>(), [b"1", b"2", b"3"]);
        assert_eq!(shown(b"a\x07b"), "a?b");
    }
}
