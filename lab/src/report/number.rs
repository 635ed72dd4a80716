//! Numbers as people read them: with commas between thousands, and only as many digits as mean something.

use terrasoar_layout::words::thousands;

/// `value` with `decimals` digits after the point and the thousands set apart by commas.
pub(super) fn grouped(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let plain = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = plain.split_once('.').unwrap_or((&plain, ""));
    let mut text = String::with_capacity(plain.len() + 8);
    if value < 0.0 && plain.bytes().any(|b| b.is_ascii_digit() && b != b'0') {
        text.push('-');
    }
    text.push_str(&thousands(whole));
    if !fraction.is_empty() {
        text.push('.');
        text.push_str(fraction);
    }
    text
}

/// `value` with about three significant digits, as for a ratio.
pub(super) fn rounded(value: f64) -> String {
    let magnitude = value.abs();
    let decimals = match magnitude {
        m if m >= 100.0 || m == 0.0 => 0,
        m if m >= 10.0 => 1,
        m if m >= 1.0 => 2,
        m if m >= 0.01 => 3,
        _ => 5,
    };
    grouped(value, decimals)
}

/// `value` as it is, without needless zeros: for labels of what was asked for.
pub(super) fn exact(value: f64) -> String {
    let text = grouped(value, 6);
    match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(grouped(1_234_567.0, 0), "1,234,567");
        assert_eq!(grouped(-1234.5, 1), "-1,234.5");
        assert_eq!(grouped(-0.001, 1), "0.0");
        assert_eq!(grouped(999.96, 1), "1,000.0");
        assert_eq!(grouped(f64::NAN, 1), "–");
        assert_eq!(
            (rounded(0.0654), rounded(8.123), rounded(123.4)),
            ("0.065".into(), "8.12".into(), "123".into())
        );
        assert_eq!((exact(0.5), exact(10.0), exact(5.29)), ("0.5".into(), "10".into(), "5.29".into()));
    }
}
