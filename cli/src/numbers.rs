//! Numbers as people read them.

use terrasoar_layout::words::thousands;

/// A whole number with its thousands set apart.
pub(crate) fn grouped(value: u64) -> String {
    thousands(&value.to_string())
}

/// A number of at most `digits` decimals, without zeros at its end.
pub(crate) fn decimal(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if !text.contains('.') {
        return text;
    }
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(
            [0, 12, 999, 1000, 1_234_567].map(grouped),
            ["0", "12", "999", "1,000", "1,234,567"].map(String::from)
        );
        assert_eq!(decimal(1234.5, 3), "1234.5");
        assert_eq!(decimal(-0.0001, 3), "0");
        assert_eq!(decimal(20.0, 0), "20");
        assert_eq!(decimal(12.000_000_1, 6), "12");
    }
}
